// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/basins.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>

#include "inverse/likelihood/background_error.h"
#include "inverse/posterior/mode_merging.h"

namespace blindcorner {
namespace {

/// Number of places from which descents start. By judgement: each descent costs some thirty
/// evaluations of the model.
constexpr std::size_t kStarts = 6;
/// Number of yaws from which a better optimum is searched for, the best optimum's own included.
/// They are 45 degrees apart where half a turn brings an object back to itself. For a box in the
/// street at 3,000, 10,000 and 30,000 photons (60 captures each), the normalised error is 1.16,
/// 2.63, 3.19 without the turns and 1.12, 1.02, 1.03 with them, for half as much time again. Six
/// yaws give no better result. On a wall, where closed form leads well, 1000 captures of all levels
/// of light have a mean squared normalised error of 1.12 without them and of 1.05 with them, for a
/// tenth more time.
constexpr int kYaws = 4;
/// Most rounds of look_elsewhere(), each of which starts from the best optimum at that time.
constexpr int kMaxRounds = 3;
/// Number of places of each object from which look_elsewhere() descends. Closed form is off by some
/// per cent, which is more than the noise of bright light, so that it ranks places badly. For two
/// spheres at 100,000 photons, the place that led to the optimum ranked fourth to eighth. With two
/// places, 4 of 120 captures ended 0.2 m off and were sure of it. With eight places none did. This
/// takes 3 % more time (35 % at 1,000 photons).
constexpr std::size_t kPlacesEach = 8;

/// Adds starts at other yaws of an optimum, spaced evenly over the range of yaws or the circle. The
/// rest of the pose follows before the yaw moves: an object that is turned where it stands fits
/// worse, whatever its yaw. Without that rule, descents led a box in the street (10,000 photons)
/// back in 2 of 120 captures, which were sure of a yaw that is off by 64 degrees.
void add_turned(const Scene& scene, const PoseVector& pose, std::vector<Start>& starts) {
  for (std::size_t k = 0; k < scene.unknowns.size(); ++k) {
    const Unknown& unknown = scene.unknowns[k];
    if (unknown.component != Component::yaw) continue;
    const auto i = static_cast<Eigen::Index>(k);
    for (int j = 1; j < kYaws; ++j) {
      Start& start = starts.emplace_back(Start{pose});
      start.pose[i] += j * unknown.range() / kYaws;
      if (period_of(scene, k) <= 0 && start.pose[i] > unknown.upper) {
        start.pose[i] -= unknown.range();
      }
      wrap_pose(scene, start.pose);
      if (scene.unknowns.size() > 1) start.held_first = static_cast<int>(k);
    }
  }
}

}  // namespace

Scored score_all(const PoseObjective& whole, const LinearSolution& without,
                 const CompiledScene* near, std::span<const Capture> captures,
                 const FitOptions& options) {
  Scored scored = score(whole, without, options.max_starts, options.negligible_log_posterior);
  if (near == nullptr) return scored;
  const Observation observation = observe(*near, captures);
  const PoseObjective objective(*near, observation);
  LinearSolution empty;
  objective.evaluate_empty(empty);
  const LightSource light(whole.compiled().coarse);
  for (Candidate& start :
       score(objective, empty, options.max_starts, options.negligible_log_posterior).starts) {
    LinearSolution linear;
    start.index = -1;
    start.log_posterior = whole.evaluate(light, start.pose, linear, false).log_posterior;
    scored.starts.push_back(std::move(start));
  }
  std::ranges::stable_sort(scored.starts, std::greater{}, &Candidate::log_posterior);
  return scored;
}

std::vector<Start> choose_starts(const PoseObjective& objective, const Scored& scored) {
  std::vector<Start> starts;
  if (objective.compiled().coarse.empty()) {
    for (const Candidate& start : scored.starts) starts.push_back({start.pose});
  } else {
    for (PoseVector& pose : best_by_model(objective, scored, kStarts)) {
      starts.push_back({std::move(pose)});
    }
  }
  return starts;
}

std::vector<Refined> with_basins(const PoseObjective& objective, std::vector<Refined> basins,
                                 double negligible, std::vector<Refined> optima) {
  const CompiledScene& compiled = objective.compiled();
  if (!compiled.coarse.empty()) {
    std::ranges::move(basins, std::back_inserter(optima));
    return merge(compiled, std::move(optima), negligible);
  }
  // The log posterior of a basin on a spline or a cheap model may be off by half of what is
  // negligible.
  std::vector<PoseVector> places;
  basins = merge(compiled, std::move(basins), 1.5 * negligible);
  for (const Refined& basin : basins) {
    const bool known = std::ranges::any_of(optima, [&](const Refined& optimum) {
      return same_place(compiled, optimum.pose, basin.pose);
    });
    if (!known) places.push_back(basin.pose);
  }
  return places.empty() ? optima : polish_all(objective, places, negligible, std::move(optima));
}

std::vector<Refined> look_elsewhere(const PoseObjective& objective, const FitOptions& options,
                                    double negligible, std::vector<Refined> optima) {
  const CompiledScene& compiled = objective.compiled();
  for (int round = 0; round < kMaxRounds; ++round) {
    const Refined top = optima.front();
    std::vector<Start> starts;
    if (options.uses(FitRule::turn)) add_turned(compiled.scene, top.pose, starts);
    if (!compiled.objects().empty() && options.uses(FitRule::rearrange)) {
      for (PoseVector& place : other_places(objective, top.pose, top.linear, kPlacesEach)) {
        starts.push_back({std::move(place)});
      }
    }
    if (starts.empty()) break;
    optima = with_basins(objective, approach_all(objective, starts), negligible, std::move(optima));
    if (same_place(compiled, optima.front().pose, top.pose)) break;
  }
  return optima;
}

}  // namespace blindcorner
