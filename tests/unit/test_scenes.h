// SPDX-License-Identifier: Apache-2.0
/// Small scenes that tests of the forward model share.
#pragma once

#include <cmath>
#include <memory>
#include <numeric>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner::testing_scenes {

using Eigen::Matrix3d;
using Eigen::Vector3d;

inline Transform at(const Vector3d& position, const Matrix3d& rotation = Matrix3d::Identity()) {
  Transform T = Transform::Identity();
  T.linear() = rotation;
  T.translation() = position;
  return T;
}

/// Axes with x along `direction` and z as far up as possible.
inline Matrix3d axes_along(const Vector3d& direction) {
  const bool vertical = std::abs(direction.z()) > 0.99 * direction.norm();
  const Vector3d up = vertical ? Vector3d::UnitX().eval() : Vector3d::UnitZ().eval();
  Matrix3d axes;
  axes.col(0) = direction.normalized();
  axes.col(1) = up.cross(axes.col(0)).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

inline Surface rectangle(const Vector3d& center, const Vector3d& normal, double width,
                         double height, double albedo, bool relay = true) {
  Surface surface;
  surface.name = relay ? "relay" : "plate";
  surface.shape = RectangleShape{width, height};
  surface.T_world_surface = at(center, axes_along(normal));
  surface.albedo = albedo;
  surface.relay = relay;
  surface.occluder = !relay;
  return surface;
}

inline AngularRectangle field_of(double h_deg, double v_deg) {
  return {-h_deg * kDegree / 2, h_deg * kDegree / 2, -v_deg * kDegree / 2, v_deg * kDegree / 2};
}

/// One zone of 0.2 degrees at the origin that looks along +x at a wall 0.6 m ahead.
inline Scene one_narrow_zone() {
  Scene scene;
  scene.name = "one narrow zone";
  Sensor& sensor = scene.sensor;
  sensor.rows = sensor.columns = 1;
  sensor.zones.assign(1, Zone{});
  sensor.zones[0].footprint = field_of(0.2, 0.2);
  sensor.zones[0].time_zero = 1e-9;
  sensor.bins = 128;
  sensor.bin_width = 100e-12;
  sensor.response = ImpulseResponse(GaussianResponse{150e-12});
  sensor.field = field_of(0.2, 0.2);
  scene.surfaces = {rectangle({0.6, 0, 0}, {-1, 0, 0}, 4, 4, 0.7)};
  scene.hidden.shape = RectangleShape{0.001, 0.001};
  scene.hidden.albedo = 0.8;
  scene.hidden.placement.position = Vector3d(0.2, 0.5, 0.1);
  scene.hidden.placement.yaw = -50 * kDegree;
  scene.unknowns = {{Component::x, 0.19, 0.21, std::nullopt}};
  return scene;
}

/// Solid angle of `one_narrow_zone`'s zone, sr.
inline double narrow_solid_angle() {
  const double t = std::tan(0.1 * kDegree);
  return 4 * std::atan(t * t / std::sqrt(1 + 2 * t * t));
}

inline std::unique_ptr<ForwardModel> model_of(const Scene& scene, bool fast,
                                              const ReferenceOptions& options = {}) {
  return fast ? make_fast_model(scene, sensor_placement(scene))
              : make_reference_renderer(scene, sensor_placement(scene), options);
}

inline FastModelOptions at_tolerance(double tolerance) {
  FastModelOptions options;
  options.tolerance = tolerance;
  return options;
}

/// Evenly over the search region.
inline PoseVector random_pose(const Scene& scene, std::mt19937_64& random) {
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    pose[static_cast<Eigen::Index>(i)] =
        std::uniform_real_distribution<double>(unknown.lower, unknown.upper)(random);
  }
  return pose;
}

/// Capture with about `photons` photons of three-bounce light over an equal background.
inline Capture reference_capture(const Scene& scene, const PoseVector& pose, double photons,
                                 std::uint64_t seed) {
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  const HistogramCube light = model->three_bounce(pose);
  double counts = 0;
  for (int z = 0; z < light.zones(); ++z) {
    for (int k = 0; k < light.bins; ++k) {
      counts += scene.sensor.zones[static_cast<std::size_t>(z)].gain * light.zone(z)[k];
    }
  }
  Capture capture;
  capture.exposures = photons / counts;
  const LinearValues linear{1.0, counts / (light.zones() * 20), scene.linear.fixed_direct};
  capture.counts =
      draw_counts(scene, expected_counts(scene, light, model->static_background(), linear),
                  capture.exposures, seed);
  capture.source = "synthetic";
  return capture;
}

inline PoseVector stated_pose(const Scene& scene) {
  return pose_of(stated_placements(scene), scene.unknowns);
}

inline double sum(const HistogramCube& cube) {
  return std::accumulate(cube.values.begin(), cube.values.end(), 0.0);
}

/// Relative L2 difference.
inline double difference(const HistogramCube& got, const HistogramCube& want) {
  double square = 0;
  double size = 0;
  for (std::size_t i = 0; i < want.values.size(); ++i) {
    square += std::pow(got.values[i] - want.values[i], 2);
    size += want.values[i] * want.values[i];
  }
  return std::sqrt(square / size);
}

}  // namespace blindcorner::testing_scenes
