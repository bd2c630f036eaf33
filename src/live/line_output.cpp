// SPDX-License-Identifier: Apache-2.0
#include "live/line_output.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;

constexpr auto kPipePatience = 100ms;
constexpr auto kFarewell = 2s;
/// Bytes that a pipe takes at once without blocking if poll calls it writable (PIPE_BUF).
constexpr std::size_t kPiece = 4096;

long now_ns() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace

LineOutput::LineOutput(int fd, Tally& tally, std::size_t capacity)
    : fd_(fd), tally_(tally), lines_(capacity), thread_([this] { run(); }) {}

LineOutput::~LineOutput() {
  end_ = now_ns() + std::chrono::nanoseconds(kFarewell).count();
  lines_.close();
  thread_.join();
}

void LineOutput::put(std::string line) {
  line += '\n';
  if (broken_) {
    tally_.add(Count::dropped_answers);
  } else if (!lines_.offer(std::move(line))) {
    tally_.note(Count::dropped_answers,
                "standard output is full: its reader is too slow; answers are left out");
  }
}

bool LineOutput::out_of_time() const { return end_ != 0 && now_ns() > end_; }

void LineOutput::run() {
  while (!lines_.finished()) {
    const std::optional<std::string> line = lines_.take(kPipePatience);
    if (!line) continue;
    if (broken_ || !write_all(*line)) tally_.add(Count::dropped_answers);
  }
}

/// False: the line, or the rest of it, could not be written.
bool LineOutput::write_all(const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    if (out_of_time()) return false;
    pollfd waiting{fd_, POLLOUT, 0};
    if (::poll(&waiting, 1, static_cast<int>(kPipePatience.count())) <= 0) continue;
    const ssize_t size = ::write(fd_, text.data() + done, std::min(kPiece, text.size() - done));
    if (size >= 0) {
      done += static_cast<std::size_t>(size);
    } else if (errno != EINTR && errno != EAGAIN) {
      tally_.say(std::string("standard output: ") + std::strerror(errno) +
                 "; nothing more is written to it");
      broken_ = true;
      return false;
    }
  }
  return true;
}

}  // namespace blindcorner::live
