// SPDX-License-Identifier: Apache-2.0
/// A classical baseline: one path length for each zone, and the point that has these distances.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

struct MultilaterationOptions {
  /// A peak counts from this many standard deviations of photon noise on; among some hundred
  /// places of a time axis, noise alone gets to 4 once in a hundred zones.
  double threshold = 4;
  int starts_per_axis = 3;  ///< evenly over the search region; by judgement, 27 of three axes

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Static background is taken off the histograms, and in what is left each zone's strongest peak is
/// picked: the best match with the pulse, as wide as light of the search region is on average,
/// within the bins that such light may reach. Its path length puts the object on an ellipsoid about
/// what is lit and what the zone sees. The point nearest to all ellipsoids is found by robust
/// nonlinear least squares from several starts within the search region; a weak pull towards the
/// middle of the prior (as wide as the prior) decides what the paths leave open. Shadows, the
/// object's extent and the peaks' heights are not looked at. Yaw and size, and all unknowns where
/// no zone has a peak, are answered by the middle of the prior.
class Multilateration {
 public:
  /// Throws Error for a scene of several hidden objects or without an unknown position.
  explicit Multilateration(const Scene& scene, const MultilaterationOptions& options = {});
  ~Multilateration();
  Multilateration(Multilateration&&) noexcept;
  Multilateration& operator=(Multilateration&&) noexcept;

  /// Values of the scene's unknowns from one capture, at its own sensor pose where it carries one.
  /// Thread safe. Throws Error for a capture that does not suit the scene.
  PoseVector predict(const Capture& capture) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
