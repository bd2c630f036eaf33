// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/shape.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

struct ShapeCase {
  Shape shape;
  double area;    ///< m^2, textbook formula
  double volume;  ///< m^3; 0 for an open surface
  bool closed;
  bool flat;
};

const std::vector<ShapeCase>& shape_cases() {
  static const std::vector<ShapeCase> cases = {
      {RectangleShape{0.3, 0.5}, 0.15, 0.0, false, true},
      {BoxShape{{2.0, 0.6, 1.8}}, 2 * (2.0 * 0.6 + 2.0 * 1.8 + 0.6 * 1.8), 2.0 * 0.6 * 1.8, true,
       true},
      {SphereShape{0.25}, 4 * kPi * 0.0625, 4.0 / 3.0 * kPi * 0.015625, true, false},
      {CylinderShape{0.2, 0.7}, 2 * kPi * 0.2 * 0.7 + 2 * kPi * 0.04, kPi * 0.04 * 0.7, true,
       false},
  };
  return cases;
}

Placement tilted_placement(double size = 1.0) {
  Placement placement;
  placement.position = Vector3d(0.4, -1.3, 0.8);
  placement.yaw = 0.7;
  placement.size = size;
  return placement;
}

class EveryShape : public testing::TestWithParam<std::size_t> {
 protected:
  const ShapeCase& shape_case() const { return shape_cases()[GetParam()]; }
  const Shape& shape() const { return shape_case().shape; }
  Transform world(const Placement& placement, Anchor anchor = Anchor::center) const {
    return object_to_world(shape(), anchor, placement);
  }
};

// Light sums over cells, so their areas have to add up to the surface's whatever the division.
TEST_P(EveryShape, CellAreasAddUpToTheSurface) {
  for (const double size : {1.0, 0.5, 1.7}) {
    for (const double edge : {10.0, 0.3, 0.07}) {
      for (const int least : {1, 3}) {
        double area = 0;
        for (const SurfaceCell& cell :
             divide(shape(), world(tilted_placement(size)), size, edge, least)) {
          area += cell.area;
        }
        EXPECT_NEAR(area, size * size * shape_case().area, 1e-12 * shape_case().area)
            << "size " << size << " edge " << edge;
      }
    }
  }
}

TEST_P(EveryShape, QuadratureAddsUpToTheSurfaceAndIntegratesQuadratics) {
  const Vector3d a(0.3, -1, 0.7);
  double first = 0;
  for (const double spacing : {0.05, 0.03, 0.01}) {
    double area = 0, square = 0;
    for (const SurfacePoint& p : quadrature(shape(), spacing)) {
      area += p.area;
      square += p.area * std::pow(a.dot(p.center), 2);
      EXPECT_NEAR(p.normal.norm(), 1, 1e-12);
      if (shape_case().closed) {
        EXPECT_GT(p.normal.dot(p.center), 0);
      }
    }
    EXPECT_NEAR(area, shape_case().area, 1e-12 * shape_case().area);
    if (first == 0) first = square;
    EXPECT_NEAR(square, first, 1e-11 * first) << "spacing " << spacing;
  }
}

TEST_P(EveryShape, CellsAreSmallParallelogramsWithOutwardNormals) {
  const Transform T = world(tilted_placement());
  constexpr double kEdge = 0.05;
  for (const SurfaceCell& cell : divide(shape(), T, 1.0, kEdge, 2)) {
    EXPECT_NEAR(cell.normal.norm(), 1.0, 1e-12);
    const Vector3d cross = cell.half_u.cross(cell.half_v);
    EXPECT_GT(cross.normalized().dot(cell.normal), 1 - 1e-9);
    if (shape_case().closed) {
      EXPECT_GT(cell.normal.dot(cell.center - T.translation()), 0);
    }
    if (shape_case().flat) {
      EXPECT_NEAR(4 * cross.norm(), cell.area, 1e-12);
      EXPECT_LE(2 * cell.half_u.norm(), kEdge * (1 + 1e-9));
      EXPECT_LE(2 * cell.half_v.norm(), kEdge * (1 + 1e-9));
    }
  }
}

