// SPDX-License-Identifier: Apache-2.0
#include "pair_sum.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/visibility.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Energy that the tabulated pulse may lose at either end.
constexpr double kPulseTail = 1e-8;
/// Lobes are cut where they have fallen to exp(-5^2 / 2) = 4e-6 of their peak.
constexpr double kLobeCut = 5.0;
/// Cosines below this are rounding of single precision hits, not light.
constexpr double kLeastCosine = 1e-9;

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

/// Rays along each side of a patch that straddles a shadow's edge.
constexpr int kShadowRays = 4;

bool blocked(const Blockers& blockers, const Vector3d& from, const Vector3d& to) {
  return std::any_of(blockers.begin(), blockers.end(),
                     [&](const RayScene* bodies) { return bodies->blocked(from, to); });
}

/// What a point sees of a patch whose centre it does or does not see: five rays, and sixteen where
/// they disagree. A shadow of something that fits between five points of a patch is missed.
VisiblePart visible_part(const Vector3d& from, const RelayPatch& patch, bool center,
                         const Blockers& blockers) {
  const auto sees = [&](double a, double b) {
    return !blocked(blockers, from, patch.area_center + a * patch.half_u + b * patch.half_v);
  };
  // Corners a hair inside: the patch's own edge may be the surface's.
  constexpr double kCorner = 0.999;
  bool same = true;
  for (const double a : {-kCorner, kCorner}) {
    for (const double b : {-kCorner, kCorner}) same = same && sees(a, b) == center;
  }
  if (same) return {center ? 1.0 : 0.0, Vector3d::Zero()};
  VisiblePart part{0.0, Vector3d::Zero()};
  for (int i = 0; i < kShadowRays; ++i) {
    for (int j = 0; j < kShadowRays; ++j) {
      const double a = (2 * i + 1.0) / kShadowRays - 1;
      const double b = (2 * j + 1.0) / kShadowRays - 1;
      if (!sees(a, b)) continue;
      part.fraction += 1;
      part.shift += a * patch.half_u + b * patch.half_v;
    }
  }
  if (part.fraction > 0) part.shift /= part.fraction;
  part.fraction /= kShadowRays * kShadowRays;
  return part;
}

/// Takes away what the cell does not see. Where it sees the centres of all patches, or of none, no
/// shadow's edge is looked for.
void shade(const Vector3d& from, const std::vector<const WeightedPatch*>& ends,
           const Blockers& blockers, std::vector<Leg>& legs) {
  std::vector<char> center;
  for (const WeightedPatch* end : ends) {
    center.push_back(blocked(blockers, from, end->patch.area_center) ? 0 : 1);
  }
  const auto seen = static_cast<std::size_t>(std::count(center.begin(), center.end(), 1));
  if (seen == ends.size()) return;
  if (seen == 0) return legs.clear();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < legs.size(); ++i) {
    const VisiblePart part = visible_part(from, ends[i]->patch, center[i] != 0, blockers);
    if (part.fraction <= 0) continue;
    Leg leg = legs[i];
    leg.weight *= part.fraction;
    leg.length += (leg.direction + ends[i]->leg_direction).dot(part.shift);
    legs[kept++] = leg;
  }
  legs.resize(kept);
}

}  // namespace

