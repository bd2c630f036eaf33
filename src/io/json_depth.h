// SPDX-License-Identifier: Apache-2.0
/// Limits how deep JSON from others may nest: reading, copying and printing it recurse.
#pragma once

#include <string>
#include <string_view>

namespace blindcorner {

/// Deepest nesting of objects and arrays that is accepted. No format here comes near it.
inline constexpr int kDeepestJson = 64;

/// Throws Error naming `where` when the text nests objects and arrays deeper than kDeepestJson.
void check_json_depth(std::string_view text, const std::string& where);

}  // namespace blindcorner
