// SPDX-License-Identifier: Apache-2.0
#include "live/zeromq.h"

#include "blindcorner/forward/error.h"

#ifdef BLINDCORNER_HAS_ZEROMQ
#include <zmq.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

namespace blindcorner::live {
namespace {

/// The longest message of a TMF8829 is 24 frames of 25 kB.
constexpr std::int64_t kLongestMessage = 4 << 20;
/// Most messages that wait here. If more come, some are lost, as with a sensor.
constexpr int kWaiting = 4;
/// Time for a connection to be made before the next attempt, ms.
constexpr int kConnectPatience = 2000;
constexpr const char* kMonitor = "inproc://monitor";

class Socket {
 public:
  Socket(void* context, int kind) : socket_(zmq_socket(context, kind)) {}
  ~Socket() { zmq_close(socket_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  void* get() const { return socket_; }

 private:
  void* socket_;
};

}  // namespace

struct ZeroMqSubscriber::Impl {
  std::unique_ptr<void, int (*)(void*)> context{zmq_ctx_new(), &zmq_ctx_term};
  Socket subscriber{context.get(), ZMQ_SUB};
  Socket monitor{context.get(), ZMQ_PAIR};

  /// What became of the connection. An event's number comes first, its address in a second part.
  Event connection() const {
    Event result = Event::nothing;
    std::array<char, 256> part{};
    while (zmq_recv(monitor.get(), part.data(), part.size(), ZMQ_DONTWAIT) >= 2) {
      std::uint16_t event = 0;
      std::memcpy(&event, part.data(), sizeof event);
      result = event == ZMQ_EVENT_DISCONNECTED ? Event::disconnected : Event::connected;
      zmq_recv(monitor.get(), part.data(), part.size(), ZMQ_DONTWAIT);
      if (result == Event::disconnected) break;
    }
    return result;
  }
};

ZeroMqSubscriber::ZeroMqSubscriber(const std::string& address, const std::string& field)
    : impl_(std::make_unique<Impl>()) {
  void* const socket = impl_->subscriber.get();
  const int none = 0, yes = 1, waiting = kWaiting, patience = kConnectPatience;
  zmq_setsockopt(socket, ZMQ_LINGER, &none, sizeof none);
  zmq_setsockopt(socket, ZMQ_IPV6, &yes, sizeof yes);
  zmq_setsockopt(socket, ZMQ_RCVHWM, &waiting, sizeof waiting);
  zmq_setsockopt(socket, ZMQ_MAXMSGSIZE, &kLongestMessage, sizeof kLongestMessage);
  // Without these times, a publisher that goes away while a connection is made would keep the
  // subscriber for half a minute.
  zmq_setsockopt(socket, ZMQ_CONNECT_TIMEOUT, &patience, sizeof patience);
  zmq_setsockopt(socket, ZMQ_HANDSHAKE_IVL, &patience, sizeof patience);
  zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0);
  const bool ready =
      zmq_socket_monitor(socket, kMonitor,
                         ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED) == 0 &&
      zmq_connect(impl_->monitor.get(), kMonitor) == 0;
  if (!ready || zmq_connect(socket, address.c_str()) != 0) {
    throw Error(field, zmq_strerror(zmq_errno()));
  }
}

bool ZeroMqSubscriber::connected_within(std::chrono::milliseconds patience) {
  zmq_pollitem_t waiting{impl_->monitor.get(), 0, ZMQ_POLLIN, 0};
  return zmq_poll(&waiting, 1, patience.count()) > 0 && impl_->connection() == Event::connected;
}

ZeroMqSubscriber::Event ZeroMqSubscriber::receive(std::string& into,
                                                  std::chrono::milliseconds patience) {
  std::array<zmq_pollitem_t, 2> waiting{
      {{impl_->subscriber.get(), 0, ZMQ_POLLIN, 0}, {impl_->monitor.get(), 0, ZMQ_POLLIN, 0}}};
  if (zmq_poll(waiting.data(), waiting.size(), patience.count()) <= 0) return Event::nothing;
  // Messages that came before the connection was lost are read first.
  if ((waiting[0].revents & ZMQ_POLLIN) == 0) return impl_->connection();
  zmq_msg_t message;
  zmq_msg_init(&message);
  const bool got = zmq_msg_recv(&message, impl_->subscriber.get(), ZMQ_DONTWAIT) >= 0;
  if (got) into.assign(static_cast<const char*>(zmq_msg_data(&message)), zmq_msg_size(&message));
  zmq_msg_close(&message);
  return got ? Event::message : Event::nothing;
}

}  // namespace blindcorner::live

#else

namespace blindcorner::live {

struct ZeroMqSubscriber::Impl {};

ZeroMqSubscriber::ZeroMqSubscriber(const std::string& address, const std::string& field) {
  throw Error(field, address +
                         " asks for ZeroMQ, which this program was built without; install "
                         "libzmq3-dev (Debian) and build again");
}

bool ZeroMqSubscriber::connected_within(std::chrono::milliseconds) { return false; }

ZeroMqSubscriber::Event ZeroMqSubscriber::receive(std::string&, std::chrono::milliseconds) {
  return Event::nothing;
}

}  // namespace blindcorner::live

#endif

namespace blindcorner::live {
ZeroMqSubscriber::~ZeroMqSubscriber() = default;
}  // namespace blindcorner::live
