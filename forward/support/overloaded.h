// SPDX-License-Identifier: Apache-2.0
/// Combines lambdas into one visitor of a variant.
#pragma once

namespace blindcorner {

template <class... Ts>
struct overloaded : Ts... {
  using Ts::operator()...;
};
/// C++20 implies this deduction guide; Clang does so from version 17 on.
template <class... Ts>
overloaded(Ts...) -> overloaded<Ts...>;

}  // namespace blindcorner
