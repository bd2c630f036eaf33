// SPDX-License-Identifier: Apache-2.0
#include "stability/cases.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/synthetic.h"

namespace blindcorner {
namespace {

AngularRectangle field_of(double left_deg, double right_deg, double top_deg, double bottom_deg) {
  return {left_deg * kDegree, right_deg * kDegree, top_deg * kDegree, bottom_deg * kDegree};
}

void scale_shape(Shape& shape, double factor) {
  if (auto* plate = std::get_if<RectangleShape>(&shape)) {
    plate->width *= factor;
    plate->height *= factor;
  } else if (auto* sphere = std::get_if<SphereShape>(&shape)) {
    sphere->radius *= factor;
  } else if (auto* box = std::get_if<BoxShape>(&shape)) {
    box->size *= factor;
  } else {
    throw Error("scaled scene", "found another shape, accepted: rectangle, sphere or box");
  }
}

}  // namespace

Scene wall_scene() {
  Scene scene;
  scene.name = "wall";
  Sensor& sensor = scene.sensor;
  sensor.zones.assign(1, Zone{});
  sensor.zones[0].footprint = field_of(-5, 5, -5, 5);
  sensor.zones[0].time_zero = 1e-9;
  sensor.response = ImpulseResponse(GaussianResponse{150e-12});
  sensor.field = field_of(-5, 5, -5, 5);
  Surface wall;
  wall.name = "relay";
  wall.shape = RectangleShape{4, 4};
  wall.T_world_surface.translation() = Eigen::Vector3d(0.6, 0, 0);
  wall.T_world_surface.linear() =
      Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  wall.albedo = 0.7;
  wall.relay = true;
  scene.surfaces = {wall};
  scene.hidden.shape = RectangleShape{0.2, 0.2};
  scene.hidden.albedo = 0.8;
  scene.hidden.placement.position = Eigen::Vector3d(0.2, 0.5, 0.1);
  scene.hidden.placement.yaw = -50 * kDegree;
  scene.unknowns = {{Component::x, 0.1, 0.3, std::nullopt},
                    {Component::y, 0.35, 0.7, std::nullopt}};
  return scene;
}

Scene nine_zone_scene() {
  Scene scene = wall_scene();
  scene.name = "wall, nine zones";
  scene.sensor.rows = scene.sensor.columns = 3;
  scene.sensor.zones.clear();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      Zone zone;
      zone.footprint = field_of(-15 + 10 * column, -5 + 10 * column, -15 + 10 * row, -5 + 10 * row);
      zone.time_zero = 1e-9;
      scene.sensor.zones.push_back(zone);
    }
  }
  scene.sensor.field = field_of(-15, 15, -15, 15);
  return scene;
}

Scene partitioned_scene(const Eigen::Vector3d& size, const Eigen::Vector3d& middle) {
  Scene scene = nine_zone_scene();
  Surface partition;
  partition.name = "partition";
  partition.shape = BoxShape{size};
  partition.T_world_surface.translation() = middle;
  partition.albedo = 0.05;
  partition.occluder = true;
  scene.surfaces.push_back(partition);
  return scene;
}

Scene occluded_scene() { return partitioned_scene({0.4, 0.02, 2}, {0.2, 0.25, 0}); }

Scene scaled(const Scene& scene, double factor) {
  Scene big = scene;
  big.T_world_sensor.translation() *= factor;
  for (Surface& surface : big.surfaces) {
    scale_shape(surface.shape, factor);
    surface.T_world_surface.translation() *= factor;
  }
  scale_shape(big.hidden.shape, factor);
  big.hidden.placement.position *= factor;
  for (Unknown& unknown : big.unknowns) {
    if (unknown.component == Component::yaw || unknown.component == Component::size) continue;
    unknown.lower *= factor;
    unknown.upper *= factor;
  }
  const auto& pulse = std::get<GaussianResponse>(scene.sensor.response.shape());
  big.sensor.response = ImpulseResponse(GaussianResponse{factor * pulse.sigma});
  big.sensor.bin_width *= factor;
  for (Zone& zone : big.sensor.zones) zone.time_zero *= factor;
  return big;
}