// Divergence theorem: the flux of a constant field is zero, that of the position is three volumes.
// One cell that points inwards or has a wrong centre breaks it.
TEST_P(EveryShape, CellsOfAClosedShapeObeyTheDivergenceTheorem) {
  if (!shape_case().closed) return;
  const Transform T = world(tilted_placement());
  Vector3d flux = Vector3d::Zero();
  double volume = 0;
  for (const SurfaceCell& cell : divide(shape(), T, 1.0, 0.05, 2)) {
    flux += cell.area * cell.normal;
    volume += cell.area * cell.normal.dot(cell.center - T.translation()) / 3;
  }
  EXPECT_LT(flux.norm(), 1e-9 * shape_case().area);
  EXPECT_NEAR(volume, shape_case().volume, 1e-9);
}

// Midpoint rule: the second moment converges to the surface's with the square of the cell's edge.
TEST_P(EveryShape, SecondMomentsConvergeQuadratically) {
  const auto moment = [&](double edge) {
    double sum = 0;
    for (const SurfaceCell& cell : divide(shape(), Transform::Identity(), 1.0, edge, 1)) {
      sum += cell.area * (std::pow(cell.center.y(), 2) + 2 * std::pow(cell.center.z(), 2));
    }
    return sum;
  };
  const double coarse = moment(0.1);
  const double middle = moment(0.05);
  const double fine = moment(0.0125);
  // Four times fewer cells along an edge cannot leave more than about a quarter of the error (the
  // cells' number is rounded up, hence the slack of a half).
  EXPECT_LT(std::abs(middle - fine), 0.5 * std::abs(coarse - fine) + 1e-12);
  if (const auto* sphere = std::get_if<SphereShape>(&shape())) {
    // Integral of z^2 over a sphere is 4 pi r^4 / 3, as is that of y^2. Relative error (edge /
    // r)^2.
    const double exact = 3 * 4 * kPi / 3 * std::pow(sphere->radius, 4);
    EXPECT_NEAR(fine, exact, std::pow(0.0125 / sphere->radius, 2) * exact);
  }
}

// The model is differentiated by finite differences: cells may move, but none may come or go.
TEST_P(EveryShape, CellsFollowThePlacementRigidly) {
  const auto home = divide(shape(), Transform::Identity(), 1.0, 0.11, 2);
  const double size = 1.3;
  const Transform T = world(tilted_placement(size));
  const auto moved = divide(shape(), T, size, 0.11, 2);
  ASSERT_EQ(home.size(), moved.size());
  for (std::size_t i = 0; i < home.size(); ++i) {
    EXPECT_LT((moved[i].center - T * Vector3d(size * home[i].center)).norm(), 1e-12);
    EXPECT_LT((moved[i].normal - T.linear() * home[i].normal).norm(), 1e-12);
    EXPECT_LT((moved[i].half_u - size * (T.linear() * home[i].half_u)).norm(), 1e-12);
    EXPECT_NEAR(moved[i].area, size * size * home[i].area, 1e-12);
  }
}

TEST_P(EveryShape, AnchorsNameTheCentroidOrTheFootprint) {
  for (const double size : {1.0, 1.6}) {
    const Placement placement = tilted_placement(size);
    for (const Anchor anchor : {Anchor::center, Anchor::base}) {
      const Transform T = object_to_world(shape(), anchor, placement);
      Vector3d centroid = Vector3d::Zero();
      double area = 0;
      for (const SurfaceCell& cell : divide(shape(), T, size, 0.05)) {
        centroid += cell.area * cell.center;
        area += cell.area;
      }
      centroid /= area;
      double lowest = 1e300;
      for (const Triangle& triangle : triangulate(shape(), T, size)) {
        for (const Vector3d& point : triangle) lowest = std::min(lowest, point.z());
      }
      EXPECT_LT((centroid - placement.position).head<2>().norm(), 1e-9);
      const double named = anchor == Anchor::center ? centroid.z() : lowest;
      EXPECT_NEAR(named, placement.position.z(), 1e-9) << shape_name(shape()) << size;
    }
  }
}

TEST_P(EveryShape, BoundingRadiusReachesTheFarthestPointOnly) {
  for (const Anchor anchor : {Anchor::center, Anchor::base}) {
    const Placement placement = tilted_placement();
    double farthest = 0;
    for (const Triangle& triangle :
         triangulate(shape(), object_to_world(shape(), anchor, placement), 1.0, 200)) {
      for (const Vector3d& point : triangle) {
        farthest = std::max(farthest, (point - placement.position).norm());
      }
    }
    EXPECT_NEAR(bounding_radius(shape(), anchor), farthest, 1e-9) << shape_name(shape());
  }
}

