// SPDX-License-Identifier: Apache-2.0
/// What is known of the object in each capture, as a table.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// A table (.csv) of true values: what is known of the unknowns, by the place of the capture, from
/// 0. Its header holds the unknowns' names, those of yaws also in degrees (`yaw_deg`). Unless there
/// is one row for each capture in their order, it also holds `index`, the capture's place. An empty
/// cell says nothing.
struct TruthTable {
  bool indexed = false;  ///< has a column index
  std::map<std::size_t, std::map<std::string, double>> truths;
};

/// Reads the columns whose names `is_known` accepts, and passes over all others. Degrees become
/// radians. Throws Error naming file, row, column and what is accepted.
TruthTable read_truth_table(const std::string& path,
                            const std::function<bool(const std::string& name)>& is_known);

/// Puts the truths of a table into captures. Its columns are x_m, y_m, z_m, yaw_deg or yaw_rad,
/// size, and `index`. With several objects, the object's name and a dot stand before each of them
/// except `index`. Throws Error naming file, row and what is accepted.
void add_truths(const std::string& path, std::vector<Capture>& captures);

}  // namespace blindcorner
