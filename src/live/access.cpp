// SPDX-License-Identifier: Apache-2.0
#include "live/access.h"

#include <arpa/inet.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <optional>
#include <random>

namespace blindcorner::live {
namespace {

/// Host and port of "host:port" or "[::1]:port"; the port is HTTP's where none is stated.
struct HostAndPort {
  std::string host;
  std::string port = "80";
};

HostAndPort split(const std::string& text) {
  const std::size_t bracket = text.rfind(']');
  const std::size_t colon = text.rfind(':');
  HostAndPort result{text};
  if (colon != std::string::npos && (bracket == std::string::npos || colon > bracket)) {
    result = {text.substr(0, colon), text.substr(colon + 1)};
  }
  if (result.host.starts_with('[') && result.host.ends_with(']')) {
    result.host = result.host.substr(1, result.host.size() - 2);
  }
  return result;
}

bool in_figures(const std::string& host) {
  in6_addr unused{};
  return ::inet_pton(AF_INET, host.c_str(), &unused) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), &unused) == 1;
}

std::string own_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

bool host_is_mine(const std::string& header, const AccessRules& rules) {
  const HostAndPort asked = split(header);
  if (asked.port != std::to_string(rules.port)) return false;
  if (asked.host == "localhost" || is_loopback(asked.host)) return true;
  if (is_loopback(rules.address)) return false;
  return in_figures(asked.host) || asked.host == own_name() || asked.host == rules.address;
}

}  // namespace

bool is_loopback(std::string_view address) {
  return address == "localhost" || address == "::1" ||
         (address.starts_with("127.") && in_figures(std::string(address)));
}

bool same_token(std::string_view a, std::string_view b) {
  unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const char other = b.empty() ? '\0' : b[i % b.size()];
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(other);
  }
  return difference == 0;
}

std::string new_token() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) {
    std::array<char, 9> digits{};
    std::snprintf(digits.data(), digits.size(), "%08x", random());
    token += digits.data();
  }
  return token;
}

std::string refusal(const RequestFacts& request, const AccessRules& rules) {
  if (!host_is_mine(request.host, rules)) return "another Host";
  if (!request.origin.empty() && request.origin != "http://" + request.host) {
    return "another Origin";
  }
  const bool from_elsewhere =
      request.fetch_site == "cross-site" || request.fetch_site == "same-site";
  if (from_elsewhere && request.fetch_mode != "navigate") return "a page from elsewhere";
  if (!rules.token.empty() && !same_token(request.token, rules.token)) return "no token";
  return {};
}

}  // namespace blindcorner::live
