// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/inverse/baseline/multilateration.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kAmbient = 3.0;
constexpr double kPhotons = 500;

/// Five spots on a wall, each lit and seen by itself, with clocks of their own. Unknown are all
/// three coordinates of a small sphere.
Scene five_spots() {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.name = "five spots";
  Sensor& sensor = scene.sensor;
  sensor.illumination = Illumination::confocal;
  sensor.columns = 5;
  sensor.zones.assign(5, Zone{});
  const double sides[5][2] = {{-0.4, -0.3}, {0.4, -0.3}, {0, 0}, {-0.4, 0.35}, {0.4, 0.3}};
  for (std::size_t z = 0; z < 5; ++z) {
    sensor.zones[z].footprint = Vector3d(0.6, sides[z][0], sides[z][1]);
    sensor.zones[z].time_zero = 1e-9 + 37e-12 * static_cast<double>(z);
  }
  scene.hidden.shape = SphereShape{0.01};
  scene.unknowns = {{Component::x, -0.4, 0.3, std::nullopt},
                    {Component::y, 0.2, 0.9, std::nullopt},
                    {Component::z, -0.3, 0.4, std::nullopt}};
  scene.linear.direct = LinearMode::fixed;
  scene.linear.fixed_direct = 0;
  scene.linear.amplitude = LinearMode::per_zone;  // all pulses are equally strong
  return scene;
}

/// Expected counts, without noise: one pulse for each spot, at the time of sensor - spot - point
/// and back, over ambient light.
Capture pulses_from(const Scene& scene, const Vector3d& point) {
  Capture capture;
  const Sensor& sensor = scene.sensor;
  capture.counts = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    const Vector3d spot = std::get<Vector3d>(zone.footprint);
    const double path = 2 * (spot.norm() + (point - spot).norm());
    const double arrival = zone.time_zero + path / kSpeedOfLight;
    for (int k = 0; k < sensor.bins; ++k) {
      const double pulse = sensor.response.cumulative((k + 1) * sensor.bin_width - arrival) -
                           sensor.response.cumulative(k * sensor.bin_width - arrival);
      capture.counts.zone(z)[k] = kAmbient + kPhotons * pulse;
    }
  }
  return capture;
}

/// Noiseless capture of a scene with a flash field, by the reference renderer.
Capture rendered(const Scene& scene, const PoseVector& pose) {
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  Capture capture;
  capture.counts = expected_counts(scene, model->three_bounce(pose), model->static_background(),
                                   {1.0, kAmbient, scene.linear.fixed_direct});
  return capture;
}

/// 3 x 3 zones of 10 degrees, all lit by one flash; the wall's direct return is in the captures.
Scene nine_zones() {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.name = "nine zones";
  Sensor& sensor = scene.sensor;
  sensor.rows = sensor.columns = 3;
  sensor.zones.assign(9, Zone{});
  for (int z = 0; z < 9; ++z) {
    const double right = (z % 3 - 1) * 10 * kDegree, down = (z / 3 - 1) * 10 * kDegree;
    Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    zone.footprint = AngularRectangle{right - 5 * kDegree, right + 5 * kDegree, down - 5 * kDegree,
                                      down + 5 * kDegree};
    zone.time_zero = 1e-9;
    zone.gain = 1e10;
  }
  sensor.field = testing_scenes::field_of(30, 30);
  scene.hidden.shape = RectangleShape{0.05, 0.05};
  scene.unknowns = {{Component::x, 0.0, 0.4, std::nullopt},
                    {Component::y, 0.3, 0.8, std::nullopt},
                    {Component::yaw, -80 * kDegree, 20 * kDegree, std::nullopt}};
  return scene;
}

PoseVector pose_of(std::initializer_list<double> values) {
  PoseVector pose(static_cast<Eigen::Index>(values.size()));
  std::ranges::copy(values, pose.begin());
  return pose;
}

/// Several places, so that no grid point is right by chance.
const Vector3d kPlaces[] = {{0.1, 0.5, 0.05}, {-0.23, 0.31, -0.2}, {0.217, 0.833, 0.271}};

TEST(BackProjection, FindsAPointFromExactPulses) {
  const Scene scene = five_spots();
  const BackProjection method(scene);
  for (const Vector3d& place : kPlaces) {
    // A tenth of the pulse's 45 mm of path: nothing but the grid and the parabola is in the way.
    EXPECT_LT((method.predict(pulses_from(scene, place)) - place).norm(), 5e-3)
        << place.transpose();
  }
}

TEST(Multilateration, FindsAPointFromExactPulses) {
  const Scene scene = five_spots();
  const Multilateration method(scene);
  for (const Vector3d& place : kPlaces) {
    // The peaks are right to a hundredth of a bin (0.3 mm); the prior, as wide as the region, pulls
    // by a few parts in a thousand of what is left, and the geometry magnifies both.
    EXPECT_LT((method.predict(pulses_from(scene, place)) - place).norm(), 5e-3)
        << place.transpose();
  }
}

