// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/matched_filter.h"

#include <mutex>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/search/scoring.h"

namespace blindcorner {
namespace {

/// Number of starts that score() lists: the first one is the best pose of the grid.
constexpr int kBestOfGrid = 1;

}  // namespace

void MatchedFilterOptions::validate() const {
  if (max_poses >= 1) return;
  throw Error("MatchedFilterOptions.max_poses",
              "found " + std::to_string(max_poses) + ", accepted: at least 1");
}

struct MatchedFilterBaseline::Impl {
  Scene scene;
  MatchedFilterOptions options;
  std::shared_ptr<const SceneKnowledge> knowledge;
  std::mutex mutex;
  std::shared_ptr<const CompiledScene> last;  ///< of the latest sensor placement

  std::shared_ptr<const CompiledScene> compiled_for(const SensorPlacement& placement) {
    const std::scoped_lock lock(mutex);
    const bool known =
        last && placement.relay_points.empty() && last->placements.front().relay_points.empty() &&
        last->placements.front().T_world_sensor.isApprox(placement.T_world_sensor, 1e-12);
    if (!known) {
      GridOptions grid;
      grid.max_poses = options.max_poses;
      grid.closed_form = options.closed_form && knowledge->coarse();
      grid.spline = false;
      last = compile(scene, {placement}, {}, grid, knowledge);
    }
    return last;
  }
};

MatchedFilterBaseline::MatchedFilterBaseline(const Scene& scene,
                                             const MatchedFilterOptions& options) {
  options.validate();
  blindcorner::validate(scene);
  impl_ = std::make_unique<Impl>();
  impl_->scene = scene;
  impl_->options = options;
  impl_->knowledge = std::make_shared<const SceneKnowledge>(scene);
}
MatchedFilterBaseline::~MatchedFilterBaseline() = default;
MatchedFilterBaseline::MatchedFilterBaseline(MatchedFilterBaseline&&) noexcept = default;
MatchedFilterBaseline& MatchedFilterBaseline::operator=(MatchedFilterBaseline&&) noexcept = default;

PoseVector MatchedFilterBaseline::predict(const Capture& capture) const {
  const Scene& scene = impl_->scene;
  check_capture(scene, capture);
  const auto compiled = impl_->compiled_for(sensor_placement(scene, &capture));
  const Observation observation = observe(*compiled, {&capture, 1});
  if (observation.zones.empty() || observation.total_count() <= 0) return middle_of_prior(scene);
  const PoseObjective objective(*compiled, observation);
  LinearSolution empty;
  objective.evaluate_empty(empty);
  const Scored scored = score(objective, empty, kBestOfGrid, FitOptions{}.negligible_log_posterior);
  return scored.starts.empty() ? middle_of_prior(scene) : scored.starts.front().pose;
}

}  // namespace blindcorner
