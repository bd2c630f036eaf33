// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/mode_merging.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace blindcorner {
namespace {

/// Optima closer than this share of the grid's spacing along every unknown are one. A spacing is
/// about the pose's uncertainty at moderate light, and descents to the same optimum end a small
/// share of a spacing apart. By judgement between that share and one.
constexpr double kSamePlace = 0.25;
/// Standard deviations within which an optimum belongs to a better one: two equal Gaussians have
/// one summit until they are two standard deviations apart.
constexpr double kMergeDistance = 1.0;
/// Two modes are apart when the log posterior on the way between them falls this far below the
/// lower one: as far as a Gaussian falls at 1.4 standard deviations from its summit. By judgement:
/// a shallower valley is filled by the samples of either mode.
constexpr double kValley = 1.0;
/// Places that are looked at on the way from one optimum to another, the likeliest valley first.
constexpr std::array kPlaces{0.5, 0.25, 0.75};
/// Most groups that an optimum is compared with. The limit bounds the time, and the posterior of a
/// capture rarely has more groups.
constexpr std::size_t kMaxGroups = 6;

}  // namespace

bool same_place(const CompiledScene& compiled, const PoseVector& a, const PoseVector& b) {
  return within_spacings(compiled, a, b, kSamePlace);
}

std::vector<Refined> merge(const CompiledScene& compiled, std::vector<Refined> optima,
                           double negligible) {
  std::stable_sort(optima.begin(), optima.end(), [](const Refined& a, const Refined& b) {
    return a.value.log_posterior > b.value.log_posterior;
  });
  std::vector<Refined> kept;
  for (Refined& optimum : optima) {
    if (!std::isfinite(optimum.value.log_posterior)) continue;
    if (!kept.empty() &&
        optimum.value.log_posterior < kept.front().value.log_posterior - negligible) {
      break;
    }
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Refined& other) {
      return same_place(compiled, other.pose, optimum.pose);
    });
    if (!known) kept.push_back(std::move(optimum));
  }
  return kept;
}

bool within_better(const Scene& scene, const std::vector<Peak>& better, const PoseVector& pose) {
  return std::any_of(better.begin(), better.end(), [&](const Peak& peak) {
    return mahalanobis2(scene, peak, pose) < kMergeDistance * kMergeDistance;
  });
}

std::vector<std::size_t> connect(const PoseObjective& objective,
                                 const std::vector<const Refined*>& optima, double inflation) {
  const CompiledScene& compiled = objective.compiled();
  // The light that samples are weighed with. Closed-form light that is corrected at one end is
  // wrong at the other: where the light does not depend on an unknown, its slopes are noise and
  // would dig valleys.
  const LightSource light =
      compiled.spline ? LightSource(*compiled.spline) : LightSource(objective.rough_models());
  const auto value = [&](const Refined& near, const PoseVector& pose) {
    LinearSolution linear = near.linear;
    return tempered(objective.evaluate(light, pose, linear, true, kSampleAccuracy), inflation);
  };
  std::vector<double> ends;
  for (const Refined* optimum : optima) ends.push_back(value(*optimum, optimum->pose));
  std::vector<std::size_t> head(optima.size());
  std::vector<std::size_t> heads;
  for (std::size_t j = 0; j < optima.size(); ++j) {
    head[j] = j;
    for (std::size_t h = 0; h < std::min(heads.size(), kMaxGroups) && head[j] == j; ++h) {
      const Refined& best = *optima[heads[h]];
      const double level = std::min(ends[heads[h]], ends[j]) - kValley;
      const PoseVector way = pose_difference(compiled.scene, best.pose, optima[j]->pose);
      const bool one = std::all_of(kPlaces.begin(), kPlaces.end(), [&](double place) {
        PoseVector pose = best.pose + place * way;
        wrap_pose(compiled.scene, pose);
        return value(best, pose) >= level;
      });
      if (one) head[j] = heads[h];
    }
    if (head[j] == j) heads.push_back(j);
  }
  return head;
}

}  // namespace blindcorner
