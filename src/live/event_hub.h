// SPDX-License-Identifier: Apache-2.0
/// Events for browsers. Publishing never waits for a browser.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "live/mailbox.h"
#include "live/tally.h"

namespace blindcorner::live {

class EventHub {
 public:
  using Event = std::shared_ptr<const std::string>;  ///< text of a server-sent event
  using Queue = Mailbox<Event>;

  /// At most `most_clients` clients listen, and at most `queue_length` events wait for each. Beyond
  /// that, the oldest events of a client are left out and counted.
  EventHub(std::size_t most_clients, std::size_t queue_length, Tally& tally)
      : most_clients_(most_clients), queue_length_(queue_length), tally_(tally) {}

  /// Adds a client. Null if there are enough clients, or the hub is closed.
  std::shared_ptr<Queue> join();
  void leave(const std::shared_ptr<Queue>& client);
  /// Sends an event to all clients. `data` is JSON on one line.
  void publish(const std::string& name, const std::string& data);
  std::size_t clients() const;
  /// Ends all queues. No client can join after that.
  void close();
  bool closed() const;

 private:
  const std::size_t most_clients_, queue_length_;
  Tally& tally_;
  mutable std::mutex mutex_;
  std::vector<std::shared_ptr<Queue>> clients_;
  bool closed_ = false;
};

/// The text of one server-sent event.
std::string event_text(const std::string& name, const std::string& data);

}  // namespace blindcorner::live
