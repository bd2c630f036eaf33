// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/pair_sum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "blindcorner/forward/constants.h"
#include "forward/relay/visibility.h"
#include "forward/sensor/least_pulse.h"
#include "forward/support/multiversion.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Lobes are cut here, in standard deviations: exp(-4.5^2 / 2) = 4e-5 of the light is beyond.
constexpr double kLobeCut = 4.5;
/// Cosines below this are rounding of single precision hits, not light.
constexpr double kMinCosine = 1e-9;

/// Consecutive legs, with a ball about their directions: lobes skip the legs that are out of reach.
struct Run {
  std::size_t begin, end;
  Vector3d center;
  double radius;
};

std::vector<Run> runs_of(const std::vector<Leg>& legs) {
  constexpr std::size_t kRun = 8;  // by judgement: short enough to be narrow, long enough to save
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

/// Ways into a retroreflecting cell side by side in memory, and what a lobe makes of each: light
/// for two neighbouring cells of the time axis.
struct LobeArrays {
  std::vector<double> x, y, z;  ///< direction
  std::vector<double> weight, length;
  std::vector<double> early, late;
  std::vector<std::int64_t> cell;

  static constexpr std::array kIn = {&LobeArrays::x, &LobeArrays::y, &LobeArrays::z,
                                     &LobeArrays::weight, &LobeArrays::length};
  void clear() {
    for (const auto values : kIn) (this->*values).clear();
  }
  void push_back(const Leg& leg) {
    x.push_back(leg.direction.x());
    y.push_back(leg.direction.y());
    z.push_back(leg.direction.z());
    weight.push_back(leg.weight * std::sqrt(leg.cosine));
    length.push_back(leg.length);
  }
  void append(const LobeArrays& other, const Run& run) {
    for (const auto values : kIn) {
      const double* from = (other.*values).data();
      (this->*values).insert((this->*values).end(), from + run.begin, from + run.end);
    }
  }
};

/// exp(x) for x in [-kLobeCut^2 / 2, 0]: the power series of exp(x / 16), whose rest is below
/// (10.2 / 16)^12 / 12! = 1e-11, squared four times. Plain arithmetic, so that loops vectorise.
inline double lobe_exponential(double x) {
  constexpr std::array<double, 12> kSeries{
      1.0,       1.0,        1.0 / 2,     1.0 / 6,      1.0 / 24,      1.0 / 120,
      1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800};
  const double y = x / 16;
  double e = kSeries[11];
  for (std::size_t i = 11; i-- > 0;) e = e * y + kSeries[i];
  e *= e;
  e *= e;
  e *= e;
  return e * e;
}

/// A way out of a retroreflecting cell, and its lobe.
struct Lobe {
  double x, y, z;  ///< direction
  double scale;    ///< of the weights
  double inverse;  ///< -1 / (2 sigma^2)
  double reach2;   ///< of the chord, squared
};

/// Pairs one way out, whose own place on the time axis is `first`, with all ways in. Light from
/// before or after the axis of `cells` cells is dropped.
BLINDCORNER_MULTIVERSION
void light_of_lobe(LobeArrays& in, const Lobe& lobe, double first, double cells_per_metre,
                   std::size_t cells) {
  const std::size_t count = in.x.size();
  in.early.resize(count);
  in.late.resize(count);
  in.cell.resize(count);
  const double* x = in.x.data();
  const double* y = in.y.data();
  const double* z = in.z.data();
  const double* w = in.weight.data();
  const double* length = in.length.data();
  double* early = in.early.data();
  double* late = in.late.data();
  std::int64_t* cell = in.cell.data();
  const auto last = static_cast<double>(cells) - 2;
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < count; ++i) {
    const double dx = x[i] - lobe.x;
    const double dy = y[i] - lobe.y;
    const double dz = z[i] - lobe.z;
    const double chord2 = dx * dx + dy * dy + dz * dz;
    const double inside = lobe.scale * w[i] * lobe_exponential(lobe.inverse * chord2);
    const double position = first + cells_per_metre * length[i];
    const bool counts = chord2 <= lobe.reach2 && position >= 0 && position < last;
    const double weight = counts ? inside : 0.0;
    const auto at = static_cast<std::int64_t>(counts ? position : 0.0);
    late[i] = weight * (position - static_cast<double>(at));
    early[i] = weight - late[i];
    cell[i] = at;
  }
}

/// Rays along each side of a patch that straddles a shadow's edge. The share of the patch that is
/// seen is then known to an eighth, and such patches are few.
constexpr int kShadowRays = 4;

bool blocked(const Blockers& blockers, const Vector3d& from, const Vector3d& to) {
  return std::any_of(blockers.begin(), blockers.end(),
                     [&](const RayScene* bodies) { return bodies->blocked(from, to); });
}

