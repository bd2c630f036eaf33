// SPDX-License-Identifier: Apache-2.0
#include "commands/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace blindcorner {

namespace {

constexpr std::size_t kBarWidth = 24;
constexpr auto kRedrawInterval = std::chrono::milliseconds(100);

std::string duration(double seconds) {
  const long whole = std::lround(std::min(seconds, 359999.0));
  char text[32];
  if (whole >= 3600) {
    std::snprintf(text, sizeof text, "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%ld:%02ld", whole / 60, whole % 60);
  }
  return text;
}

std::string bar(std::size_t filled) {
  std::string text(std::min(filled, kBarWidth), '#');
  text.resize(kBarWidth, '.');
  return "[" + text + "] ";
}

}  // namespace

std::string stage_line(const std::string& doing, double share, double seconds) {
  std::string line;
  if (share > 0) line = bar(static_cast<std::size_t>(share * static_cast<double>(kBarWidth)));
  return line + doing + "  " + duration(seconds);
}

std::string progress_line(const std::string& label, std::size_t done, std::size_t total,
                          double seconds) {
  std::string line = bar(total == 0 ? kBarWidth : kBarWidth * std::min(done, total) / total);
  line += std::to_string(done) + "/" + std::to_string(total) + " " + label;
  if (done > 0 && seconds > 0.0) {
    const double rate = static_cast<double>(done) / seconds;
    char text[48];
    std::snprintf(text, sizeof text, "  %.3g/s  %s left", rate,
                  duration(static_cast<double>(total - std::min(done, total)) / rate).c_str());
    line += text;
  }
  return line;
}

Progress::Progress(std::string label, std::size_t total)
    : label_(std::move(label)),
      total_(total),
      start_(Clock::now()),
      drawn_(start_),
      visible_(isatty(STDERR_FILENO) == 1) {
  if (visible_) draw(start_);
}

Progress::~Progress() { finish(); }

void Progress::advance(std::size_t steps) {
  const std::lock_guard lock(mutex_);
  done_ += steps;
  const auto now = Clock::now();
  if (visible_ && (now - drawn_ >= kRedrawInterval || done_ >= total_)) draw(now);
}

void Progress::finish() {
  const std::lock_guard lock(mutex_);
  if (visible_) std::fputs("\r\x1b[K", stderr);
  visible_ = false;
}

void Progress::draw(Clock::time_point now) {
  drawn_ = now;
  const std::chrono::duration<double> elapsed = now - start_;
  const std::string line = progress_line(label_, done_, total_, elapsed.count());
  std::fprintf(stderr, "\r\x1b[K%s", line.c_str());
  std::fflush(stderr);
}

StageProgress::StageProgress(std::string doing)
    : start_(std::chrono::steady_clock::now()),
      doing_(std::move(doing)),
      visible_(isatty(STDERR_FILENO) == 1) {
  if (!visible_) return;
  clock_ = std::thread([this] {
    std::unique_lock lock(mutex_);
    while (!end_) {
      draw();
      ended_.wait_for(lock, 5 * kRedrawInterval);
    }
  });
}

StageProgress::~StageProgress() {
  if (!visible_) return;
  {
    const std::lock_guard lock(mutex_);
    end_ = true;
  }
  ended_.notify_all();
  clock_.join();
  std::fputs("\r\x1b[K", stderr);
}

void StageProgress::now(const std::string& doing, double share) {
  if (!visible_) return;
  const std::lock_guard lock(mutex_);
  const bool changed = doing != doing_;
  doing_ = doing;
  share_ = share;
  if (changed) draw();
}

void StageProgress::draw() {
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
  std::fprintf(stderr, "\r\x1b[K%s", stage_line(doing_, share_, elapsed.count()).c_str());
  std::fflush(stderr);
}

}  // namespace blindcorner
