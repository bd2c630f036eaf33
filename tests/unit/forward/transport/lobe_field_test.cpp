// SPDX-License-Identifier: Apache-2.0
/// What a narrow lobe gathers, against closed forms and integrals written out.
#include "forward/transport/lobe_field.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing_scenes::at;
using testing_scenes::axes_along;
using testing_scenes::field_of;
using testing_scenes::rectangle;

constexpr double kSigma = 0.017;

double below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

/// A source so far away that its light is even; the object stands at the origin and looks along +x
/// at a plate 2 m ahead.
Scene evenly_lit() {
  Scene scene;
  scene.sensor.field = field_of(10, 10);
  scene.sensor.radiant_intensity = 1e10;
  scene.T_world_sensor = at({-1e5, 0, 0});
  scene.surfaces = {rectangle({2, 0, 0}, {-1, 0, 0}, 4, 4, 0.7)};
  scene.hidden.material = RetroreflectiveMaterial{kSigma};
  return scene;
}
/// Radiance of that plate.
double even_radiance(double albedo = 0.7) { return albedo / kPi; }

LobeField field_of_scene(const Scene& scene) { return {scene, {scene.T_world_sensor, {}}}; }

struct Gathered {
  double weight = 0, first = 0, second = 0;
  double mean() const { return first / weight; }
  double variance() const { return second / weight - mean() * mean(); }
};

/// A patch at `way` from the object whose outer leg is `leg` long, with gradient `leg_gradient`.
struct LitPatch {
  Vector3d way;
  double leg = 0;
  Vector3d leg_gradient = Vector3d::Zero();
  Vector3d u = Vector3d::Zero(), v = Vector3d::Zero();
};

std::vector<Gathered> gather(const LobeField::View& view, const std::vector<LitPatch>& patches,
                             const Vector3d& object_normal, int zone = 0) {
  std::vector<std::vector<double>> lanes(15);
  for (const LitPatch& p : patches) {
    const double r = p.way.norm();
    const Vector3d d = p.way / r;
    const double whole = p.u.norm() > 0 ? 1.0 / 3 : 0.0;
    const double values[] = {d.x(),
                             d.y(),
                             d.z(),
                             r,
                             p.leg + r,
                             whole,
                             p.leg_gradient.x(),
                             p.leg_gradient.y(),
                             p.leg_gradient.z(),
                             p.u.x(),
                             p.u.y(),
                             p.u.z(),
                             p.v.x(),
                             p.v.y(),
                             p.v.z()};
    for (std::size_t k = 0; k < lanes.size(); ++k) lanes[k].push_back(values[k]);
  }
  const auto lane = [&](std::size_t k) { return lanes[k].data(); };
  const LobeRays rays{lane(0),  lane(1),  lane(2),  lane(3),      lane(4),  lane(5),
                      lane(6),  lane(7),  lane(8),  lane(9),      lane(10), lane(11),
                      lane(12), lane(13), lane(14), object_normal};
  std::vector<double> weight(patches.size()), first(patches.size()), second(patches.size());
  view.gather(rays, patches.size(), zone, {weight.data(), first.data(), second.data()});
  std::vector<Gathered> result;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    result.push_back({weight[i], first[i], second[i]});
  }
  return result;
}

/// About one direction; paths are those of the light on its way in alone.
Gathered about(const LobeField::View& view, const Vector3d& direction, int zone = 0) {
  LitPatch patch;
  patch.way = direction.normalized();
  patch.leg = -1;
  return gather(view, {patch}, direction.normalized(), zone).front();
}

/// Turned by angles in units of the lobe's width, leftwards (+y) and up.
Vector3d turned(double left, double up) {
  return Vector3d(1, std::tan(left * kSigma), std::tan(up * kSigma)).normalized();
}

TEST(LobeField, FarFromEdgesItIsTheRadiance) {
  const LobeField field = field_of_scene(evenly_lit());
  const auto view = field.seen_from(Vector3d::Zero(), {});
  for (const double left : {0.0, 3.0, 11.0}) {
    EXPECT_NEAR(about(view, turned(left, 2)).weight / even_radiance(), 1, 1e-4) << left;
  }
}

// The tangent of the angle to an edge counts, in units of the lobe's width.
TEST(LobeField, HalfPlaneLeavesTheNormalDistributionFunction) {
  Scene scene = evenly_lit();
  scene.surfaces = {rectangle({2, 2, 0}, {-1, 0, 0}, 4, 4, 0.7)};  // lit where y > 0
  const LobeField field = field_of_scene(scene);
  const auto view = field.seen_from(Vector3d::Zero(), {});
  for (const double x : {-3.0, -1.5, -0.4, 0.0, 0.3, 1.0, 2.7, 5.5}) {
    const double want = below(std::tan(x * kSigma) / kSigma);
    EXPECT_NEAR(about(view, turned(x, 0)).weight / even_radiance(), want, 1e-6 + 1e-4 * want) << x;
  }
}

