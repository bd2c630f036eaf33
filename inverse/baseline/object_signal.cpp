// SPDX-License-Identifier: Apache-2.0
#include "inverse/baseline/object_signal.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "inverse/likelihood/observation.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Sampling of the model that gives the static background. The background does not depend on it, so
/// that no sampling has to be searched for.
constexpr SamplingStep kAnySampling{2, 2, false};
/// Steps along the longest range when the search region is probed for its time gate, and most
/// probes: (5 + 1)^3. By judgement: both ends of the ranges are among the probes, where light is
/// earliest and latest except for curvature.
constexpr int kProbeSteps = 5;
constexpr int kMaxProbes = 216;
/// Standard deviations of a path that belong to the time gate: they hold 95 % of a normal
/// distribution and all of a uniform one (root of 3).
constexpr double kGateDeviations = 2;
/// Share of the pulse's energy that may lie before or behind the gate, by judgement: it is fitted
/// as background.
constexpr double kGateTail = 0.01;
/// Fewest bins without the object's light that the static background is fitted in: three for each
/// of its two unknowns, by judgement.
constexpr int kFewestBins = 6;

double square(double x) { return x * x; }

/// Largest variance of arrival times, s^2: that of the ways in and out by a lit spot of diameter D,
/// each way with two legs that are uniform over D, and that of the pulse's core.
double most_blur(const Scene& scene) {
  const double extent = RelaySetup(scene, sensor_placement(scene)).lit_extent();
  return 2 * square(2 * extent / kSpeedOfLight) / 12 + square(scene.sensor.response.core_sigma());
}

/// [bins] Whether light between the signal's earliest and latest arrival may reach a bin.
std::vector<bool> reached_bins(const Sensor& sensor, int zone, const ZoneSignal& signal) {
  std::vector<bool> reached(static_cast<std::size_t>(sensor.bins), false);
  const auto [before, behind] = sensor.response.support(kGateTail, signal.blur);
  const int wrap = sensor.wrap(zone);
  const int first = static_cast<int>(std::floor(signal.earliest + before / sensor.bin_width));
  const int last = static_cast<int>(std::ceil(signal.latest + behind / sensor.bin_width));
  for (int k = std::max(0, first); k <= last; ++k) {
    const int bin = wrap > 0 ? k % wrap : k;
    if (bin < sensor.bins) reached[static_cast<std::size_t>(bin)] = true;
  }
  return reached;
}

/// Scale of the static light and ambient counts per bin.
struct KnownLight {
  double direct = 1, ambient = 0;
};

/// Weighted least squares, over the given bins, of those of the two that are free.
KnownLight fit_known_light(const LinearUnknowns& linear, const std::vector<double>& counts,
                           const std::vector<double>& weight, const double* known,
                           const std::vector<int>& bins, double least_ambient) {
  KnownLight light{1, linear.ambient == LinearMode::fixed ? linear.fixed_ambient : 0};
  const bool free_direct = linear.direct != LinearMode::fixed;
  const bool free_ambient = linear.ambient != LinearMode::fixed;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (const int k : bins) {
    const auto i = static_cast<std::size_t>(k);
    const Eigen::Vector2d row(free_direct ? known[k] : 0.0, free_ambient ? 1.0 : 0.0);
    const double rest =
        counts[i] - (free_direct ? 0.0 : known[k]) - (free_ambient ? 0.0 : light.ambient);
    normal += weight[i] * row * row.transpose();
    right += weight[i] * rest * row;
  }
  const Eigen::Vector2d found = normal.completeOrthogonalDecomposition().solve(right);
  if (free_direct && normal(0, 0) > 0) light.direct = std::max(0.0, found[0]);
  if (free_ambient && normal(1, 1) > 0) light.ambient = std::max(least_ambient, found[1]);
  return light;
}

}  // namespace

std::size_t PositionGrid::size() const {
  std::size_t product = 1;
  for (const int count : counts) product *= static_cast<std::size_t>(count);
  return product;
}

std::vector<double> PositionGrid::at(std::size_t index) const {
  std::vector<double> point;
  for (std::size_t a = 0; a < counts.size(); ++a) {
    const auto count = static_cast<std::size_t>(counts[a]);
    point.push_back(first[a] + step[a] * static_cast<double>(index % count));
    index /= count;
  }
  return point;
}

