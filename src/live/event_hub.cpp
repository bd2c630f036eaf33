// SPDX-License-Identifier: Apache-2.0
#include "live/event_hub.h"

#include <algorithm>

namespace blindcorner::live {

std::string event_text(const std::string& name, const std::string& data) {
  return "event: " + name + "\ndata: " + data + "\n\n";
}

std::shared_ptr<EventHub::Queue> EventHub::join() {
  const std::lock_guard lock(mutex_);
  if (closed_ || clients_.size() >= most_clients_) return nullptr;
  clients_.push_back(std::make_shared<Queue>(queue_length_));
  return clients_.back();
}

void EventHub::leave(const std::shared_ptr<Queue>& client) {
  const std::lock_guard lock(mutex_);
  std::erase(clients_, client);
}

void EventHub::publish(const std::string& name, const std::string& data) {
  const std::lock_guard lock(mutex_);
  if (clients_.empty()) return;
  const Event event = std::make_shared<const std::string>(event_text(name, data));
  std::size_t dropped = 0;
  for (const std::shared_ptr<Queue>& client : clients_) dropped += client->put(event);
  tally_.add(Count::dropped_events, static_cast<long>(dropped));
}

std::size_t EventHub::clients() const {
  const std::lock_guard lock(mutex_);
  return clients_.size();
}

void EventHub::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (const std::shared_ptr<Queue>& client : clients_) client->close();
}

bool EventHub::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

}  // namespace blindcorner::live