TEST_P(EveryShape, HalfExtentsHoldTheTurnedShapeTightly) {
  EXPECT_EQ(is_closed(shape()), shape_case().closed);
  const Vector3d any = half_extents(shape(), std::nullopt);
  for (const double yaw : {0.0, 0.4, 1.9, -2.6}) {
    Placement placement;
    placement.yaw = yaw;
    Vector3d reach = Vector3d::Zero();
    for (const Triangle& triangle : triangulate(shape(), world(placement), 1.0, 400)) {
      for (const Vector3d& point : triangle) reach = reach.cwiseMax(point.cwiseAbs());
    }
    // A polygon of 400 sides stays short of a circle by at most (pi / 400)^2 / 2 = 3e-5 of it.
    const double slack = shape_case().flat ? 1e-12 : 3e-5;
    EXPECT_LT((half_extents(shape(), yaw) - reach).cwiseAbs().maxCoeff(), slack);
    EXPECT_LE((reach - any).maxCoeff(), 1e-12) << "at any yaw";
  }
}

/// Edges of the triangles, rounded to a micrometre, with how often they run in each direction.
using Key = std::tuple<long, long, long>;
Key key_of(const Vector3d& p) {
  return {std::lround(p.x() * 1e6), std::lround(p.y() * 1e6), std::lround(p.z() * 1e6)};
}

// Occlusion is traced against these triangles: they have to be watertight and wound outwards.
TEST_P(EveryShape, TriangulationIsWatertightAndOutward) {
  const Transform T = world(tilted_placement(1.2));
  std::map<std::pair<Key, Key>, int> edges;
  double volume = 0;
  double area = 0;
  for (const auto& [a, b, c] : triangulate(shape(), T, 1.2)) {
    const Vector3d twice = (b - a).cross(c - a);
    if (twice.norm() < 1e-12) continue;  // at a sphere's poles
    area += twice.norm() / 2;
    volume += (a - T.translation()).dot(twice) / 6;
    if (shape_case().closed) {
      EXPECT_GT(twice.dot(a - T.translation()), 0);
    }
    ++edges[{key_of(a), key_of(b)}];
    ++edges[{key_of(b), key_of(c)}];
    ++edges[{key_of(c), key_of(a)}];
  }
  // An inscribed polygon of 48 sides has 1 - (2 pi / 48)^2 / 6 = 0.997 of the circle's area, a
  // sphere loses that twice.
  const double slack = shape_case().flat ? 1e-9 : 0.008;
  EXPECT_NEAR(area, 1.44 * shape_case().area, slack * area);
  EXPECT_NEAR(volume, std::pow(1.2, 3) * shape_case().volume, slack * volume + 1e-12);
  if (!shape_case().closed) return;
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ((edges.count({edge.second, edge.first})), 1U);
  }
}

// A turn by the period leaves every corner on some corner, half of it does not.
TEST_P(EveryShape, YawPeriodIsTheSmallestTurnThatLooksTheSame) {
  const auto looks_the_same = [&](const Shape& s, double turn) {
    Placement placement = tilted_placement();
    const auto points = [&] {
      std::map<Key, int> set;
      for (const SurfaceCell& cell :
           divide(s, object_to_world(s, Anchor::center, placement), 1.0, 10.0)) {
        ++set[key_of(cell.center + 0.01 * cell.normal)];
      }
      return set;
    };
    const auto before = points();
    placement.yaw += turn;
    return points() == before;
  };
  const double period = yaw_period(shape());
  if (period == 0) {
    EXPECT_FALSE(shape_case().flat);
    return;
  }
  EXPECT_TRUE(looks_the_same(shape(), period));
  EXPECT_FALSE(looks_the_same(shape(), period / 2));
  const Shape square = BoxShape{{0.4, 0.4, 1.0}};
  EXPECT_TRUE(looks_the_same(square, yaw_period(square)));
  EXPECT_FALSE(looks_the_same(square, yaw_period(square) / 2));
}

INSTANTIATE_TEST_SUITE_P(Shape, EveryShape, testing::Range(std::size_t{0}, shape_cases().size()),
                         [](const auto& tested) {
                           return shape_name(shape_cases()[tested.param].shape);
                         });

