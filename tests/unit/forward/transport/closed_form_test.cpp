// SPDX-License-Identifier: Apache-2.0
/// Scenes whose light can be written down, for both models.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;

/// The fast model's error against its tolerance of 1 %, which steers an estimate and is no bound.
constexpr double kFastError = 4 * 0.01;

class ClosedForm : public testing::TestWithParam<bool> {
 protected:
  bool fast() const { return GetParam(); }
  double light(const Scene& scene, const ReferenceOptions& options = {}) const {
    return sum(model_of(scene, fast(), options)->three_bounce(stated_pose(scene)));
  }
};

INSTANTIATE_TEST_SUITE_P(Models, ClosedForm, testing::Values(false, true), [](const auto& tested) {
  return std::string(tested.param ? "fast" : "reference");
});

// A lit disc of radius a around the spot that the zone sees, a patch at distance d opposite: the
// lobe of width s that goes back into the disc holds 1 - exp(-(a/d)^2 / (2 s^2)) of the
// retroreflected light, from all of it (the confocal limit, fall-off r^-2) to a^2 / (2 s^2 d^2)
// (the Lambertian limit, r^-4).
TEST_P(ClosedForm, RetroLobeBetweenTheConfocalAndTheLambertianLimit) {
  for (const double sigma_deg : {0.6, 1.5, 2.5, 5.0, 12.0}) {
    Scene scene = one_narrow_zone();
    const double d = 0.5;
    const double a = 0.03;
    const double sigma = sigma_deg * kDegree;
    scene.sensor.field = AngularCone{std::atan(a / 0.6)};
    scene.hidden.material = RetroreflectiveMaterial{sigma};
    scene.hidden.placement.position = Vector3d(0.6 - d, 0, 0);
    scene.hidden.placement.yaw = 0;
    scene.unknowns = {{Component::x, 0.095, 0.105, std::nullopt}};
    const double radiance = 1 / (0.6 * 0.6) * 0.7 / kPi;
    const double retro_limit = radiance * 0.8 * 1e-6 * (0.7 / kPi) / (d * d) * narrow_solid_angle();
    const double exact = retro_limit * (1 - std::exp(-0.5 * std::pow(a / d / sigma, 2)));
    // Cosines and distances change by (a / d)^2 / 2 = 0.2 % over the disc, a few of them.
    EXPECT_NEAR(light(scene), exact, (fast() ? kFastError : 0.01) * exact)
        << sigma_deg << " degrees";
  }
}

// A patch beside the sensor that faces the wall: of light in the direction theta it gets
// I rho / pi cos^4 theta / D^2, integrated over the field.
TEST_P(ClosedForm, ConeOfIllumination) {
  Scene scene = one_narrow_zone();
  scene.hidden.placement.position = Vector3d(0, 0, 0);
  scene.hidden.placement.yaw = 0;
  scene.unknowns = {{Component::x, -0.005, 0.005, std::nullopt}};
  const double d2 = 0.6 * 0.6;
  const double out = narrow_solid_angle() * (0.7 / kPi) / d2;
  for (const double half_deg : {5.0, 20.0, 45.0}) {
    scene.sensor.field = AngularCone{half_deg * kDegree};
    const double in = 2.0 / 5 * (1 - std::pow(std::cos(half_deg * kDegree), 5)) * 0.7 / d2;
    const double exact = in * out * (0.8 / kPi) * 1e-6;
    EXPECT_NEAR(light(scene), exact, (fast() ? 0.015 : 1e-3) * exact) << half_deg << " degrees";
  }
}

// The same for a rectangle of directions, in tangents u, v: (1 + u^2 + v^2)^(-7/2).
TEST_P(ClosedForm, RectangularFieldOfIllumination) {
  Scene scene = one_narrow_zone();
  scene.hidden.placement.position = Vector3d(0, 0, 0);
  scene.hidden.placement.yaw = 0;
  scene.unknowns = {{Component::x, -0.005, 0.005, std::nullopt}};
  scene.sensor.field = AngularRectangle{-10 * kDegree, 35 * kDegree, -30 * kDegree, 15 * kDegree};
  const double u0 = -std::tan(10 * kDegree), u1 = std::tan(35 * kDegree);
  const double v0 = -std::tan(30 * kDegree), v1 = std::tan(15 * kDegree);
  constexpr int kSteps = 500;
  double in = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double u = u0 + (u1 - u0) * (i + 0.5) / kSteps;
      const double v = v0 + (v1 - v0) * (j + 0.5) / kSteps;
      in += std::pow(1 + u * u + v * v, -3.5);
    }
  }
  const double d2 = 0.6 * 0.6;
  in *= (u1 - u0) * (v1 - v0) / (kSteps * kSteps) * 0.7 / kPi / d2;
  const double exact = in * narrow_solid_angle() * (0.7 / kPi) / d2 * (0.8 / kPi) * 1e-6;
  EXPECT_NEAR(light(scene), exact, (fast() ? 0.015 : 1e-3) * exact);
}

