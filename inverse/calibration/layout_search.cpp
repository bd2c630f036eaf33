// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/layout_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "inverse/calibration/capture_statistics.h"

namespace blindcorner {
namespace {

/// Least number of captures that decide, if as many are given; fewer than twice as many are used.
/// With this many, right and wrong layouts differ by hundreds in deviance, far more than kWrapGain.
constexpr std::size_t kCaptures = 48;
/// A wrap is refuted by another one whose deviance is this much less (five sigma).
constexpr double kWrapGain = 25;
/// Squared residuals beyond this many variances, three standard deviations, count less and less.
constexpr double kTrim = 9.0;
/// Turns of gain, ambient light and Huber's weights. Each turn more than halves the remaining
/// error, and deviances are compared to a unit.
constexpr int kReweightings = 8;
/// Coarse and fine steps of the time zero, bins. The coarse ones come within a quarter of a bin of
/// the truth, the fine ones within a sixteenth. An error as small as that changes the light too
/// little to matter for the layout (a pulse is a bin wide or wider).
constexpr double kStep = 0.5;
constexpr double kFineStep = 0.125;
/// Standard deviations of the time zero's prior that are searched on either side: they hold 95 % of
/// the prior.
constexpr double kTimeZeroSigmas = 2.0;

/// Some of the captures, spread over those given, enough to tell a few discrete choices apart.
CalibrationProblem few_captures(const Scene& scene, const std::vector<Capture>& all,
                                const std::vector<std::optional<PoseVector>>& where) {
  std::vector<Capture> captures;
  std::vector<std::optional<PoseVector>> poses;
  const std::size_t stride = std::max<std::size_t>(1, all.size() / kCaptures);
  for (std::size_t c = 0; c < all.size(); c += stride) {
    captures.push_back(all[c]);
    poses.push_back(where[c]);
  }
  return {scene, std::move(captures), std::move(poses), {}};
}

/// One zone in one capture.
struct Row {
  const BinLikelihood* noise_model;
  Eigen::ArrayXd counts;  ///< less the static light
  Eigen::ArrayXd known;   ///< the static light
  Eigen::ArrayXd light;   ///< of the object, at the stated gain
  double ambient;
};

/// Variance of each bin, and squared residuals in units of it.
struct Misfit {
  Eigen::ArrayXd variance, squares;

  Misfit(const Row& row, double gain) {
    const Eigen::ArrayXd mean = row.ambient + gain * row.light;
    variance = (mean + row.known).unaryExpr([&](double m) {
      return row.noise_model->variance(row.noise_model->lit(m));
    });
    squares = (row.counts - mean).square() / variance;
  }
};

/// Deviance of a zone's rows at the gain that explains them best and, where it is free, at the best
/// ambient light of each row. Large residuals count linearly (Huber's function).
double deviance_of(std::vector<Row>& rows, bool free_ambient) {
  double gain = 0;
  for (int i = 0; i < kReweightings; ++i) {
    double numerator = 0;
    double denominator = 0;
    std::vector<std::pair<double, double>> centers;  // of counts and light
    for (const Row& row : rows) {
      const Misfit misfit(row, gain);
      const Eigen::ArrayXd weight =
          (kTrim / misfit.squares.cwiseMax(kTrim)).sqrt() / misfit.variance;
      const double total = weight.sum();
      const double count = free_ambient ? (weight * row.counts).sum() / total : row.ambient;
      const double light = free_ambient ? (weight * row.light).sum() / total : 0.0;
      numerator += (weight * (row.counts - count) * (row.light - light)).sum();
      denominator += (weight * (row.light - light).square()).sum();
      centers.emplace_back(count, light);
    }
    gain = denominator > 0 ? std::max(numerator / denominator, 0.0) : 0.0;
    for (std::size_t r = 0; free_ambient && r < rows.size(); ++r) {
      rows[r].ambient = centers[r].first - gain * centers[r].second;
    }
  }
  double sum = 0;
  for (const Row& row : rows) {
    const Eigen::ArrayXd squares = Misfit(row, gain).squares;
    sum += (squares < kTrim).select(squares, 2 * (kTrim * squares).sqrt() - kTrim).sum();
  }
  return sum;
}

/// Deviance of each zone over the captures, [zones], each zone with the gain that suits it.
std::vector<double> zone_deviances(const CalibrationProblem& problem, const Scene& scene) {
  const Evaluations evaluations = problem.evaluate(scene);
  std::vector<std::vector<Row>> rows(scene.sensor.zones.size());
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const CalibrationProblem::Evaluation& at = evaluations[c];
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      if (!has_data(observation, zone, 1.0)) continue;
      const Eigen::Index bins = zone.bins();
      Row row{&observation.noise_model(zone),
              Eigen::Map<const Eigen::ArrayXd>(zone.counts.data(), bins),
              Eigen::ArrayXd::Zero(bins),
              Eigen::Map<const Eigen::ArrayXd>(at.object[i].data(), bins), at.linear.ambient[i]};
      if (!at.known.empty()) {
        row.known =
            at.linear.direct[i] * Eigen::Map<const Eigen::ArrayXd>(at.known[i].data(), bins);
      }
      row.counts -= row.known;
      rows[static_cast<std::size_t>(zone.zone)].push_back(std::move(row));
    }
  }
  const bool free_ambient = scene.linear.ambient == LinearMode::per_zone;
  std::vector<double> deviances;
  for (std::vector<Row>& of_zone : rows) deviances.push_back(deviance_of(of_zone, free_ambient));
  return deviances;
}

