// SPDX-License-Identifier: Apache-2.0
/// Run-time dispatch of hot loops: compiled for several instruction sets, chosen by the loader.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(BLINDCORNER_SANITIZE)
#define BLINDCORNER_MULTIVERSION \
  __attribute__((target_clones("arch=skylake-avx512", "arch=haswell", "default")))
#else
#define BLINDCORNER_MULTIVERSION
#endif
