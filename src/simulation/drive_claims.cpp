// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/drive_claims.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "blindcorner/simulation/credible_level.h"

namespace blindcorner {
namespace {

/// The truth lies in the region of the first level for a right answer, and outside of the region of
/// the second level for a wrong one.
constexpr double kCovered = 0.95, kWrong = 0.999;
/// The heaviest mode stands for the whole answer when it weighs more than this.
constexpr double kDominates = 0.9;
/// Frames whose times differ by less are the same, s.
constexpr double kSameTime = 1e-6;

bool has(const std::vector<std::string>& flags, const char* word) {
  return std::ranges::find(flags, word) != flags.end();
}

bool by_sight(const DriveFrame& frame) {
  return has(frame.flags, "in_sight") || has(frame.flags, "partly_in_sight");
}

/// Whether the true x and y of all objects lie in the search region.
bool in_search_region(const Scene& scene, const PoseVector& truth) {
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    const double at = truth[static_cast<Eigen::Index>(i)];
    const bool on_ground = unknown.component == Component::x || unknown.component == Component::y;
    if (on_ground && (at < unknown.lower || at > unknown.upper)) return false;
  }
  return true;
}

/// Whether the answer itself says that it may be wrong.
bool doubted(const DriveFrame& frame) {
  return has(frame.flags, "multimodal") || has(frame.flags, "predicted") ||
         has(frame.flags, "at_bound");
}

/// Errors of x and y of each hidden object under a mode.
PositionErrors errors_of(const Scene& scene, const PoseMode& mode, const PoseVector& truth) {
  PositionErrors errors;
  for (int object = 0; object < object_count(scene); ++object) {
    std::vector<Eigen::Index> places;
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      const Unknown& unknown = scene.unknowns[i];
      const bool on_ground = unknown.component == Component::x || unknown.component == Component::y;
      if (unknown.object == object && on_ground) places.push_back(static_cast<Eigen::Index>(i));
    }
    const Eigen::VectorXd d = (mode.pose - truth)(places);
    if (places.empty() || !d.allFinite()) continue;
    errors.squared += d.squaredNorm();
    errors.normalised += d.dot(Eigen::MatrixXd(mode.covariance(places, places)).ldlt().solve(d));
    errors.positions += 1;
    errors.freedom += static_cast<int>(places.size());
  }
  return errors;
}

/// The frame that was captured at this time; null: none.
const DriveFrame* captured(const DriveResult& result, double time) {
  const auto frame = std::ranges::find_if(result.frames, [&](const DriveFrame& other) {
    return std::abs(other.time - time) < kSameTime;
  });
  return frame == result.frames.end() ? nullptr : &*frame;
}

DriveClaims::First first_claim(const Drive& drive, const DriveResult& result,
                               const DriveFrame& now) {
  DriveClaims::First first;
  first.time = now.time;
  first.distance = std::numeric_limits<double>::infinity();
  for (const Placement& object : placements_at(drive.scene, *now.truth)) {
    first.distance =
        std::min(first.distance, (object.position.head<2>() - now.vehicle.position).norm());
  }
  Eigen::Vector2d before = now.vehicle.position;
  for (const DriveFrame& frame : result.frames) {
    if (frame.time <= now.time) continue;
    first.lead += (frame.vehicle.position - before).norm();
    first.lead_time = frame.time - now.time;
    before = frame.vehicle.position;
    if (frame.fate == FrameFate::in_sight) break;
  }
  return first;
}

}  // namespace

std::optional<double> PositionErrors::rms() const {
  return positions > 0 ? std::optional(std::sqrt(squared / positions)) : std::nullopt;
}

std::optional<double> PositionErrors::ratio() const {
  return freedom > 0 ? std::optional(normalised / freedom) : std::nullopt;
}

void PositionErrors::add(const PositionErrors& other) {
  squared += other.squared;
  normalised += other.normalised;
  positions += other.positions;
  freedom += other.freedom;
}

DriveClaims drive_claims(const Drive& drive, const DriveResult& result) {
  DriveClaims claims;
  double last = -std::numeric_limits<double>::infinity();
  for (const DriveFrame& frame : result.frames) {
    const double time = frame.time - frame.mixture_age;
    if (!frame.mixture || by_sight(frame) || time < last + kSameTime) continue;
    last = time;
    const DriveFrame* then = captured(result, time);
    if (then == nullptr) continue;
    if (then->truth && !in_search_region(drive.scene, *then->truth)) {
      ++claims.outside;
      continue;
    }
    ++claims.answers;
    const PoseMixture& mixture = *frame.mixture;
    if (mixture.presence_probability <= kSurePresence || mixture.modes.empty()) {
      claims.lost += claims.first ? 1 : 0;
      continue;
    }
    ++claims.sure;
    const double level = then->truth ? credible_level(drive.scene, mixture, *then->truth) : 1.0;
    claims.covered += level <= kCovered ? 1 : 0;
    claims.wrong += level > kWrong ? 1 : 0;
    claims.wrong_flagged += level > kWrong && doubted(frame) ? 1 : 0;
    if (!then->truth) continue;
    const PoseMixture now = *known_later(drive, frame);
    claims.covered_in_map += credible_level(drive.scene, now, *frame.truth) <= kCovered ? 1 : 0;
    if (mixture.modes.front().weight > kDominates) {
      claims.at_capture.add(errors_of(drive.scene, mixture.modes.front(), *then->truth));
      claims.in_map.add(errors_of(drive.scene, now.modes.front(), *frame.truth));
    }
    if (!claims.first && level <= kCovered) claims.first = first_claim(drive, result, frame);
  }
  return claims;
}

}  // namespace blindcorner
