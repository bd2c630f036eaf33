// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/dataset.h"

#include <cmath>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "blindcorner/simulation/synthetic.h"
#include "forward/relay/ray_scene.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Spread of the sensor as a share of its distance to the relay: a hand's breadth in front of a
/// wall, a metre in a street.
constexpr double kSpreadShare = 0.05;

int grid_side(int objects) { return static_cast<int>(std::lround(std::sqrt(objects))); }

double default_spread(const Scene& scene) {
  const Transform& T = scene.T_world_sensor;
  const auto hit = RayScene(scene.surfaces).first_hit(T.translation(), T.linear().col(0));
  return kSpreadShare * (hit ? hit->distance : 1.0);
}

/// Place among the unknowns of a component of the first object.
Eigen::Index place_of(const Scene& scene, Component component) {
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    if (unknown.component == component && unknown.object == 0) return static_cast<Eigen::Index>(i);
  }
  throw Error(scene_place(scene) + ": unknowns",
              "found no " + component_name(component) + ", accepted for a data set: x_m and y_m");
}

double grid_value(const Unknown& unknown, int step, int side) {
  return side == 1 ? 0.5 * (unknown.lower + unknown.upper)
                   : unknown.lower + unknown.range() * step / (side - 1);
}

std::vector<PoseVector> grid_poses(const Scene& scene, int side, std::mt19937_64& random) {
  const Eigen::Index x = place_of(scene, Component::x);
  const Eigen::Index y = place_of(scene, Component::y);
  std::vector<PoseVector> poses;
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      PoseVector pose = draw_pose(scene, random);
      pose[x] = grid_value(scene.unknowns[static_cast<std::size_t>(x)], column, side);
      pose[y] = grid_value(scene.unknowns[static_cast<std::size_t>(y)], row, side);
      poses.push_back(pose);
    }
  }
  return poses;
}

std::vector<Transform> sensor_poses(const Scene& scene, const DatasetOptions& options, int count,
                                    double spread, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<Transform> poses{scene.T_world_sensor};
  while (static_cast<int>(poses.size()) < count) {
    Transform pose = scene.T_world_sensor;
    pose.translation().x() += spread * unit(random);
    pose.translation().y() += spread * unit(random);
    const double turn = options.sensor_yaw_spread * unit(random);
    pose.linear() = Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix() * pose.linear();
    seen_from(scene, pose);  // throws where no relay is in view
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace

void DatasetOptions::validate() const {
  const auto fail = [](const char* field, double found, const char* accepted) {
    throw Error(field, "found " + std::to_string(found) + ", accepted: " + accepted);
  };
  const int side = grid_side(objects);
  if (objects < 1 || side * side != objects) {
    fail("objects", objects, "a square number, such as 400 for a grid of 20 x 20");
  }
  if (random < 0) fail("random", random, ">= 0");
  if (sensors < 1) fail("sensors", sensors, ">= 1");
  if (exposures < 1) fail("exposures", exposures, ">= 1");
  if (sensor_spread && !(*sensor_spread >= 0 && std::isfinite(*sensor_spread))) {
    fail("sensor_spread", *sensor_spread, ">= 0 m");
  }
  if (!(sensor_yaw_spread >= 0 && std::isfinite(sensor_yaw_spread))) {
    fail("sensor_yaw_spread", sensor_yaw_spread, ">= 0 rad");
  }
}

DatasetPlan plan_dataset(const Scene& scene, const DatasetOptions& options) {
  options.validate();
  validate(scene);
  std::mt19937_64 random(options.seed);
  DatasetPlan plan;
  plan.side = grid_side(options.objects);
  plan.sensor_spread = options.sensor_spread.value_or(default_spread(scene));
  plan.paired = options.random > 0;
  plan.sensors = sensor_poses(scene, options, plan.paired ? options.random : options.sensors,
                              plan.sensor_spread, random);
  if (plan.paired) {
    plan.side = 0;
    for (int i = 0; i < options.random; ++i) plan.objects.push_back(draw_pose(scene, random));
    return plan;
  }
  plan.objects = grid_poses(scene, plan.side, random);
  return plan;
}

std::vector<Capture> render_dataset(const Scene& scene, const DatasetPlan& plan,
                                    const DatasetOptions& options,
                                    const std::function<void()>& advance) {
  const SimulatedSensor sensor(scene);
  std::vector<Capture> captures(plan.captures());
  parallel_for(std::size_t{0}, captures.size(), [&](std::size_t i) {
    // Photons of neighbouring captures come from seeds far apart.
    const std::uint64_t seed = options.seed + 1'000'003 * (i + 1);
    const std::size_t object = plan.paired ? i : i / plan.sensors.size();
    captures[i] = sensor
                      .sense(plan.sensors[i % plan.sensors.size()], plan.objects[object], seed,
                             options.exposures)
                      .capture;
    captures[i].index = static_cast<int>(i);
    if (advance) advance();
  });
  return captures;
}

}  // namespace blindcorner
