// SPDX-License-Identifier: Apache-2.0
/// Lines to a pipe or file whose reader may be slow, or gone: the caller never waits.
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
  /// Writes to the file descriptor `fd`, which stays the caller's. At most `capacity` lines wait;
  /// where there is no room, a new line is left out whole and counted.
  LineOutput(int fd, Tally& tally, std::size_t capacity = 256);
  /// Gives what waits two seconds.
  ~LineOutput();
  LineOutput(const LineOutput&) = delete;
  LineOutput& operator=(const LineOutput&) = delete;

  /// A line without its end.
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
  std::atomic<long> end_ = 0;  ///< steady clock, ns; 0: not asked to end
  std::thread thread_;
};

}  // namespace blindcorner::live
