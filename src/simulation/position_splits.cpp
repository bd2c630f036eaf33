// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/position_splits.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// FNV-1a of the values in tenths of a millimetre (or of a milliradian).
std::uint64_t hash_of(const PoseVector& pose) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const double value : pose) {
    auto rounded = static_cast<std::int64_t>(std::llround(value * 1e4));
    for (int byte = 0; byte < 8; ++byte) {
      hash = (hash ^ static_cast<std::uint64_t>(rounded & 0xff)) * 1099511628211ull;
      rounded >>= 8;
    }
  }
  // Low bits of FNV are weak.
  return (hash ^ (hash >> 29)) * 0x9e3779b97f4a7c15ull >> 11;
}

void add_unless_empty(std::vector<PositionSplit>& splits, PositionSplit split) {
  if (split.learn.empty() || split.evaluate.empty()) return;
  std::ranges::sort(split.evaluate);
  splits.push_back(std::move(split));
}

std::vector<std::size_t> captures_of_fold(std::span<const LabelledPosition> positions, int fold,
                                          int folds) {
  std::vector<std::size_t> own;
  for (std::size_t c = 0; c < positions.size(); ++c) {
    if (positions[c].hash % static_cast<std::uint64_t>(folds) == static_cast<std::uint64_t>(fold)) {
      own.push_back(c);
    }
  }
  return own;
}

/// Learns on the chosen captures and evaluates the others, or the other way round.
PositionSplit learn_and_evaluate(std::span<const LabelledPosition> positions,
                                 const std::vector<std::size_t>& chosen, bool learn_chosen) {
  PositionSplit split;
  for (std::size_t c = 0; c < positions.size(); ++c) {
    const bool inside = std::ranges::find(chosen, c) != chosen.end();
    if (inside == learn_chosen) {
      split.learn.push_back(c);
    } else {
      split.evaluate.push_back(positions[c].key);
    }
  }
  return split;
}

std::vector<PositionSplit> fold_splits(std::span<const LabelledPosition> positions, int folds) {
  std::vector<PositionSplit> splits;
  for (int f = 0; f < folds; ++f) {
    add_unless_empty(splits,
                     learn_and_evaluate(positions, captures_of_fold(positions, f, folds), false));
  }
  return splits;
}

std::vector<PositionSplit> few_splits(std::span<const LabelledPosition> positions, int folds,
                                      int few) {
  std::vector<PositionSplit> splits;
  for (int f = 0; f < folds; ++f) {
    std::vector<std::size_t> own = captures_of_fold(positions, f, folds);
    std::ranges::sort(own, {}, [&](std::size_t c) { return positions[c].hash / 7; });
    own.resize(std::min(own.size(), static_cast<std::size_t>(few)));
    add_unless_empty(splits, learn_and_evaluate(positions, own, true));
  }
  return splits;
}

/// Two splits at the median of one coordinate: one learns below it and evaluates above it, the
/// other one does the reverse.
std::vector<PositionSplit> half_splits(std::span<const LabelledPosition> positions,
                                       Eigen::Index coordinate) {
  std::vector<double> values;
  for (const LabelledPosition& p : positions) values.push_back(p.pose[coordinate]);
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  const double middle = values[values.size() / 2];
  std::vector<PositionSplit> splits(2);
  for (std::size_t c = 0; c < positions.size(); ++c) {
    const std::size_t half = positions[c].pose[coordinate] < middle ? 0 : 1;
    splits[half].learn.push_back(c);
    splits[1 - half].evaluate.push_back(positions[c].key);
  }
  for (PositionSplit& split : splits) std::ranges::sort(split.evaluate);
  return splits;
}

}  // namespace

LabelledPosition position_of(const Scene& scene, const Capture& capture) {
  const std::vector<std::string> names = unknown_names(scene);
  LabelledPosition position;
  position.pose.resize(static_cast<Eigen::Index>(names.size()));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto value = capture.truth.find(names[i]);
    if (value == capture.truth.end() || !std::isfinite(value->second)) {
      throw Error(capture.source + " capture " + std::to_string(capture.index),
                  "truth: accepted: the true value of every unknown");
    }
    position.pose[static_cast<Eigen::Index>(i)] = value->second;
  }
  position.hash = hash_of(position.pose);
  position.key = std::to_string(position.hash);
  return position;
}

std::vector<LabelledPosition> positions_of(const Scene& scene, std::span<const Capture> captures) {
  std::vector<LabelledPosition> positions;
  for (const Capture& capture : captures) positions.push_back(position_of(scene, capture));
  return positions;
}

std::vector<std::size_t> PositionSplit::evaluated(
    std::span<const LabelledPosition> positions) const {
  std::vector<std::size_t> chosen;
  for (std::size_t c = 0; c < positions.size(); ++c) {
    if (std::ranges::binary_search(evaluate, positions[c].key)) chosen.push_back(c);
  }
  return chosen;
}

void SplitOptions::validate() const {
  for (const std::string& scheme : schemes) {
    if (scheme != "folds" && scheme != "few" && scheme != "halves") {
      throw Error("schemes", "found " + scheme + ", accepted: folds, few, halves");
    }
  }
  if (folds < 2 || folds > 1000) {
    throw Error("folds", "found " + std::to_string(folds) + ", accepted: 2 to 1000");
  }
  if (few < 1 || few > 1000000) {
    throw Error("few", "found " + std::to_string(few) + ", accepted: 1 to 1000000");
  }
}

std::vector<SplitScheme> split_schemes(std::span<const LabelledPosition> positions,
                                       const std::vector<std::string>& names,
                                       const SplitOptions& options) {
  options.validate();
  std::vector<SplitScheme> all;
  if (positions.empty()) return all;
  for (const std::string& scheme : options.schemes) {
    const auto add = [&](std::string name, std::vector<PositionSplit> splits) {
      if (!splits.empty()) all.push_back({scheme, std::move(name), std::move(splits)});
    };
    if (scheme == "folds") {
      add(std::to_string(options.folds) + " folds", fold_splits(positions, options.folds));
    } else if (scheme == "few") {
      add("calibrated on " + std::to_string(options.few),
          few_splits(positions, options.folds, options.few));
    } else {
      for (std::size_t i = 0; i < names.size(); ++i) {
        const auto halves = half_splits(positions, static_cast<Eigen::Index>(i));
        add("lower half of " + names[i] + " calibrated", {halves[0]});
        add("upper half of " + names[i] + " calibrated", {halves[1]});
      }
    }
  }
  return all;
}

}  // namespace blindcorner
