// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/relay.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Rectangle whose normal is `normal`, wide along y or, if the normal is vertical, along x.
Surface wall(const Vector3d& center, const Vector3d& normal, double width, double height,
             double albedo = 0.7) {
  Surface surface;
  surface.shape = RectangleShape{width, height};
  Matrix3d axes;
  const Vector3d up = std::abs(normal.z()) > 0.9 ? Vector3d::UnitX() : Vector3d::UnitZ();
  axes.col(0) = normal.normalized();
  axes.col(1) = up.cross(normal).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  surface.T_world_surface.linear() = axes;
  surface.T_world_surface.translation() = center;
  surface.albedo = albedo;
  surface.relay = true;
  return surface;
}

AngularRectangle angles(double left, double right, double top, double bottom) {
  return {left * kDegree, right * kDegree, top * kDegree, bottom * kDegree};
}

/// Solid angle of tangents [0, x] x [0, y].
double corner_angle(double x, double y) { return std::atan(x * y / std::sqrt(1 + x * x + y * y)); }

double total(const std::vector<RelayPatch>& patches) {
  double sum = 0;
  for (const RelayPatch& patch : patches) sum += patch.solid_angle;
  return sum;
}

std::vector<RelayPatch> sample(const std::vector<Surface>& surfaces,
                               const FieldOfIllumination& region, const RelaySampling& sampling,
                               const Vector3d& origin = Vector3d::Zero(),
                               const Matrix3d& rotation = Matrix3d::Identity()) {
  const RayScene rays(surfaces);
  return sample_region(rays, surfaces, origin, rotation, region, sampling);
}

TEST(RelayTest, SolidAnglesHaveTheirClosedForms) {
  // Four times the corner for a symmetric field, 2 pi (1 - cos) for a cone.
  const double x = std::tan(20.5 * kDegree);
  const double y = std::tan(26 * kDegree);
  EXPECT_NEAR(solid_angle(angles(-20.5, 20.5, -26, 26)), 4 * corner_angle(x, y), 1e-12);
  EXPECT_NEAR(solid_angle(AngularCone{0.3}), 2 * kPi * (1 - std::cos(0.3)), 1e-12);
  // Half of a symmetric field to one side, and a field that lies off the axis altogether.
  EXPECT_NEAR(solid_angle(angles(0, 20.5, -26, 26)), 2 * corner_angle(x, y), 1e-12);
  EXPECT_NEAR(solid_angle(angles(10, 20.5, 0, 26)),
              corner_angle(x, y) - corner_angle(std::tan(10 * kDegree), y), 1e-12);
  // A field of nearly a half space.
  EXPECT_NEAR(solid_angle(angles(-89.999, 89.999, -89.999, 89.999)), 2 * kPi, 1e-3);
}

// Whatever the division, the patches of a wall that fills the field account for all of it.
TEST(RelayTest, PatchesOfAFullFieldAddUpToItsSolidAngle) {
  const std::vector<Surface> surfaces = {wall({0.6, 0, 0}, {-1, 0, 0}, 10, 10)};
  const std::vector<FieldOfIllumination> regions = {angles(-16.5, 16.5, -16, 16),
                                                    angles(5, 20, -12, -3), AngularCone{0.5}};
  for (const FieldOfIllumination& region : regions) {
    for (const bool gauss : {false, true}) {
      for (const int divisions : {1, 2, 7, 20}) {
        RelaySampling sampling;
        sampling.divisions = divisions;
        if (gauss) sampling.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
        EXPECT_NEAR(total(sample(surfaces, region, sampling)), solid_angle(region),
                    1e-9 * solid_angle(region))
            << divisions;
      }
    }
  }
}

