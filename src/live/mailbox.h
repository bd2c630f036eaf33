// SPDX-License-Identifier: Apache-2.0
/// Hands things from one thread to another, with a bounded number on the way.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace blindcorner::live {

/// A queue of at most `capacity` items. With a capacity of one it holds the latest item. Thread
/// safe.
template <typename T>
class Mailbox {
 public:
  explicit Mailbox(std::size_t capacity = 1) : capacity_(capacity) {}

  /// Never waits. Drops the oldest items if there is no room for this one. Returns how many.
  std::size_t put(T value) {
    std::size_t dropped = 0;
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return 0;
      for (; waiting_.size() >= capacity_; ++dropped) waiting_.pop_front();
      waiting_.push_back(std::move(value));
    }
    filled_.notify_one();
    return dropped;
  }

  /// Never waits, and drops nothing. False if there is no room or the box is closed.
  bool offer(T value) {
    {
      const std::lock_guard lock(mutex_);
      if (closed_ || waiting_.size() >= capacity_) return false;
      waiting_.push_back(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  /// Waits for room. False if the box is closed meanwhile.
  bool put_patiently(T value) {
    {
      std::unique_lock lock(mutex_);
      emptied_.wait(lock, [&] { return closed_ || waiting_.size() < capacity_; });
      if (closed_) return false;
      waiting_.push_back(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  /// Takes the oldest item. Nothing if none came within `patience`, or if the box is closed and
  /// empty.
  std::optional<T> take(std::chrono::milliseconds patience) {
    std::optional<T> value;
    {
      std::unique_lock lock(mutex_);
      filled_.wait_for(lock, patience, [&] { return closed_ || !waiting_.empty(); });
      if (waiting_.empty()) return std::nullopt;
      value.emplace(std::move(waiting_.front()));
      waiting_.pop_front();
    }
    emptied_.notify_one();
    return value;
  }

  /// After this call no item comes in. The items that are there can still be taken.
  void close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    filled_.notify_all();
    emptied_.notify_all();
  }

  /// Whether it is closed and empty.
  bool finished() const {
    const std::lock_guard lock(mutex_);
    return closed_ && waiting_.empty();
  }
  bool empty() const {
    const std::lock_guard lock(mutex_);
    return waiting_.empty();
  }

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable filled_, emptied_;
  std::deque<T> waiting_;
  bool closed_ = false;
};

}  // namespace blindcorner::live
