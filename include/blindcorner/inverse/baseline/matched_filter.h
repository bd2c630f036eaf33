// SPDX-License-Identifier: Apache-2.0
/// A classical baseline: the best of a grid of poses, as a matched filter scores them.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

struct MatchedFilterOptions {
  /// Of the grid, whose spacing grows until they are no more: as FitOptions::max_scored_poses.
  int max_poses = 20'000;
  /// Their histograms are closed-form pulses, of microseconds each; else the cheap fast model's,
  /// whose tables take seconds.
  bool closed_form = true;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// The expected histogram of every pose of a grid over the search region is compared with the
/// capture; the best of them is the answer, without any refinement. These are the poses and the
/// scores that a fit starts from, so that the difference is what refinement is worth.
class MatchedFilterBaseline {
 public:
  explicit MatchedFilterBaseline(const Scene& scene, const MatchedFilterOptions& options = {});
  ~MatchedFilterBaseline();
  MatchedFilterBaseline(MatchedFilterBaseline&&) noexcept;
  MatchedFilterBaseline& operator=(MatchedFilterBaseline&&) noexcept;

  /// Values of the scene's unknowns from one capture, at its own sensor pose where it carries one;
  /// the middle of the prior for a capture without light. Thread safe. Throws Error for a capture
  /// that does not suit the scene.
  PoseVector predict(const Capture& capture) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