TEST(ClassicalBaselines, FindAPlateThatAFlashLightsAndDoNotGuessItsTurn) {
  const Scene scene = nine_zones();
  const BackProjection back_projection(scene);
  const Multilateration multilateration(scene);
  for (const auto& truth : {pose_of({0.2, 0.5, -0.6}), pose_of({0.31, 0.62, -0.9})}) {
    const Capture capture = rendered(scene, truth);
    for (const PoseVector& found :
         {back_projection.predict(capture), multilateration.predict(capture)}) {
      // Half of the plate's diagonal: which part of it shines most is not known to them.
      EXPECT_LT((found - truth).head<2>().norm(), 0.035) << found.transpose();
      EXPECT_DOUBLE_EQ(found[2], -30 * kDegree);
    }
  }
}

TEST(ClassicalBaselines, TakeTheSensorsPoseFromTheCapture) {
  Scene scene = nine_zones();
  const PoseVector truth = pose_of({0.2, 0.5, -0.6});
  const BackProjection back_projection(scene);
  const Multilateration multilateration(scene);
  scene.T_world_sensor.translation() = Vector3d(-0.1, 0.08, 0);
  Capture capture = rendered(scene, truth);
  capture.T_world_sensor = scene.T_world_sensor;
  EXPECT_LT((back_projection.predict(capture) - truth).head<2>().norm(), 0.035);
  EXPECT_LT((multilateration.predict(capture) - truth).head<2>().norm(), 0.035);
}

TEST(ClassicalBaselines, AnswerTheMiddleOfThePriorWithoutAnObject) {
  const Scene scene = nine_zones();
  const PoseVector middle = middle_of_prior(scene);
  EXPECT_NEAR((middle - pose_of({0.2, 0.55, -30 * kDegree})).norm(), 0, 1e-12);
  const auto model = make_fast_model(scene, sensor_placement(scene));
  Capture empty;
  empty.counts = expected_counts(scene, HistogramCube(3, 3, scene.sensor.bins),
                                 model->static_background(), {1.0, kAmbient, 1.0});
  EXPECT_EQ(Multilateration(scene).predict(empty), middle);
  empty.counts.values.assign(empty.counts.values.size(), 0.0);
  EXPECT_EQ(Multilateration(scene).predict(empty), middle);
  EXPECT_EQ(BackProjection(scene).predict(empty), middle);
}

TEST(ClassicalBaselines, LeaveOpenWhatOneSpotCannotTell) {
  Scene scene = five_spots();
  for (std::size_t z = 1; z < 5; ++z) scene.sensor.zones[z].dead = true;
  scene.unknowns = {{Component::y, 0.2, 0.9, std::nullopt},
                    {Component::z, -0.1, 0.1, std::nullopt}};
  scene.hidden.placement.position = Vector3d(0.1, 0.5, 0);
  // The spot stands opposite of it: from 0.5 m away, 0.1 m up change the path by 1 cm; 10 photons
  // do not show that.
  scene.sensor.zones[0].footprint = Vector3d(0.6, 0.0, 0.0);
  Capture capture = pulses_from(scene, Vector3d(0.1, 0.5, 0.0));
  for (double& count : capture.counts.values) count = (count - kAmbient) / 50 + kAmbient;
  const PoseVector found = BackProjection(scene).predict(capture);
  EXPECT_NEAR(found[0], 0.5, 0.02);
  EXPECT_EQ(found[1], 0.0);
}

TEST(ClassicalBaselines, RefuseWhatTheyCannotAnswer) {
  Scene scene = nine_zones();
  Capture capture = rendered(scene, pose_of({0.2, 0.5, -0.6}));
  const BackProjection back_projection(scene);
  const Multilateration multilateration(scene);
  capture.counts.values[7] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message_of([&] { back_projection.predict(capture); }), "no error");
  EXPECT_NE(message_of([&] { multilateration.predict(capture); }), "no error");
  capture.counts = HistogramCube(1, 1, 5);
  EXPECT_NE(message_of([&] { back_projection.predict(capture); }), "no error");
  EXPECT_NE(message_of([&] { multilateration.predict(capture); }), "no error");
  Scene two = scene;
  two.further_hidden.push_back(two.hidden);
  two.further_hidden.front().name = "second";
  EXPECT_THAT(message_of([&] { BackProjection{two}; }),
              AllOf(HasSubstr("2 objects"), HasSubstr("accepted")));
  EXPECT_THAT(message_of([&] { Multilateration{two}; }), HasSubstr("2 objects"));
  scene.unknowns = {{Component::yaw, 0, 1, std::nullopt}};
  EXPECT_THAT(message_of([&] { BackProjection{scene}; }), HasSubstr("found no position"));
  EXPECT_THAT(message_of([] { BackProjectionOptions{-1}.validate(); }), HasSubstr("spacing"));
  EXPECT_THAT(message_of([] { MultilaterationOptions{0}.validate(); }), HasSubstr("threshold"));
}

}  // namespace
}  // namespace blindcorner