TEST(LobeField, StripLeavesTheDifferenceOfTwo) {
  Scene scene = evenly_lit();
  scene.surfaces = {rectangle({2, 0, 0}, {-1, 0, 0}, 0.06, 4, 0.7)};  // as wide as 1.8 lobes
  const LobeField field = field_of_scene(scene);
  const auto view = field.seen_from(Vector3d::Zero(), {});
  const double edge = std::atan(0.015) / kSigma;
  for (const double x : {-2.0, -0.9, 0.0, 0.5, 1.7}) {
    const double want = below(std::tan((edge - x) * kSigma) / kSigma) -
                        below(std::tan((-edge - x) * kSigma) / kSigma);
    EXPECT_NEAR(about(view, turned(x, 0)).weight / even_radiance(), want, 1e-6 + 1e-4 * want) << x;
  }
}

TEST(LobeField, RightCornerLeavesTheProduct) {
  Scene scene = evenly_lit();
  scene.surfaces = {rectangle({2, 2, 2}, {-1, 0, 0}, 4, 4, 0.7)};
  const LobeField field = field_of_scene(scene);
  const auto view = field.seen_from(Vector3d::Zero(), {});
  for (const double x : {-1.2, 0.0, 0.8}) {
    for (const double y : {-0.7, 0.0, 1.9}) {
      EXPECT_NEAR(about(view, turned(x, y)).weight / even_radiance(), below(x) * below(y), 2e-3);
    }
  }
}

// Edges that meet at 60 or 120 degrees: Mehler's series to the second power of their correlation.
TEST(LobeField, ObliqueCornerIsWithinThreePercentOfTheLobe) {
  Scene scene = evenly_lit();
  // The shadow of an oblique plate leaves a wedge of the half plane y > 0.
  scene.surfaces = {rectangle({2, 2, 0}, {-1, 0, 0}, 4, 4, 0.7)};
  const LobeField field = field_of_scene(scene);
  for (const double angle : {60 * kDegree, 120 * kDegree}) {
    const Vector3d along(0, std::cos(angle), std::sin(angle));
    const Vector3d aside(0, -std::sin(angle), std::cos(angle));
    const Vector3d ahead(1, 0, 0);
    const OccluderFace plate{{ahead - 4 * along, ahead + 4 * along, ahead + 4 * along + 4 * aside,
                              ahead - 4 * along + 4 * aside},
                             false};
    const auto view = field.seen_from(Vector3d::Zero(), {plate});
    for (const Vector2d& x : {Vector2d(0, 0), Vector2d(0.5, 0.6), Vector2d(0.4, -0.5)}) {
      double want = 0;  // the wedge by sums over the lobe
      constexpr double kStep = 0.02;
      for (double a = -6 + kStep / 2; a < 6; a += kStep) {
        for (double b = -6 + kStep / 2; b < 6; b += kStep) {
          const Vector2d z = x + Vector2d(a, b);
          const bool visible = z.x() * aside.y() + z.y() * aside.z() < 0;
          if (z.x() > 0 && visible) {
            want += kStep * kStep * std::exp(-0.5 * (a * a + b * b)) / (2 * kPi);
          }
        }
      }
      EXPECT_NEAR(about(view, turned(x.x(), x.y())).weight / even_radiance(), want, 0.03)
          << angle << " " << x.transpose();
    }
  }
}

TEST(LobeField, OccluderHidesItsShare) {
  const LobeField field = field_of_scene(evenly_lit());
  // Half way to the relay, y > 0.
  const OccluderFace face{
      {Vector3d(1, 0, -2), Vector3d(1, 4, -2), Vector3d(1, 4, 2), Vector3d(1, 0, 2)}, false};
  const auto view = field.seen_from(Vector3d::Zero(), {face});
  for (const double x : {-2.5, -0.6, 0.0, 0.9, 2.2}) {
    EXPECT_NEAR(about(view, turned(x, 0)).weight / even_radiance(), below(-x), 1e-3) << x;
  }
  // Behind the relay it hides nothing.
  OccluderFace behind = face;
  for (Vector3d& corner : behind.corners) corner.x() = 3;
  EXPECT_NEAR(about(field.seen_from(Vector3d::Zero(), {behind}), turned(1, 0)).weight,
              even_radiance(), 1e-4);
}

