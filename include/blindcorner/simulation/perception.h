// SPDX-License-Identifier: Apache-2.0
/// How a vehicle interprets its sensor's frames: one interface for all perceptions.
///
/// A new perception needs one file that implements Perception, and one line in the list of
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

/// A perception's answer about hidden objects after a frame.
struct PerceptionAnswer {
  std::optional<PoseMixture> mixture;    ///< empty: the perception has nothing to say
  std::vector<PoseVelocity> velocities;  ///< [modes] if the perception knows them, else empty
  std::vector<std::string> flags;        ///< words, like the flags of a fit's result
  std::string error;  ///< one line if the perception failed on the frame; else empty
};

/// Gets the frames in the order of time, and keeps what it learns. Not thread safe.
class Perception {
 public:
  virtual ~Perception() = default;

  /// Answers a capture taken from the sensor's pose in the world. `time`: s since the start of the
  /// drive. Never throws for a frame that the perception cannot use: the answer's `error` says so.
  virtual PerceptionAnswer perceive(const Capture& capture, const Transform& T_world_sensor,
                                    double time) = 0;

  /// Whether the perception uses the histograms. If not, nobody needs to sense them.
  virtual bool needs_histograms() const { return true; }
  /// Whether the vehicle drives as if somebody might come from any place that it does not see
  /// (occluded_speed.h).
  virtual bool expects_unseen() const { return false; }
  /// Radius of the discs that represent hidden objects in the map, m. Empty: the scene's shapes.
  virtual std::optional<double> disc_radius() const { return std::nullopt; }
};

/// Inputs that perceptions are made from.
struct PerceptionSetup {
  const Scene& scene;  ///< scene as the vehicle knows it
  Motion motion;       ///< motion of hidden objects as a tracker assumes it
  /// Fitter of that scene, for the solver. What the fitter compiles serves all perceptions that
  /// share it. Null: the solver makes its own.
  std::shared_ptr<const Fitter> fitter;
  /// The hidden objects' true pose at a time, s. Empty: there are none. For the oracles only.
  std::function<std::optional<PoseVector>(double)> truth;
  double injected_error = 0;      ///< m, distance by which misled oracles miss the truth
  std::uint64_t seed = 1;         ///< seed of the direction of this error
  PerceptionNetworks networks{};  ///< networks of the perceptions that need one
};

/// Names of all perceptions:
/// "los" knows hidden objects only when they are in sight, so it never has an answer of its own.
/// "los_cautious" is the same, but the vehicle drives so that it can stop for anybody who may come
/// from a place that it does not see.
/// "solver" is the fit and its tracker.
/// "cnn" is the published network. As published, its answer is taken as certain and as a disc of
/// 1 m.
/// "cnn_wide" is the ensemble, with the covariance that it states.
/// "oracle" is the truth, with the standard deviations of a known pose.
/// "oracle_disc" and "oracle_covariance" are misled by an injected error, in one direction for each
/// drive. The first is sure of a disc of 1 m at the wrong place, as published. The second states a
/// covariance that matches the error.
std::vector<std::string> perception_names();

/// Time from a frame's arrival to the answer, s, if a drive file declares none. It is an upper
/// estimate for perceptions that only compute a network, and 0 for the others.
double default_delay(const std::string& name);
/// The delay that the drive file declares, else the default delay.
double declared_delay(const Drive& drive, const std::string& name);

/// Throws Error naming `field` unless the name is among the accepted names.
void check_perception(const std::string& name, const std::string& field,
                      const std::vector<std::string>& accepted = perception_names());

/// Throws Error for an unknown name, and if the scene does not suit the perception.
std::unique_ptr<Perception> make_perception(const std::string& name, const PerceptionSetup& setup);

/// Standard deviations that are stated for a known pose: a finger's breadth, a few degrees.
inline constexpr double kKnownPosition = 0.02;  ///< m
inline constexpr double kKnownAngle = 0.05;     ///< rad
inline constexpr double kKnownSpeed = 0.05;     ///< m/s
inline constexpr double kKnownSize = 0.02;      ///< relative

/// Radius of the disc that represents an obstacle in the published study of localisation errors, m.
inline constexpr double kPublishedDisc = 1.0;

/// The mixture that states a known pose with these standard deviations. An empty pose states that
/// nothing is there.
PoseMixture known_pose(const Scene& scene, const std::optional<PoseVector>& pose);

}  // namespace blindcorner
