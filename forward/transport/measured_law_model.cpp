// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/measured_law_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/relay/ray_scene.h"
#include "forward/relay/relay_setup.h"
#include "forward/sensor/pulse_table.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// A law goes to zero at right angles to its axis and to infinity at its spot. Below these values
/// of cosine and distance it stays constant. By judgement: nobody measures within a degree of the
/// surface, or nearer than objects are large.
constexpr double kMinCosine = 0.02;
constexpr double kMinDistance = 0.05;  // m

class MeasuredLawModel final : public ForwardModel {
 public:
  MeasuredLawModel(const Scene& scene, const SensorPlacement& placement, double extra_sigma)
      : scene_(scene),
        law_(std::get<MeasuredLawMaterial>(scene.hidden.material)),
        setup_(scene_, placement),
        pulses_(scene.sensor.response, scene.sensor.bin_width, extra_sigma * extra_sigma),
        blur_(extra_sigma * extra_sigma),
        direct_(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins) {
    if (!setup_.uses_points()) throw measured_law_without_points(scene);
    for (int z = 0; z < scene.sensor.zone_count(); ++z) {
      spots_.push_back({});
      if (scene.sensor.zones[static_cast<std::size_t>(z)].dead) continue;
      const WeightedPatch seen = setup_.seen(z, {}).front();
      const auto [across, up] = surface_axes(seen.patch.normal);
      const Vector3d axis = seen.patch.normal + law_.axis_across * across + law_.axis_up * up;
      spots_.back() = {seen.patch.center, axis.normalized(),
                       scene.sensor.path_origin == PathOrigin::sensor ? seen.leg : 0.0};
    }
    plan_ = make_plan(scene, setup_.relay_points(), 0.0);
    plan_.occluders.clear();
    plan_.decisions.clear();
    constexpr double kUnknown = std::numeric_limits<double>::infinity();
    plan_.decide({Term::patch_pairs, "three-bounce transport", false,
                  "the object's brightness follows a measured law of cosine and distance",
                  kUnknown});
    plan_.decide({Term::occlusion, "occlusion between relay and object", false,
                  "what is hidden on the way is in the measured law", kUnknown});
  }

  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    const Sensor& sensor = scene_.sensor;
    const Vector3d q = placement_of(pose).position;
    out = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    std::vector<double> row(static_cast<std::size_t>(unwrapped_bins(sensor)));
    for (int z = 0; z < sensor.zone_count(); ++z) {
      const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
      if (zone.dead) continue;
      const Spot& spot = spots_[static_cast<std::size_t>(z)];
      const Vector3d way = q - spot.point;
      const double distance = std::max(way.norm(), kMinDistance);
      const double cosine = std::max(way.dot(spot.axis) / distance, kMinCosine);
      const double light = scene_.hidden.albedo * std::pow(cosine, law_.cosine_exponent) *
                           std::pow(distance, -law_.distance_exponent);
      std::fill(row.begin(), row.end(), 0.0);
      pulses_.add(row.data(), static_cast<int>(row.size()),
                  (zone.time_zero + 2 * (spot.leg + distance) / kSpeedOfLight) / sensor.bin_width,
                  blur_, light);
      fold(sensor, z, row.data(), static_cast<int>(row.size()), out.zone(z));
    }
  }

  const HistogramCube& static_background() const override { return direct_; }
  const TransportPlan& plan() const override { return plan_; }

 private:
  struct Spot {
    Vector3d point = Vector3d::Zero();
    Vector3d axis = Vector3d::UnitX();  ///< of the law
    double leg = 0;                     ///< m, sensor to spot
  };

  Placement placement_of(const PoseVector& pose) const {
    return place(scene_.hidden.placement, scene_.unknowns, pose);
  }

  Scene scene_;
  MeasuredLawMaterial law_;
  RelaySetup setup_;
  PulseTable pulses_;
  double blur_;
  HistogramCube direct_;
  std::vector<Spot> spots_;
  TransportPlan plan_;
};

}  // namespace

std::unique_ptr<ForwardModel> make_measured_law_model(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      double extra_pulse_sigma) {
  return std::make_unique<MeasuredLawModel>(scene, placement, extra_pulse_sigma);
}

}  // namespace blindcorner