Scene moved(const Scene& scene, const Eigen::Vector3d& by) {
  Scene far = scene;
  far.T_world_sensor.translation() += by;
  for (Surface& surface : far.surfaces) surface.T_world_surface.translation() += by;
  far.hidden.placement.position += by;
  for (Unknown& unknown : far.unknowns) {
    const auto axis = static_cast<Eigen::Index>(unknown.component);
    if (axis > 2) continue;
    unknown.lower += by[axis];
    unknown.upper += by[axis];
  }
  return far;
}

PoseVector stated_pose(const Scene& scene) {
  return pose_of(stated_placements(scene), scene.unknowns);
}

HistogramCube fast_light(const Scene& scene) {
  return make_fast_model(scene, sensor_placement(scene))->three_bounce(stated_pose(scene));
}

HistogramCube reference_light(const Scene& scene) {
  return make_reference_renderer(scene, sensor_placement(scene))->three_bounce(stated_pose(scene));
}

double total(const HistogramCube& light) {
  return std::accumulate(light.values.begin(), light.values.end(), 0.0);
}

double relative_difference(const HistogramCube& got, const HistogramCube& want) {
  if (got.values.size() != want.values.size()) return std::numeric_limits<double>::infinity();
  double square = 0, size = 0;
  for (std::size_t i = 0; i < want.values.size(); ++i) {
    square += std::pow(got.values[i] - want.values[i], 2);
    size += std::pow(want.values[i], 2);
  }
  return std::sqrt(square / size);
}

Capture photon_capture(const Scene& scene, double photons, double background_ratio,
                       std::uint64_t seed) {
  LightBudget budget;
  budget.third_bounce_photons = photons;
  budget.background_ratio = background_ratio;
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  return make_capture(scene, *model, stated_pose(scene), budget, seed);
}

FitOptions without_empty_captures() {
  FitOptions options;
  options.empty_captures = 0;
  return options;
}

double mode_distance(const Scene& scene, const PoseMixture& posterior, const PoseVector& pose) {
  double least = std::nan("");
  for (const PoseMode& mode : posterior.modes) {
    const PoseVector d = pose_error(scene, mode.pose, pose);
    least = std::fmin(least, d.dot(mode.covariance.ldlt().solve(d)));
  }
  return least;
}

bool is_sound(const Scene& scene, const FitResult& result) {
  const PoseMixture& posterior = result.posterior;
  if (!posterior.mean.allFinite() || !posterior.covariance.allFinite()) return false;
  if (!(posterior.presence_probability >= 0 && posterior.presence_probability <= 1)) return false;
  for (const PoseMode& mode : posterior.modes) {
    if (!mode.pose.allFinite() || !mode.covariance.allFinite() || !(mode.weight >= 0)) return false;
    if (mode.pose.size() != static_cast<Eigen::Index>(scene.unknowns.size())) return false;
    // Scaled to correlations: the unknowns' units must not decide.
    const Eigen::VectorXd sigma = mode.covariance.diagonal().cwiseMax(0).cwiseSqrt();
    if (!(sigma.minCoeff() > 0)) return false;
    const Eigen::MatrixXd correlation =
        sigma.cwiseInverse().asDiagonal() * mode.covariance * sigma.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(correlation);
    if (eigen.eigenvalues().minCoeff() < -1e-9) return false;
  }
  return true;
}

StabilityMeasurement refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    const std::string text = error.what();
    const bool clear = text.find("accepted") != std::string::npos;
    return {clear && text.find('\n') == std::string::npos ? 0.0 : 1.0, text};
  }
  return {1, "not refused"};
}

}  // namespace blindcorner
