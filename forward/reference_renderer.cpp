// SPDX-License-Identifier: Apache-2.0
/// The three-bounce sum of the design, pair by pair.
#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/forward_model.h"
#include "measured_law_model.h"
#include "relay_setup.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Energy that the tabulated pulse may lose at either end.
constexpr double kPulseTail = 1e-8;
/// Lobes are cut where they have fallen to exp(-5^2 / 2) = 4e-6 of their peak.
constexpr double kLobeCut = 5.0;
/// Lit cells that meet a lobe are at most this share of its footprint's sigma wide.
constexpr double kLobeCell = 0.8;

/// Light is first collected on a fine time axis, `kFine` cells a bin, each pair shared linearly
/// between two cells, and convolved with the pulse at the end. Sharing adds a variance of at most
/// a quarter of a cell squared: below 1e-3 of the pulse's.
class FineAxis {
 public:
  FineAxis(const Sensor& sensor)
      : bins_(unwrapped_bins(sensor)),
        fine_(std::max(16, static_cast<int>(
                               std::ceil(16 * sensor.bin_width / sensor.response.core_sigma())))) {
    const auto [early, late] = sensor.response.support(kPulseTail);
    first_ = static_cast<int>(std::floor(early / sensor.bin_width)) - 1;
    length_ = static_cast<int>(std::ceil(late / sensor.bin_width)) + 1 - first_;
    margin_ = length_;
    for (int phase = 0; phase < fine_; ++phase) {
      for (int k = 0; k < length_; ++k) {
        const double edge = (first_ + k - static_cast<double>(phase) / fine_) * sensor.bin_width;
        pulse_.push_back(sensor.response.cumulative(edge + sensor.bin_width) -
                         sensor.response.cumulative(edge));
      }
    }
  }

  int cells() const { return (bins_ + 2 * margin_) * fine_ + 1; }
  double scale() const { return fine_; }  ///< cells per bin
  double origin() const { return margin_ * fine_; }

  void convolve(const std::vector<double>& cells, double* row) const {
    for (int bin = -margin_; bin < bins_ + margin_; ++bin) {
      for (int phase = 0; phase < fine_; ++phase) {
        const double light = cells[static_cast<std::size_t>((bin + margin_) * fine_ + phase)];
        if (light == 0) continue;
        const double* pulse = pulse_.data() + static_cast<std::ptrdiff_t>(phase) * length_;
        const int begin = std::max(0, -(bin + first_));
        const int end = std::min(length_, bins_ - bin - first_);
        for (int k = begin; k < end; ++k) row[bin + first_ + k] += light * pulse[k];
      }
    }
  }

 private:
  int bins_, fine_;
  int first_ = 0, length_ = 0, margin_ = 0;
  std::vector<double> pulse_;  // [phase][bin]
};

/// Light between one object point and one relay point.
struct Leg {
  double weight = 0;                      ///< without the cosine at the object
  double cosine = 0;                      ///< at the object
  double length = 0;                      ///< outer and inner leg, in cells of the fine axis
  Vector3d direction = Vector3d::Zero();  ///< from the object point, unit
};

/// Consecutive legs whose directions lie in a ball: lobes skip whole runs.
struct Run {
  std::size_t begin, end;
  Vector3d center;
  double radius;
};

std::vector<Run> runs_of(const std::vector<Leg>& legs) {
  constexpr std::size_t kRun = 32;
  std::vector<Run> runs;
  for (std::size_t begin = 0; begin < legs.size(); begin += kRun) {
    Run run{begin, std::min(begin + kRun, legs.size()), Vector3d::Zero(), 0.0};
    for (std::size_t i = run.begin; i < run.end; ++i) run.center += legs[i].direction;
    run.center /= static_cast<double>(run.end - run.begin);
    for (std::size_t i = run.begin; i < run.end; ++i) {
      run.radius = std::max(run.radius, (legs[i].direction - run.center).norm());
    }
    runs.push_back(run);
  }
  return runs;
}

