// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_file.h"

#include <vector>

#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"
#include "io/obj_check.h"

namespace blindcorner {

std::shared_ptr<const TriangleMesh> read_obj(const std::string& path, double scale) {
  tinyobj::ObjReaderConfig config;
  config.triangulate = true;
  tinyobj::ObjReader reader;
  if (!reader.ParseFromString(checked_obj(read_bytes(path), path), "", config)) {
    std::string what = reader.Error();
    what = what.substr(0, what.find('\n'));
    throw Error(path, "found no Wavefront OBJ (" + what + "), accepted: an OBJ file with faces");
  }
  const std::vector<double>& numbers = reader.GetAttrib().vertices;
  std::vector<Eigen::Vector3d> vertices;
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
    vertices.emplace_back(scale * numbers[i], scale * numbers[i + 1], scale * numbers[i + 2]);
  }
  std::vector<std::array<int, 3>> triangles;
  for (const tinyobj::shape_t& shape : reader.GetShapes()) {
    const auto& indices = shape.mesh.indices;
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
      triangles.push_back(
          {indices[i].vertex_index, indices[i + 1].vertex_index, indices[i + 2].vertex_index});
    }
  }
  try {
    return make_mesh(std::move(vertices), std::move(triangles));
  } catch (const Error& error) {
    throw Error(path, error.what());
  }
}

}  // namespace blindcorner
