// SPDX-License-Identifier: Apache-2.0
/// Search for the cheapest sampling that meets a tolerance. The error of a sampling is judged by
/// how much a finer one would change the light.
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

/// Coarsest and finest sampling that is tried, in units of the steps that the estimates in
/// sampling.cpp ask for, and the ratio of one sampling to the next: sqrt(2) doubles the number of
/// cells. By judgement: errors grow with the fourth power of the coarseness, so the estimates may
/// be wrong by a factor of 2^10 to one side and of 25 to the other.
constexpr double kCoarsest = 5.657;
constexpr double kFinest = 0.45;
constexpr double kCoarsenessStep = 1.41421356;
/// The same for rules of points. Their error falls so fast that smaller steps pay: two of them make
/// one of the others.
constexpr double kRuleStep = 1.18920712;
constexpr double kRuleFinest = 0.3;
/// Ratio of the worst bin's change, relative to the peak, to the relative change of all light (L2):
/// 1.5 to 2 on floors and walls. Samplings of rules and of pairs are judged by kPeakOfL2 times the
/// change of all light, because a single bin at the edge of a lobe's footprint says little about a
/// pose.
constexpr double kPeakOfL2 = 2;
/// Coarsest samplings that are tried for rules of points: no shipped scene takes a coarser one, to
/// 10 %. The search for the object's sampling leaves the relay at kRuleRelay, because the edges of
/// shadows hardly change with the object's points.
constexpr double kRuleRelay = 1.41421356;
constexpr double kRuleObject = 2;
/// Coarsest sampling of the object that is tried for pairs. The estimate's limit for pairs is made
/// for the relay's patches and far too strict for the object: where on the object light turns back
/// does not move the lobe's middle.
constexpr double kPairsObject = 8 * kCoarsest;
/// Coarsest sampling of the relay that is tried for pairs: resolves_lobe() says how wide patches
/// may be.
constexpr double kPairsRelay = 2 * kCoarsest;
/// Most pairs of a lit and a seen patch, over all points of the object, that one evaluation may
/// take. By judgement of time: the search for a sampling ends there, whatever the tolerance.
constexpr double kMaxPairs = 2.5e7;
/// Most legs between patches and the object's points that a lobe's single sum may take, likewise.
constexpr double kMaxLegs = 4e6;

/// Change of a bin, relative to the peak, that is too large to come from a coarse sampling. If the
/// single sum differs from pairs by more than this, no finer sampling of the single sum is tried.
constexpr double kSurelyPairs = 1;

/// Relative change of a pose's light (L2), root mean square over the poses. Poses with next to no
/// light do not count: by judgement, those whose peak is at most a thousandth of the brightest
/// pose's peak.
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

