// SPDX-License-Identifier: Apache-2.0
/// What the OBJ parser lets pass.
#pragma once

#include <string>

namespace blindcorner {

/// Most triangles of a mesh: light around a corner is spread over centimetres, and every triangle
/// costs in every sum.
inline constexpr std::size_t kMaxTriangles = 20'000;

/// Throws Error naming file and line where a vertex has a coordinate that is no finite number, or a
/// face an index that is no whole number or names no vertex.
void check_obj(const std::string& text, const std::string& path);

}  // namespace blindcorner