// Patch by patch: on the wall, at the stated distance, facing the sensor, and of an area that its
// solid angle projects to.
TEST(RelayTest, PatchesLieOnTheSurface) {
  const Vector3d normal = Vector3d(-1, 0.4, 0.3).normalized();
  const Vector3d point(0.8, 0.1, 0.9);
  const std::vector<Surface> surfaces = {wall(point, normal, 10, 10, 0.35)};
  const Vector3d origin(0.1, -0.2, 1.0);
  const Matrix3d rotation = Eigen::AngleAxisd(0.2, Vector3d(1, 2, 3).normalized()).matrix();
  RelaySampling sampling;
  sampling.divisions = 12;
  const std::vector<FieldOfIllumination> regions = {angles(-15, 20, -12, 18), AngularCone{0.3}};
  for (const FieldOfIllumination& region : regions) {
    for (const RelayPatch& patch : sample(surfaces, region, sampling, origin, rotation)) {
      // Embree traces in single precision: 1e-7 of a metre's length, a few times.
      EXPECT_NEAR((patch.center - point).dot(normal), 0, 1e-6);
      EXPECT_NEAR((patch.center - origin).norm(), patch.distance, 1e-6);
      EXPECT_LT((patch.normal - normal).norm(), 1e-5);
      EXPECT_EQ(patch.albedo, 0.35);
      EXPECT_EQ(patch.surface, 0);
      EXPECT_TRUE(contains(region, rotation.transpose() * (patch.center - origin)));
      const double cosine = (origin - patch.center).normalized().dot(normal);
      const double area = 4 * patch.half_u.cross(patch.half_v).norm();
      // A cell spans 0.05 rad; its area differs from the flat estimate in second order, by a few
      // times 0.05^2, except a cone's wedges at the axis.
      if (std::holds_alternative<AngularCone>(region)) continue;
      EXPECT_NEAR(area * cosine / std::pow(patch.distance, 2), patch.solid_angle,
                  0.01 * patch.solid_angle);
    }
  }
}

// The wall ends inside the field: only directions that hit it count. A border cell is quartered
// four times and shared by 34 rays, so the border is known to half of a sixteenth of a sixteenth.
TEST(RelayTest, FieldThatCrossesAnEdgeKeepsThePartOnTheSurface) {
  const double edge = 0.137;  // m, to the right of the axis, at 1 m
  const std::vector<Surface> surfaces = {wall({1, 5 - edge, 0}, {-1, 0, 0}, 10, 10)};
  const double y = std::tan(20 * kDegree);
  const double exact = 2 * corner_angle(std::tan(20 * kDegree), y) + 2 * corner_angle(edge, y);
  for (const bool gauss : {false, true}) {
    for (const int divisions : {3, 10}) {
      RelaySampling sampling;
      sampling.divisions = divisions;
      if (gauss) sampling.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
      const double cell = 2 * y / divisions / 16;
      const double strip = 2 * y * cell / 2 / 16;  // sr, at most: cells over the edge are shared
      EXPECT_NEAR(total(sample(surfaces, angles(-20, 20, -20, 20), sampling)), exact, strip);
    }
  }
}

// Wall and floor meet inside the field: together they fill it, and each holds its own share.
TEST(RelayTest, FieldOverTwoSurfacesIsSharedBetweenThem) {
  const std::vector<Surface> surfaces = {wall({1, 0, 5}, {-1, 0, 0}, 20, 10, 0.7),
                                         wall({0, 0, 0}, {0, 0, 1}, 20, 20, 0.2)};
  const Vector3d origin(0, 0, 0.1);
  const AngularRectangle region = angles(-15, 15, -10, 20);
  RelaySampling sampling;
  sampling.divisions = 8;
  std::map<int, double> share;
  for (const RelayPatch& patch : sample(surfaces, region, sampling, origin)) {
    share[patch.surface] += patch.solid_angle;
    EXPECT_EQ(patch.albedo, patch.surface == 0 ? 0.7 : 0.2);
  }
  EXPECT_NEAR(share[0] + share[1], solid_angle(region), 1e-9);
  const double x = std::tan(15 * kDegree);
  const double floor = 2 * (corner_angle(x, std::tan(20 * kDegree)) - corner_angle(x, 0.1));
  const double strip =
      2 * x * (std::tan(20 * kDegree) + std::tan(10 * kDegree)) / sampling.divisions / 16 / 2 / 16;
  EXPECT_NEAR(share[1], floor, strip);
}

// A seam that runs along a cell's edge, a hundredth of the cell inside: it is not overlooked.
TEST(RelayTest, ASeamNearACellsEdgeIsSeen) {
  RelaySampling sampling;
  sampling.edge_depth = 5;
  sampling.edge_rays = 13;
  sampling.edge_inset = 1e-3;
  const double top = std::tan(-5 * kDegree), bottom = std::tan(5 * kDegree);
  const double seam = 0.01 * (bottom - top);
  const std::vector<Surface> room = {
      wall({3, 0, 0}, -Vector3d::UnitX(), 10, 10),
      wall({0, 0, -3 * (bottom - seam)}, Vector3d::UnitZ(), 10, 10, 0.3),
  };
  double on_floor = 0;
  for (const RelayPatch& patch : sample(room, angles(-5, 5, -5, 5), sampling)) {
    if (patch.surface == 1) on_floor += patch.solid_angle;
  }
  const double exact = 2 * (corner_angle(bottom, bottom) - corner_angle(bottom, bottom - seam));
  EXPECT_NEAR(on_floor, exact, 0.1 * exact);
}

