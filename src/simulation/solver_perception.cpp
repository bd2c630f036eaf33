// SPDX-License-Identifier: Apache-2.0
#include "simulation/solver_perception.h"

#include <memory>
#include <optional>

#include "blindcorner/inverse/tracking/tracker.h"

namespace blindcorner {
namespace {

/// Velocity of a track's mode, with its covariance and its covariance with the pose.
PoseVelocity velocity_of(const TrackLayout& layout, const Gaussian& state) {
  const Eigen::Index n = layout.poses;
  // Takes velocities to the unknowns that they belong to.
  Eigen::MatrixXd place = Eigen::MatrixXd::Zero(n, layout.size - layout.measured);
  for (std::size_t i = 0; i < layout.moving.size(); ++i) {
    place(layout.moving[i], static_cast<Eigen::Index>(i)) = 1;
  }
  const Eigen::Index moving = place.cols();
  return {place * state.mean.tail(moving),
          place * state.covariance.bottomRightCorner(moving, moving) * place.transpose(),
          state.covariance.topRightCorner(layout.measured, moving).topRows(n) * place.transpose()};
}

class SolverPerception final : public Perception {
 public:
  explicit SolverPerception(const PerceptionSetup& setup)
      : fitter_(setup.fitter ? setup.fitter : make_timely_fitter(setup.scene)),
        tracker_(fitter_->scene(), setup.motion) {}

  PerceptionAnswer perceive(const Capture& capture, const Transform& T_world_sensor,
                            double time) override {
    PerceptionAnswer answer;
    Capture placed = capture;
    placed.T_world_sensor = T_world_sensor;
    try {
      const double dt = last_ ? time - *last_ : 0.0;
      const FitResult result = track_frame(*fitter_, tracker_, placed, dt, false);
      last_ = time;
      answer.mixture = result.posterior;
      answer.flags = result.flags;
      for (const TrackMode& mode : tracker_.modes()) {
        answer.velocities.push_back(velocity_of(tracker_.layout(), mode.state));
      }
    } catch (const std::exception& error) {
      answer.error = error.what();
    }
    return answer;
  }

 private:
  std::shared_ptr<const Fitter> fitter_;
  Tracker tracker_;
  std::optional<double> last_;  ///< s, of the last frame that was used
};

}  // namespace

std::shared_ptr<const Fitter> make_timely_fitter(const Scene& scene) {
  FitOptions options;
  options.known_light = KnownLightSampling::timely;
  return std::make_shared<const Fitter>(scene, options);
}

std::unique_ptr<Perception> make_solver_perception(const PerceptionSetup& setup) {
  return std::make_unique<SolverPerception>(setup);
}

}  // namespace blindcorner
