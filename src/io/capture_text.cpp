// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/capture_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

std::string number(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.6g", value);
  return digits;
}

std::string padded(const std::string& text, std::size_t width) {
  return std::string(width - std::min(width, text.size()), ' ') + text;
}

std::string plural(std::size_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

/// Smallest and largest of what was added.
struct Range {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -std::numeric_limits<double>::infinity();
  std::size_t count = 0;

  void add(double value) {
    lowest = std::min(lowest, value);
    highest = std::max(highest, value);
    ++count;
  }
  std::string text() const {
    return lowest == highest ? number(lowest) : number(lowest) + " to " + number(highest);
  }
};

struct ValueSummary {
  std::size_t values = 0, nan = 0, infinite = 0, negative = 0;
  double total = 0.0;  ///< of the finite ones
  Range range;         ///< of the finite ones
};

ValueSummary summarise(const CaptureFile& file) {
  ValueSummary summary;
  for (const Capture& capture : file.captures) {
    for (const double value : capture.counts.values) {
      ++summary.values;
      if (std::isnan(value)) {
        ++summary.nan;
      } else if (std::isinf(value)) {
        ++summary.infinite;
      } else {
        summary.negative += value < 0.0 ? 1 : 0;
        summary.total += value;
        summary.range.add(value);
      }
    }
  }
  return summary;
}

/// "dispersion 1.2 to 1.4 (7 of 36 captures)".
std::string known(const std::string& name, const Range& range, std::size_t captures) {
  std::string text = name + " " + range.text();
  if (range.count != captures) {
    text += " (" + std::to_string(range.count) + " of " + plural(captures, "capture") + ")";
  }
  return text + "\n";
}

std::string describe_knowledge(const CaptureFile& file) {
  Range exposures, dispersion;
  std::size_t poses = 0, points = 0;
  std::map<std::string, Range> truth;
  for (const Capture& capture : file.captures) {
    exposures.add(capture.exposures);
    if (capture.dispersion) dispersion.add(*capture.dispersion);
    poses += capture.T_world_sensor ? 1 : 0;
    points += capture.relay_points ? 1 : 0;
    for (const auto& [name, value] : capture.truth) truth[name].add(value);
  }
  const std::size_t n = file.captures.size();
  std::string text = known("exposures averaged:", exposures, n);
  if (dispersion.count > 0) text += known("dispersion:", dispersion, n);
  if (poses > 0)
    text += "sensor pose: in " + std::to_string(poses) + " of " + plural(n, "capture") + "\n";
  if (points > 0)
    text += "relay points: in " + std::to_string(points) + " of " + plural(n, "capture") + "\n";
  for (const auto& [name, range] : truth) text += known("truth " + name + ":", range, n);
  return text;
}

/// Mean of the bins [begin, end); NaN when one of them is.
double pooled(const double* bins, int begin, int end) {
  double sum = 0.0;
  for (int k = begin; k < end; ++k) sum += bins[k];
  return sum / (end - begin);
}

std::string draw(const double* bins, int bin_count, const DescribeOptions& options) {
  static constexpr const char* kBlocks[] = {" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const int cells = std::min(options.width, bin_count);
  const auto edge = [&](int cell) {
    return static_cast<int>(static_cast<long long>(cell) * bin_count / cells);
  };
  std::vector<double> heights;
  Range range;
  for (int i = 0; i < cells; ++i) {
    double height = pooled(bins, edge(i), edge(i + 1));
    if (options.logarithmic) height = std::log1p(std::max(height, 0.0));
    heights.push_back(height);
    if (std::isfinite(height)) range.add(std::max(height, 0.0));
  }
  // A logarithm flattens everything above a large ambient light, so its axis begins at the lowest
  // value.
  const double lowest = options.logarithmic ? range.lowest : 0.0;
  std::string text;
  for (const double height : heights) {
    if (std::isnan(height)) {
      text += "?";
    } else if (height <= 0.0) {
      text += " ";
    } else {
      // The lowest block stands for anything above zero, the full one for the peak.
      const double share =
          range.highest > lowest ? (height - lowest) / (range.highest - lowest) : 0;
      text += kBlocks[1 + static_cast<int>(std::min(7.0, 8.0 * share))];
    }
  }
  return text;
}

std::string describe_zone(const HistogramCube& cube, int zone, const DescribeOptions& options) {
  const double* bins = cube.zone(zone);
  double total = 0.0;
  int peak = -1;
  for (int k = 0; k < cube.bins; ++k) {
    if (!std::isfinite(bins[k])) continue;
    total += bins[k];
    if (peak < 0 || bins[k] > bins[peak]) peak = k;
  }
  std::string text = padded(std::to_string(zone), 4);
  text += padded(std::to_string(zone / cube.columns), 4);
  text += padded(std::to_string(zone % cube.columns), 4);
  text += padded(number(total), 13);
  text += padded(peak < 0 ? "-" : std::to_string(peak), 6);
  text += padded(peak < 0 ? "-" : number(bins[peak]), 13);
  return text + "  " + draw(bins, cube.bins, options) + "\n";
}

}  // namespace

void DescribeOptions::validate() const {
  if (capture < -1) {
    throw Error("capture", "found " + std::to_string(capture) + ", accepted -1 (none) or more");
  }
  if (width < 1 || width > 10'000) {
    throw Error("width", "found " + std::to_string(width) + ", accepted 1 to 10000");
  }
}

std::string describe(const CaptureFile& file, const DescribeOptions& options) {
  options.validate();
  if (file.captures.empty()) return "no captures\n";
  const std::size_t n = file.captures.size();
  const HistogramCube& first = file.captures.front().counts;
  std::string text = plural(n, "capture") + " of " + std::to_string(first.rows) + " x " +
                     std::to_string(first.columns) + " zones x " + std::to_string(first.bins) +
                     " bins of " +
                     (file.bin_width > 0.0 ? number(file.bin_width * 1e12) + " ps"
                                           : std::string("unknown width")) +
                     "\n";
  if (!file.sensor.empty()) text += "sensor: " + file.sensor + "\n";
  if (!file.description.empty()) text += "description: " + file.description + "\n";
  text += describe_knowledge(file);
  const ValueSummary summary = summarise(file);
  text += "values: " + std::to_string(summary.values) + ", of these " +
          std::to_string(summary.nan) + " NaN, " + std::to_string(summary.infinite) +
          " infinite, " + std::to_string(summary.negative) + " negative\n";
  if (summary.range.count > 0) {
    text += "counts: " + summary.range.text() + ", total " + number(summary.total) + "\n";
  }
  if (options.capture < 0) return text;
  if (static_cast<std::size_t>(options.capture) >= n) {
    throw Error("capture", "found " + std::to_string(options.capture) + ", accepted 0 to " +
                               std::to_string(n - 1));
  }
  const Capture& capture = file.captures[static_cast<std::size_t>(options.capture)];
  text += "\ncapture " + std::to_string(options.capture) +
          (options.logarithmic ? " (logarithmic)" : "") + "\n";
  text += "zone row col        total  peak        count  histogram\n";
  for (int zone = 0; zone < capture.counts.zones(); ++zone) {
    text += describe_zone(capture.counts, zone, options);
  }
  return text;
}

}  // namespace blindcorner
