// SPDX-License-Identifier: Apache-2.0
/// Who may read the page.
#pragma once

#include <string>
#include <string_view>

namespace blindcorner::live {

/// The parts of a request that decide. A part that the request lacks is empty.
struct RequestFacts {
  std::string host{};        ///< header Host
  std::string origin{};      ///< header Origin
  std::string fetch_site{};  ///< header Sec-Fetch-Site
  std::string fetch_mode{};  ///< header Sec-Fetch-Mode
  std::string token{};       ///< from the address, the cookie or the header Authorization
};

struct AccessRules {
  std::string address = "127.0.0.1";  ///< address that the server listens on
  int port = 0;
  std::string token{};  ///< empty: no token is asked for; only for this machine
};

/// Why a request is refused; empty: it is welcome. A page that a browser loaded from elsewhere
/// cannot read this one, whatever name it gave this machine (DNS rebinding): the header Host has to
/// be localhost or a loopback address. If the server listens beyond this machine, Host may also be
/// any numeric address, this machine's name or the address listened on.
std::string refusal(const RequestFacts& request, const AccessRules& rules);

/// Whether an address is a loopback address, which only this machine can reach.
bool is_loopback(std::string_view address);
/// Compares two tokens in a time that does not depend on where they differ.
bool same_token(std::string_view a, std::string_view b);
/// 128 random bits in hexadecimal.
std::string new_token();

}  // namespace blindcorner::live
