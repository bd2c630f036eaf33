// SPDX-License-Identifier: Apache-2.0
// What stands where: known surfaces, hidden objects at a pose, the grid cells that they may occupy.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "arrays.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/forward/scene/shape.h"
#include "blindcorner/planner/grid/pose_spread.h"
#include "interrupt.h"
#include "module.h"

namespace blindcorner::python {
namespace {

/// [corners, 2] m.
Array<2> corners_of(const Footprint& footprint) {
  std::vector<double> values;
  for (const Eigen::Vector2d& corner : footprint) {
    values.insert(values.end(), corner.data(), corner.data() + 2);
  }
  return array_of<2>(std::move(values), {footprint.size(), 2});
}

/// [triangles, 3, 3] corners, m.
Array<3> triangles_of(const std::vector<Triangle>& triangles) {
  std::vector<double> values;
  for (const Triangle& triangle : triangles) {
    for (const Eigen::Vector3d& corner : triangle) {
      values.insert(values.end(), corner.data(), corner.data() + 3);
    }
  }
  return array_of<3>(std::move(values), {triangles.size(), 3, 3});
}

/// (name, relay, footprint, triangles) of each known surface.
nb::list surfaces(const SceneData& data) {
  nb::list list;
  for (const Surface& surface : data.scene.surfaces) {
    list.append(nb::make_tuple(
        surface.name, surface.relay, corners_of(footprint(surface.shape, surface.T_world_surface)),
        triangles_of(triangulate(surface.shape, surface.T_world_surface, 1))));
  }
  return list;
}

/// (name, x, y, z, yaw, size, footprint, triangles) of each hidden object at a pose.
nb::list objects_at(const SceneData& data, const PoseVector& pose) {
  const auto& scene = data.scene;
  if (pose.size() != static_cast<Eigen::Index>(scene.unknowns.size())) {
    throw Error("pose", "found " + std::to_string(pose.size()) +
                            " numbers, accepted: " + std::to_string(scene.unknowns.size()));
  }
  const std::vector<Placement> placements = placements_at(scene, pose);
  nb::list list;
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    const Placement& at = placements[static_cast<std::size_t>(i)];
    const Transform T_world_object = object_to_world(object.shape, object.anchor, at);
    const bool placed = at.position.allFinite() && std::isfinite(at.yaw) && std::isfinite(at.size);
    list.append(nb::make_tuple(
        object.name, at.position.x(), at.position.y(), at.position.z(), at.yaw, at.size,
        corners_of(placed ? footprint(object.shape, object.anchor, at) : Footprint{}),
        triangles_of(placed ? triangulate(object.shape, T_world_object, at.size)
                            : std::vector<Triangle>{})));
  }
  return list;
}

/// [zones, 3] unit vectors to the middle of what each zone looks at, sensor frame; NaN where that
/// is not known.
Array<2> zone_axes(const SceneData& data) {
  std::vector<double> values;
  for (const Zone& zone : data.scene.sensor.zones) {
    Eigen::Vector3d axis;
    if (const auto* angles = std::get_if<AngularRectangle>(&zone.footprint)) {
      const auto middle = [](double a, double b) { return (std::tan(a) + std::tan(b)) / 2; };
      axis = {1, -middle(angles->left, angles->right), -middle(angles->top, angles->bottom)};
    } else {
      axis = data.scene.T_world_sensor.inverse() * std::get<Eigen::Vector3d>(zone.footprint);
    }
    axis.normalize();
    values.insert(values.end(), axis.data(), axis.data() + 3);
  }
  return array_of<2>(std::move(values), {data.scene.sensor.zones.size(), 3});
}

PoseMixture mixture_of(double presence, const Input<1>& weights, const Input<2>& poses,
                       const Input<3>& covariances) {
  PoseMixture mixture;
  mixture.presence_probability = presence;
  const std::size_t modes = weights.shape(0), n = poses.shape(1);
  if (poses.shape(0) != modes || covariances.shape(0) != modes || covariances.shape(1) != n ||
      covariances.shape(2) != n) {
    throw Error("modes",
                "accepted: weights [modes], poses [modes, unknowns], covariances "
                "[modes, unknowns, unknowns]");
  }
  const auto size = static_cast<Eigen::Index>(n);
  for (std::size_t k = 0; k < modes; ++k) {
    PoseMode mode;
    mode.weight = weights(k);
    mode.pose = Eigen::Map<const Eigen::VectorXd>(poses.data() + k * n, size);
    mode.covariance = Eigen::Map<const Eigen::MatrixXd>(covariances.data() + k * n * n, size, size);
    mixture.modes.push_back(std::move(mode));
  }
  return mixture;
}

/// A grid over the ground, and what hidden objects may occupy of it.
struct HiddenGrid {
  GridGeometry geometry;
  PoseSpread spread;
};

std::shared_ptr<HiddenGrid> make_grid(const ScenePointer& scene, int rows, int columns,
                                      double cell_size, const Eigen::Vector2d& origin) {
  GridGeometry geometry;
  geometry.rows = rows;
  geometry.columns = columns;
  geometry.cell_size = cell_size;
  geometry.origin = origin;
  geometry.validate();
  return std::make_shared<HiddenGrid>(HiddenGrid{geometry, PoseSpread(scene->scene, geometry)});
}

Array<2> occupied(const std::shared_ptr<HiddenGrid>& grid, double presence, const Input<1>& weights,
                  const Input<2>& poses, const Input<3>& covariances) {
  PoseMixture mixture = mixture_of(presence, weights, poses, covariances);
  std::vector<double> cells = interruptible(
      [grid, mixture = std::move(mixture)] { return grid->spread.occupied(mixture); }, [] {});
  return array_of<2>(std::move(cells), {static_cast<std::size_t>(grid->geometry.rows),
                                        static_cast<std::size_t>(grid->geometry.columns)});
}

}  // namespace

void add_places(nb::module_& m) {
  m.def("surfaces", &surfaces, nb::arg("scene"),
        "(name, whether it is a relay, footprint [corners, 2], triangles [n, 3, 3]) of each known "
        "surface, m.");
  m.def("objects_at", &objects_at, nb::arg("scene"), nb::arg("pose"),
        "(name, x, y, z (m), yaw (rad), size, footprint [corners, 2], triangles [n, 3, 3], m) of "
        "each hidden object at a pose [unknowns]; without corners where the pose is not a number.");
  m.def("zone_axes", &zone_axes, nb::arg("scene"),
        "[zones, 3] unit vectors to the middle of what each zone looks at, sensor frame.");
  nb::class_<HiddenGrid>(m, "HiddenGrid", "Cells that hidden objects may occupy.")
      .def_static("make", &make_grid, nb::arg("scene"), nb::arg("rows"), nb::arg("columns"),
                  nb::arg("cell_size"), nb::arg("origin"))
      .def("occupied", &occupied, nb::arg("presence"), nb::arg("weights"), nb::arg("poses"),
           nb::arg("covariances"), "[rows, columns] probabilities; row 0 has the lowest y.");
}

}  // namespace blindcorner::python