// Sensor aside, turned, pitched and rolled, light beside it: one lit and one seen spot, with the
// three-bounce formula written out between them.
TEST_P(ClosedForm, TiltedSensorWithItsLightAside) {
  Scene scene = one_narrow_zone();
  const Matrix3d rotation =
      (Eigen::AngleAxisd(-0.3, Vector3d::UnitZ()) * Eigen::AngleAxisd(0.2, Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.4, Vector3d::UnitX()))
          .toRotationMatrix();
  const Vector3d sensor(-0.1, 0.2, 0.15);
  scene.T_world_sensor = at(sensor, rotation);
  scene.sensor.light_offset = Vector3d(0.01, 0.12, -0.07);
  const Vector3d source = sensor + rotation * scene.sensor.light_offset;
  const Vector3d axis = rotation.col(0);
  const Vector3d lit = source + (0.6 - source.x()) / axis.x() * axis;
  const Vector3d seen = sensor + (0.6 - sensor.x()) / axis.x() * axis;
  const Vector3d patch = scene.hidden.placement.position;
  const Vector3d normal(std::cos(-50 * kDegree), std::sin(-50 * kDegree), 0);
  const auto leg = [&](const Vector3d& spot) {
    const Vector3d way = spot - patch;
    return narrow_solid_angle() * 0.7 / kPi * (way.x() / way.norm()) *
           (normal.dot(way) / way.norm()) / way.squaredNorm();
  };
  const double exact = leg(lit) * leg(seen) * (0.8 / kPi) * 1e-6;
  const auto model = model_of(scene, fast());
  const HistogramCube cube = model->three_bounce(stated_pose(scene));
  EXPECT_NEAR(sum(cube), exact, 1e-3 * exact);
  const double path =
      (lit - source).norm() + (lit - patch).norm() + (seen - patch).norm() + (seen - sensor).norm();
  double first = 0;
  for (int k = 0; k < cube.bins; ++k) first += (k + 0.5) * cube.values[static_cast<std::size_t>(k)];
  EXPECT_NEAR(first / sum(cube), (1e-9 + path / kSpeedOfLight) / scene.sensor.bin_width, 0.02);
}

// A black screen beside the lit floor, an inner corner: of the floor points that the field lights
// the patch gets light from those whose way does not cross the screen.
TEST_P(ClosedForm, InnerCornerHidesPartOfTheFloor) {
  Scene scene = one_narrow_zone();
  scene.sensor.bins = 256;  // the far end of the lit floor is late
  scene.surfaces = {rectangle({0, 0, -0.4}, {0, 0, 1}, 8, 8, 0.5)};
  Surface screen = rectangle({-1.42, 0.3, 0.6}, {0, -1, 0}, 4, 2, 0, false);  // edge at x = 0.58
  scene.surfaces.push_back(screen);
  scene.T_world_sensor = at({0, 0, 0}, axes_along({0.8, 0, -0.6}));
  const Matrix3d axes = scene.T_world_sensor.linear();
  scene.sensor.field = field_of(36, 30);
  scene.hidden.placement.position = Vector3d(0.7, 0.7, -0.1);
  scene.hidden.placement.yaw = -100 * kDegree;
  scene.unknowns = {{Component::x, 0.695, 0.705, std::nullopt}};
  const Vector3d patch = scene.hidden.placement.position;
  const Vector3d normal(std::cos(-100 * kDegree), std::sin(-100 * kDegree), 0);
  const auto leg = [&](const Vector3d& floor) {
    const Vector3d way = floor - patch;
    const double cosine = normal.dot(way) / way.norm();
    const double crossing = patch.x() + (0.3 - patch.y()) / way.y() * way.x();
    if (cosine <= 0 || crossing < 0.58) return 0.0;
    return 0.5 / kPi * cosine * (-way.z() / way.norm()) / way.squaredNorm();
  };
  const auto hit = [&](double u, double v) {
    const Vector3d direction = axes * Vector3d(1, -u, -v);
    return Vector3d(-0.4 / direction.z() * direction);
  };
  constexpr int kSteps = 600;
  const double u1 = std::tan(18 * kDegree), v1 = std::tan(15 * kDegree);
  double in = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const double u = u1 * ((2 * i + 1.0) / kSteps - 1);
      const double v = v1 * ((2 * j + 1.0) / kSteps - 1);
      const double weight = 4 * u1 * v1 / (kSteps * kSteps) * std::pow(1 + u * u + v * v, -1.5);
      in += weight * leg(hit(u, v));
    }
  }
  const double exact = in * narrow_solid_angle() * leg(hit(0, 0)) * (0.8 / kPi) * 1e-6;
  ASSERT_GT(exact, 0.0);
  ReferenceOptions fine;
  fine.field_divisions = 24;
  EXPECT_NEAR(light(scene, fine), exact, (fast() ? kFastError : 0.004) * exact);
  scene.surfaces.pop_back();
  EXPECT_GT(light(scene), 1.05 * exact) << "the corner hides a good part of the floor";
}

