// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/hybrid_methods.h"

#include <cmath>
#include <memory>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/inverse/tracking/frame_likelihood.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

/// Evidence that must be gained before the network's start overrules the search: less is what two
/// descents to one optimum differ by.
constexpr double kMoreEvidence = 0.5;

class Hybrid {
 public:
  Hybrid(const Scene& scene, const CnnBaseline& cnn, std::uint64_t seed)
      : fitter_(scene), cnn_(cnn), seed_(seed), prior_(prior_of(scene)) {}

  MethodAnswer from_network(const Capture& capture) const {
    const auto frame = fitter_.frame(capture);
    return answer(frame->update(prior_, start(network_pose(capture)), 1), capture);
  }

  MethodAnswer from_both(const Capture& capture) const {
    const FitResult fit = fitter_.fit(capture);
    const auto frame = fitter_.frame(capture);
    const auto own = frame->update(prior_, start(fit.posterior.modes.front().optimum), 1);
    const auto other = frame->update(prior_, start(network_pose(capture)), 1);
    if (other.log_evidence > own.log_evidence + kMoreEvidence) return answer(other, capture);
    return {fit.posterior.mean, credible_level_of(fitter_.scene(), fit.posterior, capture, seed_),
            fit.flags};
  }

 private:
  static Gaussian prior_of(const Scene& scene) {
    const auto poses = static_cast<Eigen::Index>(scene.unknowns.size());
    const bool amplitude = scene.linear.amplitude == LinearMode::shared;
    const Eigen::Index size = poses + (amplitude ? 1 : 0);
    Gaussian prior{Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Zero(size, size)};
    for (Eigen::Index i = 0; i < poses; ++i) {
      const PriorMoments moments = prior_moments(scene, static_cast<std::size_t>(i));
      prior.mean[i] = moments.mean;
      prior.covariance(i, i) = moments.variance;
    }
    if (amplitude) {
      const AmplitudePrior& a = scene.linear.amplitude_prior;
      prior.mean[poses] = std::log(a.median);
      prior.covariance(poses, poses) = a.sigma_log * a.sigma_log;
    }
    return prior;
  }

  PoseVector network_pose(const Capture& capture) const {
    return cnn_.predict(capture, capture.T_world_sensor.value_or(fitter_.scene().T_world_sensor));
  }

  Eigen::VectorXd start(const PoseVector& pose) const {
    Eigen::VectorXd at = prior_.mean;
    at.head(pose.size()) = pose;
    return at;
  }

  MethodAnswer answer(const FrameLikelihood::Update& update, const Capture& capture) const {
    const auto poses = static_cast<Eigen::Index>(fitter_.scene().unknowns.size());
    PoseMode mode;
    mode.weight = 1;
    mode.pose = mode.optimum = update.posterior.mean.head(poses);
    mode.covariance = update.posterior.covariance.topLeftCorner(poses, poses);
    const PoseMixture posterior{{mode}, 1, mode.pose, mode.covariance};
    return {mode.pose, credible_level_of(fitter_.scene(), posterior, capture, seed_)};
  }

  Fitter fitter_;
  CnnBaseline cnn_;
  std::uint64_t seed_;
  Gaussian prior_;
};

}  // namespace

std::vector<ComparedMethod> hybrid_methods(const Scene& scene, const CnnBaseline& cnn,
                                           const std::string& network, std::uint64_t seed) {
  const auto hybrid = std::make_shared<const Hybrid>(scene, cnn, seed);
  const std::string training = "as " + network;
  return {
      {"from " + network, training, [hybrid](const Capture& c) { return hybrid->from_network(c); }},
      {"solver and " + network, training,
       [hybrid](const Capture& c) { return hybrid->from_both(c); }}};
}

}  // namespace blindcorner
