// SPDX-License-Identifier: Apache-2.0
/// Who may read the page.
#pragma once

#include <string>
#include <string_view>

namespace blindcorner::live {

/// What of a request decides; empty: the request has no such part.
struct RequestFacts {
  std::string host{};        ///< header Host
  std::string origin{};      ///< header Origin
  std::string fetch_site{};  ///< header Sec-Fetch-Site
  std::string fetch_mode{};  ///< header Sec-Fetch-Mode
  std::string token{};       ///< of the address, the cookie or the header Authorization
};

struct AccessRules {
  std::string address = "127.0.0.1";  ///< listened on
  int port = 0;
  std::string token{};  ///< empty: none is asked for, on this machine only
};

/// Empty: welcome. Else why not. A page that a browser loaded from elsewhere cannot read this one,
/// whatever name it gave this machine (DNS rebinding): the header Host has to be an address that is
/// listened on, or localhost; beyond this machine any address in figures or this machine's name.
std::string refusal(const RequestFacts& request, const AccessRules& rules);

/// Whether an address is this machine's own and nobody else's.
bool is_loopback(std::string_view address);
/// Compares in a time that does not depend on where they differ.
bool same_token(std::string_view a, std::string_view b);
/// 128 random bits in hexadecimal.
std::string new_token();

}  // namespace blindcorner::live
