// SPDX-License-Identifier: Apache-2.0
/// The cheapest sampling that meets a tolerance, by what finer ones would change.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "forward/support/parallel.h"
#include "forward/transport/fast_model.h"

namespace blindcorner {
namespace {

/// Coarseness of sampling that is looked at, in units of what the estimates in sampling.cpp ask
/// for, and the ratio from one to the next: cells double with each sqrt(2). By judgement, far
/// enough to either side that estimates may be wrong by the fourth power of it: 2^10, and a 25th.
constexpr double kCoarsest = 5.657;
constexpr double kFinest = 0.45;
constexpr double kCoarsenessStep = 1.41421356;
/// The same for rules of points, whose error falls so fast that smaller steps pay: half as long.
constexpr double kRuleStep = 1.18920712;
constexpr double kRuleFinest = 0.3;
/// Change of the worst bin, relative to the peak, for each relative change of all light (L2): 1.5
/// to 2 on floors and walls. Rules and pairs are chosen by twice the latter: a single bin at the
/// edge of a lobe's footprint says little of a pose.
constexpr double kPeakOfL2 = 2;
/// The coarsest of rules: of the shipped scenes none is coarser, to 10 %. The object's is looked
/// for with the relay's: shadows' edges hardly change with the object's points.
constexpr double kRuleRelay = 1.41421356;
constexpr double kRuleObject = 2;
/// The same of pairs' object points, whose estimate holds for the patches' sake: where on the
/// object light turns back does not move the lobe's middle.
constexpr double kPairsObject = 8 * kCoarsest;
/// And of their patches: resolves_lobe() says how wide they may be.
constexpr double kPairsRelay = 2 * kCoarsest;
/// Most pairs of lit and seen patches that a lobe's model takes for an evaluation, by judgement of
/// time: the search for a sampling ends there, whatever the tolerance.
constexpr double kMaxPairs = 2.5e7;
/// Most legs between patches and the object's points that its single sum takes, likewise.
constexpr double kMaxLegs = 4e6;

/// Change of a bin, relative to the peak, that no coarse sampling makes: where one sum differs so
/// much from pairs, no finer sampling of it is looked for.
constexpr double kSurelyPairs = 1;

/// Relative change of a pose's light (L2), root mean square over poses; those that give next to no
/// light, by judgement a thousandth of the brightest's peak, do not count.
double l2_change(const std::vector<HistogramCube>& coarse, const std::vector<HistogramCube>& fine) {
  constexpr double kDark = 1e-3;
  double brightest = 0;
  for (const HistogramCube& cube : fine) {
    brightest = std::max(brightest, *std::ranges::max_element(cube.values));
  }
  double sum = 0, poses = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (*std::ranges::max_element(fine[i].values) <= kDark * brightest) continue;
    double change = 0, light = 0;
    for (std::size_t k = 0; k < fine[i].values.size(); ++k) {
      change += std::pow(coarse[i].values[k] - fine[i].values[k], 2);
      light += std::pow(fine[i].values[k], 2);
    }
    sum += change / light;
    ++poses;
  }
  return std::sqrt(sum / std::max(poses, 1.0));
}

/// Largest change of a bin, relative to the peak of its pose; poses that give next to no light, by
/// judgement a thousandth of the brightest's peak, do not count.
double largest_change(const std::vector<HistogramCube>& coarse,
                      const std::vector<HistogramCube>& fine) {
  constexpr double kDark = 1e-3;
  std::vector<double> peaks;
  for (const HistogramCube& cube : fine) {
    peaks.push_back(*std::max_element(cube.values.begin(), cube.values.end()));
  }
  const double brightest = *std::max_element(peaks.begin(), peaks.end());
  double largest = 0;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (peaks[i] <= kDark * brightest) continue;
    for (std::size_t k = 0; k < fine[i].values.size(); ++k) {
      largest = std::max(largest, std::abs(coarse[i].values[k] - fine[i].values[k]) / peaks[i]);
    }
  }
  return largest;
}