class ReferenceRenderer final : public ForwardModel {
 public:
  ReferenceRenderer(const Scene& scene, const SensorPlacement& placement,
                    const ReferenceOptions& options)
      : scene_(scene),
        options_(options),
        setup_(scene_, placement),
        axis_(scene_.sensor),
        plan_(make_plan(scene_, setup_.relay_points(), setup_.lit_extent())) {
    const PulseTable pulses(scene_.sensor.response, scene_.sensor.bin_width,
                            std::pow(scene_.sensor.response.core_sigma(), 2), kPulseTail);
    direct_ = setup_.direct_return(pulses, 4 * options_.zone_divisions, false);
    RelaySampling sampling;
    sampling.divisions = options_.zone_divisions;
    for (int z = 0; z < scene_.sensor.zone_count(); ++z) {
      const bool dead = scene_.sensor.zones[static_cast<std::size_t>(z)].dead;
      seen_.push_back(dead ? std::vector<WeightedPatch>{} : setup_.seen(z, sampling));
    }
  }

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override;
  const HistogramCube& direct_return() const override { return direct_; }
  const TransportPlan& plan() const override { return plan_; }

 private:
  std::vector<Leg> legs(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches) const;
  RelaySampling lit_sampling(const Vector3d& object) const;

  Scene scene_;
  ReferenceOptions options_;
  RelaySetup setup_;
  FineAxis axis_;
  TransportPlan plan_;
  HistogramCube direct_;
  std::vector<std::vector<WeightedPatch>> seen_;
};

std::vector<Leg> ReferenceRenderer::legs(const SurfaceCell& cell,
                                         const std::vector<WeightedPatch>& patches) const {
  const double cells_per_metre = axis_.scale() / (kSpeedOfLight * scene_.sensor.bin_width);
  std::vector<Leg> legs;
  legs.reserve(patches.size());
  for (const WeightedPatch& p : patches) {
    const Vector3d way = p.patch.center - cell.center;
    const double length = way.norm();
    Leg leg;
    leg.direction = way / length;
    leg.cosine = leg.direction.dot(cell.normal);
    const double relay_cosine = -leg.direction.dot(p.patch.normal);
    if (leg.cosine <= 0 || relay_cosine <= 0) continue;
    if (!plan_.occluders.empty() && setup_.occluder_rays().blocked(cell.center, p.patch.center)) {
      continue;
    }
    leg.weight = p.weight * relay_cosine / (length * length);
    leg.length = (p.leg + length) * cells_per_metre;
    legs.push_back(leg);
  }
  return legs;
}

RelaySampling ReferenceRenderer::lit_sampling(const Vector3d& object) const {
  RelaySampling sampling;
  sampling.divisions = options_.field_divisions;
  if (const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene_.hidden.material)) {
    // Lit cells must be small against the lobe's footprint.
    const double sigma = retro->lobe_sigma;
    sampling.split = [object, sigma](const RelayPatch& patch) {
      const double u = patch.half_u.norm();
      const double v = patch.half_v.norm();
      const double most = 0.5 * kLobeCell * sigma * (patch.center - object).norm();
      return std::max(u, v) <= most ? 0 : (u > v ? 1 : 2);
    };
  }
  return sampling;
}

