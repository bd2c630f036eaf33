// SPDX-License-Identifier: Apache-2.0
/// Where a recording is played to: a pseudo-terminal, a TCP port, standard output.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace blindcorner::live {

/// As with a sensor, what nobody reads is gone.
class ReplayPort {
 public:
  virtual ~ReplayPort() = default;
  /// What `live --input` takes to read from it.
  virtual std::string name() const = 0;
  /// Whether somebody reads.
  virtual bool has_reader() = 0;
  /// Writes all of it to whoever reads; waits for a slow reader until `stop`. False: nobody will
  /// ever read again.
  virtual bool write(std::string_view bytes, const std::function<bool()>& stop) = 0;
};

/// Throw Error with what the system says.
std::unique_ptr<ReplayPort> pseudo_terminal();
/// Listens on tcp://host:port, port 0 for any that is free.
std::unique_ptr<ReplayPort> tcp_port(const std::string& address);
std::unique_ptr<ReplayPort> standard_output();

}  // namespace blindcorner::live
