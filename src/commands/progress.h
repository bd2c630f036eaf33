// SPDX-License-Identifier: Apache-2.0
/// Progress bar of the command line.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>

namespace blindcorner {

/// One line on standard error that shows share, rate and remaining time. Silent when standard error
/// is not a terminal. Thread safe.
class Progress {
 public:
  /// `total` steps; `label` says what is counted, such as "captures".
  Progress(std::string label, std::size_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(std::size_t steps = 1);
  /// Clears the line. Further calls do nothing.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  void draw(Clock::time_point now);

  const std::string label_;
  const std::size_t total_;
  const Clock::time_point start_;
  std::mutex mutex_;
  Clock::time_point drawn_;
  std::size_t done_ = 0;
  bool visible_ = false;
};

/// The line itself: bar, count, steps per second and remaining time; at least 40 characters.
std::string progress_line(const std::string& label, std::size_t done, std::size_t total,
                          double seconds);

}  // namespace blindcorner