void ReferenceRenderer::three_bounce(const PoseVector& pose, HistogramCube& out) const {
  const Sensor& sensor = scene_.sensor;
  const HiddenObject& hidden = scene_.hidden;
  out = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  const Placement placement = place(hidden.placement, scene_.unknowns, pose);
  const Transform T = object_to_world(hidden.shape, hidden.anchor, placement);
  const auto cells =
      divide(hidden.shape, T, placement.size, options_.object_edge, options_.object_divisions);
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&hidden.material);
  const bool confocal = sensor.illumination == Illumination::confocal;
  const RelaySampling sampling = lit_sampling(T.translation());
  const std::vector<WeightedPatch> lit =
      confocal ? std::vector<WeightedPatch>{} : setup_.lit(sampling);

  const int zones = sensor.zone_count();
  std::vector<std::vector<double>> light(static_cast<std::size_t>(zones));
  for (auto& row : light) row.assign(static_cast<std::size_t>(axis_.cells()), 0.0);

  std::vector<std::vector<WeightedPatch>> lit_by_zone(static_cast<std::size_t>(zones));
  for (int z = 0; z < zones && confocal; ++z) {
    if (sensor.zones[static_cast<std::size_t>(z)].dead) continue;
    lit_by_zone[static_cast<std::size_t>(z)] = setup_.lit_by_zone(z, sampling);
  }
  for (const SurfaceCell& cell : cells) {
    const std::vector<Leg> shared_in = confocal ? std::vector<Leg>{} : legs(cell, lit);
    if (!confocal && shared_in.empty()) continue;
    const std::vector<Run> shared_runs =
        retro != nullptr && !confocal ? runs_of(shared_in) : std::vector<Run>{};
    for (int z = 0; z < zones; ++z) {
      const auto zone = static_cast<std::size_t>(z);
      if (sensor.zones[zone].dead) continue;
      const std::vector<Leg> out_legs = legs(cell, seen_[zone]);
      if (out_legs.empty()) continue;
      const std::vector<Leg> own_in = confocal ? legs(cell, lit_by_zone[zone]) : std::vector<Leg>{};
      const std::vector<Leg>& in_legs = confocal ? own_in : shared_in;
      const double start =
          axis_.origin() + sensor.zones[zone].time_zero / sensor.bin_width * axis_.scale();
      std::vector<double>& row = light[zone];
      const double last = static_cast<double>(row.size()) - 2;
      const auto deposit = [&](double weight, double position) {
        if (!(position >= 0 && position < last)) return;
        const auto at = static_cast<std::size_t>(position);
        const double fraction = position - static_cast<double>(at);
        row[at] += weight * (1 - fraction);
        row[at + 1] += weight * fraction;
      };
      if (retro == nullptr) {
        const double scattered = cell.area * hidden.albedo / kPi;
        for (const Leg& r : out_legs) {
          const double out_weight = scattered * r.weight * r.cosine;
          const double at = start + r.length;
          for (const Leg& p : in_legs) deposit(out_weight * p.weight * p.cosine, at + p.length);
        }
        continue;
      }
      // f = rho G(alpha; sigma) / sqrt(cos_i cos_o), times both cosines. In chords of the unit
      // sphere, alpha's Gaussian is normalised exactly.
      const double sigma2 = retro->lobe_sigma * retro->lobe_sigma;
      const double reach = kLobeCut * retro->lobe_sigma;
      const double peak = cell.area * hidden.albedo / (2 * kPi * sigma2);
      const std::vector<Run> own_runs = confocal ? runs_of(in_legs) : std::vector<Run>{};
      for (const Leg& r : out_legs) {
        for (const Run& run : confocal ? own_runs : shared_runs) {
          if ((run.center - r.direction).norm() > run.radius + reach) continue;
          for (std::size_t i = run.begin; i < run.end; ++i) {
            const Leg& p = in_legs[i];
            const double chord = (p.direction - r.direction).squaredNorm();
            if (chord > reach * reach) continue;
            deposit(peak * r.weight * p.weight * std::exp(-0.5 * chord / sigma2) *
                        std::sqrt(p.cosine * r.cosine),
                    start + r.length + p.length);
          }
        }
      }
    }
  }
  std::vector<double> unwrapped(static_cast<std::size_t>(unwrapped_bins(sensor)));
  for (int z = 0; z < zones; ++z) {
    std::fill(unwrapped.begin(), unwrapped.end(), 0.0);
    axis_.convolve(light[static_cast<std::size_t>(z)], unwrapped.data());
    fold(sensor, z, unwrapped.data(), static_cast<int>(unwrapped.size()), out.zone(z));
  }
}

}  // namespace

void ReferenceOptions::validate() const {
  if (zone_divisions < 1) throw Error("ReferenceOptions.zone_divisions", "accepted: at least 1");
  if (field_divisions < 1) throw Error("ReferenceOptions.field_divisions", "accepted: at least 1");
  if (object_divisions < 1)
    throw Error("ReferenceOptions.object_divisions", "accepted: at least 1");
  if (!(object_edge > 0)) throw Error("ReferenceOptions.object_edge", "accepted: above 0 m");
}

std::unique_ptr<ForwardModel> make_reference_renderer(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      const ReferenceOptions& options) {
  options.validate();
  if (std::holds_alternative<MeasuredLawMaterial>(scene.hidden.material)) {
    return make_measured_law_model(scene, placement, 0.0);
  }
  return std::make_unique<ReferenceRenderer>(scene, placement, options);
}

}  // namespace blindcorner
