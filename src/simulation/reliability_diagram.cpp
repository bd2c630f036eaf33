// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/reliability_diagram.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "blindcorner/forward/error.h"

namespace blindcorner {

ReliabilityDiagram::ReliabilityDiagram(int bins)
    : ReliabilityDiagram(
          std::vector<ReliabilityCount>(static_cast<std::size_t>(std::max(bins, 0)))) {}

ReliabilityDiagram::ReliabilityDiagram(std::vector<ReliabilityCount> counts)
    : counts_(std::move(counts)) {
  if (counts_.empty()) throw Error("reliability diagram", "no bins; accepted: 1 or more");
}

void ReliabilityDiagram::add(double probability, bool happened) {
  if (!(probability >= 0 && probability <= 1)) {
    throw Error("reliability diagram",
                "probability " + std::to_string(probability) + "; accepted: 0 to 1");
  }
  const auto bin = static_cast<std::size_t>(probability * static_cast<double>(counts_.size()));
  ReliabilityCount& count = counts_[std::min(bin, counts_.size() - 1)];
  ++count.statements;
  count.happened += happened ? 1 : 0;
  count.sum += probability;
}

void ReliabilityDiagram::merge(const ReliabilityDiagram& other) {
  if (other.counts_.size() != counts_.size()) {
    throw Error("reliability diagram",
                std::to_string(other.counts_.size()) +
                    " bins to merge; accepted: " + std::to_string(counts_.size()));
  }
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    counts_[i].statements += other.counts_[i].statements;
    counts_[i].happened += other.counts_[i].happened;
    counts_[i].sum += other.counts_[i].sum;
  }
}

std::vector<ReliabilityBin> ReliabilityDiagram::bins(int effective_trials) const {
  return bins(std::vector<int>(counts_.size(), effective_trials));
}

std::vector<ReliabilityBin> ReliabilityDiagram::bins(
    const std::vector<int>& effective_trials) const {
  std::vector<ReliabilityBin> bins;
  const auto width = 1.0 / static_cast<double>(counts_.size());
  for (const ReliabilityCount& count : counts_) {
    const int effective = effective_trials.at(bins.size());
    ReliabilityBin bin;
    bin.lower = static_cast<double>(bins.size()) * width;
    bin.upper = bin.lower + width;
    bin.statements = count.statements;
    bin.happened = count.happened;
    if (count.statements > 0) {
      bin.mean_predicted = count.sum / count.statements;
      bin.observed = static_cast<double>(count.happened) / count.statements;
    }
    const int trials = effective > 0 ? std::min(effective, count.statements) : count.statements;
    bin.interval = wilson_interval(static_cast<int>(std::lround(bin.observed * trials)), trials);
    bins.push_back(bin);
  }
  return bins;
}

}  // namespace blindcorner