FineAxis::FineAxis(const Sensor& sensor)
    : bins_(unwrapped_bins(sensor)),
      fine_(std::max(
          16, static_cast<int>(std::ceil(16 * sensor.bin_width / sensor.response.core_sigma())))) {
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

void FineAxis::convolve(const std::vector<double>& cells, double* row) const {
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

std::vector<Leg> legs_to(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches,
                         const Blockers& blockers, int surface, bool soften) {
  std::vector<Leg> legs;
  std::vector<const WeightedPatch*> ends;
  legs.reserve(patches.size());
  for (const WeightedPatch& p : patches) {
    if (surface >= 0 && p.patch.surface == surface) continue;
    const Vector3d way = p.patch.center - cell.center;
    const double length = way.norm();
    Leg leg;
    leg.direction = way / length;
    leg.cosine = leg.direction.dot(cell.normal);
    const double relay_cosine = -leg.direction.dot(p.patch.normal);
    if (!(leg.cosine > kLeastCosine && relay_cosine > kLeastCosine)) continue;
    const double area = 4 * p.patch.half_u.cross(p.patch.half_v).norm();
    leg.weight = p.weight * relay_cosine / (length * length + (soften ? area / kPi : 0.0));
    leg.length = p.leg + length;
    legs.push_back(leg);
    if (!blockers.empty()) ends.push_back(&p);
  }
  if (!blockers.empty()) shade(cell.center, ends, blockers, legs);
  return legs;
}

/// Shares weights between the two nearest cells of one zone's fine axis.
struct PairSum::Deposit {
  std::vector<double>& row;
  double start;
  double scale;

  bool holds(double length) const {
    const double position = start + scale * length;
    return position >= 0 && position < static_cast<double>(row.size()) - 2;
  }
  void add_all(double weight, double length, const std::vector<double>& weights,
               const std::vector<double>& lengths) const {
    const double first = start + scale * length;
    double* cells = row.data();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double position = first + scale * lengths[i];
      const auto at = static_cast<std::ptrdiff_t>(position);
      const double later = (position - static_cast<double>(at)) * weight * weights[i];
      cells[at] += weight * weights[i] - later;
      cells[at + 1] += later;
    }
  }
  void operator()(double weight, double length) const {
    const double position = start + scale * length;
    if (!holds(length)) return;
    const auto at = static_cast<std::size_t>(position);
    const double fraction = position - static_cast<double>(at);
    row[at] += weight * (1 - fraction);
    row[at + 1] += weight * fraction;
  }
};

PairSum::PairSum(const Sensor& sensor)
    : sensor_(sensor),
      axis_(sensor),
      cells_per_metre_(axis_.cells_per_bin() / (kSpeedOfLight * sensor.bin_width)),
      light_(static_cast<std::size_t>(sensor.zone_count()),
             std::vector<double>(static_cast<std::size_t>(axis_.cells()), 0.0)) {}

PairSum::Deposit PairSum::deposit(int zone) {
  const auto z = static_cast<std::size_t>(zone);
  const double time_zero = sensor_.zones[z].time_zero / sensor_.bin_width;
  return {light_[z], axis_.origin() + time_zero * axis_.cells_per_bin(), cells_per_metre_};
}

void PairSum::add(int zone, double weight, double length) { deposit(zone)(weight, length); }

void PairSum::add_lambertian(int zone, double scattered, const std::vector<Leg>& in,
                             const std::vector<Leg>& out) {
  if (in.empty()) return;
  const Deposit put = deposit(zone);
  // Side by side in memory, and without a range check where the longest and the shortest pass it.
  std::vector<double> weights, lengths;
  for (const Leg& p : in) {
    weights.push_back(p.weight * p.cosine);
    lengths.push_back(p.length);
  }
  const auto [shortest, longest] = std::minmax_element(lengths.begin(), lengths.end());
  for (const Leg& r : out) {
    const double out_weight = scattered * r.weight * r.cosine;
    if (put.holds(r.length + *shortest) && put.holds(r.length + *longest)) {
      put.add_all(out_weight, r.length, weights, lengths);
    } else {
      for (std::size_t i = 0; i < in.size(); ++i) {
        put(out_weight * weights[i], r.length + lengths[i]);
      }
    }
  }
}

void PairSum::add_retroreflective(int zone, double area, double albedo, double sigma,
                                  const std::vector<Leg>& in, const std::vector<Leg>& out) {
  const Deposit put = deposit(zone);
  const double sigma2 = sigma * sigma;
  const double reach = kLobeCut * sigma;
  const double peak = area * albedo / (2 * kPi * sigma2);
  const std::vector<Run> runs = runs_of(in);
  for (const Leg& r : out) {
    for (const Run& run : runs) {
      if ((run.center - r.direction).norm() > run.radius + reach) continue;
      for (std::size_t i = run.begin; i < run.end; ++i) {
        const Leg& p = in[i];
        const double chord = (p.direction - r.direction).squaredNorm();
        if (chord > reach * reach) continue;
        put(peak * r.weight * p.weight * std::exp(-0.5 * chord / sigma2) *
                std::sqrt(p.cosine * r.cosine),
            r.length + p.length);
      }
    }
  }
}

void PairSum::finish(HistogramCube& cube) const {
  std::vector<double> unwrapped(static_cast<std::size_t>(unwrapped_bins(sensor_)));
  for (int z = 0; z < sensor_.zone_count(); ++z) {
    std::fill(unwrapped.begin(), unwrapped.end(), 0.0);
    axis_.convolve(light_[static_cast<std::size_t>(z)], unwrapped.data());
    fold(sensor_, z, unwrapped.data(), static_cast<int>(unwrapped.size()), cube.zone(z));
  }
}

}  // namespace blindcorner
