// SPDX-License-Identifier: Apache-2.0
/// What happens before and after the iterations of a loop, for the thread sanitizer.
///
/// Debian builds oneTBB without the sanitizer, which therefore does not see that what a thread did
/// before its loop comes before every iteration, and that every iteration comes before what the
/// thread does next. `LoopOrder` tells it. It says nothing about two iterations of one loop, so
/// that the sanitizer still finds those that disturb each other. In all other builds it does
/// nothing.
#pragma once

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#include <tbb/partitioner.h>

#include <type_traits>
#include <utility>
#endif

namespace blindcorner {

#ifdef __SANITIZE_THREAD__

class LoopOrder {
 public:
  LoopOrder() { __tsan_release(&before_); }
  ~LoopOrder() { __tsan_acquire(&after_); }
  LoopOrder(const LoopOrder&) = delete;
  LoopOrder& operator=(const LoopOrder&) = delete;

  /// An argument of a loop: a function in its place, all others as they are.
  template <typename Argument>
  auto of(const Argument& argument) const {
    if constexpr (std::is_arithmetic_v<Argument> || requires { argument.begin(); } ||
                  std::is_same_v<Argument, tbb::simple_partitioner>) {
      return argument;
    } else {
      return Ordered<Argument>{this, &argument};
    }
  }

 private:
  /// Also where the function throws.
  struct Release {
    char* at;
    ~Release() { __tsan_release(at); }
  };

  template <typename Function>
  struct Ordered {
    const LoopOrder* order;
    const Function* function;
    // The sanitizer does not look at the reading of these two members: it comes before the order.
    template <typename... Parts>
    __attribute__((no_sanitize("thread"))) void operator()(Parts&&... parts) const {
      __tsan_acquire(&order->before_);
      const Release release{&order->after_};
      (*function)(std::forward<Parts>(parts)...);
    }
  };

  // Their addresses name the two events.
  mutable char before_ = 0;
  mutable char after_ = 0;
};

#else

class LoopOrder {
 public:
  template <typename Argument>
  const Argument& of(const Argument& argument) const {
    return argument;
  }
};

#endif

}  // namespace blindcorner