class SamplingSearch {
 public:
  SamplingSearch(const std::shared_ptr<const SensorView>& view, const FastModelOptions& options,
                 bool pairs)
      : view_(view), options_(options), lobe_pairs_(pairs) {
    kernel_ = model({kCoarsest, kCoarsest})->kernel();
  }

  /// Limits become stricter until going on to at least twice as many cells would change no bin of
  /// any probed pose by more than the tolerance (of the pose's peak; of rules and pairs, kPeakOfL2
  /// times the change of all light, root mean square over the poses). The error falls with the
  /// fourth power of a cell's edges, so the change is at least three quarters of the coarser one's
  /// error. The object takes half of the tolerance at most, the relay what that leaves.
  SamplingStep find() {
    const double tolerance = options_.tolerance;
    // Pairs err by the object's cells the same at a coarser relay.
    SamplingStep sampling_step{2.0, kCoarsest};
    if (kernel_ == Kernel::retro_pairs) sampling_step.relay = kCoarsest;
    if (by_rules(kernel_)) sampling_step.relay = kRuleRelay;
    // Half of the time is left for a finer relay.
    while (too_long(*model(sampling_step), 0.5) && sampling_step.relay < kCoarsest) {
      sampling_step.relay *= kCoarsenessStep;
    }
    const bool rules = by_rules(kernel_);
    const Choice object = coarsest(
        rules                            ? kRuleObject
        : kernel_ == Kernel::retro_pairs ? kPairsObject
                                         : kCoarsest,
        0.5 * tolerance, 0.5,
        [&](double c) {
          return model({sampling_step.relay, c});
        },
        [](const FastModel& m) { return m.sampling().object_nodes; });
    sampling_step.object = object.coarseness;
    // Of pairs, root mean squares of errors that have nothing to do with each other.
    const double taken = std::min(object.change, 0.5 * tolerance);
    const Choice relay = coarsest(
        rules                            ? kRuleRelay
        : kernel_ == Kernel::retro_pairs ? kPairsRelay
                                         : kCoarsest,
        kernel_ == Kernel::retro_pairs ? std::sqrt(tolerance * tolerance - taken * taken)
                                       : tolerance - taken,
        1,
        [&](double c) {
          return model({c, sampling_step.object});
        },
        [&](const FastModel& m) {
          const int cells = m.sampling().lit.size() + m.sampling().seen.size();
          return resolves_lobe(m) ? cells : -1;
        });
    sampling_step.relay = relay.coarseness;
    sampling_step.lobe_pairs = kernel_ == Kernel::retro_pairs;
    worst_change_ = object.worst_change + relay.worst_change;
    return sampling_step;
  }
  /// Largest change of a bin, by object and relay, where the search ended.
  double worst_change() const { return worst_change_; }
  double unresolved() const { return unresolved_; }

  std::unique_ptr<FastModel> model(SamplingStep sampling_step) const {
    sampling_step.lobe_pairs = lobe_pairs_;
    return std::make_unique<FastModel>(view_, options_, FoundSampling{sampling_step, 0, {}});
  }
  /// Histograms of the probed poses; learns which share of all pairs of patches they look at.
  std::vector<HistogramCube> probe(const FastModel& model) {
    const Scene& scene = view_->transport->scene;
    const std::vector<PoseVector>& poses = view_->transport->probe_poses;
    std::vector<HistogramCube> cubes(poses.size());
    std::vector<double> pairs(poses.size());
    parallel_for(std::size_t{0}, poses.size(), [&](std::size_t i) {
      const Placement placement = place(scene.hidden.placement, scene.unknowns, poses[i]);
      pairs[i] = model.render(placement, {}, cubes[i]);
    });
    if (kernel_ == Kernel::retro_pairs) {
      near_share_ = *std::ranges::max_element(pairs) / std::max(pair_count(model), 1.0);
    }
    return cubes;
  }