// The seam between a wall and a floor, along the cells: wherever it lies in one, each surface gets
// its share, and the middle of it.
TEST(RelayTest, CellsOverASeamAreShared) {
  RelaySampling sampling;
  sampling.edge_depth = 2;
  const double top = std::tan(-5 * kDegree), bottom = std::tan(5 * kDegree);
  const double cell = (bottom - top) / 4;
  for (double t = 0.03; t < 1; t += 0.1) {
    const double seam = 0.01 + t * cell;
    const std::vector<Surface> room = {
        wall({3, 0, 0}, -Vector3d::UnitX(), 10, 10),
        wall({0, 0, -3 * seam}, Vector3d::UnitZ(), 10, 10, 0.3),
    };
    const auto patches = sample(room, angles(-5, 5, -5, 5), sampling);
    double on_wall = 0, on_floor = 0, lowest = 0, farthest = 0;
    for (const RelayPatch& patch : patches) {
      (patch.surface == 0 ? on_wall : on_floor) += patch.solid_angle;
      const Vector3d reach = patch.half_u.cwiseAbs() + patch.half_v.cwiseAbs();
      if (patch.surface == 0) lowest = std::min(lowest, patch.center.z() - reach.z());
      if (patch.surface == 1) farthest = std::max(farthest, patch.center.x() + reach.x());
    }
    const double exact = 2 * (corner_angle(bottom, -top) + corner_angle(bottom, seam));
    const double row = total(patches) / 4;
    EXPECT_NEAR(on_wall, exact, 0.02 * row) << t;
    EXPECT_NEAR(on_wall + on_floor, solid_angle(angles(-5, 5, -5, 5)), 1e-4 * row) << t;
    // Patches end at the seam, but for what one ray may miss; along the grazing floor that is more,
    // and far and near halves of a patch differ.
    EXPECT_NEAR(lowest, -3 * seam, 3 * 0.03 * cell) << t;
    EXPECT_LT(farthest, 3 * (1 + 0.06 * cell / seam)) << t;
    EXPECT_GT(farthest, 2.1) << t;
  }
}

// Four nodes integrate cubic weights exactly; against cells of angle e the rest is of fourth order.
TEST(RelayTest, GaussNodesIntegrateSmoothWeights) {
  const std::vector<Surface> surfaces = {wall({1, 0, 0}, {-1, 0, 0}, 10, 10)};
  const auto irradiance = [&](int divisions, bool gauss) {
    RelaySampling sampling;
    sampling.divisions = divisions;
    if (gauss) sampling.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
    double sum = 0;
    const Vector3d object(0.3, 0.6, 0.1);
    for (const RelayPatch& p : sample(surfaces, angles(-20, 20, -20, 20), sampling)) {
      const Vector3d way = object - p.center;
      sum += p.solid_angle * p.normal.dot(way) / std::pow(way.norm(), 3);
    }
    return sum;
  };
  const double exact = irradiance(200, false);
  // Cells of 0.18 m seen from 0.9 m: (0.2)^4 / 100 for nodes; midpoints err by (0.2)^2 / 10.
  EXPECT_NEAR(irradiance(4, true), exact, 1e-4 * exact);
  EXPECT_NEAR(irradiance(4, false), exact, 1e-2 * exact);
  EXPECT_LT(std::abs(irradiance(4, true) - exact), std::abs(irradiance(4, false) - exact));
}

TEST(RelayTest, GaussNodesOfACellShareAGroup) {
  const std::vector<Surface> surfaces = {wall({1, 0, 0}, {-1, 0, 0}, 10, 10)};
  RelaySampling sampling;
  sampling.divisions = 3;
  sampling.nodes = [](const RelayPatch&) { return std::array{2, 2}; };
  std::map<int, int> count;
  for (const RelayPatch& patch : sample(surfaces, angles(-20, 20, -20, 20), sampling)) {
    EXPECT_TRUE(patch.node);
    ++count[patch.group];
  }
  EXPECT_EQ(count.size(), 9U);
  for (const auto& [group, nodes] : count) EXPECT_EQ(nodes, 4);
}

