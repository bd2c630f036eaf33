// SPDX-License-Identifier: Apache-2.0
/// Measurement of run times.
#pragma once

#include <chrono>
#include <ctime>

namespace blindcorner {

/// Times in s: on the clock, and summed over all processors that the program uses. Other programs
/// on the machine do not lengthen the latter.
struct RunTime {
  double wall = 0, processor = 0;

  RunTime operator+(const RunTime& other) const {
    return {wall + other.wall, processor + other.processor};
  }
};

class Stopwatch {
 public:
  RunTime since_start() const {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - wall_;
    return {wall.count(), static_cast<double>(std::clock() - processor_) / CLOCKS_PER_SEC};
  }

 private:
  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
  std::clock_t processor_ = std::clock();
};

}  // namespace blindcorner
