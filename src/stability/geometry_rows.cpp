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

const char* const kGeometryTheme = "Geometry";

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

/// Whether the object's light reaches the sensor.
enum class Seen { yes, no };

/// Number of bad bins: bins of either model or of the direct return that are negative or not
/// finite, and bins that are lit where nothing can be seen. NaN if light is due and there is none,
/// because dark bins would pass any test.
StabilityMeasurement bad_bins(const Scene& scene, Seen seen) {
  const auto model = make_fast_model(scene, sensor_placement(scene));
  const HistogramCube fast = model->three_bounce(stated_pose(scene));
  const HistogramCube reference = reference_light(scene), direct = model->static_background();
  double bad = 0;
  for (const HistogramCube* light : {&fast, &reference, &direct}) {
    bad += static_cast<double>(std::ranges::count_if(
        light->values, [](double value) { return !std::isfinite(value) || value < 0; }));
  }
  if (!(total(direct) > 0)) return {std::nan(""), "no direct return"};
  for (const HistogramCube* light : {&fast, &reference}) {
    if (seen == Seen::yes && !(total(*light) > 0)) return {std::nan(""), "no light"};
    if (seen == Seen::no) {
      bad += static_cast<double>(
          std::ranges::count_if(light->values, [](double value) { return value > 0; }));
    }
  }
  return {bad, ""};
}

StabilityRow light_row(const std::string& name, const std::string& what, const Scene& scene,
                       Seen seen = Seen::yes) {
  return {name,
          kGeometryTheme,
          what + ": bins of either model or of the direct return that are negative or no number" +
              (seen == Seen::no ? ", or lit by the plate" : "; light of the plate there must be"),
          0,
          "bins",
          LimitOrigin::physics,
          seen == Seen::no ? "Light is finite and never negative, and does not pass the wall."
                           : "Light is finite and never negative.",
          [scene, seen] { return bad_bins(scene, seen); }};
}

Scene grazing_scene(double degrees) {
  Scene scene = wall_scene();
  const double turn = (180 - degrees) * kDegree;
  scene.surfaces[0].T_world_surface.linear() =
      Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return scene;
}

/// The plate's light by a wall in whose plane the sensor almost lies, compared with a limit: the
/// relative difference, for the worse of the two models. In the limit, the half of the zone that
/// meets the wall does so at the sensor itself. All light then goes from there to the plate, back
/// to the same place, and into that half of the zone again.
StabilityMeasurement grazing_limit() {
  const Scene scene = grazing_scene(89.99);
  const double half_zone = 10 * kDegree * 2 * std::sin(5 * kDegree) / 2;  // sr
  const Placement& plate = scene.hidden.placement;
  const Eigen::Vector3d facing(std::cos(plate.yaw), std::sin(plate.yaw), 0);
  const Eigen::Vector3d along(-facing.y(), facing.x(), 0);
  constexpr int kCells = 20;  // along an edge: cells of 1 cm at a distance of half a metre
  const double cell = 0.2 / kCells;
  double sum = 0;
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      const Eigen::Vector3d q = plate.position + (cell * (i + 0.5) - 0.1) * along +
                                Eigen::Vector3d(0, 0, cell * (j + 0.5) - 0.1);
      const double square = q.squaredNorm();
      const double leg = q.y() * std::max(-facing.dot(q), 0.0) / (square * square);
      sum += leg * leg * cell * cell;
    }
  }
  const double relay = half_zone * scene.surfaces[0].albedo / kPi;
  const double want = relay * relay * scene.hidden.albedo / kPi * sum;
  const double fast = total(fast_light(scene)), reference = total(reference_light(scene));
  return {std::max(std::abs(fast / want - 1), std::abs(reference / want - 1)), ""};
}

StabilityMeasurement outside_gate() {
  const Scene scene = with_plate({-30, 30, 0.1}, -50, 0.2);
  return {total(fast_light(scene)) + total(reference_light(scene)), ""};
}

/// Relative difference of the light of a 1 mm plate from that of a 2 mm plate, by area.
StabilityMeasurement small_plate() {
  const Eigen::Vector3d place(0.2, 0.5, 0.1);
  const double one = total(fast_light(with_plate(place, -50, 1e-3)));
  const double two = total(fast_light(with_plate(place, -50, 2e-3)));
  return {std::abs(4 * one / two - 1), ""};
}

/// A square of 0.2 m in n x n cells of two triangles each. If `degenerate`, as many triangles
/// without area are added.
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

/// A ball of about `count` triangles. Of all bodies, its convexity takes the most work to prove.
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

