// SPDX-License-Identifier: Apache-2.0
/// What the OBJ parser lets pass.
#pragma once

#include <string>

namespace blindcorner {

/// Most triangles of a mesh: light around a corner is spread over centimetres, and every triangle
/// costs in every sum, up to 7 ms of compiling.
inline constexpr std::size_t kMaxTriangles = 5000;

/// The text without comments, its words one blank apart. Throws Error naming file and line where a
/// vertex has a coordinate that is no finite number, or a face an index that is no whole number or
/// names no vertex.
std::string checked_obj(std::string text, const std::string& path);

}  // namespace blindcorner
