// SPDX-License-Identifier: Apache-2.0
/// Rows about where things stand and what they are made of.
#include <algorithm>
#include <cmath>
#include <ctime>

#include "blindcorner/forward/constants.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kTheme = "Geometry";

Scene with_plate(const Eigen::Vector3d& position, double yaw_deg, double edge) {
  Scene scene = wall_scene();
  scene.hidden.shape = RectangleShape{edge, edge};
  scene.hidden.placement.position = position;
  scene.hidden.placement.yaw = yaw_deg * kDegree;
  const auto widen = [](Unknown& unknown, double value) {
    unknown.lower = std::min(unknown.lower, value);
    unknown.upper = std::max(unknown.upper, value);
  };
  widen(scene.unknowns[0], position.x());
  widen(scene.unknowns[1], position.y());
  return scene;
}

/// Bins of both models, and of the direct return, that are no light: negative or not finite.
StabilityMeasurement bad_bins(const Scene& scene) {
  const auto fast = make_fast_model(scene, sensor_placement(scene));
  double bad = 0;
  for (const HistogramCube& light : {fast->three_bounce(stated_pose(scene)),
                                     fast->static_background(), reference_light(scene)}) {
    bad += static_cast<double>(std::ranges::count_if(
        light.values, [](double value) { return !std::isfinite(value) || value < 0; }));
  }
  return {bad, ""};
}

StabilityRow light_row(const std::string& name, const std::string& what, const Scene& scene) {
  return {name,
          kTheme,
          what + ": bins of either model or of the direct return that are negative or no number",
          0,
          "bins",
          LimitOrigin::physics,
          "Light is finite and never negative.",
          [scene] { return bad_bins(scene); }};
}

Scene grazing_scene(double degrees) {
  Scene scene = wall_scene();
  const double turn = (180 - degrees) * kDegree;
  scene.surfaces[0].T_world_surface.linear() =
      Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return scene;
}

StabilityMeasurement outside_gate() {
  const Scene scene = with_plate({-30, 30, 0.1}, -50, 0.2);
  return {total(fast_light(scene)) + total(reference_light(scene)), ""};
}

/// Light of a plate of 1 mm against that of one of 2 mm, by area.
StabilityMeasurement small_plate() {
  const Eigen::Vector3d place(0.2, 0.5, 0.1);
  const double one = total(fast_light(with_plate(place, -50, 1e-3)));
  const double two = total(fast_light(with_plate(place, -50, 2e-3)));
  return {std::abs(4 * one / two - 1), ""};
}

/// A square of 0.2 m, n x n cells of two triangles, and as many triangles without area.
std::shared_ptr<const TriangleMesh> square(int n, bool degenerate) {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<int, 3>> triangles;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) vertices.emplace_back(0, -0.1 + 0.2 * i / n, -0.1 + 0.2 * j / n);
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j, b = a + n + 1;
      triangles.push_back({a, b, b + 1});
      triangles.push_back({a, b + 1, a + 1});
      if (degenerate) {
        triangles.push_back({a, a, b});
        triangles.push_back({a, b, a});
      }
    }
  }
  return make_mesh(vertices, triangles);
}

HistogramCube mesh_light(const std::shared_ptr<const TriangleMesh>& mesh) {
  Scene scene = wall_scene();
  scene.hidden.shape = MeshShape{mesh, false};
  return fast_light(scene);
}

/// A ball of about `count` triangles: of all bodies the one whose convexity is the most to prove.
std::shared_ptr<const TriangleMesh> ball(int count) {
  const int rings = static_cast<int>(std::sqrt(count / 4.0)), around = 2 * rings;
  std::vector<Eigen::Vector3d> vertices{{0, 0, 1}};
  for (int r = 1; r < rings; ++r) {
    const double polar = kPi * r / rings;
    for (int k = 0; k < around; ++k) {
      const double turn = 2 * kPi * k / around;
      vertices.emplace_back(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn),
                            std::cos(polar));
    }
  }
  vertices.emplace_back(0, 0, -1);
  const int south = static_cast<int>(vertices.size()) - 1;
  const auto at = [&](int ring, int k) { return 1 + (ring - 1) * around + k % around; };
  std::vector<std::array<int, 3>> triangles;
  for (int k = 0; k < around; ++k) {
    triangles.push_back({0, at(1, k), at(1, k + 1)});
    triangles.push_back({south, at(rings - 1, k + 1), at(rings - 1, k)});
    for (int r = 1; r + 1 < rings; ++r) {
      triangles.push_back({at(r, k), at(r + 1, k), at(r + 1, k + 1)});
      triangles.push_back({at(r, k), at(r + 1, k + 1), at(r, k + 1)});
    }
  }
  return make_mesh(vertices, triangles);
}

StabilityMeasurement large_mesh() {
  const std::clock_t start = std::clock();
  const auto mesh = ball(200'000);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  return {mesh->convex ? seconds : std::nan(""), mesh->convex ? "" : "not seen to be convex"};
}

}  // namespace

std::vector<StabilityRow> geometry_rows() {
  const Eigen::Vector3d usual(0.2, 0.5, 0.1);
  return {
      light_row("touches_the_relay", "Plate that touches the wall",
                with_plate({0.6, 0.05, 0}, 180, 0.2)),
      light_row("edge_on", "Plate whose edge points at the middle of the wall",
                with_plate(usual, 38.66, 0.2)),
      light_row("behind_the_sensor", "Plate 1 m behind the sensor",
                with_plate({-1, 0.2, 0.1}, 0, 0.2)),
      light_row("behind_the_relay", "Plate behind the wall", with_plate({0.9, 0.2, 0.1}, 180, 0.2)),
      light_row("plate_of_3_m", "Plate of 3 m that cuts through the wall",
                with_plate({0, 0.9, 0.1}, -50, 3)),
      light_row("relay_at_89_degrees", "Wall seen at 89 degrees from its normal",
                grazing_scene(89)),
      light_row("relay_at_89.99_degrees", "Wall seen at 89.99 degrees from its normal",
                grazing_scene(89.99)),
      {"outside_the_gate", kTheme, "Plate 42 m away, time axis of 1.9 m: all light", 0, "W/m^2",
       LimitOrigin::physics, "Its light comes after the last bin.", outside_gate},
      {"plate_of_1_mm", kTheme,
       "Plate of 1 mm against one of 2 mm: relative difference of the light by area", 1e-5, "1",
       LimitOrigin::physics,
       "Far from an object its light goes with its area, up to the square of size over distance: "
       "(2 mm / 0.64 m)^2 = 1e-5.",
       small_plate},
      {"triangles_without_area", kTheme,
       "A square mesh with and without 64 triangles of no area: relative difference of the light",
       0, "1", LimitOrigin::physics, "What has no area reflects nothing.",
       [] {
         return StabilityMeasurement{
             relative_difference(mesh_light(square(4, true)), mesh_light(square(4, false))), ""};
       }},
      {"coplanar_triangles", kTheme,
       "A square of 2 against one of 288 coplanar triangles: relative difference of the light",
       0.01, "1", LimitOrigin::physics,
       "Both are the same surface; 1 % is the fast model's tolerance.",
       [] {
         return StabilityMeasurement{
             relative_difference(mesh_light(square(1, false)), mesh_light(square(12, false))), ""};
       }},
      {"convexity_of_200000_triangles", kTheme,
       "A ball of 200,000 triangles is read and found to be convex: processor time", 10, "s",
       LimitOrigin::arithmetic,
       "Each triangle walks down a tree of vertices, about 1e8 steps together; triangles times "
       "vertices are 2e10.",
       large_mesh},
  };
}

}  // namespace blindcorner
