// SPDX-License-Identifier: Apache-2.0
#include "live/recorder.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <utility>

#include "blindcorner/forward/error.h"
#include "live/background_thread.h"

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr std::size_t kQueue = 64;

}  // namespace

Recorder::Recorder(RecorderOptions options, Tally& tally)
    : options_(std::move(options)), tally_(tally), frames_(kQueue) {
  const fs::path folder = fs::path(options_.path).parent_path();
  if (!folder.empty() && !fs::is_directory(folder)) {
    throw Error(options_.path, "its folder does not exist");
  }
  part_.bin_width = options_.bin_width;
  part_.sensor = options_.sensor;
  part_.description = options_.description;
  thread_ = std::thread([this] { run(); });
}

Recorder::~Recorder() { finish(); }

void Recorder::add(Capture capture, bool patient) {
  const bool taken =
      patient ? frames_.put_patiently(std::move(capture)) : frames_.offer(std::move(capture));
  if (taken) return;
  tally_.note(Count::unrecorded_frames,
              options_.path + ": the disk is too slow; frames are left out");
}

std::vector<std::string> Recorder::finish() {
  frames_.close();
  if (thread_.joinable()) thread_.join();
  return files_;
}

std::string Recorder::name_of(int part) const {
  if (part == 1) return options_.path;
  char suffix[16];
  std::snprintf(suffix, sizeof suffix, "_%04d.exr", part);
  return fs::path(options_.path).replace_extension().string() + suffix;
}

void Recorder::run() {
  give_way();
  auto last_save = std::chrono::steady_clock::now();
  std::size_t bytes = 0;
  while (!frames_.finished()) {
    std::optional<Capture> capture = frames_.take(200ms);
    if (capture) {
      bytes += capture->counts.values.size() * sizeof(double);
      part_.captures.push_back(std::move(*capture));
    }
    const auto now = std::chrono::steady_clock::now();
    const bool full = bytes >= options_.most_bytes;
    if (!full && std::chrono::duration<double>(now - last_save).count() < options_.save_interval) {
      continue;
    }
    save();
    last_save = now;
    if (!full) continue;
    part_.captures = {};
    saved_ = unsaved_ = bytes = 0;
    ++number_;
  }
  save();
}

void Recorder::save() {
  if (part_.captures.size() == saved_) return;
  const std::string path = name_of(number_);
  try {
    write_captures(path, part_);
    tally_.add(Count::unrecorded_frames, -static_cast<long>(unsaved_));
    saved_ = part_.captures.size();
    unsaved_ = 0;
    if (files_.empty() || files_.back() != path) files_.push_back(path);
  } catch (const std::exception& error) {
    const std::size_t more = part_.captures.size() - saved_ - unsaved_;
    tally_.note(Count::unrecorded_frames, error.what(), static_cast<long>(more));
    unsaved_ += more;
  }
}

}  // namespace blindcorner::live
