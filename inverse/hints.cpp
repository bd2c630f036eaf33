// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/hints.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "blindcorner/forward/constants.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "forward/relay/relay_setup.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Places along each unknown coordinate, by judgement: 729 for three coordinates, in the middles of
/// ninths of the ranges.
constexpr int kLattice = 9;
/// Cells along each side of a zone and of the lit field, by judgement. The nearest and the farthest
/// centres of these cells count.
constexpr int kZoneCells = 2, kFieldCells = 6;
/// A share of the search region that is worth a sentence: by judgement.
constexpr double kWorthSaying = 0.02;
/// A share above this is called all: what is missing is less than half a per cent, which a sentence
/// would round away.
constexpr double kAll = 0.995;
/// Half width of a pulse in standard deviations of its core. A place counts as unseen only if at
/// least 98 % of its light misses the bins.
constexpr double kPulse = 2;
/// A deviance this many standard deviations off, and this many times the expected one, is not a
/// matter of details: the wrong scenes of the stability table stay below 30.
constexpr double kFarOff = 30, kManyTimes = 2;
/// If the counts differ from the model's by more than this factor, the brightness is wrong and not
/// the shape. By judgement.
constexpr double kOtherBrightness = 1.15;

/// Pieces of the relay that one zone or all zones see, or that are lit for them.
using Patches = std::vector<WeightedPatch>;

/// The shortest and the longest way to a place from the light or the sensor, by way of the patches
/// that face the place.
struct Legs {
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;

  bool any() const { return longest > 0; }
};

Legs legs_to(const Patches& patches, const Vector3d& place, double way) {
  Legs legs;
  for (const WeightedPatch& p : patches) {
    const Vector3d out = place - p.patch.center;
    if (out.dot(p.patch.normal) <= 0) continue;
    const double path = way * p.leg + out.norm();
    legs.shortest = std::min(legs.shortest, path);
    legs.longest = std::max(legs.longest, path);
  }
  return legs;
}

/// The relay as one sensor placement lights and sees it.
class SeenRelay {
 public:
  SeenRelay(const Scene& scene, const SensorPlacement& placement)
      : scene_(scene), setup_(scene, placement) {
    const bool by_zone =
        scene.sensor.illumination == Illumination::confocal || setup_.uses_points();
    RelaySampling field;
    field.divisions = kFieldCells;
    field.with_radiance = false;
    if (!by_zone) lit_ = {setup_.lit(field)};
    RelaySampling zone = field;
    zone.divisions = kZoneCells;
    for (int z = 0; z < scene.sensor.zone_count(); ++z) {
      const bool dead = scene.sensor.zones[static_cast<std::size_t>(z)].dead;
      seen_.push_back(dead ? Patches{} : setup_.seen(z, zone));
      if (by_zone) lit_.push_back(dead ? Patches{} : setup_.lit_by_zone(z, zone));
    }
    std::set<int> surfaces;
    for (const Patches& patches : seen_) {
      for (const WeightedPatch& p : patches) surfaces.insert(p.patch.surface);
    }
    for (const int s : surfaces) {
      if (s < 0) continue;
      names_ += (names_.empty() ? "" : ", ") + scene.surfaces[static_cast<std::size_t>(s)].name;
    }
  }

  const std::string& names() const { return names_; }

  /// Adds `share` to the reason why a place is unseen, if there is one. `radius` is that of the
  /// body about the place, m.
  void judge(const Vector3d& place, double radius, double share, RegionReach& reach) const {
    const Sensor& sensor = scene_.sensor;
    bool faced = false, late = false;
    const double pulse = kPulse * sensor.response.core_sigma();
    Legs shared;
    if (lit_.size() == 1) shared = legs_to(lit_.front(), place, 1);
    for (int z = 0; z < sensor.zone_count(); ++z) {
      const auto i = static_cast<std::size_t>(z);
      const Legs in = lit_.size() == 1 ? shared : legs_to(lit_[i], place, 1);
      const Legs out = legs_to(seen_[i], place, 1);
      if (!in.any() || !out.any()) continue;
      faced = true;
      if (sensor.wrap(z) > 0) return;  // late light wraps to early bins
      const auto bin_of = [&](double path, double shift) {
        return (sensor.zones[i].time_zero + path / kSpeedOfLight + shift) / sensor.bin_width;
      };
      const double first = bin_of(in.shortest + out.shortest - 2 * radius, -pulse);
      const double last = bin_of(in.longest + out.longest + 2 * radius, pulse);
      const bool after = first >= sensor.valid_end(z);
      const bool before = last < sensor.zones[i].first_valid_bin;
      if (!after && !before) return;
      late = late || after;
    }
    (!faced ? reach.behind : late ? reach.late : reach.early) += share;
  }

