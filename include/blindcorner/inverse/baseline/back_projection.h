// SPDX-License-Identifier: Apache-2.0
/// A classical baseline: back-projection of the captured light onto a grid over the search region.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

struct BackProjectionOptions {
  /// Distance of two voxels, as a path in standard deviations of pulse and bin. Half a step off,
  /// the path there and back is at most 0.5 off, and a score keeps exp(-0.5^2 / 4) = 0.94 of its
  /// value.
  double spacing = 0.5;
  /// Most voxels of the first grid: 20 along each of three axes. The grid's spacing grows until it
  /// has no more voxels. By judgement, to limit the time.
  int max_voxels = 8000;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Subtracts the static background from the histograms and projects the rest back onto every voxel.
/// Light by way of a voxel arrives in each zone as a pulse. The pulse's time and width follow from
/// the lit and the seen relay patches (sensor - relay - voxel - relay - sensor). The voxel's score
/// is the correlation of these pulses with the counts, weighted with the photon noise. Shadows of
/// known bodies count. The object's extent and yaw do not, so the answer is where the object shines
/// most and not its middle. From the strongest voxel, a climb over ever finer voxels and then
/// parabolas lead to the position. An axis along which the score changes by less than half a unit
/// of log likelihood cannot be determined: its answer is the middle of the prior. The middle of the
/// prior also answers yaw and size always, and all unknowns of a capture without light.
class BackProjection {
 public:
  /// Throws Error for a scene of several hidden objects or without an unknown position.
  explicit BackProjection(const Scene& scene, const BackProjectionOptions& options = {});
  ~BackProjection();
  BackProjection(BackProjection&&) noexcept;
  BackProjection& operator=(BackProjection&&) noexcept;

  /// Values of the scene's unknowns from one capture, at the capture's own sensor pose where it has
  /// one. Thread safe. Throws Error for a capture that does not suit the scene.
  PoseVector predict(const Capture& capture) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The middle of the scene's prior: an answer that does not use the capture.
PoseVector middle_of_prior(const Scene& scene);

}  // namespace blindcorner
