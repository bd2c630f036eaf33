// SPDX-License-Identifier: Apache-2.0
/// A classical baseline: one path length for each zone, and the point that fits these path lengths
/// best.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

struct MultilaterationOptions {
  /// A peak counts from this many standard deviations of photon noise on. Among some hundred places
  /// of a time axis, noise alone reaches 4 once in a hundred zones.
  double threshold = 4;
  int starts_per_axis = 3;  ///< evenly over the search region; by judgement, 27 for three axes

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Subtracts the static background from the histograms and picks each zone's strongest peak. The
/// peak is the best match with the pulse inside the time gate, the bins that light of the search
/// region may reach. The pulse is as wide as such light is on average. The peak's path length puts
/// the object on an ellipsoid about the lit and the seen part of the relay. Robust nonlinear least
/// squares finds the point nearest to all ellipsoids, from several starts within the search region.
/// A weak pull towards the middle of the prior (as wide as the prior) decides what the paths leave
/// open. Shadows, the object's extent and the peaks' heights are ignored. The middle of the prior
/// answers yaw and size, and all unknowns where no zone has a peak.
class Multilateration {
 public:
  /// Throws Error for a scene of several hidden objects or without an unknown position.
  explicit Multilateration(const Scene& scene, const MultilaterationOptions& options = {});
  ~Multilateration();
  Multilateration(Multilateration&&) noexcept;
  Multilateration& operator=(Multilateration&&) noexcept;

  /// Values of the scene's unknowns from one capture, at the capture's own sensor pose where it has
  /// one. Thread safe. Throws Error for a capture that does not suit the scene.
  PoseVector predict(const Capture& capture) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