/// Every wrap in the farther half of the time axis, no wrap, and the stated wraps.
std::vector<int> wrap_candidates(const Sensor& sensor) {
  std::vector<int> candidates{0};
  for (int wrap = (sensor.bins + 1) / 2; wrap <= sensor.bins; ++wrap) candidates.push_back(wrap);
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const int stated = sensor.wrap(z);
    if (std::ranges::find(candidates, stated) == candidates.end()) candidates.push_back(stated);
  }
  return candidates;
}

/// All orders of `count` things, the original one first.
std::vector<std::vector<int>> permutations(std::size_t count) {
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::vector<std::vector<int>> all;
  do {
    all.push_back(order);
  } while (std::next_permutation(order.begin(), order.end()));
  return all;
}

/// The wrap chosen for a zone on one spot, and the evidence for it.
struct Choice {
  double deviance = 0;
  ZoneWrap wrap;
  bool decided = false;  ///< the data refute what is stated, or confirm it against all others
};

/// Chooses from wraps and their deviances: the stated wrap, unless it is refuted; then no wrap,
/// unless that is refuted (a wrap behind all light changes nothing); then the wrap that beats all
/// others.
Choice decide(int zone, int stated, std::vector<std::pair<double, int>> order) {
  std::sort(order.begin(), order.end());
  const double best = order[0].first;
  const auto deviance_of = [&](int wrap) {
    return std::ranges::find(order, wrap, &std::pair<double, int>::second)->first;
  };
  const bool refuted = deviance_of(stated) - best >= kWrapGain;
  const bool clear = order[1].first - best >= kWrapGain;
  const bool never = deviance_of(0) - best < kWrapGain;
  Choice choice{best, {zone, stated, stated, 0, 0}, refuted ? never || clear : clear};
  if (refuted && choice.decided) choice.wrap.found = never ? 0 : order[0].second;
  const auto& next = order[0].second == choice.wrap.found ? order[1] : order[0];
  choice.wrap.margin = next.first - deviance_of(choice.wrap.found);
  choice.wrap.next = next.second;
  return choice;
}

/// The search. A zone's light depends only on its own spot and its own wrap. All zones are
/// therefore evaluated at once with each spot and each wrap, and the deviances of assignments are
/// sums of the zones' deviances.
class LayoutSearch {
 public:
  LayoutSearch(const Scene& scene, CalibrationProblem problem, const CalibrationOptions& options,
               std::function<void(double)> advance)
      : scene_(scene),
        problem_(std::move(problem)),
        spots_(relay_spots(scene)),
        advance_(std::move(advance)) {
    if (options.permutations && spots_.points.size() > 1 && spots_.points.size() <= kMaxSpots) {
      orders_ = permutations(spots_.points.size());
    }
    if (options.wraps) wraps_ = wrap_candidates(scene.sensor);
    deviances_.assign(orders_.size(), std::numeric_limits<double>::infinity());
    const double range = kTimeZeroSigmas * options.time_zero_bins;
    const int steps = static_cast<int>(std::ceil(range / kStep));
    const int fine = steps > 0 ? static_cast<int>(std::round(0.5 * kStep / kFineStep)) : 0;
    const int turns = 2 * (steps + fine) + 2;
    double done = 0;
    const auto look = [&](double time_zero) {
      evaluate(time_zero, options.time_zero_bins);
      advance_(++done / turns);
    };
    for (int i = -steps; i <= steps; ++i) look(kStep * i);
    const double coarse = time_zero_;
    for (int i = -fine; i <= fine; ++i) look(coarse + kFineStep * i);
  }