PositionGrid position_grid(const Scene& scene, double spacing, int most) {
  PositionGrid grid;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].component <= Component::z) grid.unknowns.push_back(i);
  }
  for (bool fits = false; !fits; spacing *= 1.1) {
    grid.counts.clear();
    grid.first.clear();
    grid.step.clear();
    for (const std::size_t i : grid.unknowns) {
      const Unknown& unknown = scene.unknowns[i];
      const int steps = std::max(1, static_cast<int>(std::ceil(unknown.range() / spacing)));
      grid.counts.push_back(steps + 1);
      grid.first.push_back(unknown.lower);
      grid.step.push_back(unknown.range() / steps);
    }
    const std::size_t least = std::size_t{1} << grid.unknowns.size();
    fits = grid.size() <= std::max(least, static_cast<std::size_t>(most));
  }
  return grid;
}

PositionGrid cell_centers(const Scene& scene, int count) {
  PositionGrid grid;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    if (unknown.component > Component::z) continue;
    grid.unknowns.push_back(i);
    grid.counts.push_back(count);
    grid.step.push_back(unknown.range() / count);
    grid.first.push_back(unknown.lower + 0.5 * grid.step.back());
  }
  return grid;
}

PoseVector middle_of_prior(const Scene& scene) {
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    pose[static_cast<Eigen::Index>(i)] = prior_moments(scene, i).mean;
  }
  return pose;
}

Vector3d scattering_point(const Scene& scene, const PoseVector& pose) {
  const HiddenObject& object = scene.hidden;
  const Placement placement = place(object.placement, scene.unknowns, pose);
  return object_to_world(object.shape, object.anchor, placement).translation();
}

SignalScene::SignalScene(Scene scene)
    : scene_(std::move(scene)),
      transport_(make_scene_transport(scene_)),
      pulses_(scene_.sensor.response, scene_.sensor.bin_width, most_blur(scene_)),
      pulse_path_(kSpeedOfLight * std::sqrt(square(scene_.sensor.response.core_sigma()) +
                                            square(scene_.sensor.bin_width) / 12)) {
  if (object_count(scene_) > 1) {
    throw Error(scene_place(scene_) + ": hidden",
                "found " + std::to_string(object_count(scene_)) +
                    " objects, accepted by back-projection and multilateration: one");
  }
  const auto is_position = [](const Unknown& u) { return u.component <= Component::z; };
  if (std::ranges::none_of(scene_.unknowns, is_position)) {
    throw Error(scene_place(scene_) + ": unknowns",
                "found no position, accepted by back-projection and multilateration: x_m, y_m or "
                "z_m among them");
  }
}

double SignalScene::position(int zone, double path) const {
  const double time_zero = scene_.sensor.zones[static_cast<std::size_t>(zone)].time_zero;
  return (time_zero + path / kSpeedOfLight) / scene_.sensor.bin_width;
}

void SignalScene::find_gates(const RelayPaths& paths, std::vector<ZoneSignal>& signals) const {
  double widest = 0;
  for (const Unknown& u : scene_.unknowns) {
    if (u.component <= Component::z) widest = std::max(widest, u.range());
  }
  // Both ends of each range are probed: light from there is the earliest and the latest.
  const PositionGrid probes = position_grid(scene_, widest / kProbeSteps, kMaxProbes);
  std::vector<double> lit(signals.size(), 0);
  std::vector<PointPulse> pulses;
  PoseVector pose = middle_of_prior(scene_);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const std::vector<double> point = probes.at(i);
    for (std::size_t a = 0; a < point.size(); ++a) {
      pose[static_cast<Eigen::Index>(probes.unknowns[a])] = point[a];
    }
    paths.pulses(scattering_point(scene_, pose), false, pulses);
    for (std::size_t z = 0; z < signals.size(); ++z) {
      if (pulses[z].weight <= 0) continue;
      ZoneSignal& signal = signals[z];
      const int zone = static_cast<int>(z);
      const double spread = kGateDeviations * std::sqrt(pulses[z].variance);
      if (lit[z] == 0) {
        signal.earliest = std::numeric_limits<double>::max();
        signal.latest = -signal.earliest;
      }
      signal.earliest = std::min(signal.earliest, position(zone, pulses[z].path - spread));
      signal.latest = std::max(signal.latest, position(zone, pulses[z].path + spread));
      signal.blur += pulses[z].variance / square(kSpeedOfLight);
      ++lit[z];
    }
  }
  for (std::size_t z = 0; z < signals.size(); ++z) {
    signals[z].used = lit[z] > 0 && !scene_.sensor.zones[z].dead;
    if (lit[z] > 0) signals[z].blur /= lit[z];
  }
}

