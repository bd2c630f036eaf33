// SPDX-License-Identifier: Apache-2.0
/// Where a recording is played to: a pseudo-terminal, a TCP port, standard output.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace blindcorner::live {

/// As with a sensor, bytes that nobody reads are lost.
class ReplayPort {
 public:
  virtual ~ReplayPort() = default;
  /// The address from which `live --input` reads it.
  virtual std::string name() const = 0;
  /// Whether somebody reads.
  virtual bool has_reader() = 0;
  /// Writes all bytes to everybody who reads, and waits for slow readers until `stop`. A terminal
  /// and a TCP port let go a reader that takes nothing for two seconds. False: nobody will ever
  /// read again.
  virtual bool write(std::string_view bytes, const std::function<bool()>& stop) = 0;
};

/// These functions throw Error with the system's message.
std::unique_ptr<ReplayPort> pseudo_terminal();
/// Listens on tcp://host:port, port 0 for any that is free.
std::unique_ptr<ReplayPort> tcp_port(const std::string& address);
std::unique_ptr<ReplayPort> standard_output();

}  // namespace blindcorner::live