 private:
  struct Choice {
    double coarseness;
    double change;                 ///< by going on to twice as many cells, as a share of the peak
    double worst_change = change;  ///< the same of the worst bin
  };

  static double pair_count(const FastModel& m) {
    return 1.0 * m.sampling().lit.size() * m.sampling().seen.size() * m.sampling().object_nodes;
  }
  /// Whether an evaluation would take more than that share of the longest time.
  bool too_long(const FastModel& m, double share) const {
    if (kernel_ == Kernel::retro_pairs) return near_share_ * pair_count(m) > share * kMaxPairs;
    const Sampling& sampling = m.sampling();
    if (kernel_ == Kernel::brdf_pairs) {
      // Of a confocal sensor, the light of a zone's own spot only.
      const double sets = view_->confocal ? view_->transport->scene.sensor.zone_count() : 1.0;
      return pair_count(m) / sets > share * kMaxPairs;
    }
    const double patches = sampling.lit.size() + sampling.seen.size();
    return kernel_ == Kernel::retro_single && patches * sampling.object_nodes > share * kMaxLegs;
  }
  /// Whether pairs see an even relay as even. Seen patches that are small against the lit ones see
  /// ripples of a row of patches of edge w: what is left of them (lobe_pairs.h) is 2 (1 - pi^4 /
  /// 180) exp(-2 pi^2 (sigma^2 / w^2 + 1 / 12)). Each seen patch and object point sees another
  /// phase.
  bool resolves_lobe(const FastModel& m) const {
    if (kernel_ != Kernel::retro_pairs) return true;
    const double edge = m.sampling_step()->relay * kLobePatch;  // in units of the lobe
    const double ripple = 2 * (1 - std::pow(kPi, 4) / 180) *
                          std::exp(-2 * kPi * kPi * (1 / (edge * edge) + 1.0 / 12));
    const auto seen = static_cast<double>(m.sampling().seen.group_end.size()) /
                      view_->transport->scene.sensor.zone_count();
    return ripple < options_.tolerance * std::sqrt(std::max(seen * m.sampling().object_nodes, 1.0));
  }

  /// Of the models that `make` makes of a coarseness, from this one on; `count` their cells, -1
  /// where they are too coarse to be looked at.
  Choice coarsest(double from, double tolerance, double most_time,
                  const std::function<std::unique_ptr<FastModel>(double)>& make,
                  const std::function<int(const FastModel&)>& count) {
    // Borders of surfaces and shadows converge slowly: below this, finer cells that gain next to
    // nothing, less than a fifth of the change, are not worth their time. By judgement: of smooth
    // light, twice as many cells leave a quarter.
    constexpr double kStagnates = 0.05;
    constexpr double kGainsNothing = 0.8;
    struct Candidate {
      double coarseness;
      int cells;
      std::vector<HistogramCube> cubes;
    };
    std::vector<Candidate> candidates;
    const bool rules = by_rules(kernel_);
    std::vector<double> changes;  // [candidate] to at least twice as many cells
    double last_skipped = 0;      // coarseness
    const double step = rules ? kRuleStep : kCoarsenessStep;
    for (double c = from; c > (rules ? kRuleFinest : kFinest); c /= step) {
      const auto tried = make(c);
      const int cells = count(*tried);
      const bool first = candidates.empty() && last_skipped == 0;
      if (!first && too_long(*tried, most_time)) break;
      if (cells < 0) {
        last_skipped = c;
        continue;
      }
      if (!candidates.empty() && candidates.back().cells == cells) continue;
      candidates.push_back({c, cells, probe(*tried)});
      const Candidate& fine = candidates.back();
      while (changes.size() + 1 < candidates.size()) {
        const Candidate& coarse = candidates[changes.size()];
        if (fine.cells < 2 * coarse.cells) break;
        const double worst = largest_change(coarse.cubes, fine.cubes);
        const double change = kernel_ == Kernel::retro_single
                                  ? worst
                                  : kPeakOfL2 * l2_change(coarse.cubes, fine.cubes);
        if (change < tolerance) return {coarse.coarseness, change, worst};
        const double before =
            changes.empty() ? std::numeric_limits<double>::infinity() : changes.back();
        changes.push_back(change);
        if (!rules && change < kStagnates && change > kGainsNothing * before) {
          unresolved_ += change;
          return {coarse.coarseness, change, worst};
        }
      }
    }
    if (candidates.empty()) {
      unresolved_ += tolerance;
      return {last_skipped, tolerance};
    }
    if (changes.empty()) return {candidates.back().coarseness, tolerance};
    if (kernel_ == Kernel::retro_pairs) {
      // The time is up. Changes fall at least with the square of the edges.
      const double at = candidates[changes.size() - 1].coarseness;
      for (std::size_t k = changes.size(); k < candidates.size(); ++k) {
        const double expected = changes.back() * std::pow(candidates[k].coarseness / at, 2);
        if (expected < tolerance) return {candidates[k].coarseness, expected};
      }
    }
    unresolved_ += changes.back();
    return {candidates.back().coarseness, tolerance};
  }