void SignalScene::take_off_known_light(const Capture& capture, const HistogramCube& known,
                                       const HistogramCube& error, int zone,
                                       ZoneSignal& signal) const {
  const Sensor& sensor = scene_.sensor;
  const auto bins = static_cast<std::size_t>(sensor.bins);
  const double exposures = capture.exposures_of(zone);
  signal.used = signal.used && exposures > 0;
  if (!signal.used) return;
  const double* measured = capture.counts.zone(zone);
  signal.counts.assign(measured, measured + bins);
  std::vector<double> live(bins, 1.0);
  if (sensor.pile_up_cycles > 0) {
    undo_pile_up(sensor.pile_up_cycles, measured, sensor.bins, signal.counts.data(), live.data());
  }
  const double dispersion = capture.dispersion.value_or(sensor.dispersion) / sensor.dispersion;
  signal.weight.assign(bins, 0.0);
  const int first = sensor.zones[static_cast<std::size_t>(zone)].first_valid_bin;
  std::vector<int> valid, outside;
  const std::vector<bool> reached = reached_bins(sensor, zone, signal);
  for (int k = first; k < sensor.valid_end(zone); ++k) {
    const auto i = static_cast<std::size_t>(k);
    // A bin without a count need not be dark: one photon in all exposures might have been expected.
    const double expected = std::max(measured[k], 1 / exposures);
    const double own = std::max(0.0, error.values.empty() ? 0.0 : error.zone(zone)[k]);
    const double variance =
        dispersion * count_variance(sensor, zone, expected) / (exposures * square(live[i])) +
        square(own * sensor.zones[static_cast<std::size_t>(zone)].gain);
    signal.weight[i] = 1 / variance;
    valid.push_back(k);
    if (!reached[i]) outside.push_back(k);
  }
  // Photon counts are never negative; counts that a sensor has processed may be.
  const double least_ambient =
      sensor.noise.counts_photons() ? 0.0 : -std::numeric_limits<double>::infinity();
  const bool enough = static_cast<int>(outside.size()) >= kFewestBins;
  const KnownLight light =
      fit_known_light(scene_.linear, signal.counts, signal.weight, known.zone(zone),
                      enough ? outside : valid, least_ambient);
  for (std::size_t k = 0; k < bins; ++k) {
    if (!reached[k]) signal.weight[k] = 0;
    signal.counts[k] = signal.weight[k] > 0
                           ? signal.counts[k] - light.direct * known.zone(zone)[k] - light.ambient
                           : 0.0;
  }
}

std::vector<ZoneSignal> SignalScene::extract(const Capture& capture,
                                             const RelayPaths& paths) const {
  check_capture(scene_, capture);
  std::vector<ZoneSignal> signals(static_cast<std::size_t>(scene_.sensor.zone_count()));
  find_gates(paths, signals);
  FastModelOptions options;
  options.sampling_step = kAnySampling;
  const auto model = make_fast_model(transport_, sensor_placement(scene_, &capture), options);
  const HistogramCube known = static_background(scene_, model->static_background());
  const HistogramCube error = total(model->background_error());
  for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
    take_off_known_light(capture, known, error, z, signals[static_cast<std::size_t>(z)]);
  }
  return signals;
}

void SignalScene::correlate(int zone, const ZoneSignal& signal, double position, double blur,
                            double& signal_sum, double& pulse_sum) const {
  const Sensor& sensor = scene_.sensor;
  const int length = unwrapped_bins(sensor);
  const auto [reach_first, reach_end] = pulses_.reach(position);
  const int first = std::clamp(reach_first, 0, length), end = std::clamp(reach_end, first, length);
  if (first == end) return;
  static thread_local std::vector<double> row;
  row.assign(static_cast<std::size_t>(end - first), 0.0);
  pulses_.add(row.data(), end - first, position - first, blur, 1.0);
  const int wrap = sensor.wrap(zone);
  for (int k = first; k < end; ++k) {
    const int bin = wrap > 0 ? k % wrap : k;
    if (bin >= sensor.bins) continue;
    const auto i = static_cast<std::size_t>(bin);
    const double pulse = row[static_cast<std::size_t>(k - first)];
    signal_sum += pulse * signal.counts[i] * signal.weight[i];
    pulse_sum += pulse * pulse * signal.weight[i];
  }
}

}  // namespace blindcorner