// Through the edge between two faces of one body comes no light.
TEST(LobeField, FacesOfOneBodyHideTogether) {
  const LobeField field = field_of_scene(evenly_lit());
  Surface box;
  box.shape = BoxShape{{0.4, 0.4, 3}};
  box.T_world_surface = at({1, 0, 0}, Eigen::AngleAxisd(kPi / 4, Vector3d::UnitZ()).matrix());
  box.occluder = true;
  const auto view = field.seen_from(Vector3d::Zero(), occluder_faces({box}));
  for (const double x : {0.0, 0.5, 3.0}) {
    EXPECT_NEAR(about(view, turned(x, 0)).weight / even_radiance(), 0, 1e-3) << x;
  }
}

// What stands between source and relay throws a shadow.
TEST(LobeField, ShadowsOfTheSourceAreDark) {
  Scene scene = evenly_lit();
  Surface plate = rectangle({-3, 2, 0}, {-1, 0, 0}, 4, 4, 0.1, false);  // behind the object, y > 0
  scene.surfaces.push_back(plate);
  const auto view = field_of_scene(scene).seen_from(Vector3d::Zero(), {});
  for (const double x : {-2.0, 0.0, 0.7, 3.0}) {
    EXPECT_NEAR(about(view, turned(x, 0)).weight / even_radiance(), below(-x), 1e-3) << x;
  }
}

TEST(LobeField, ConfocalZonesLightTheirOwnSpot) {
  Scene scene = evenly_lit();
  scene.sensor.illumination = Illumination::confocal;
  scene.sensor.columns = 2;
  scene.sensor.zones.assign(2, Zone{});
  const double reach = 1e-5;  // 1 m wide at the relay
  scene.sensor.zones[0].footprint = AngularRectangle{-reach, 0, -reach, reach};  // leftwards: y > 0
  scene.sensor.zones[1].footprint = AngularRectangle{0, reach, -reach, reach};
  const auto view = field_of_scene(scene).seen_from(Vector3d::Zero(), {});
  for (const double x : {-8.0, -0.5, 0.0, 1.5, 8.0}) {
    EXPECT_NEAR(about(view, turned(x, 0), 0).weight / even_radiance(), below(x), 1e-3) << x;
    EXPECT_NEAR(about(view, turned(x, 0), 1).weight / even_radiance(), below(-x), 1e-3) << x;
  }
}

TEST(LobeField, ConeEndsAtItsRim) {
  Scene scene = evenly_lit();
  scene.sensor.field = AngularCone{0.5 / 1e5};  // rim 0.5 m from the axis: straight for the lobe
  const auto view = field_of_scene(scene).seen_from(Vector3d::Zero(), {});
  const double edge = std::atan(0.25) / kSigma;
  for (const double x : {-1.0, 0.0, 1.0, 2.0}) {
    // The lobe's footprint across a rim of 15 times its radius: up to 2 % of the share.
    EXPECT_NEAR(about(view, turned(edge - x, 0)).weight / even_radiance(), below(x), 0.02) << x;
  }
  EXPECT_NEAR(about(view, turned(0.3, 0.2)).weight / even_radiance(), 1, 1e-4);
}

/// A near source over a tilted floor whose border crosses the lobe.
struct TiltedFloor {
  Scene scene = evenly_lit();
  Vector3d object{0.9, 0.1, 0.4};
  Vector3d source{0, 0, 0.3};
  double border = 0.0;  ///< floor is lit where y > border
  static constexpr double kAlbedo = 0.5;

  TiltedFloor(double at_border) : border(at_border) {
    scene.T_world_sensor = at(source, axes_along({1, 0, -0.5}));
    scene.sensor.radiant_intensity = 1;
    scene.sensor.field = field_of(140, 100);
    scene.surfaces = {rectangle({0, border + 2, 0}, {0, 0, 1}, 4, 4, kAlbedo)};
  }
  double radiance(const Vector3d& p) const {
    const Vector3d from = p - source;
    return kAlbedo / kPi * source.z() / std::pow(from.norm(), 3);
  }
  /// The lobe about a direction, summed over a grid of angles.
  Gathered integral(const Vector3d& direction) const {
    const Vector3d e1 = direction.unitOrthogonal();
    const Vector3d e2 = direction.cross(e1);
    Gathered sum;
    constexpr double kStep = 0.02;
    for (double a = -6 + kStep / 2; a < 6; a += kStep) {
      for (double b = -6 + kStep / 2; b < 6; b += kStep) {
        const Vector3d ray = direction + kSigma * (a * e1 + b * e2);
        const Vector3d p = object - object.z() / ray.z() * ray;
        if (ray.z() >= 0 || p.y() < border) continue;
        const double weight =
            kStep * kStep * std::exp(-0.5 * (a * a + b * b)) / (2 * kPi) * radiance(p);
        const double path = (p - source).norm() + (p - object).norm();
        sum.weight += weight;
        sum.first += weight * path;
        sum.second += weight * path * path;
      }
    }
    return sum;
  }
};

