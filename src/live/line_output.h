// SPDX-License-Identifier: Apache-2.0
/// Writes lines to a pipe or file whose reader may be slow or gone. The caller never waits.
#pragma once

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "live/mailbox.h"
#include "live/tally.h"

namespace blindcorner::live {

class LineOutput {
 public:
  /// Writes to the file descriptor `fd`, which stays the caller's. At most `capacity` lines wait.
  /// If there is no room, a new line is left out whole and counted.
  LineOutput(int fd, Tally& tally, std::size_t capacity = 256);
  /// Waits at most two seconds until the waiting lines are written.
  ~LineOutput();
  LineOutput(const LineOutput&) = delete;
  LineOutput& operator=(const LineOutput&) = delete;

  /// Adds a line, given without its line end.
  void put(std::string line);
  /// Whether the other side has closed.
  bool broken() const { return broken_; }

 private:
  void run();
  bool write_all(const std::string& text);
  bool out_of_time() const;

  const int fd_;
  Tally& tally_;
  Mailbox<std::string> lines_;
  std::atomic<bool> broken_ = false;
  std::atomic<long> end_ = 0;  ///< deadline of the last writes, steady clock, ns; 0: none
  std::thread thread_;
};

}  // namespace blindcorner::live
