// SPDX-License-Identifier: Apache-2.0
/// Lambdas as one visitor of a variant.
#pragma once

namespace blindcorner {

template <class... Ts>
struct overloaded : Ts... {
  using Ts::operator()...;
};
/// Implied by C++20, which Clang has from version 17 on.
template <class... Ts>
overloaded(Ts...) -> overloaded<Ts...>;

}  // namespace blindcorner
