// SPDX-License-Identifier: Apache-2.0
#include "live/tally.h"

namespace blindcorner::live {
namespace {

constexpr std::array<const char*, static_cast<std::size_t>(Count::kinds)> kNames = {
    "lines",
    "frames",
    "answers",
    "skipped_frames",
    "damaged_lines",
    "repeated_lines",
    "long_lines",
    "other_lines",
    "incomplete_captures",
    "unsuitable_frames",
    "failed_frames",
    "restarts",
    "interruptions",
    "dropped_answers",
    "dropped_events",
    "refused_requests",
    "unrecorded_frames"};

}  // namespace

void Tally::note(Count kind, const std::string& text, long n) {
  add(kind, n);
  if (!told_[place(kind)].exchange(true)) say(text);
}

void Tally::say(const std::string& text) {
  if (!say_) return;
  const std::lock_guard lock(mutex_);
  say_(text);
}

std::map<std::string, long> Tally::all() const {
  std::map<std::string, long> counts;
  for (std::size_t i = 0; i < kNames.size(); ++i) counts[kNames[i]] = counts_[i];
  return counts;
}

std::string Tally::text() const {
  std::string text;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (counts_[i] == 0) continue;
    text += (text.empty() ? "" : ", ") + std::string(kNames[i]) + " " + std::to_string(counts_[i]);
  }
  return text;
}

}  // namespace blindcorner::live
