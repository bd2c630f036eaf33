// SPDX-License-Identifier: Apache-2.0
/// What is known of the object in each capture, as a table.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// A table (.csv) of true values: of each capture's place, from 0, what is known of the unknowns.
/// Its header holds their names, yaws also in degrees (`yaw_deg`), and `index`, a capture's place,
/// where the rows are not one for each capture in their order. An empty cell says nothing.
struct TruthTable {
  bool indexed = false;  ///< has a column index
  std::map<std::size_t, std::map<std::string, double>> truths;
};

/// Reads the columns whose names `is_known` accepts, in radians where they are in degrees, and
/// passes over all others. Throws Error naming file, row, column and what is accepted.
TruthTable read_truth_table(const std::string& path,
                            const std::function<bool(const std::string& name)>& is_known);

/// Puts the truths of a table into captures. Its columns are x_m, y_m, z_m, yaw_deg or yaw_rad, and
/// size, with several objects after the object's name and a dot; and `index`. Throws Error naming
/// file, row and what is accepted.
void add_truths(const std::string& path, std::vector<Capture>& captures);

}  // namespace blindcorner
