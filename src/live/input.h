// SPDX-License-Identifier: Apache-2.0
/// Where a stream comes from: a serial device, a file, standard input, a TCP port, a ZeroMQ
/// publisher.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "live/tally.h"
#include "live/zeromq.h"

namespace blindcorner::live {

/// The parts of scheme://host:port. The parser throws Error naming `field`.
struct TcpAddress {
  std::string host;
  std::string port;
};
TcpAddress parse_tcp_address(const std::string& text, const std::string& field,
                             const std::string& scheme = "tcp");
bool is_tcp_address(const std::string& text);

struct InputOptions {
  std::string address;  ///< DEVICE, FILE, "-", tcp://host:port or zmq://host:port
  int baud = 115200;    ///< of a serial device; a pseudo-terminal or USB device takes any
  bool waits = true;    ///< for a device or port that is not there, or goes away
};

/// Reads the bytes of a stream. If the source goes away, waits for it: an unplugged device, a
/// closed connection.
class Input {
 public:
  enum class Event { bytes, nothing, interrupted, ended };

  /// Throws Error for an address that can never be read. If `waits` is false, also throws for one
  /// that cannot be read at once.
  Input(InputOptions options, Tally& tally);
  ~Input();
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  /// Waits at most `patience` for bytes, which replace what `into` holds.
  Event read(std::string& into, std::chrono::milliseconds patience);

  /// Whether unread bytes wait, as those of a regular file do. A sensor's bytes do not.
  bool is_file() const { return kind_ == Kind::file; }

 private:
  enum class Kind { file, pipe, device, tcp, zeromq };

  bool open();
  int connect_tcp(std::string& problem) const;
  void set_up_serial() const;
  Event read_published(std::string& into, std::chrono::milliseconds patience);
  Event lost(const std::string& reason);
  Event pause(std::chrono::milliseconds patience);

  InputOptions options_;
  Tally& tally_;
  Kind kind_ = Kind::file;
  int fd_ = -1;
  std::unique_ptr<ZeroMqSubscriber> publisher_;
  bool told_waiting_ = false;
  std::chrono::steady_clock::time_point next_try_{};
};

}  // namespace blindcorner::live
