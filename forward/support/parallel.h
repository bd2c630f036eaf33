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

#include "forward/support/loop_order.h"

namespace blindcorner {

/// Calls `loop` with a context of its own, and with the order of what happens in it. Throws what an
/// iteration throws.
template <typename Loop>
void run_whole(const Loop& loop) {
  tbb::this_task_arena::isolate([&] {
    tbb::task_group_context own(tbb::task_group_context::isolated);
    const LoopOrder order{};
    loop(own, order);
  });
}

/// tbb::parallel_for and tbb::parallel_invoke with their arguments. They are objects and not
/// functions: with functions of these names, the compiler would choose oneTBB's own wherever an
/// argument is a oneTBB type (a range, a partitioner).
inline constexpr auto parallel_for = [](const auto&... arguments) {  // NOLINT: called like it
  run_whole([&](tbb::task_group_context& own, const LoopOrder& order) {
    tbb::parallel_for(order.of(arguments)..., own);
  });
};
inline constexpr auto parallel_invoke = [](const auto&... functions) {  // NOLINT: called like it
  run_whole([&](tbb::task_group_context& own, const LoopOrder& order) {
    tbb::parallel_invoke(order.of(functions)..., own);
  });
};

}  // namespace blindcorner