// ---------------------------------------------------------------------------------------------
// Light of the known scene

/// The zone and the light look at the wall, a plate of the known scene stands where the hidden
/// patch of `one_narrow_zone` is.
Scene with_known_plate() {
  Scene scene = one_narrow_zone();
  scene.surfaces.push_back(rectangle({0.2, 0.5, 0.1},
                                     {std::cos(-50 * kDegree), std::sin(-50 * kDegree), 0}, 0.001,
                                     0.001, 0.8, false));
  scene.hidden.placement.position = Vector3d(0.2, -0.5, 0.1);
  scene.hidden.placement.yaw = 50 * kDegree;
  return scene;
}

// A known plate sends the light that a hidden one in its place would.
TEST(StaticReturn, ThreeBouncesOfAKnownPlateAreThoseOfAHiddenOne) {
  const Scene known = with_known_plate();
  const Scene hidden = one_narrow_zone();
  const auto reference = model_of(known, false);
  Scene alone = known;
  alone.surfaces.pop_back();
  HistogramCube bounces = reference->static_background();
  const HistogramCube first = model_of(alone, false)->static_background();
  for (std::size_t i = 0; i < bounces.values.size(); ++i) bounces.values[i] -= first.values[i];
  const HistogramCube want = model_of(hidden, false)->three_bounce(stated_pose(hidden));
  // The first bounce, a million times brighter, is subtracted.
  EXPECT_NEAR(sum(bounces), sum(want), 2e-3 * sum(want));
}

// A hidden object between a wall and a plate takes the plate's light away.
TEST(StaticReturn, HiddenObjectBlocksThreeBounceLight) {
  Scene scene = with_known_plate();
  scene.surfaces[1].shape = RectangleShape{0.05, 0.05};
  scene.hidden.shape = RectangleShape{0.3, 0.3};
  scene.hidden.placement.position = Vector3d(0.4, 0.25, 0.05);  // between the spot and the plate
  scene.hidden.placement.yaw = 130 * kDegree;                   // back towards the wall
  scene.unknowns = {{Component::x, 0.3, 0.5, std::nullopt}};
  const auto reference = model_of(scene, false);
  Scene alone = scene;
  alone.surfaces.pop_back();
  const double first = sum(model_of(alone, false)->static_background());
  const double open = sum(reference->static_background()) - first;
  ASSERT_GT(open, 1e-9 * first);
  EXPECT_NEAR(sum(reference->shadowed_background(stated_pose(scene))) - first, 0, 1e-6 * open);
}

// A black partition that stands on the floor leaves the light of the half before it: the scene is
// the one whose floor ends there. Cells astride of it would see over to its other side. A floor in
// two pieces does not stand across itself.
TEST_P(ClosedForm, PartitionPartsTheFloorThatItStandsOn) {
  Scene parted = one_narrow_zone();
  parted.sensor.field = field_of(8, 30);
  parted.sensor.zones[0].footprint = field_of(8, 30);
  parted.surfaces[0] = rectangle({0.6, 0, 0.5}, {-1, 0, 0}, 2, 2, 0.7);
  const double end = 0.137;
  Scene half = parted;
  for (const double side : {-0.5, 0.5}) {
    parted.surfaces.push_back(rectangle({0, side, -0.3}, {0, 0, 1}, 1, 2, 0.5, false));
  }
  parted.surfaces.push_back(rectangle({0, end, 0.2}, {0, -1, 0}, 2, 1, 0, false));
  half.surfaces.push_back(rectangle({0, 0.5 * (end - 1), -0.3}, {0, 0, 1}, 1 + end, 2, 0.5, false));
  const double want = sum(model_of(half, fast())->static_background());
  const double got = sum(model_of(parted, fast())->static_background());
  half.surfaces.pop_back();
  const double bounced = want - sum(model_of(half, fast())->static_background());
  ASSERT_GT(bounced, 1e-3 * want);
  EXPECT_NEAR(got, want, (fast() ? 0.01 : 0.003) * bounced);
}

