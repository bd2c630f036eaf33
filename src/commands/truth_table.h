// SPDX-License-Identifier: Apache-2.0
/// What is known of the object in each capture, as a table.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// What a column of true values holds.
struct TruthColumn {
  std::string name;  ///< of the unknown: yaw_rad also of a column in degrees
  double unit = 1;   ///< that its numbers are in: rad for a degree
};

/// "yaw_deg", "front.yaw_deg": a yaw in degrees; any other name: itself.
TruthColumn truth_column(const std::string& header);

/// Puts the truths of a table (.csv) into captures. Its header holds x_m, y_m, z_m, yaw_deg or
/// yaw_rad, and size, with several objects after the object's name and a dot; and `index`, a
/// capture's place from 0, where the rows are not one for each capture in their order. An empty
/// cell says nothing. Throws Error naming file, row and what is accepted.
void add_truths(const std::string& path, std::vector<Capture>& captures);

}  // namespace blindcorner
