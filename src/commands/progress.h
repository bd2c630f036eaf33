// SPDX-License-Identifier: Apache-2.0
/// Progress bar of the command line.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <string>
#include <thread>

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

/// One line on standard error that says what is being done and since when, for work that does not
/// come in equal steps. Silent when standard error is not a terminal. Thread safe.
class StageProgress {
 public:
  explicit StageProgress(std::string doing);
  ~StageProgress();
  StageProgress(const StageProgress&) = delete;
  StageProgress& operator=(const StageProgress&) = delete;

  /// What is being done from now on, and which share of that is done; 0: not known.
  void now(const std::string& doing, double share);

 private:
  void draw();

  const std::chrono::steady_clock::time_point start_;
  std::mutex mutex_;
  std::condition_variable ended_;
  std::string doing_;
  double share_ = 0;
  bool visible_ = false;
  bool end_ = false;
  std::thread clock_;  ///< draws the line anew while time passes
};

/// The line of a stage: a bar where a share is known, what is being done, the time that has passed.
std::string stage_line(const std::string& doing, double share, double seconds);

/// The line itself: bar, count, steps per second and remaining time; at least 40 characters.
std::string progress_line(const std::string& label, std::size_t done, std::size_t total,
                          double seconds);

}  // namespace blindcorner
