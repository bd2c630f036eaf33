// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/sensor_path.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/ray_scene.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

constexpr double kForwardShare = 0.3;
constexpr double kForwardTurn = 0.1;  ///< rad

/// Middle of the first hidden object's search region.
Vector3d search_center(const Scene& scene) {
  Placement middle = scene.hidden.placement;
  for (const Unknown& unknown : scene.unknowns) {
    if (unknown.object == 0) middle.set(unknown.component, 0.5 * (unknown.lower + unknown.upper));
  }
  return middle.position;
}

}  // namespace

std::vector<Transform> sensor_path(const std::vector<Transform>& through, int frames) {
  if (through.empty()) throw Error("sensor path", "found no pose, accepted: at least one");
  if (frames < 1) {
    throw Error("sensor path", "found " + std::to_string(frames) + " frames, accepted: at least 1");
  }
  std::vector<Transform> path;
  const auto stretches = static_cast<double>(through.size() - 1);
  for (int i = 0; i < frames; ++i) {
    const double at = frames > 1 ? stretches * i / (frames - 1) : 0.0;
    const auto last = through.size() - 1;
    const std::size_t from = std::min(static_cast<std::size_t>(at), last);
    const std::size_t to = std::min(from + 1, last);
    const double share = at - static_cast<double>(from);
    if (!(share > 0)) {  // exactly there, without the rounding of a quaternion
      path.push_back(through[from]);
      continue;
    }
    Transform pose = Transform::Identity();
    pose.translation() =
        (1 - share) * through[from].translation() + share * through[to].translation();
    pose.linear() = Eigen::Quaterniond(through[from].linear())
                        .slerp(share, Eigen::Quaterniond(through[to].linear()))
                        .toRotationMatrix();
    path.push_back(pose);
  }
  return path;
}

Transform forward_end(const Scene& scene) {
  Transform end = scene.T_world_sensor;
  const Vector3d look = end.linear().col(0);
  const auto hit = RayScene(scene.surfaces).first_hit(end.translation(), look);
  // For a sensor that looks straight down, forward is where the image's top is.
  Vector3d forward = std::hypot(look.x(), look.y()) > 1e-6 ? look : Vector3d(end.linear().col(2));
  forward.z() = 0;
  forward.normalize();
  const Vector3d aside = search_center(scene) - end.translation();
  const double side = forward.x() * aside.y() - forward.y() * aside.x() < 0 ? -1.0 : 1.0;
  end.translation() += kForwardShare * (hit ? hit->distance : 1.0 / kForwardShare) * forward;
  end.linear() =
      Eigen::AngleAxisd(side * kForwardTurn, Vector3d::UnitZ()).toRotationMatrix() * end.linear();
  return end;
}

Scene seen_from(const Scene& scene, const Transform& T_world_sensor) {
  Scene moved = scene;
  moved.T_world_sensor = T_world_sensor;
  check_relay_visible(moved);
  return moved;
}

}  // namespace blindcorner
