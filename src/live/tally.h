// SPDX-License-Identifier: Apache-2.0
/// What goes wrong while a stream runs. Each kind of trouble is reported once and always counted.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace blindcorner::live {

/// What is counted. The names in JSON are in tally.cpp.
enum class Count {
  lines,                ///< that came in
  frames,               ///< whole ones that suit the scene
  answers,              ///< frames that were fitted
  skipped_frames,       ///< frames that a newer one replaced before it could be fitted
  damaged_lines,        ///< cut or corrupt
  repeated_lines,       ///< the same line once more
  long_lines,           ///< longer than any sensor's
  other_lines,          ///< of another sensor or kind
  incomplete_captures,  ///< lacked lines
  unsuitable_frames,    ///< other zones or bins than the scene's
  failed_frames,        ///< the fit could not use them
  restarts,             ///< of the board
  interruptions,        ///< of the input: unplugged, or the connection was closed
  dropped_answers,      ///< not written because standard output was full
  dropped_events,       ///< not sent because a browser did not read
  refused_requests,     ///< of browsers: another host, no token, too many
  unrecorded_frames,    ///< the disk was too slow or full
  kinds                 ///< how many there are
};

/// Thread safe.
class Tally {
 public:
  /// `say` gets a sentence the first time that a kind of trouble occurs.
  explicit Tally(std::function<void(const std::string&)> say = {}) : say_(std::move(say)) {}

  void add(Count kind, long n = 1) { counts_[place(kind)] += n; }
  /// Counts, and says `text` if it is the first of its kind.
  void note(Count kind, const std::string& text, long n = 1);
  /// Says `text`, whatever was said before.
  void say(const std::string& text);

  long of(Count kind) const { return counts_[place(kind)]; }
  /// All counts by name.
  std::map<std::string, long> all() const;
  /// The counts that are not zero: "frames 120, answers 118, skipped_frames 2".
  std::string text() const;

 private:
  static std::size_t place(Count kind) { return static_cast<std::size_t>(kind); }

  std::array<std::atomic<long>, static_cast<std::size_t>(Count::kinds)> counts_{};
  std::array<std::atomic<bool>, static_cast<std::size_t>(Count::kinds)> told_{};
  std::mutex mutex_;  ///< one sentence at a time
  std::function<void(const std::string&)> say_;
};

}  // namespace blindcorner::live