/// Processor time for a ball squeezed to a needle: its triangles are up to a million times as long
/// as wide.
StabilityMeasurement needle_mesh() {
  const auto round = ball(5000);
  std::vector<Eigen::Vector3d> vertices = round->vertices;
  for (Eigen::Vector3d& v : vertices) v.head<2>() *= 1e-6;
  const std::clock_t start = std::clock();
  const auto mesh = make_mesh(vertices, round->triangles);
  const HistogramCube light = mesh_light(mesh);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  const auto bad = [](double value) { return !std::isfinite(value) || value < 0; };
  if (std::ranges::any_of(light.values, bad)) return {std::nan(""), "light that is none"};
  return {seconds, ""};
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
      light_row("touches_the_relay", "Plate that stands on the wall with an edge",
                with_plate({0.5, 0.15, 0}, -90, 0.2)),
      light_row("in_the_relay", "Plate within the wall's plane",
                with_plate({0.6, 0.05, 0}, 180, 0.2), Seen::no),
      light_row("edge_on", "Plate whose edge points at the middle of the wall",
                with_plate(usual, 38.66, 0.2)),
      light_row("behind_the_sensor", "Plate 0.5 m behind the sensor",
                with_plate({-0.5, 0.2, 0.1}, 0, 0.2)),
      light_row("behind_the_relay", "Plate behind the wall", with_plate({0.9, 0.2, 0.1}, 180, 0.2),
                Seen::no),
      light_row("plate_of_3_m", "Plate of 3 m that cuts through the wall",
                with_plate({0, 0.9, 0.1}, -50, 3)),
      light_row("relay_at_89_degrees", "Wall seen at 89 degrees from its normal",
                grazing_scene(89)),
      light_row("relay_at_89.99_degrees", "Wall seen at 89.99 degrees from its normal",
                grazing_scene(89.99)),
      {"relay_at_89.99_degrees_limit", kGeometryTheme,
       "The same: difference of the light in all bins from that of a wall that the zone meets at "
       "the "
       "sensor itself",
       0.1, "1", LimitOrigin::physics,
       "The sensor is 0.1 mm from the wall's plane. Of the rays that meet it, up to 5 degrees "
       "below "
       "it, one in 90 goes farther than 10 cm, and a leg from there is up to 2.2 times as bright: "
       "some 3 % for both legs; 10 % allows for three times that.",
       grazing_limit},
      {"outside_the_gate", kGeometryTheme, "Plate 42 m away, time axis of 1.9 m: all light", 0,
       "W/m^2", LimitOrigin::physics, "Its light comes after the last bin.", outside_gate},
      {"plate_of_1_mm", kGeometryTheme,
       "Plate of 1 mm against one of 2 mm: relative difference of the light by area", 1e-5, "1",
       LimitOrigin::physics,
       "Far from an object its light goes with its area, up to the square of size over distance: "
       "(2 mm / 0.64 m)^2 = 1e-5.",
       small_plate},
      {"triangles_without_area", kGeometryTheme,
       "A square mesh with and without 64 triangles of no area: relative difference of the light",
       0, "1", LimitOrigin::physics, "What has no area reflects nothing.",
       [] {
         return StabilityMeasurement{
             relative_difference(mesh_light(square(4, true)), mesh_light(square(4, false))), ""};
       }},
      {"coplanar_triangles", kGeometryTheme,
       "A square of 2 against one of 288 coplanar triangles: relative difference of the light",
       0.01, "1", LimitOrigin::physics,
       "Both are the same surface; 1 % is the fast model's tolerance.",
       [] {
         return StabilityMeasurement{
             relative_difference(mesh_light(square(1, false)), mesh_light(square(12, false))), ""};
       }},
      {"plate_of_100_km", kGeometryTheme, "Plate of 100 km: 0 for a clear refusal", 0, "1",
       LimitOrigin::arithmetic,
       "Paths to all of it take 8,000 times the sensor's time axis; tables of them would fill any "
       "memory.",
       [] {
         const Scene scene = with_plate({0.2, 0.5, 0.1}, -50, 1e5);
         const Capture capture = photon_capture(wall_scene(), 3000, 1, 1);
         return refusal([&] { fit(scene, capture, without_empty_captures()); });
       }},
      {"needle_mesh", kGeometryTheme,
       "A ball of 5000 triangles squeezed to a needle, whose triangles are up to a million times "
       "as "
       "long as wide, is read and seen: processor time, no number where its light is none",
       10, "s", LimitOrigin::arithmetic, "5000 triangles, each seen from some hundred places.",
       needle_mesh},
      {"convexity_of_200000_triangles", kGeometryTheme,
       "A ball of 200,000 triangles is read and found to be convex: processor time", 10, "s",
       LimitOrigin::arithmetic,
       "Each triangle walks down a tree of vertices, about 1e8 steps together; triangles times "
       "vertices are 2e10.",
       large_mesh},
  };
}

}  // namespace blindcorner
