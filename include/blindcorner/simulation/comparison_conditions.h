// SPDX-License-Identifier: Apache-2.0
/// Captures for a comparison of methods: some as in a network's training, others with each change
/// that may occur where the network is used.
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
  int captures = 40;  ///< captures of each condition
  /// The data set that the networks are taken to have learnt. Its grid, its sensor poses and its
  /// exposures are used. Photons are drawn anew.
  DatasetOptions dataset;
  std::uint64_t seed = 1;                 ///< seed of all draws for the comparison
  std::vector<std::string> conditions{};  ///< names of the wanted conditions; empty: all

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// One way in which captures may differ from those of the data set.
struct Condition {
  std::string name;         ///< "relay tilted"
  std::string description;  ///< a sentence: where the captures come from
  /// What is wrong here in the scene that the methods are told. Empty: that scene is right.
  std::string wrong;
  std::string left_out;  ///< why there are no captures; empty: there are some
  /// [captures] with the sensor pose and the truth, in the unknowns of the scene that methods are
  /// told.
  std::vector<Capture> captures{};
};

/// Names of all conditions in order.
std::vector<std::string> condition_names();
/// The condition's name for a word: the word itself, or the only name that begins with the word.
/// Otherwise throws Error that lists the possible names.
std::string condition_named(const std::string& word);

/// The conditions with captures of the simulated sensor. Conditions that change something other
/// than places use the places of "trained positions". The captures are the same at any number of
/// threads. `advance` is called after each capture, from any thread. Throws Error for a scene with
/// several hidden objects, and for a scene from which plan_dataset makes no data set.
std::vector<Condition> render_conditions(const Scene& scene, const ComparisonOptions& options,
                                         const std::function<void()>& advance = {});

/// Whether the first hidden object at a pose is clear of all known surfaces: the boxes around
/// object and surface are apart. They may overlap by 1 mm, so that objects may stand on a floor.
bool clear_of_surfaces(const Scene& scene, const PoseVector& pose);

}  // namespace blindcorner
