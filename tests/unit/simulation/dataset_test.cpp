// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/dataset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "bundled.h"

namespace blindcorner {
namespace {

TEST(Dataset, ObjectsStandOnAGridAndSensorsAroundTheScenes) {
  const Scene scene = bundled_scene("tmf8828_wall");
  DatasetOptions options;
  const DatasetPlan plan = plan_dataset(scene, options);
  ASSERT_EQ(plan.objects.size(), 400U);
  ASSERT_EQ(plan.sensors.size(), 5U);
  std::set<double> x, y;
  for (const PoseVector& pose : plan.objects) {
    x.insert(pose[0]);
    y.insert(pose[1]);
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      EXPECT_GE(pose[static_cast<Eigen::Index>(i)], scene.unknowns[i].lower);
      EXPECT_LE(pose[static_cast<Eigen::Index>(i)], scene.unknowns[i].upper);
    }
  }
  EXPECT_EQ(x.size(), 20U);
  EXPECT_EQ(y.size(), 20U);
  EXPECT_DOUBLE_EQ(*x.begin(), 0.15);
  EXPECT_DOUBLE_EQ(*y.rbegin(), 0.7);
  EXPECT_NE(plan.objects[0][3], plan.objects[1][3]);  // yaw is drawn
  // The wall is 0.6 m away.
  EXPECT_NEAR(plan.sensor_spread, 0.03, 1e-6);
  EXPECT_TRUE(plan.sensors.front().isApprox(scene.T_world_sensor, 0));
  for (const Transform& pose : plan.sensors) {
    const Eigen::Vector3d moved = pose.translation() - scene.T_world_sensor.translation();
    EXPECT_LE(moved.cwiseAbs().maxCoeff(), plan.sensor_spread);
    EXPECT_EQ(moved.z(), 0);
    EXPECT_LE(std::abs(yaw_pitch_roll_of(pose.linear())[0]), 0.035);
  }
}

TEST(Dataset, RandomCapturesHavePlacesAndSensorPosesOfTheirOwn) {
  const Scene scene = bundled_scene("tmf8828_wall");
  DatasetOptions options;
  options.random = 6;
  const DatasetPlan plan = plan_dataset(scene, options);
  ASSERT_EQ(plan.captures(), 6U);
  const auto captures = render_dataset(scene, plan, options);
  ASSERT_EQ(captures.size(), 6U);
  std::set<double> x, sensor_x;
  for (std::size_t i = 0; i < captures.size(); ++i) {
    EXPECT_EQ(captures[i].truth.at("x_m"), plan.objects[i][0]);
    EXPECT_TRUE(captures[i].T_world_sensor->isApprox(plan.sensors[i], 0));
    x.insert(plan.objects[i][0]);
    sensor_x.insert(plan.sensors[i].translation().x());
  }
  EXPECT_EQ(x.size(), 6U);
  EXPECT_EQ(sensor_x.size(), 6U);
}

TEST(Dataset, CapturesAreWhatTheSimulatedSensorSenses) {
  const Scene scene = bundled_scene("tmf8828_wall");
  DatasetOptions options;
  options.objects = 4;
  options.sensors = 2;
  const DatasetPlan plan = plan_dataset(scene, options);
  const auto captures = render_dataset(scene, plan, options);
  ASSERT_EQ(captures.size(), 8U);
  for (std::size_t i = 0; i < captures.size(); ++i) {
    EXPECT_EQ(captures[i].exposures, 10);
    EXPECT_EQ(captures[i].truth.at("x_m"), plan.objects[i / 2][0]);
    EXPECT_EQ(captures[i].truth.at("yaw_rad"), plan.objects[i / 2][3]);
    EXPECT_TRUE(captures[i].T_world_sensor->isApprox(plan.sensors[i % 2], 0));
  }
  // An average of ten exposures scatters about the expected counts with a tenth of their variance:
  // the mean square of the normalised difference is 1, within 0.05 for 1152 bins (standard
  // deviation).
  const SimulatedSensor sensor(scene);
  const SensedFrame many = sensor.sense(plan.sensors[0], plan.objects[0], 1, 100000);
  double squares = 0;
  const auto& counts = captures[0].counts.values;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    const double expected = many.capture.counts.values[k];
    squares += std::pow(counts[k] - expected, 2) / (expected / 10);
  }
  const double dispersion = scene.sensor.dispersion;
  EXPECT_NEAR(squares / static_cast<double>(counts.size()) / dispersion, 1, 0.2);
}

TEST(Dataset, SameSeedSameCaptures) {
  const Scene scene = bundled_scene("tmf8828_wall");
  DatasetOptions options;
  options.objects = 1;
  options.sensors = 2;
  const auto counts_of = [&] {
    return render_dataset(scene, plan_dataset(scene, options), options).back().counts.values;
  };
  const auto counts = counts_of();
  EXPECT_EQ(counts, counts_of());
  options.seed = 2;
  EXPECT_NE(counts, counts_of());
}

TEST(Dataset, RefusesWhatItCannotDo) {
  Scene scene = bundled_scene("tmf8828_wall");
  DatasetOptions options;
  options.objects = 399;
  EXPECT_THROW(plan_dataset(scene, options), Error);
  options = {};
  options.exposures = 0;
  EXPECT_THROW(plan_dataset(scene, options), Error);
  scene.unknowns.erase(scene.unknowns.begin());
  EXPECT_THROW(plan_dataset(scene, {}), Error);
}

}  // namespace
}  // namespace blindcorner
