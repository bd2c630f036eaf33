// SPDX-License-Identifier: Apache-2.0
#include "simulation/movers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "planner/grid/object_marginal.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// Root mean square speed above which an object moves, m/s. A standing person sways by less.
constexpr double kMoves = 0.5;
/// Least side of a body, m: the discs need a side above zero.
constexpr double kThinnest = 0.05;

/// Discs of an object's bounding rectangle along its longer side, and the turn to that side (rad).
std::pair<VehicleFootprint, double> body_of(const GroundObject& object, double size) {
  Eigen::AlignedBox2d box;
  for (const Vector2d& corner : object.outline) box.extend(Vector2d(size * corner));
  const Vector2d sides = box.sizes().cwiseMax(kThinnest), middle = box.center();
  if (sides.x() >= sides.y()) {
    return {VehicleFootprint::rectangle(sides.x(), sides.y(), middle.x()), 0.0};
  }
  return {VehicleFootprint::rectangle(sides.y(), sides.x(), middle.y()), kPi / 2};
}

/// Whether nothing but the prior is known of an object's x or y.
bool is_anywhere(const PoseMode& mode, const GroundObject& object) {
  return std::ranges::any_of(mode.undetermined,
                             [&](int u) { return u == object.x || u == object.y; });
}

/// Value of an unknown of a mode, or the known value where there is no unknown.
double value_of(const PoseMode& mode, int unknown, double known) {
  return unknown >= 0 ? mode.pose[unknown] : known;
}

/// The velocity of one object under a mode.
class ObjectVelocity {
 public:
  ObjectVelocity(const GroundObject& object, const PoseVelocity& velocity)
      : object_(object), velocity_(velocity) {}

  bool moves() const {
    return mean().squaredNorm() + block(velocity_.covariance).trace() > kMoves * kMoves;
  }
  Vector2d mean() const {
    return {value(velocity_.mean, object_.x), value(velocity_.mean, object_.y)};
  }
  /// The matrix's block of x and y; zero for known components.
  Eigen::Matrix2d block(const Eigen::MatrixXd& matrix) const {
    Eigen::Matrix2d block = Eigen::Matrix2d::Zero();
    const int at[] = {object_.x, object_.y};
    for (int row = 0; row < 2; ++row) {
      for (int column = 0; column < 2; ++column) {
        if (at[row] >= 0 && at[column] >= 0) block(row, column) = matrix(at[row], at[column]);
      }
    }
    return block;
  }

 private:
  static double value(const Eigen::VectorXd& values, int unknown) {
    return unknown >= 0 ? values[unknown] : 0.0;
  }
  const GroundObject& object_;
  const PoseVelocity& velocity_;
};

}  // namespace

StandingAndMoving split_by_motion(const Scene& scene, const Motion& motion,
                                  const HiddenAnswer& answer) {
  StandingAndMoving split{answer, {}};
  const std::vector<PoseVelocity>& velocities = answer.velocities;
  if (velocities.size() != answer.mixture.modes.size()) return split;  // nothing is known to move
  // The vehicle does not brake for a person whom nobody has perceived. The prior alone says that
  // somebody may be there, with any velocity, in every frame and to every perception.
  const double presence = answer.mixture.presence_probability;
  const double prior = scene.presence_prior;
  if (!(presence > prior)) return split;
  const HiddenMotion prediction(scene, motion, OccupancyOptions{}.dwell_time);
  const PoseMixture now = prediction.predicted(answer.mixture, answer.age, velocities);
  const double perceived = (presence - prior) / (1 - prior) / presence * now.presence_probability;
  for (int o = 0; o < object_count(scene); ++o) {
    const GroundObject object(scene, o);
    for (std::size_t i = 0; i < now.modes.size(); ++i) {
      const PoseMode& mode = now.modes[i];
      if (is_absent(mode, object) || is_anywhere(mode, object)) continue;
      const ObjectVelocity known(object, velocities[i]);
      if (!known.moves()) continue;
      Mover mover;
      mover.name = hidden_object(scene, o).name;
      double turn = 0;
      std::tie(mover.body, turn) = body_of(object, value_of(mode, object.size, object.known.size));
      mover.pose.position = {value_of(mode, object.x, object.known.position.x()),
                             value_of(mode, object.y, object.known.position.y())};
      mover.pose.heading = value_of(mode, object.yaw, object.known.yaw) + turn;
      mover.velocity = known.mean();
      const Eigen::Matrix2d cross =
          known.block(velocities[i].with_pose) + answer.age * known.block(velocities[i].covariance);
      const double q = motion.acceleration_density;
      mover.covariance << known.block(mode.covariance), cross, cross.transpose(),
          known.block(velocities[i].covariance) + q * answer.age * Eigen::Matrix2d::Identity();
      mover.acceleration_density = q;
      mover.probability = perceived * mode.weight;
      split.moving.push_back(mover);
      for (const int unknown : object.unknowns) {
        split.standing.mixture.modes[i].pose[unknown] = std::numeric_limits<double>::quiet_NaN();
      }
    }
  }
  return split;
}

}  // namespace blindcorner
