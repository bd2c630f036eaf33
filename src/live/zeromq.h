// SPDX-License-Identifier: Apache-2.0
/// Receives what a ZeroMQ publisher sends. Without libzmq at build time, no subscriber can be made.
#pragma once

#include <chrono>
#include <memory>
#include <string>

namespace blindcorner::live {

class ZeroMqSubscriber {
 public:
  enum class Event { message, nothing, connected, disconnected };

  /// Connects to tcp://host:port in the background, again and again. Throws Error naming `field` if
  /// ZeroMQ refuses the address, or if the program was built without ZeroMQ.
  ZeroMqSubscriber(const std::string& address, const std::string& field);
  ~ZeroMqSubscriber();

  /// Whether the publisher answers within `patience`.
  bool connected_within(std::chrono::milliseconds patience);

  /// Waits at most `patience`. A message replaces what `into` holds.
  Event receive(std::string& into, std::chrono::milliseconds patience);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner::live
