// SPDX-License-Identifier: Apache-2.0
/// What a vehicle makes of its sensor's frames: one interface for all that may sit behind it.
///
/// A perception that is added is one file that implements Perception, and one line in the list of
/// perception.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/simulation/perception_networks.h"

namespace blindcorner {

/// What a perception says of hidden objects after a frame.
struct PerceptionAnswer {
  std::optional<PoseMixture> mixture;    ///< empty: it has nothing to say
  std::vector<PoseVelocity> velocities;  ///< [modes] where it knows them, else empty
  std::vector<std::string> flags;        ///< words, as those of a fit's result
  std::string error;                     ///< one line when it failed on the frame; else empty
};

/// Called with the frames in the order of time; keeps what it learnt. Not thread safe.
class Perception {
 public:
  virtual ~Perception() = default;

  /// `capture` with the sensor's pose in the world; `time` in s since the start of the drive. Never
  /// throws for a frame that it cannot use: the answer's `error` says so.
  virtual PerceptionAnswer perceive(const Capture& capture, const Transform& T_world_sensor,
                                    double time) = 0;

  /// Whether it looks at the histograms: nobody need sense them for one that does not.
  virtual bool needs_histograms() const { return true; }
  /// Whether the vehicle drives as if somebody might come from wherever it does not see
  /// (occluded_speed.h).
  virtual bool expects_unseen() const { return false; }
  /// Hidden objects go to the map as discs of this radius, m; empty: as the scene's shapes.
  virtual std::optional<double> disc_radius() const { return std::nullopt; }
};

/// What perceptions are made from.
struct PerceptionSetup {
  const Scene& scene;  ///< as the vehicle knows it
  Motion motion;       ///< of hidden objects as a tracker assumes it
  /// Of that scene, for the solver: what it compiles serves all who share it. Null: one of its own.
  std::shared_ptr<const Fitter> fitter;
  /// The hidden objects' true pose at a time, s; empty: there are none. For the oracle only.
  std::function<std::optional<PoseVector>(double)> truth;
  double injected_error = 0;      ///< m, by which misled oracles miss the truth
  std::uint64_t seed = 1;         ///< of the direction in which they do
  PerceptionNetworks networks{};  ///< of the perceptions that are networks
};

/// "los": knows hidden objects only when they are in sight, so it never has anything to say itself.
/// "los_cautious": the same, driving such that the vehicle can stop for whoever may come from where
/// it does not see.
/// "solver": the fit and its tracker. "cnn": the published network, whose answer is taken for
/// certain and for a disc of 1 m, as published. "cnn_wide": the ensemble, with the covariance that
/// it states. "oracle": the truth, within the known pose's
/// deviations. "oracle_disc" and "oracle_covariance" are misled by an injected error, one direction
/// a drive: the first is sure of a disc of 1 m there, as published; the second states a covariance
/// to match.
std::vector<std::string> perception_names();

/// Time from a frame's arrival to the answer, s, where a drive file declares none: an upper
/// estimate of perceptions that only compute a network; 0 of the others.
double default_delay(const std::string& name);
/// What the drive file declares, else that.
double declared_delay(const Drive& drive, const std::string& name);

/// Throws Error naming `field` unless the name is among those that are accepted there.
void check_perception(const std::string& name, const std::string& field,
                      const std::vector<std::string>& accepted = perception_names());

/// Throws Error for an unknown name, and where the scene does not suit the perception.
std::unique_ptr<Perception> make_perception(const std::string& name, const PerceptionSetup& setup);

/// Standard deviations that are stated of a pose which is known: a finger's breadth, a few degrees.
inline constexpr double kKnownPosition = 0.02;  ///< m
inline constexpr double kKnownAngle = 0.05;     ///< rad
inline constexpr double kKnownSpeed = 0.05;     ///< m/s
inline constexpr double kKnownSize = 0.02;      ///< relative

/// Radius of the disc that the published study of localisation errors takes an obstacle for, m.
inline constexpr double kPublishedDisc = 1.0;

/// The mixture that states a known pose (empty: that nothing is there) within these.
PoseMixture known_pose(const Scene& scene, const std::optional<PoseVector>& pose);

}  // namespace blindcorner
