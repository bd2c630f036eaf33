// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/batch.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <new>
#include <set>
#include <utility>
#include <vector>

#include "inverse/likelihood/observation.h"

namespace blindcorner {
namespace {

/// A difference that moves the last of 128 bins by about one bin.
constexpr double kBinWidthTolerance = 0.01;

/// Where a capture's sensor stood and what its zones looked at, as numbers that can be compared.
std::vector<double> placement_of(const Capture& capture) {
  std::vector<double> placement;
  const auto note = [&](const double* values, std::ptrdiff_t count) {
    placement.insert(placement.end(), values, values + count);
  };
  if (capture.T_world_sensor) note(capture.T_world_sensor->matrix().data(), 16);
  if (capture.relay_points) {
    for (const Eigen::Vector3d& point : *capture.relay_points) {
      if (point.allFinite()) note(point.data(), 3);
    }
  }
  return placement;
}

/// Mean number of captures that one sensor placement took.
int captures_per_placement(std::span<const Capture* const> captures) {
  std::set<std::vector<double>> placements;
  int count = 0;
  for (const Capture* capture : captures) {
    if (capture == nullptr) continue;
    ++count;
    placements.insert(placement_of(*capture));
  }
  return std::max(count / std::max(static_cast<int>(placements.size()), 1), 1);
}

/// Runs a fit. A std::exception that it throws becomes the result's error.
template <typename Fit>
FitResult guarded(const Fit& fit) {
  FitResult failed;
  try {
    return fit();
  } catch (const std::bad_alloc&) {
    failed.error = "out of memory";
  } catch (const std::exception& error) {
    failed.error = error.what();
  }
  return failed;
}

}  // namespace

std::string bin_width_problem(double found, double expected) {
  if (found <= 0.0 || std::abs(found / expected - 1.0) <= kBinWidthTolerance) return {};
  char text[128];
  std::snprintf(text, sizeof text,
                "bin_width_ps: found %.6g, accepted: the scene's %.6g within 1 %%", found * 1e12,
                expected * 1e12);
  return text;
}

std::string suit_captures(std::span<const Capture* const> captures, Sensor& sensor,
                          FitOptions& options) {
  std::vector<const Capture*> readable;
  std::ranges::copy_if(captures, std::back_inserter(readable),
                       [](const Capture* capture) { return capture != nullptr; });
  options.captures_per_placement = captures_per_placement(readable);
  return leave_out_saturated_bins(sensor, readable);
}

void name_captures(std::span<const Capture* const> captures, FitResult& result) {
  result.sources.clear();
  result.indices.clear();
  for (const Capture* capture : captures) {
    result.sources.push_back(capture->source);
    result.indices.push_back(capture->index);
  }
  if (result.truth.empty() && !captures.empty()) result.truth = captures.front()->truth;
}

FitResult fit_named(const Fitter& fitter, const Capture& capture) {
  FitResult result = guarded([&] { return fitter.fit(capture); });
  const Capture* const only = &capture;
  name_captures({&only, 1}, result);
  return result;
}

FitResult fit_joint_named(const Fitter& fitter, std::span<const Capture> captures) {
  FitResult result = guarded([&] { return fitter.fit_joint(captures); });
  std::vector<const Capture*> all;
  for (const Capture& capture : captures) all.push_back(&capture);
  name_captures(all, result);
  return result;
}

}  // namespace blindcorner
