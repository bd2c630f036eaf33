// SPDX-License-Identifier: Apache-2.0
#include "simulation/solver_perception.h"

#include <cmath>
#include <optional>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/inverse/tracking/tracker.h"

namespace blindcorner {
namespace {

/// Velocities over the ground of the heaviest mode, as far as the track has them.
std::vector<PlanarVelocity> velocities_of(const Scene& scene, const Motion& motion,
                                          const TrackSummary& track) {
  std::vector<PlanarVelocity> velocities(static_cast<std::size_t>(object_count(scene)));
  for (PlanarVelocity& velocity : velocities) {
    velocity.covariance.diagonal().setConstant(std::pow(motion.initial_speed, 2));
  }
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    const auto axis = static_cast<Eigen::Index>(unknown.component);
    const auto index = static_cast<Eigen::Index>(i);
    if (axis > 1 || index >= track.velocity.size() || !std::isfinite(track.velocity[index]))
      continue;
    velocities[static_cast<std::size_t>(unknown.object)].mean[axis] = track.velocity[index];
  }
  return velocities;
}

class SolverPerception final : public Perception {
 public:
  explicit SolverPerception(const PerceptionSetup& setup)
      : motion_(setup.motion), fitter_(setup.scene, setup.fit), tracker_(setup.scene, motion_) {}

  PerceptionAnswer perceive(const Capture& capture, const Transform& T_world_sensor,
                            double time) override {
    PerceptionAnswer answer;
    Capture placed = capture;
    placed.T_world_sensor = T_world_sensor;
    try {
      const double dt = last_ ? time - *last_ : 0.0;
      const FitResult result = track_frame(fitter_, tracker_, placed, dt);
      last_ = time;
      answer.mixture = result.posterior;
      answer.flags = result.flags;
      if (result.track) answer.velocities = velocities_of(fitter_.scene(), motion_, *result.track);
    } catch (const std::exception& error) {
      answer.error = error.what();
    }
    return answer;
  }

 private:
  Motion motion_;
  Fitter fitter_;
  Tracker tracker_;
  std::optional<double> last_;  ///< s, of the last frame that was used
};

}  // namespace

std::unique_ptr<Perception> make_solver_perception(const PerceptionSetup& setup) {
  return std::make_unique<SolverPerception>(setup);
}

}  // namespace blindcorner
