// SPDX-License-Identifier: Apache-2.0
/// Loops over the processor's threads that run whole or throw.
///
/// If an iteration throws, oneTBB cancels its loop and every loop inside the other iterations. A
/// loop that is cancelled from outside returns early and without an exception, so that the code
/// behind it reads results that nobody wrote. A context of its own keeps each loop from that: only
/// its own iterations cancel it, and then it throws.
///
/// A thread that waits for its loop takes no work from outside, which may need what it holds.
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

namespace blindcorner {

/// tbb::parallel_for of its arguments; throws what an iteration throws. An object, because of a
/// function of this name, oneTBB's own would be taken wherever an argument is oneTBB's (a range, a
/// partitioner).
inline constexpr struct {
  template <typename... Arguments>
  void operator()(const Arguments&... arguments) const {
    tbb::this_task_arena::isolate([&] {
      tbb::task_group_context own(tbb::task_group_context::isolated);
      tbb::parallel_for(arguments..., own);
    });
  }
} parallel_for;

/// tbb::parallel_invoke of its functions; throws what one of them throws.
inline constexpr struct {
  template <typename... Functions>
  void operator()(const Functions&... functions) const {
    tbb::this_task_arena::isolate([&] {
      tbb::task_group_context own(tbb::task_group_context::isolated);
      tbb::parallel_invoke(functions..., own);
    });
  }
} parallel_invoke;

}  // namespace blindcorner
