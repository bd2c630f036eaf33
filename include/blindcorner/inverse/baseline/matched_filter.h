// SPDX-License-Identifier: Apache-2.0
/// A classical baseline: the best pose of a grid by the score of a matched filter.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

struct MatchedFilterOptions {
  /// Most poses of the grid, whose spacing grows until it has no more poses. As
  /// FitOptions::max_scored_poses.
  int max_poses = 20'000;
  /// True: the poses' histograms are closed-form pulses, which take microseconds each. False: they
  /// come from the cheap fast model, whose tables take seconds.
  bool closed_form = true;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Compares the expected histogram of every pose of a grid over the search region with the capture.
/// The best pose is the answer, without any refinement. A fit starts from such poses and scores (in
/// closed form, of at most FitOptions::max_closed_form_poses poses), so the difference from a fit
/// shows what refinement is worth.
class MatchedFilterBaseline {
 public:
  explicit MatchedFilterBaseline(const Scene& scene, const MatchedFilterOptions& options = {});
  ~MatchedFilterBaseline();
  MatchedFilterBaseline(MatchedFilterBaseline&&) noexcept;
  MatchedFilterBaseline& operator=(MatchedFilterBaseline&&) noexcept;

  /// Values of the scene's unknowns from one capture, at the capture's own sensor pose where it has
  /// one. A capture without light gets the middle of the prior. Thread safe. Throws Error for a
  /// capture that does not suit the scene.
  PoseVector predict(const Capture& capture) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
