// SPDX-License-Identifier: Apache-2.0
/// Loops over the processor's threads that run whole or throw.
///
/// If an iteration throws, oneTBB cancels its loop and every loop inside the other iterations. A
/// loop that is cancelled from outside returns early and without an exception, so that the code
/// after it reads results that were never written. Each loop therefore has a context of its own:
/// only its own iterations cancel it, and then it throws.
///
/// A thread that waits for its loop takes no work from outside. Such work may need a resource
/// that the thread holds.
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

namespace blindcorner {

/// Calls tbb::parallel_for with its arguments and throws what an iteration throws. It is an object
/// and not a function: with a function of this name, the compiler would choose oneTBB's own
/// wherever an argument is a oneTBB type (a range, a partitioner).
inline constexpr struct {
  template <typename... Arguments>
  void operator()(const Arguments&... arguments) const {
    tbb::this_task_arena::isolate([&] {
      tbb::task_group_context own(tbb::task_group_context::isolated);
      tbb::parallel_for(arguments..., own);
    });
  }
} parallel_for;

/// Calls tbb::parallel_invoke with its functions and throws what one of them throws.
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
