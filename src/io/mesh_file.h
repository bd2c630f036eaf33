// SPDX-License-Identifier: Apache-2.0
/// Triangle meshes from Wavefront OBJ files.
#pragma once

#include <memory>
#include <string>

#include "blindcorner/forward/scene/shape.h"

namespace blindcorner {

/// Reads the faces of an OBJ file (polygons are cut into triangles; materials, normals and texture
/// are not used), vertices times `scale` metres. Throws Error naming the file.
std::shared_ptr<const TriangleMesh> read_obj(const std::string& path, double scale);

}  // namespace blindcorner