/// The part of a patch that a point sees. `center` tells whether it sees the centre. Five rays
/// decide, and sixteen if the five disagree. The shadow of a body that fits between the five points
/// of a patch is missed.
VisiblePart visible_part(const Vector3d& from, const RelayPatch& patch, bool center,
                         const Blockers& blockers) {
  const auto sees = [&](double a, double b) {
    return !blocked(blockers, from, patch.area_center + a * patch.half_u + b * patch.half_v);
  };
  // Corners lie slightly inside, because the patch's own edge may be the surface's.
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

/// Takes away the light that the cell does not see. If it sees the centres of all patches, or of
/// none, no shadow's edge is searched for.
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
      // A cell is a sixteenth of a bin or, if that is less, of the pulse's width (at least
      // kMinPulseBins).
      fine_(static_cast<int>(std::ceil(
          16 / std::clamp(sensor.response.core_sigma() / sensor.bin_width, kMinPulseBins, 1.0)))) {
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
    if (!(leg.cosine > kMinCosine && relay_cosine > kMinCosine)) continue;
    const double area = 4 * p.patch.half_u.cross(p.patch.half_v).norm();
    leg.weight = p.weight * relay_cosine / (length * length + (soften ? area / kPi : 0.0));
    leg.length = p.leg + length;
    leg.patch = static_cast<std::size_t>(&p - patches.data());
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
  /// Adds `count` ways that go on from a leg of `length`, without a range check.
  void add_all(double weight, double length, const double* weights, const double* lengths,
               std::size_t count) const {
    const double first = start + scale * length;
    double* cells = row.data();
    for (std::size_t i = 0; i < count; ++i) {
      const double position = first + scale * lengths[i];
      const auto at = static_cast<std::ptrdiff_t>(position);
      const double later = (position - static_cast<double>(at)) * weight * weights[i];
      cells[at] += weight * weights[i] - later;
      cells[at + 1] += later;
    }
  }
  void add(const LobeArrays& light) const {
    double* cells = row.data();
    for (std::size_t i = 0; i < light.cell.size(); ++i) {
      cells[light.cell[i]] += light.early[i];
      cells[light.cell[i] + 1] += light.late[i];
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
  // The ways in, side by side in memory.
  std::vector<double> weights, lengths;
  for (const Leg& p : in) {
    weights.push_back(p.weight * p.cosine);
    lengths.push_back(p.length);
  }
  const auto [shortest, longest] = std::minmax_element(lengths.begin(), lengths.end());
  for (const Leg& r : out) {
    const double out_weight = scattered * r.weight * r.cosine;
    if (put.holds(r.length + *shortest) && put.holds(r.length + *longest)) {
      put.add_all(out_weight, r.length, weights.data(), lengths.data(), in.size());
    } else {
      for (std::size_t i = 0; i < in.size(); ++i) {
        put(out_weight * weights[i], r.length + lengths[i]);
      }
    }
  }
}

void PairSum::add_brdf(int zone, double area_albedo, const Brdf& brdf, const Vector3d& normal,
                       const std::vector<Leg>& in, const std::vector<Leg>& out) {
  const Deposit put = deposit(zone);
  for (const Leg& r : out) {
    const double scale = area_albedo * r.weight * r.cosine;
    for (const Leg& p : in) {
      put(scale * p.weight * p.cosine * brdf.value(normal, p.direction, r.direction),
          p.length + r.length);
    }
  }
}

void PairSum::add_retroreflective(int zone, double area, double albedo, double sigma,
                                  const std::vector<Leg>& in, const std::vector<Leg>& out) {
  const Deposit put = deposit(zone);
  const double reach = kLobeCut * sigma;
  const double peak = area * albedo / (2 * kPi * sigma * sigma);
  const std::vector<Run> runs = runs_of(in);
  LobeArrays all, near;
  for (const Leg& leg : in) all.push_back(leg);
  for (const Run& ways_out : runs_of(out)) {
    near.clear();
    for (const Run& run : runs) {
      const double most = run.radius + ways_out.radius + reach;
      if ((run.center - ways_out.center).squaredNorm() <= most * most) near.append(all, run);
    }
    for (std::size_t o = ways_out.begin; o < ways_out.end; ++o) {
      const Leg& r = out[o];
      const Vector3d& d = r.direction;
      const double scale = peak * r.weight * std::sqrt(r.cosine);
      light_of_lobe(near, {d.x(), d.y(), d.z(), scale, -0.5 / (sigma * sigma), reach * reach},
                    put.start + put.scale * r.length, put.scale, put.row.size());
      put.add(near);
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
