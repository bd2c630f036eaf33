// SPDX-License-Identifier: Apache-2.0
/// Checks of OBJ files beyond those of the parser.
#pragma once

#include <string>

namespace blindcorner {

/// Most triangles of a mesh. Light around a corner is spread over centimetres. Every triangle adds
/// to every sum, and up to 7 ms to compiling.
inline constexpr std::size_t kMaxTriangles = 5000;

/// The text without comments, its words one blank apart. Throws Error naming file and line where a
/// vertex has a coordinate that is no finite number, or a face an index that is no whole number or
/// names no vertex.
std::string checked_obj(std::string text, const std::string& path);

}  // namespace blindcorner
