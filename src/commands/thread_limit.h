// SPDX-License-Identifier: Apache-2.0
/// The option --threads of commands that share their work by TBB.
#pragma once

#include <tbb/global_control.h>

#include <optional>

namespace blindcorner {

/// Limits the number of threads while this lives; 0: one per processor.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads) {
    if (threads > 0) {
      limit_.emplace(tbb::global_control::max_allowed_parallelism,
                     static_cast<std::size_t>(threads));
    }
  }

 private:
  std::optional<tbb::global_control> limit_;
};

}  // namespace blindcorner
