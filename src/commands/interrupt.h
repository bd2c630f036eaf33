// SPDX-License-Identifier: Apache-2.0
/// Ctrl-C ends long work with what is finished.
#pragma once

#include <cstddef>
#include <string>

namespace blindcorner {

/// While this lives, the first Ctrl-C (SIGINT, or SIGTERM) asks the work to end, and a second one
/// ends the program as it otherwise would. Only one may live at a time.
class Interruptible {
 public:
  Interruptible();
  ~Interruptible();
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  /// Whether the work has been asked to end. Thread safe.
  static bool asked();
};

/// Error of a capture that was not begun. It tells such a capture from one that failed.
inline constexpr const char* kInterrupted = "not done: interrupted";

/// Says on the standard error stream how much of the work was finished, such as "12 of 60 trials";
/// `rest` is what becomes of it, such as "the same command goes on from there"; empty: nothing.
void tell_interrupted(std::size_t finished, std::size_t all, const std::string& what,
                      const std::string& rest = {});

}  // namespace blindcorner
