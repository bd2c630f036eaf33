// SPDX-License-Identifier: Apache-2.0
/// Serves the live page and its events over HTTP.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "live/access.h"
#include "live/event_hub.h"
#include "live/tally.h"

namespace blindcorner::live {

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 8628;      ///< 0: any that is free
  std::string token{};  ///< empty: no token is asked for

  /// Throws Error if others could read without a token, or if the port is out of range.
  void validate() const;
};

/// What is served: `/` the page, `/events` server-sent events, `/status.json`.
struct Served {
  std::string page{};                       ///< HTML
  std::function<std::string()> greeting{};  ///< first events of a browser; may be empty
  std::function<std::string()> status{};    ///< JSON
};

class PageServer {
 public:
  /// Listens at once, in threads of its own. Throws Error when the port cannot be had.
  PageServer(const ServerOptions& options, Served served, EventHub& hub, Tally& tally);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  int port() const;
  /// The address to open in a browser, with the token.
  std::string url() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner::live
