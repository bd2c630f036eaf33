// SPDX-License-Identifier: Apache-2.0
/// Exact distance transforms of sampled functions, in linear time (Felzenszwalb & Huttenlocher,
/// "Distance Transforms of Sampled Functions", Theory of Computing 2012).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "blindcorner/planner/grid/grid_geometry.h"

namespace blindcorner {

/// min over cells c of f(c) + |centre(c) - centre(here)|^2 for each cell, in units of cells.
/// Infinite values of f are ignored. Throws Error unless f has a value per cell.
std::vector<double> lowered_by_parabolas(const GridGeometry& geometry, std::span<const double> f);

/// Squared distance of each cell's centre from the nearest point of an obstacle's square, in units
/// of cells; 0 in obstacles, infinity without obstacles. Throws Error unless `obstacle` has a value
/// per cell (0: no obstacle).
std::vector<double> squared_distances(const GridGeometry& geometry,
                                      std::span<const std::uint8_t> obstacle);

}  // namespace blindcorner
