// SPDX-License-Identifier: Apache-2.0
/// Captures whose truth comes from none of this project's models. An independent path tracer
/// computed the light in absolute units.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// A traced histogram, W/m^2 per bin as in ForwardModel::three_bounce, and its standard errors.
struct TracedLight {
  HistogramCube mean, standard_error;
};

/// A scene's light at several poses of its hidden objects, and without them.
struct TracedScene {
  std::vector<PoseVector> poses;   ///< [poses] values of the scene's unknowns
  std::vector<TracedLight> light;  ///< [poses] all bounces, the known scene's own light included
  TracedLight empty;
};

/// Reads an archive (.npz) with the arrays `poses` [pose, 4] (x, y, z in m and yaw in degrees of
/// the first object), `mean` and `standard_error` [pose, row, column, bin], `empty_mean` and
/// `empty_standard_error` [row, column, bin]. The other objects are shifted along with the first
/// and not turned. Throws Error naming file and array, also if the arrays do not suit the scene.
TracedScene read_traced_scene(const Scene& scene, const std::string& path);

/// The archive of a scene's traced light in a directory, or in the directory's folder mitransient.
/// `reference_NAME.json` belongs to NAME.npz.
std::string traced_file(const std::string& directory, const std::string& scene_path);

/// Light that the object adds at a pose. It may be negative because of the tracer's noise.
HistogramCube object_light(const TracedScene& traced, std::size_t pose);

/// The same poses with the objects' light from the reference renderer, sampled `sampling` times as
/// densely as by default, without standard errors. This shows what is left without the tracer's
/// noise.
TracedScene rendered_objects(const Scene& scene, const TracedScene& traced, double sampling);

/// Draws captures of a traced scene.
class TracedCaptures {
 public:
  /// `own_light`, W/m^2, replaces the tracer's light of the empty scene. Null: it does not.
  TracedCaptures(const Scene& scene, TracedScene traced, const HistogramCube* own_light = nullptr);

  std::size_t poses() const { return traced_.poses.size(); }
  const TracedScene& traced() const { return traced_; }
  /// Standard errors of the traced part of the expected light, W/m^2 per bin. If the empty scene's
  /// traced light was taken away, its errors are included.
  HistogramCube standard_error(std::size_t pose) const;
  /// Expected counts of one exposure: gain * light + ambient.
  const HistogramCube& expected(std::size_t pose) const { return expected_[pose]; }
  /// Number of exposures after which the object's light has this many photons, on average over the
  /// poses.
  double exposures(double photons) const { return photons / mean_counts_; }

  /// Ambient light, counts per bin of one exposure.
  double ambient() const { return ambient_; }

  /// A capture of exposures(photons) exposures, with its truth. The ambient light is the same at
  /// all poses. On average over the poses, it is as strong as the object's light within the bins
  /// that hold 90 % of that light. The same seed gives the same counts.
  Capture capture(std::size_t pose, double photons, std::uint64_t seed) const;

 private:
  Scene scene_;
  TracedScene traced_;
  std::vector<HistogramCube> expected_;
  double mean_counts_ = 0;
  double ambient_ = 0;
  bool objects_alone_ = false;  ///< the empty scene's traced light was taken away
};

}  // namespace blindcorner
