// SPDX-License-Identifier: Apache-2.0
/// Whether the fit notices that an object is there, and how often it takes nothing for one.
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

  int empty_captures = 1000;  ///< without an object, at each level of light, drawn apart from those
                              ///< that fits calibrate themselves with

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// What a fit says about presence.
struct DetectionTrial {
  std::string error;  ///< why there is no answer; empty: there is
  double presence = 0;
  double false_alarm = 1;
  bool reported = false;  ///< the fit is not flagged `nothing_detected`
};

/// A threshold's share of empty captures above it, and of those with an object.
struct RocPoint {
  double false_share = 0, true_share = 0;
};

/// From (0, 0) to (1, 1), a point for each value that occurs: captures whose score is at least so
/// much are called detections.
std::vector<RocPoint> roc_curve(std::span<const double> with, std::span<const double> without);
/// Probability that a capture with an object scores higher than an empty one; equal scores count
/// half.
double area_below(std::span<const RocPoint> curve);
/// Share of detections at a share of false alarms, linear between points.
double true_share_at(std::span<const RocPoint> curve, double false_share);

/// One level of light of a scene. Its claims: the share of empty captures whose false-alarm
/// probability is below p.
struct DetectionLevel : ClaimLevel {
  std::vector<DetectionTrial> with, without;
  /// Presence (its odds) and the false-alarm probability (the smaller the higher) as statistics.
  std::vector<RocPoint> by_presence, by_false_alarm;
  int reported_with = 0, reported_without = 0;  ///< not flagged nothing_detected
};

using DetectionScene = StudyScene<DetectionLevel>;
using DetectionReport = StudyReport<DetectionOptions, DetectionLevel>;

/// Runs the study on one scene; claims are judged by judge_study() over all scenes.
DetectionScene study_detection(const Scene& scene, const DetectionOptions& options,
                               const std::function<void()>& advance = {});

}  // namespace blindcorner
