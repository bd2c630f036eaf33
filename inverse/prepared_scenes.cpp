// SPDX-License-Identifier: Apache-2.0
#include "inverse/prepared_scenes.h"

#include <algorithm>
#include <iterator>

#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/forward/transport/transport_plan.h"

namespace blindcorner {
namespace {

/// Number of captures of one sensor placement from which tables of exact histograms pay: the tables
/// cost seconds and save some ten milliseconds for each capture.
constexpr int kManyCaptures = 50;
/// Finite-difference step of the sensor's own pose, m and rad (of equal length a metre away). It
/// changes a path by 4 mm at most, which is an error of (h / sigma)^2 / 6 = 0.2 % for a pulse of
/// 4 cm.
constexpr double kSensorStep = 2e-3;

bool same(const std::vector<SensorPlacement>& a, const std::vector<SensorPlacement>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const SensorPlacement& x, const SensorPlacement& y) {
                      return x.T_world_sensor.isApprox(y.T_world_sensor, 1e-12) &&
                             std::equal(x.relay_points.begin(), x.relay_points.end(),
                                        y.relay_points.begin(), y.relay_points.end(),
                                        [](const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
                                          return p == q || (!p.allFinite() && !q.allFinite());
                                        });
                    });
}

std::unique_ptr<MovedModels> move_sensor(const std::vector<SensorPlacement>& placements,
                                         const CompiledScene& compiled) {
  auto moved = std::make_unique<MovedModels>();
  for (std::size_t i = 0; i < 6; ++i) {
    moved->step[i] = kSensorStep;
    for (const double sign : {1.0, -1.0}) {
      ModelSet& set = sign > 0 ? moved->plus[i] : moved->minus[i];
      FastModelOptions fast;
      fast.sampling_step = compiled.models().front()->sampling_step();
      for (SensorPlacement placement : placements) {
        if (i < 3) {
          placement.T_world_sensor.translation()[static_cast<int>(i)] += sign * kSensorStep;
        } else {
          placement.T_world_sensor.linear() =
              Eigen::AngleAxisd(sign * kSensorStep,
                                Eigen::Vector3d::Unit(static_cast<int>(i) - 3)) *
              placement.T_world_sensor.linear();
        }
        set.push_back(make_fast_model(compiled.knowledge->transport(), placement, fast));
      }
    }
  }
  return moved;
}

}  // namespace

PreparedScenes::PreparedScenes(const Scene& scene, const FitOptions& options)
    : scene_(scene), options_(options), knowledge_(std::make_shared<const SceneKnowledge>(scene)) {}

std::shared_ptr<Prepared> PreparedScenes::at(const std::vector<SensorPlacement>& placements) {
  std::shared_ptr<Prepared> entry = find(placements);
  std::call_once(entry->once, [&] {
    entry->compiled = compile(scene_, placements, options_, grid_options(), knowledge_);
    if (scene_.sensor_covariance) entry->moved = move_sensor(placements, *entry->compiled);
    entry->bytes = entry->compiled->bytes();
  });
  drop_least_used();
  return entry;
}

const CompiledScene* PreparedScenes::near_relay(Prepared& whole) const {
  std::call_once(whole.near_once, [&] {
    const auto ranges = ranges_near_relay(scene_);
    if (!ranges || whole.compiled->coarse.empty()) return;
    Scene part = scene_;
    part.unknowns = *ranges;
    whole.near = compile(part, whole.placements, options_, grid_options(), knowledge_);
  });
  return whole.near.get();
}

FalseAlarmCalibration& PreparedScenes::false_alarms(const std::shared_ptr<Prepared>& own) {
  std::shared_ptr<Prepared> place = own;
  const std::vector<SensorPlacement> at_home{sensor_placement(scene_)};
  if (own->placements.size() == 1 && own->placements.front().relay_points.empty() &&
      at_home.front().relay_points.empty()) {
    std::call_once(home_once_, [&] { home_ = at(at_home); });
    place = home_;
  }
  const std::scoped_lock lock(mutex_);
  if (!place->false_alarms) {
    place->false_alarms = std::make_unique<FalseAlarmCalibration>(place->compiled.get());
  }
  return *place->false_alarms;
}

std::shared_ptr<Prepared> PreparedScenes::find(const std::vector<SensorPlacement>& placements) {
  const std::scoped_lock lock(mutex_);
  for (auto it = prepared_.begin(); it != prepared_.end(); ++it) {
    if (!same((*it)->placements, placements)) continue;
    prepared_.splice(prepared_.begin(), prepared_, it);
    return prepared_.front();
  }
  prepared_.push_front(std::make_shared<Prepared>());
  prepared_.front()->placements = placements;
  return prepared_.front();
}

void PreparedScenes::drop_least_used() {
  const std::scoped_lock lock(mutex_);
  std::size_t bytes = 0;
  for (auto it = prepared_.begin(); it != prepared_.end();) {
    bytes += (*it)->bytes;
    const bool keep = it == prepared_.begin() || bytes <= options_.cache_bytes || (*it)->bytes == 0;
    it = keep ? std::next(it) : prepared_.erase(it);
  }
}

GridOptions PreparedScenes::grid_options() const {
  GridOptions grid;
  grid.closed_form = options_.captures_per_placement < kManyCaptures;
  grid.max_poses = grid.closed_form && knowledge_->coarse() ? options_.max_closed_form_poses
                                                            : options_.max_scored_poses;
  grid.closed_form_poses = options_.max_closed_form_poses;
  return grid;
}

}  // namespace blindcorner
