// SPDX-License-Identifier: Apache-2.0
/// Run-time dispatch of hot loops. They are compiled for several instruction sets, and the loader
/// chooses one.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(BLINDCORNER_SANITIZE)
#define BLINDCORNER_MULTIVERSION \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define BLINDCORNER_MULTIVERSION
#endif

/// Marks a loop whose iterations touch disjoint memory, where the arrays are too many for a check
/// at run time.
#if defined(__GNUC__) && !defined(__clang__)
#define BLINDCORNER_INDEPENDENT _Pragma("GCC ivdep")
#elif defined(__clang__)
#define BLINDCORNER_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define BLINDCORNER_INDEPENDENT
#endif