// The split is asked until it is content and loses no light.
TEST(RelayTest, SplitHalvesUntilContent) {
  const std::vector<Surface> surfaces = {wall({1, 0, 0}, {-1, 0, 0}, 10, 10)};
  RelaySampling sampling;
  constexpr double kMax = 0.02;
  sampling.split = [](const RelayPatch& patch) {
    if (patch.half_u.norm() > kMax) return 1;
    return patch.half_v.norm() > kMax ? 2 : 0;
  };
  const AngularRectangle region = angles(-20, 20, -10, 10);
  const auto patches = sample(surfaces, region, sampling);
  EXPECT_NEAR(total(patches), solid_angle(region), 1e-9);
  std::set<int> groups;
  for (const RelayPatch& patch : patches) {
    EXPECT_LE(patch.half_u.norm(), kMax);
    EXPECT_LE(patch.half_v.norm(), kMax);
    groups.insert(patch.group);
  }
  EXPECT_EQ(groups.size(), patches.size());
}

TEST(RelayTest, NothingInViewGivesNoPatch) {
  const std::vector<Surface> surfaces = {wall({-1, 0, 0}, {1, 0, 0}, 10, 10)};
  EXPECT_TRUE(sample(surfaces, AngularCone{0.4}, {}).empty());
}

// A rectangle reflects on its normal's side only; seen from behind it is black but still there.
TEST(RelayTest, BackOfARectangleIsBlack) {
  const std::vector<Surface> surfaces = {wall({1, 0, 0}, {1, 0, 0}, 10, 10),
                                         wall({2, 0, 0}, {-1, 0, 0}, 10, 10)};
  for (const RelayPatch& patch : sample(surfaces, AngularCone{0.4}, {})) {
    EXPECT_EQ(patch.surface, 0);
    EXPECT_EQ(patch.albedo, 0.0);
  }
}

TEST(RelayTest, FieldsContainTheirOwnDirections) {
  const FieldOfIllumination region = angles(-10, 20, -5, 15);
  const auto inside = [&](double right, double down) {
    return contains(region,
                    direction_from_tangents(std::tan(right * kDegree), std::tan(down * kDegree)));
  };
  EXPECT_TRUE(inside(19.9, 14.9));
  EXPECT_TRUE(inside(-9.9, -4.9));
  EXPECT_FALSE(inside(20.1, 0));
  EXPECT_FALSE(inside(0, -5.1));
  EXPECT_FALSE(contains(region, Vector3d(-1, 0, 0)));
  EXPECT_TRUE(contains(AngularCone{0.3}, Vector3d(std::cos(0.29), std::sin(0.29), 0)));
  EXPECT_FALSE(contains(AngularCone{0.3}, 7 * Vector3d(std::cos(0.31), 0, std::sin(0.31))));
  // Right is -y and down is -z.
  EXPECT_LT(direction_from_tangents(0.2, 0).y(), 0);
  EXPECT_LT(direction_from_tangents(0, 0.2).z(), 0);
}

TEST(RelayTest, RelayPointTakesTheNearestRelaySurface) {
  std::vector<Surface> surfaces = {wall({1, 0, 0}, {-1, 0, 0}, 4, 4, 0.7),
                                   wall({0, 0, -1}, {0, 0, 1}, 4, 4, 0.2)};
  const RelayPatch on_wall = relay_point_patch(surfaces, {0.99, 0.3, 0.2}, 0.05);
  EXPECT_EQ(on_wall.surface, 0);
  EXPECT_EQ(on_wall.albedo, 0.7);
  EXPECT_EQ(on_wall.solid_angle, 1.0);
  EXPECT_LT((on_wall.normal - Vector3d(-1, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(relay_point_patch(surfaces, {0.2, 0, -1}, 0.05).surface, 1);
  EXPECT_THROW(relay_point_patch(surfaces, {0.5, 0, -0.4}, 0.05), Error);
  surfaces[0].relay = false;
  EXPECT_THROW(relay_point_patch(surfaces, {0.99, 0.3, 0.2}, 0.05), Error);
}

// The nearest surface is the nearest rectangle, not the nearest infinite plane: here the plane of a
// small shelf far to the left passes closer to the point than the wall on which it lies.
TEST(RelayTest, RelayPointIgnoresPlanesWhoseSurfaceIsElsewhere) {
  const std::vector<Surface> surfaces = {wall({1, 0, 0}, {-1, 0, 0}, 4, 4, 0.7),
                                         wall({0, 9, 0.2}, {0, 0, 1}, 0.1, 0.1, 0.2)};
  EXPECT_EQ(relay_point_patch(surfaces, {0.99, 0.3, 0.2}, 0.05).surface, 0);
}

}  // namespace
}  // namespace blindcorner