/// Largest change of a bin, relative to the peak of its pose. Poses with next to no light do not
/// count, as in l2_change().
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

  /// Makes the sampling finer until at least twice as many cells would change the light of the
  /// probed poses by less than the tolerance. For a lobe's single sum, the change is that of the
  /// worst bin, relative to its pose's peak. For rules and pairs, it is kPeakOfL2 times the
  /// relative change of all light (L2), root mean square over the poses. The error falls with the
  /// fourth power of a cell's edges, so the change is at least three quarters of the coarser
  /// sampling's error. The object takes at most half of the tolerance, and the relay what is left.
  SamplingStep find() {
    const double tolerance = options_.tolerance;
    // For pairs, the error of the object's cells is the same with a coarser relay.
    SamplingStep sampling_step{2.0, kCoarsest};
    if (kernel_ == Kernel::retro_pairs) sampling_step.relay = kCoarsest;
    if (by_rules(kernel_)) sampling_step.relay = kRuleRelay;
    // The object may take half of the time. The other half is left for a finer relay.
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
    // For pairs, both changes are root mean squares of independent errors, so their squares add.
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
  /// Largest change of a bin where the search ended: the object's plus the relay's.
  double worst_change() const { return worst_change_; }
  double unresolved() const { return unresolved_; }

  std::unique_ptr<FastModel> model(SamplingStep sampling_step) const {
    sampling_step.lobe_pairs = lobe_pairs_;
    return std::make_unique<FastModel>(view_, options_, FoundSampling{sampling_step, 0, {}});
  }
  /// Histograms of the probed poses. For pairs, also finds the largest share of all pairs of
  /// patches that a pose looks at.
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
    double worst_change = change;  ///< the same for the worst bin
  };

  static double pair_count(const FastModel& m) {
    return 1.0 * m.sampling().lit.size() * m.sampling().seen.size() * m.sampling().object_nodes;
  }
  /// Whether an evaluation would take more than this share of the longest time.
  bool too_long(const FastModel& m, double share) const {
    if (kernel_ == Kernel::retro_pairs) return near_share_ * pair_count(m) > share * kMaxPairs;
    const Sampling& sampling = m.sampling();
    if (kernel_ == Kernel::brdf_pairs) {
      // With a confocal sensor, a zone pairs only with its own lit spot.
      const double sets = view_->confocal ? view_->transport->scene.sensor.zone_count() : 1.0;
      return pair_count(m) / sets > share * kMaxPairs;
    }
    const double patches = sampling.lit.size() + sampling.seen.size();
    return kernel_ == Kernel::retro_single && patches * sampling.object_nodes > share * kMaxLegs;
  }
  /// Whether pairs show an even relay as even. Seen patches that are small against the lit ones see
  /// the ripples of a row of lit patches of edge w. The amplitude that remains (lobe_pairs.h) is 2
  /// (1 - pi^4 / 180) exp(-2 pi^2 (sigma^2 / w^2 + 1 / 12)). Each seen patch and each object point
  /// sees another phase, so the ripples of n of them fall by sqrt(n).
  bool resolves_lobe(const FastModel& m) const {
    if (kernel_ != Kernel::retro_pairs) return true;
    const double edge = m.sampling_step()->relay * kLobePatch;  // in units of the lobe
    const double ripple = 2 * (1 - std::pow(kPi, 4) / 180) *
                          std::exp(-2 * kPi * kPi * (1 / (edge * edge) + 1.0 / 12));
    const auto seen = static_cast<double>(m.sampling().seen.group_end.size()) /
                      view_->transport->scene.sensor.zone_count();
    return ripple < options_.tolerance * std::sqrt(std::max(seen * m.sampling().object_nodes, 1.0));
  }

  /// The coarsest sampling from coarseness `from` on whose change is below `tolerance`. `make`
  /// makes a model of a coarseness. `count` returns the number of its cells, or -1 if it is too
  /// coarse to be tried. `most_time` is a share of the longest time.
  Choice coarsest(double from, double tolerance, double most_time,
                  const std::function<std::unique_ptr<FastModel>(double)>& make,
                  const std::function<int(const FastModel&)>& count) {
    // Light at the borders of surfaces and shadows converges slowly. If the change is below
    // kStagnates and finer cells have lowered it by less than a fifth, still finer cells are not
    // worth their time. By judgement: for smooth light, twice as many cells leave a quarter of the
    // change.
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
  double near_share_ = 1;  ///< share of all pairs of patches that lie within a lobe's reach
  double unresolved_ = 0;  ///< change of a bin where the search gave up
  double worst_change_ = 0;
};

}  // namespace

/// Finds a sampling for the view's kernel, and takes pairs instead of the single sum if the sum
/// leaves out too much. It compares the sum with a coarse sampling of pairs first. If the change is
/// more than `pairs_from`, it compares the sum with pairs that meet the tolerance. If coarse
/// samplings of both differ by more than kSurelyPairs, no finer single sum is tried.
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
    // The errors of the sum and of the pairs are independent: without the pairs' own error, the
    // sum's error is left. A change that the search gave up on is that of a sampling with at most
    // half as many cells as the one that it took.
    const double own = std::max(pairs.worst_change(), 0.5 * pairs.unresolved());
    const double both = largest_change(summed, pairs.probe(*pairs.model(with_pairs)));
    change = std::sqrt(std::max(both * both - own * own, 0.0));
    if (change > pairs_from) return paired(pairs, with_pairs, change);
  }
  found.pairs_reason = "; pairs would change a bin by no more than the tolerance";
  return found;
}

}  // namespace blindcorner
