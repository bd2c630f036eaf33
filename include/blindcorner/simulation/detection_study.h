// SPDX-License-Identifier: Apache-2.0
/// Tests whether the fit notices an object, and how often it reports an object where there is none.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/simulation/claim_study.h"

namespace blindcorner {

struct DetectionOptions : ClaimStudyOptions {
  DetectionOptions() { photons = {3, 10, 30, 100, 300, 1000}; }

  int empty_captures = 1000;  ///< captures without an object at each level of light, drawn apart
                              ///< from the empty captures that fits calibrate themselves with

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// A fit's statement about presence.
struct DetectionTrial {
  std::string error;  ///< why there is no answer; empty: there is one
  double presence = 0;
  double false_alarm = 1;
  bool reported = false;  ///< the fit is not flagged `nothing_detected`
};

/// Shares of the empty captures, and of the captures with an object, that score at least a
/// threshold.
struct RocPoint {
  double false_share = 0, true_share = 0;
};

/// Curve from (0, 0) to (1, 1) with a point for each score that occurs. Captures that score at
/// least this value are called detections.
std::vector<RocPoint> roc_curve(std::span<const double> with, std::span<const double> without);
/// Probability that a capture with an object scores higher than an empty one; equal scores count
/// half.
double area_below(std::span<const RocPoint> curve);
/// Share of detections at a share of false alarms, interpolated linearly between points.
double true_share_at(std::span<const RocPoint> curve, double false_share);

/// One level of light of a scene. Each of its claims is a share of empty captures whose false-alarm
/// probability is below p.
struct DetectionLevel : ClaimLevel {
  std::vector<DetectionTrial> with, without;
  /// Curves whose score is the presence probability, or the false-alarm probability (the smaller,
  /// the higher the score).
  std::vector<RocPoint> by_presence, by_false_alarm;
  int reported_with = 0, reported_without = 0;  ///< not flagged nothing_detected
};

using DetectionScene = StudyScene<DetectionLevel>;
using DetectionReport = StudyReport<DetectionOptions, DetectionLevel>;

/// Runs the study on one scene; claims are judged by judge_study() over all scenes.
DetectionScene study_detection(const Scene& scene, const DetectionOptions& options,
                               const std::function<void()>& advance = {});

}  // namespace blindcorner