 private:
  const Scene& scene_;
  RelaySetup setup_;
  std::vector<Patches> lit_;   ///< one for all zones, or [zones]
  std::vector<Patches> seen_;  ///< [zones]
  std::string names_;
};

Vector3d middle_of(const HiddenObject& object, const Placement& placement) {
  return object_to_world(object.shape, object.anchor, placement).translation();
}

double radius_of(const HiddenObject& object, const Placement& placement) {
  return placement.size * bounding_radius(object.shape, Anchor::center);
}

std::string percent(double share) {
  if (share > kAll) return "all";
  return std::to_string(std::max(std::lround(100 * share), 1L)) + " %";
}

std::string metres(double length) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f m", length);
  return text;
}

/// The longest path whose light comes within the bins that are used, m.
double longest_path(const Sensor& sensor) {
  double longest = 0;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const double end = sensor.valid_end(z) * sensor.bin_width;
    longest = std::max(longest, (end - zone.time_zero) * kSpeedOfLight);
  }
  return longest;
}

/// Sentences about unseen parts of `region_of` ("the search region"), or about the unseen object if
/// it is empty.
std::vector<std::string> sentences(const Sensor& sensor, const RegionReach& reach,
                                   const std::string& region_of, const std::string& remedy) {
  std::vector<std::string> list;
  const auto subject = [&](double share) {
    std::string text = region_of.empty() ? "The object" : percent(share) + " of " + region_of;
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    return text;
  };
  if (reach.behind >= kWorthSaying) {
    list.push_back(subject(reach.behind) + " lies behind the relay surface (" + reach.relay +
                   "), where no light goes; " + remedy + ", or the direction of its normal.");
  }
  if (reach.late >= kWorthSaying) {
    list.push_back(subject(reach.late) +
                   " is so far away that its light comes after the last bin " +
                   "that is used (a path of " + metres(longest_path(sensor)) + "); " + remedy +
                   ", or the sensor's bins, bin_width_ps, time_zero_ps and valid_bins.");
  }
  if (reach.early >= kWorthSaying) {
    list.push_back(subject(reach.early) + " is so near that its light comes before the first bin " +
                   "that is used; " + remedy + ", or the sensor's time_zero_ps and valid_bins.");
  }
  return list;
}

/// Sum of a fit's counts and of its model's over the bins that entered it.
std::pair<double, double> totals(const FitResult& result) {
  double measured = 0, model = 0;
  for (const FittedHistograms& fitted : result.histograms) {
    for (int z = 0; z < fitted.measured.zones(); ++z) {
      if (!fitted.zone_used[static_cast<std::size_t>(z)]) continue;
      for (int k = fitted.first_bin; k < std::min(fitted.end_bin, fitted.measured.bins); ++k) {
        measured += fitted.measured.zone(z)[k];
        model += fitted.model.zone(z)[k];
      }
    }
  }
  return {measured, model};
}

std::string rounded_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::vector<std::string> misfit_hints(const Scene& scene, const FitResult& result) {
  const GoodnessOfFit& fit = result.goodness_of_fit;
  const double off = (fit.deviance - fit.expected) / fit.standard_deviation;
  if (!(off > kFarOff) || !(fit.deviance > kManyTimes * fit.expected)) return {};
  const auto [measured, model] = totals(result);
  const double ratio = model > 0 ? measured / model : 0;
  const std::string begin =
      "The light is " + rounded_text(off) + " standard deviations from what the scene can explain";
  const std::string remedy =
      "`blindcorner calibrate SCENE CAPTURES -o instrument.json` measures the instrument, from "
      "captures without an object (--no-object) or of known objects. Then fit with "
      "--instrument instrument.json.";
  if (scene.linear.direct == LinearMode::fixed && model > 0 &&
      (ratio > kOtherBrightness || ratio < 1 / kOtherBrightness)) {
    return {begin + ", and it is " + rounded_text(ratio) +
            " times as bright as the scene says. The gains were probably never calibrated. " +
            remedy};
  }
  return {begin +
          ". The gains, time zero, the pulse or the known surfaces are not as the scene states, or "
          "there is more than one object. The histograms of the page show where. " +
          remedy};
}

