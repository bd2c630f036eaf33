// SPDX-License-Identifier: Apache-2.0
/// Ways to divide measured captures into captures to learn and captures to evaluate, by the true
/// positions of the object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// A position given by its true values. Its hash gives an order that depends on nothing else, so
/// that splits are the same whatever else is in the file.
struct LabelledPosition {
  std::string key;
  std::uint64_t hash = 0;
  PoseVector pose;
};

/// Throws Error naming the capture unless it carries the true value of every unknown.
LabelledPosition position_of(const Scene& scene, const Capture& capture);
std::vector<LabelledPosition> positions_of(const Scene& scene, std::span<const Capture> captures);

struct PositionSplit {
  std::vector<std::size_t> learn;     ///< indices of captures
  std::vector<std::string> evaluate;  ///< keys of positions, sorted

  /// Indices of the captures at the evaluated positions.
  std::vector<std::size_t> evaluated(std::span<const LabelledPosition> positions) const;
};

/// One way of dividing. Each of its splits is evaluated. Together, the splits make one row of a
/// table.
struct SplitScheme {
  std::string scheme;  ///< "folds"
  std::string name;    ///< "5 folds", "lower half of x_m calibrated"
  std::vector<PositionSplit> splits;
};

struct SplitOptions {
  /// "folds": learn all folds but one. "few": learn a few positions of one fold. "halves": learn
  /// one half of the volume, along each coordinate and each way.
  std::vector<std::string> schemes{"folds", "few", "halves"};
  int folds = 5;  ///< number of folds, by a hash of the true position
  int few = 40;   ///< positions that the scheme "few" learns

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Schemes in the order asked for, without schemes that have no split. `names` are the names of the
/// unknowns.
std::vector<SplitScheme> split_schemes(std::span<const LabelledPosition> positions,
                                       const std::vector<std::string>& names,
                                       const SplitOptions& options);

}  // namespace blindcorner
