// SPDX-License-Identifier: Apache-2.0
/// A classical baseline: the captured light is projected back onto a grid over the search region.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

struct BackProjectionOptions {
  /// Distance of two voxels, in standard deviations of pulse and bin as path: half a step
  /// off, paths there and back are 0.5 off at most, and a score keeps exp(-0.5^2 / 4) = 0.94 of it.
  double spacing = 0.5;
  /// Of the first grid, whose spacing grows until they are no more: 20 along each of three axes. By
  /// judgement: a limit of the time.
  int max_voxels = 8000;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Static background is taken off the histograms. The rest is projected back onto every voxel:
/// light by way of it arrives in each zone as a pulse whose time and width follow from the lit and
/// the seen relay patches (sensor - relay - voxel - relay - sensor), and the correlation of these
/// pulses with the counts, weighted with the photon noise, is the voxel's score. Shadows of known
/// bodies count; the object's extent and its turn do not, so that the answer is where it shines
/// most and not its middle. The strongest voxel, refined by parabolas, is the position. An axis
/// along which the score changes by less than half a unit of log likelihood cannot be told: it is
/// answered by the middle of the prior, as are yaw and size always, and all unknowns of a capture
/// without light.
class BackProjection {
 public:
  /// Throws Error for a scene of several hidden objects or without an unknown position.
  explicit BackProjection(const Scene& scene, const BackProjectionOptions& options = {});
  ~BackProjection();
  BackProjection(BackProjection&&) noexcept;
  BackProjection& operator=(BackProjection&&) noexcept;

  /// Values of the scene's unknowns from one capture, at its own sensor pose where it carries one.
  /// Thread safe. Throws Error for a capture that does not suit the scene.
  PoseVector predict(const Capture& capture) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The middle of the scene's prior: what says nothing about the capture.
PoseVector middle_of_prior(const Scene& scene);

}  // namespace blindcorner