  Layout result() const {
    Layout layout{scene_, {}, {}};
    for (std::size_t i = 0; i < orders_.size(); ++i) {
      layout.assignments.push_back({orders_[i], deviances_[i]});
    }
    if (!orders_.empty()) place(orders_[order_], layout.scene);
    for (const Choice& choice : choices_) {
      layout.scene.sensor.zones[static_cast<std::size_t>(choice.wrap.zone)].wrap_bins =
          choice.wrap.found;
      if (choice.decided) layout.wraps.push_back(choice.wrap);
    }
    std::stable_sort(layout.assignments.begin(), layout.assignments.end(),
                     [](const auto& a, const auto& b) { return a.deviance < b.deviance; });
    return layout;
  }

 private:
  /// Puts the spots in the places that the order says.
  void place(const std::vector<int>& order, Scene& scene) const {
    std::vector<Eigen::Vector3d> points;
    for (const int i : order) points.push_back(spots_.points[static_cast<std::size_t>(i)]);
    move_spots(scene, spots_, points);
  }

  /// Choices of all zones, [zones], when all are on `spot`; -1: each zone is on its own spot.
  std::vector<Choice> choose(const Scene& scene, int spot) const {
    Scene trial = scene;
    if (spot >= 0) place(std::vector<int>(spots_.points.size(), spot), trial);
    const std::size_t zones = scene.sensor.zones.size();
    std::vector<Choice> choices(zones);
    if (wraps_.empty()) {
      const std::vector<double> deviances = zone_deviances(problem_, trial);
      for (std::size_t z = 0; z < zones; ++z) {
        const int stated = scene.sensor.wrap(static_cast<int>(z));
        choices[z] = {deviances[z], {static_cast<int>(z), stated, stated, 0, 0}, false};
      }
      return choices;
    }
    std::vector<std::vector<std::pair<double, int>>> order(zones);  // by deviance
    for (const int wrap : wraps_) {
      for (Zone& zone : trial.sensor.zones) zone.wrap_bins = wrap;
      const std::vector<double> deviances = zone_deviances(problem_, trial);
      for (std::size_t z = 0; z < zones; ++z) order[z].emplace_back(deviances[z], wrap);
    }
    for (std::size_t z = 0; z < zones; ++z) {
      choices[z] =
          decide(static_cast<int>(z), scene.sensor.wrap(static_cast<int>(z)), std::move(order[z]));
    }
    return choices;
  }

  /// Evaluates all layouts with the time zero `time_zero` bins later than stated.
  void evaluate(double time_zero, double sigma) {
    Scene scene = scene_;
    for (Zone& zone : scene.sensor.zones) zone.time_zero += time_zero * scene.sensor.bin_width;
    const double prior = sigma > 0 ? std::pow(time_zero / sigma, 2) : 0.0;
    const auto note = [&](std::size_t order, std::vector<Choice> choices) {
      double sum = prior;
      for (const Choice& choice : choices) sum += choice.deviance;
      if (order < deviances_.size()) deviances_[order] = std::min(deviances_[order], sum);
      if (!(sum < least_)) return;
      least_ = sum;
      time_zero_ = time_zero;
      order_ = order;
      choices_ = std::move(choices);
    };
    if (orders_.empty()) return note(0, choose(scene, -1));
    std::vector<std::vector<Choice>> on;  // [spot][zone]
    for (std::size_t s = 0; s < spots_.points.size(); ++s) {
      on.push_back(choose(scene, static_cast<int>(s)));
    }
    for (std::size_t i = 0; i < orders_.size(); ++i) {
      std::vector<Choice> choices;
      for (std::size_t z = 0; z < scene.sensor.zones.size(); ++z) {
        choices.push_back(on[static_cast<std::size_t>(orders_[i][spots_.of_zone[z]])][z]);
      }
      note(i, std::move(choices));
    }
  }

  const Scene& scene_;
  const CalibrationProblem problem_;
  const RelaySpots spots_;
  std::function<void(double)> advance_;
  std::vector<std::vector<int>> orders_;  // empty: the spots stay where they are
  std::vector<int> wraps_;                // empty: the time axes wrap as stated
  std::vector<double> deviances_;         // [orders] at the time zero that suits it best

  // The best so far.
  double least_ = std::numeric_limits<double>::infinity();
  double time_zero_ = 0;
  std::size_t order_ = 0;
  std::vector<Choice> choices_;  // [zones]
};

}  // namespace

Layout find_layout(const Scene& scene, const std::vector<Capture>& captures,
                   const std::vector<std::optional<PoseVector>>& poses,
                   const CalibrationOptions& options, const std::function<void(double)>& advance) {
  if (!options.permutations && !options.wraps) return {scene, {}, {}};
  return LayoutSearch(scene, few_captures(scene, captures, poses), options, advance).result();
}

}  // namespace blindcorner