  const std::shared_ptr<const SensorView>& view_;
  FastModelOptions options_;
  bool lobe_pairs_;
  Kernel kernel_ = Kernel::lambertian;
  double near_share_ = 1;  ///< of all pairs of patches: those within a lobe's reach
  double unresolved_ = 0;  ///< change of a bin where the search gave up
  double worst_change_ = 0;
};

}  // namespace

/// A sampling for the plan's kernel, and pairs instead of the single sum where that leaves out too
/// much: looks first at a coarse sampling of pairs, and where the change may be more than the
/// tolerance at one that meets it. Where coarse samplings of both differ by more than kSurelyPairs,
/// no finer single sum is looked for.
FoundSampling find_sampling(const std::shared_ptr<const SensorView>& view,
                            const FastModelOptions& options, double pairs_from) {
  SamplingSearch single(view, options, false);
  const auto paired = [](SamplingSearch& pairs, const SamplingStep& step, double change) {
    return FoundSampling{step, pairs.unresolved(),
                         "; one sum would change a bin by " + two_digits(change)};
  };
  const bool either = view->kernel == Kernel::retro_single && !view->setup.uses_points() &&
                      !options.overrides.switched_off(Term::patch_pairs);
  if (either && single.model({kCoarsest, kCoarsest})->single_sum_bound() > kSurelyPairs) {
    SamplingSearch pairs(view, options, true);
    const double change = largest_change(single.probe(*single.model({2, kCoarsest})),
                                         pairs.probe(*pairs.model({kCoarsest, 2 * kCoarsest})));
    if (change > kSurelyPairs) return paired(pairs, pairs.find(), change);
  }
  FoundSampling found{single.find(), single.unresolved(), {}};
  if (!either) return found;
  const auto best = single.model(found.sampling_step);
  if (best->single_sum_bound() < 0.5 * pairs_from) return found;
  const std::vector<HistogramCube> summed = single.probe(*best);
  SamplingSearch pairs(view, options, true);
  double change = largest_change(summed, pairs.probe(*pairs.model({4, kCoarsest})));
  if (change > pairs_from) {
    const SamplingStep with_pairs = pairs.find();
    // Of two errors that have nothing to do with each other, the sum's. What a search gave up on is
    // the change of a sampling with at most half of the cells that it took.
    const double own = std::max(pairs.worst_change(), 0.5 * pairs.unresolved());
    const double both = largest_change(summed, pairs.probe(*pairs.model(with_pairs)));
    change = std::sqrt(std::max(both * both - own * own, 0.0));
    if (change > pairs_from) return paired(pairs, with_pairs, change);
  }
  found.pairs_reason = "; pairs would change a bin by no more than the tolerance";
  return found;
}

}  // namespace blindcorner
