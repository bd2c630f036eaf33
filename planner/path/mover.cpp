// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/mover.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace blindcorner {
namespace {

/// Movers of lower probability are left to braking, like cells that are no obstacles.
constexpr double kAvoided = 0.2;
/// Time that is examined, s: later, a mover has changed its mind or the vehicle its speed.
constexpr double kHorizon = 4;
/// Margin on all sides, m, and the most that a standard deviation adds to it.
constexpr double kMargin = 0.3, kMostSigma = 1.0;
/// Speed below which a vehicle will not be where its path says, m/s.
constexpr double kSlow = 1;

}  // namespace

PlanarPose Mover::at(double time) const { return {pose.position + time * velocity, pose.heading}; }

double Mover::sigma_at(double time) const {
  const Eigen::Matrix2d cross = covariance.topRightCorner<2, 2>();
  const Eigen::Matrix2d later = covariance.topLeftCorner<2, 2>() +
                                time * (cross + cross.transpose()) +
                                time * time * covariance.bottomRightCorner<2, 2>();
  const double walk = acceleration_density * time * time * time / 3;
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(later).eigenvalues().maxCoeff() +
                   walk);
}

bool MoverAvoidance::meets(const VehicleFootprint& body, const PlanarPose& pose, double distance,
                           const PlanarPose& now) const {
  if (speed < kSlow || distance > kHorizon * speed) return false;
  const double time = distance / speed;
  return std::ranges::any_of(movers, [&](const Mover& mover) {
    if (mover.probability < kAvoided) return false;
    const double margin = kMargin + std::min(kMostSigma, mover.sigma_at(time));
    return touch(body, pose, mover.body, mover.at(time), margin) &&
           !touch(body, now, mover.body, mover.pose, kMargin);
  });
}

}  // namespace blindcorner