/// Variance of the positions along the direction that is known best, m^2. For one object this is
/// the way of its light, along which a shift of the time axis moves it.
double least_position_variance(const Scene& scene, const Eigen::MatrixXd& covariance) {
  std::vector<Eigen::Index> positions;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].component <= Component::z)
      positions.push_back(static_cast<Eigen::Index>(i));
  }
  if (positions.empty()) return std::numeric_limits<double>::infinity();
  const Eigen::MatrixXd own = covariance(positions, positions);
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(own, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .minCoeff();
}

/// Warns that nothing checks time zero. A pose takes up an error of time zero without a trace: the
/// deviance stays as expected (ten captures of 30,000 photons on tmf8828_wall without its direct
/// return, with time zero half a bin off).
std::string time_zero_hint(const Scene& scene, const FitResult& result) {
  const LinearUnknowns& linear = scene.linear;
  if (linear.direct != LinearMode::fixed || linear.fixed_direct != 0) return {};
  if (result.posterior.modes.empty()) return {};
  const double shift = 0.25 * scene.sensor.bin_width * kSpeedOfLight;  // half a bin, there and back
  const double variance = least_position_variance(scene, result.posterior.modes.front().covariance);
  if (!(variance < shift * shift)) return {};
  return "The counts hold no direct return (linear.direct is absent), so that nothing in them "
         "checks "
         "time_zero_ps. An error of half a bin would move the object by " +
         rounded_text(1e3 * shift) +
         " mm or more, and the stated uncertainty does not count that. Calibrate time_zero_ps with "
         "objects at known places.";
}

}  // namespace

RegionReach region_reach(const Scene& scene, const SensorPlacement& sensor, int object) {
  const SeenRelay relay(scene, sensor);
  const HiddenObject& hidden = hidden_object(scene, object);
  std::vector<Placement> places{hidden.placement};
  for (const Unknown& unknown : scene.unknowns) {
    if (unknown.object != object || unknown.component > Component::z) continue;
    std::vector<Placement> more;
    for (const Placement& place : places) {
      for (int i = 0; i < kLattice; ++i) {
        more.push_back(place);
        more.back().set(unknown.component, unknown.lower + (i + 0.5) / kLattice * unknown.range());
      }
    }
    places = std::move(more);
  }
  RegionReach reach;
  reach.relay = relay.names();
  for (const Placement& place : places) {
    relay.judge(middle_of(hidden, place), radius_of(hidden, place),
                1.0 / static_cast<double>(places.size()), reach);
  }
  return reach;
}

RegionReach placement_reach(const Scene& scene, const SensorPlacement& sensor,
                            const std::vector<Placement>& placements) {
  const SeenRelay relay(scene, sensor);
  RegionReach worst;
  worst.relay = relay.names();
  for (int i = 0; i < object_count(scene) && worst.unseen() == 0; ++i) {
    const HiddenObject& hidden = hidden_object(scene, i);
    const Placement& place = placements[static_cast<std::size_t>(i)];
    relay.judge(middle_of(hidden, place), radius_of(hidden, place), 1, worst);
  }
  return worst;
}

std::vector<std::string> scene_hints(const Scene& scene, const SensorPlacement& sensor) {
  std::vector<std::string> hints;
  for (int i = 0; i < object_count(scene); ++i) {
    const std::string region = object_count(scene) > 1
                                   ? "the search region of " + hidden_object(scene, i).name
                                   : "the search region";
    for (std::string& hint :
         sentences(scene.sensor, region_reach(scene, sensor, i), region,
                   "nothing can be found there: check the ranges of unknowns")) {
      hints.push_back(std::move(hint));
    }
  }
  return hints;
}

std::vector<std::string> placement_hints(const Scene& scene, const SensorPlacement& sensor,
                                         const std::vector<Placement>& placements) {
  return sentences(scene.sensor, placement_reach(scene, sensor, placements), "",
                   "the capture holds none of its light: check the pose");
}

std::vector<std::string> fit_hints(const Scene& scene, const FitResult& result) {
  std::vector<std::string> hints = misfit_hints(scene, result);
  if (const std::string hint = time_zero_hint(scene, result); !hint.empty()) hints.push_back(hint);
  return hints;
}

}  // namespace blindcorner