TEST(LobeField, MomentsOnATiltedRelayAreTheIntegrals) {
  for (const double border : {-1.0, -0.02, 0.0, 0.015}) {  // outside of the lobe, and within
    const TiltedFloor floor(border);
    const LobeField field = field_of_scene(floor.scene);
    const auto view = field.seen_from(floor.object, {});
    for (const double x : {0.35, 0.6, 0.85}) {
      const Vector3d direction = (Vector3d(x, 0, 0) - floor.object).normalized();
      const Gathered got = about(view, direction);
      const Gathered want = floor.integral(direction);
      const double spread = std::sqrt(want.variance());
      EXPECT_NEAR(got.weight / want.weight, 1, 4e-3) << border << " " << x;
      // Right below source and object the path hardly changes over the lobe: parts of a millimetre.
      const double slack = 0.05 * spread + 3e-4;
      EXPECT_NEAR(got.mean(), want.mean(), slack) << border << " " << x;
      EXPECT_NEAR(std::sqrt(got.variance()), spread, slack) << border << " " << x;
    }
  }
}

// A patch as one is what its points give, each weighted with what it sends back; at an edge, which
// cuts the lobe about the patch's middle, where that is the mean (the middle of the patch).
TEST(LobeField, PatchIsTheMeanOfItsPoints) {
  for (const double border : {-1.0, 0.0}) {
    const TiltedFloor floor(border);
    const LobeField field = field_of_scene(floor.scene);
    const auto view = field.seen_from(floor.object, {});
    const Vector3d center(0.6, 0, 0);
    const Vector3d u(0.012, 0, 0), v(0, 0.008, 0);
    const Vector3d normal = Vector3d(-0.6, 0, -0.8);  // of the object
    const auto patch_at = [&](const Vector3d& p) {
      LitPatch patch;
      patch.way = p - floor.object;
      patch.leg = (p - floor.source).norm();
      patch.leg_gradient = (p - floor.source).normalized();
      return patch;
    };
    const auto sent = [&](const Vector3d& p) {  // back from the object, up to a constant
      const Vector3d way = p - floor.object;
      return way.dot(normal) * -way.z() / std::pow(way.norm(), 4);
    };
    std::vector<LitPatch> points;
    std::vector<double> out;
    constexpr int kSide = 24;
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const Vector3d p =
            center + ((2 * i + 1.0) / kSide - 1) * u + ((2 * j + 1.0) / kSide - 1) * v;
        points.push_back(patch_at(p));
        out.push_back(sent(p) / sent(center) / (kSide * kSide));
      }
    }
    Gathered want;
    const std::vector<Gathered> each = gather(view, points, normal);
    for (std::size_t i = 0; i < each.size(); ++i) {
      want.weight += out[i] * each[i].weight;
      want.first += out[i] * each[i].first;
      want.second += out[i] * each[i].second;
    }
    LitPatch whole = patch_at(center);
    whole.u = u;
    whole.v = v;
    const Gathered got = gather(view, {whole}, normal).front();
    const double spread = std::sqrt(want.variance());
    EXPECT_NEAR(got.weight / want.weight, 1, 1e-2) << border;
    EXPECT_NEAR((got.mean() - want.mean()) / spread, 0, 0.05) << border;
    EXPECT_NEAR(std::sqrt(got.variance()) / spread, 1, 0.05) << border;
  }
}

// However many directions are asked about at once.
TEST(LobeField, ManyDirectionsAreEachByItself) {
  const TiltedFloor floor(0.0);
  const LobeField field = field_of_scene(floor.scene);
  const auto view = field.seen_from(floor.object, {});
  std::vector<LitPatch> patches(150);
  for (std::size_t i = 0; i < patches.size(); ++i) {
    patches[i].way = Vector3d(0.3 + 0.004 * static_cast<double>(i), 0.02, 0) - floor.object;
  }
  const auto all = gather(view, patches, Vector3d(0, 0, -1));
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const Gathered one = gather(view, {patches[i]}, Vector3d(0, 0, -1)).front();
    EXPECT_NEAR(all[i].weight / one.weight, 1, 1e-6) << i;
    EXPECT_NEAR(all[i].mean() / one.mean(), 1, 1e-6) << i;
  }
}

}  // namespace
}  // namespace blindcorner
