// SPDX-License-Identifier: Apache-2.0
/// Long work without the interpreter's lock, which Ctrl-C ends.
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <thread>
#include <type_traits>
#include <utility>

namespace blindcorner::python {

namespace nb = nanobind;

/// Thrown through the library by work that was told to stop. It is no std::exception, which would
/// become the error of a capture.
struct Stopped {};

/// What a Python callback raised, on its way through the library.
struct CallbackFailed {
  std::shared_ptr<nb::python_error> error;
};

/// Whether this is the thread in which Python handles signals.
bool on_main_thread();

/// Keeps a thread whose work was told to stop, until join_abandoned(). No such thread outlives the
/// interpreter.
void abandon(std::thread thread);

/// Waits for all threads that were abandoned. To be called at the interpreter's end.
void join_abandoned();

/// Runs `work` without the interpreter's lock. `work` owns all that it needs and touches no Python
/// object. In the main thread, signals are handled meanwhile. If one raises (Ctrl-C), this calls
/// `stop` and throws at once; the work goes on alone until it notices.
template <typename Work>
std::invoke_result_t<Work&> interruptible(Work work, const std::function<void()>& stop) {
  using Result = std::invoke_result_t<Work&>;
  constexpr auto kSignalInterval = std::chrono::milliseconds(20);
  try {
    if (!on_main_thread()) {
      const nb::gil_scoped_release released;
      return work();
    }
    const auto task = std::make_shared<std::packaged_task<Result()>>(std::move(work));
    std::future<Result> result = task->get_future();
    std::thread thread([task] { (*task)(); });
    bool interrupted = false;
    {
      const nb::gil_scoped_release released;
      while (!interrupted && result.wait_for(kSignalInterval) != std::future_status::ready) {
        const nb::gil_scoped_acquire held;
        interrupted = PyErr_CheckSignals() != 0;
      }
      if (!interrupted) thread.join();
    }
    if (!interrupted) return result.get();
    stop();
    abandon(std::move(thread));
    throw nb::python_error();
  } catch (const CallbackFailed& failed) {
    throw nb::python_error(*failed.error);
  }
}

/// A flag that asks work to stop; the work has to look at it.
class StopFlag {
 public:
  StopFlag() : asked_(std::make_shared<std::atomic<bool>>(false)) {}
  bool asked() const { return *asked_; }
  void ask() const { *asked_ = true; }
  /// Throws Stopped if asked.
  void check() const {
    if (asked()) throw Stopped{};
  }

 private:
  std::shared_ptr<std::atomic<bool>> asked_;
};

/// A Python callable that any thread may call, or let go of, with or without the lock.
class Callback {
 public:
  Callback() = default;
  explicit Callback(nb::object callable);

  explicit operator bool() const { return callable_ != nullptr; }

  /// Throws CallbackFailed with what the callable raised.
  template <typename... Arguments>
  void operator()(Arguments... arguments) const {
    const nb::gil_scoped_acquire held;
    try {
      (*callable_)(arguments...);
    } catch (const nb::python_error& error) {
      throw CallbackFailed{std::make_shared<nb::python_error>(error)};
    }
  }

 private:
  std::shared_ptr<nb::object> callable_;
};

}  // namespace blindcorner::python