// What a hidden object takes away from the known scene's light is what a black surface in its place
// would: all pairs summed anew against the changes only.
TEST(StaticReturn, HiddenObjectBlocksAsABlackSurfaceDoes) {
  Scene scene = with_known_plate();
  scene.sensor.field = field_of(30, 30);
  scene.sensor.zones[0].footprint = field_of(25, 25);
  scene.surfaces[1].shape = RectangleShape{0.5, 0.5};
  scene.hidden.shape = RectangleShape{0.15, 0.2};
  scene.hidden.placement.position = Vector3d(0.36, 0.3, 0.05);
  scene.hidden.placement.yaw = 120 * kDegree;
  scene.unknowns = {{Component::x, 0.3, 0.5, std::nullopt}};
  const auto reference = model_of(scene, false);
  Scene black = scene;
  Surface body;
  body.name = "black";
  body.shape = scene.hidden.shape;
  body.T_world_surface =
      object_to_world(scene.hidden.shape, scene.hidden.anchor, scene.hidden.placement);
  body.albedo = 0;
  black.surfaces.push_back(body);
  Scene alone = scene;
  alone.surfaces.pop_back();
  const double first = sum(model_of(alone, false)->static_background());
  const HistogramCube open = reference->static_background();
  const HistogramCube got = reference->shadowed_background(stated_pose(scene));
  const HistogramCube want = model_of(black, false)->static_background();
  const double share = (sum(want) - first) / (sum(open) - first);
  ASSERT_GT(share, 0.2);
  ASSERT_LT(share, 0.98);
  const double brightest = *std::max_element(open.values.begin(), open.values.end());
  for (std::size_t i = 0; i < want.values.size(); ++i) {
    EXPECT_NEAR(got.values[i], want.values[i], 1e-12 * brightest) << "bin " << i;
  }
  // The fast model takes the same away, as far as its sampling tells.
  const auto fast = model_of(scene, true);
  const HistogramCube lit = fast->static_background();
  const HistogramCube shaded = fast->shadowed_background(stated_pose(scene));
  double off = 0, all = 0;
  for (std::size_t i = 0; i < want.values.size(); ++i) {
    const double right = open.values[i] - got.values[i];
    off += std::pow(lit.values[i] - shaded.values[i] - right, 2);
    all += right * right;
  }
  EXPECT_LT(off, 0.1 * 0.1 * all);
}

// Source, wall, floor, detector: the light falls on a spot of the wall, the second zone looks at a
// spot of the floor.
TEST(StaticReturn, TwoBouncesHaveTheFormulaWrittenOut) {
  Scene scene = one_narrow_zone();
  scene.sensor.columns = 1;
  scene.sensor.rows = 2;
  scene.sensor.zones.assign(2, scene.sensor.zones[0]);
  const double down = 40 * kDegree;
  scene.sensor.zones[1].footprint =
      AngularRectangle{-0.1 * kDegree, 0.1 * kDegree, down - 0.1 * kDegree, down + 0.1 * kDegree};
  scene.surfaces.push_back(rectangle({0, 0, -0.3}, {0, 0, 1}, 4, 4, 0.5));
  scene.surfaces[0] = rectangle({0.6, 0, 1.7}, {-1, 0, 0}, 4, 4, 0.7);
  const Vector3d lit(0.6, 0, 0);
  const Vector3d seen(0.3 / std::tan(down), 0, -0.3);
  const Vector3d way = seen - lit;
  const double r = way.norm();
  const double t = std::tan(0.1 * kDegree);
  // du dv (1 + u^2 + v^2)^(-3/2) of the second zone.
  const double v0 = std::tan(down - 0.1 * kDegree), v1 = std::tan(down + 0.1 * kDegree);
  const double vc = std::tan(down);
  const double zone = 2 * t * (v1 - v0) * std::pow(1 + vc * vc, -1.5);
  const double exact = narrow_solid_angle() * (0.7 / kPi) * (-way.x() / r) * (-way.z() / r) /
                       (r * r) * (0.5 / kPi) * zone;
  const HistogramCube direct = model_of(scene, false)->static_background();
  double got = 0;
  for (int k = 0; k < direct.bins; ++k) got += direct.zone(1)[k];
  // Three bounces would have to end wall, wall, floor or floor, floor, floor: there are none.
  EXPECT_NEAR(got, exact, 2e-3 * exact);
}

}  // namespace
}  // namespace blindcorner