// A function with a pole one half edge in front of the plate: the error falls by a constant factor
// with each point, where midpoints would gain a factor of four for twice as many.
TEST(ShapeTest, QuadratureOfARectangleConvergesExponentially) {
  const auto light = [](int points) {
    double sum = 0;
    for (const SurfacePoint& p : quadrature(RectangleShape{2, 2}, 2.0 / points)) {
      sum += p.area / (p.center - Vector3d(1, 0, 0)).squaredNorm();
    }
    return sum;
  };
  const double exact = light(40);
  double before = std::abs(light(2) / exact - 1);
  for (const int points : {4, 6, 8, 10, 12}) {
    const double error = std::abs(light(points) / exact - 1);
    EXPECT_LT(error, 0.2 * before) << points;
    before = error;
  }
  EXPECT_LT(before, 1e-6);
}

// Yaw 0 points the rectangle's normal and the box's first edge along +x, counter-clockwise.
TEST(ShapeTest, YawTurnsCounterClockwiseFromX) {
  Placement placement;
  const auto normal = [&] {
    const Shape shape = RectangleShape{0.2, 0.2};
    return divide(shape, object_to_world(shape, Anchor::center, placement), 1.0, 1.0)[0].normal;
  };
  EXPECT_LT((normal() - Vector3d::UnitX()).norm(), 1e-12);
  placement.yaw = kPi / 2;
  EXPECT_LT((normal() - Vector3d::UnitY()).norm(), 1e-12);

  placement.yaw = 0;
  const Shape box = BoxShape{{2.0, 0.6, 1.8}};
  double reach = 0;
  for (const Triangle& triangle :
       triangulate(box, object_to_world(box, Anchor::center, placement), 1.0)) {
    for (const Vector3d& point : triangle) reach = std::max(reach, point.x());
  }
  EXPECT_NEAR(reach, 1.0, 1e-12);
}

TEST(ShapeTest, FlatFacesAreWoundOutwardsAndOnlyOfFlatShapes) {
  const Transform T = object_to_world(BoxShape{}, Anchor::center, tilted_placement());
  const auto faces = flat_faces(BoxShape{{0.3, 0.4, 0.5}}, T, 1.0);
  EXPECT_EQ(faces.size(), 6U);
  for (const auto& face : faces) {
    const Vector3d normal = (face[1] - face[0]).cross(face[3] - face[0]);
    EXPECT_GT(normal.dot(face[0] - T.translation()), 0);
    EXPECT_LT((face[0] + face[2] - face[1] - face[3]).norm(), 1e-12) << "not a parallelogram";
  }
  const auto rectangle = flat_faces(RectangleShape{0.3, 0.4}, Transform::Identity(), 1.0);
  ASSERT_EQ(rectangle.size(), 1U);
  EXPECT_GT((rectangle[0][1] - rectangle[0][0]).cross(rectangle[0][3] - rectangle[0][0]).x(), 0);
  EXPECT_THROW(flat_faces(SphereShape{}, T, 1.0), Error);
  EXPECT_THROW(flat_faces(CylinderShape{}, T, 1.0), Error);
}

TEST(ShapeTest, StandingShapesAreAnchoredAtTheBase) {
  EXPECT_EQ(default_anchor(BoxShape{}), Anchor::base);
  EXPECT_EQ(default_anchor(CylinderShape{}), Anchor::base);
  EXPECT_EQ(default_anchor(RectangleShape{}), Anchor::center);
  EXPECT_EQ(default_anchor(SphereShape{}), Anchor::center);
}

TEST(PoseTest, UnknownsReplaceTheirComponentsAndNothingElse) {
  const std::vector<Unknown> unknowns = {{Component::yaw, -1.0, 1.0, std::nullopt},
                                         {Component::x, 0.0, 2.0, std::nullopt},
                                         {Component::size, 0.5, 2.0, std::nullopt}};
  const Placement known = tilted_placement();
  const PoseVector pose = (PoseVector(3) << 0.1, 1.5, 0.9).finished();
  const Placement placed = place(known, unknowns, pose);
  EXPECT_EQ(placed.yaw, 0.1);
  EXPECT_EQ(placed.position, Vector3d(1.5, known.position.y(), known.position.z()));
  EXPECT_EQ(placed.size, 0.9);
  EXPECT_EQ(pose_of(placed, unknowns), pose);
  EXPECT_EQ(component_name(Component::yaw), "yaw_rad");
  EXPECT_EQ(component_name(Component::z), "z_m");
}

}  // namespace
}  // namespace blindcorner
