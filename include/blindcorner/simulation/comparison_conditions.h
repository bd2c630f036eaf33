// SPDX-License-Identifier: Apache-2.0
/// Captures for a comparison of methods: as a network was trained, and everything else that may be
/// different where it is used.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/simulation/dataset.h"

namespace blindcorner {

struct ComparisonOptions {
  int captures = 40;  ///< of each condition
  /// The data set that networks are taken to have learnt: its grid, its poses of the sensor and its
  /// exposures. Photons are drawn anew.
  DatasetOptions dataset;
  std::uint64_t seed = 1;                 ///< of what is drawn for the comparison
  std::vector<std::string> conditions{};  ///< names of those wanted; empty: all

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One way in which captures may differ from those of the data set.
struct Condition {
  std::string name;         ///< "relay tilted"
  std::string description;  ///< a sentence: where the captures come from
  /// What the scene that methods are told says and that is wrong here; empty: it is right.
  std::string wrong;
  std::string left_out;  ///< why there are no captures; empty: there are
  /// [captures] with truth (in the unknowns of the scene that methods are told) and sensor pose.
  std::vector<Capture> captures{};
};

/// Names of all conditions in order.
std::vector<std::string> condition_names();
/// The name that a word stands for: itself, or the only one that begins so. Throws Error that lists
/// those that are possible.
std::string condition_named(const std::string& word);

/// The conditions with captures of the simulated sensor. Those that change something other than
/// places share their places with "trained positions". The same at any number of threads. `advance`
/// is called after each capture, from any thread. Throws Error for a scene of which plan_dataset
/// makes no data set, and one of several hidden objects.
std::vector<Condition> render_conditions(const Scene& scene, const ComparisonOptions& options,
                                         const std::function<void()>& advance = {});

/// Whether the first hidden object at a pose stays clear of all known surfaces: boxes around both
/// are apart (1 mm may overlap, so that objects may stand on a floor).
bool clear_of_surfaces(const Scene& scene, const PoseVector& pose);

}  // namespace blindcorner
