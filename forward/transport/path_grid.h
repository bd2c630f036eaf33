// SPDX-License-Identifier: Apache-2.0
/// Paths of light on an even grid. On such a grid, pairing the light that arrives with the light
/// that leaves is a convolution.
///
/// A leg of path x is laid on the grid as the cubic B-splines about x, which are four cells. Two
/// legs of paths x and y, convolved, are then a tensor product of B-splines in x and y. The
/// histogram of a pulse at x + y is a smooth function of x and y, which such splines interpolate.
/// Its coefficients are the pulses at the grid's paths, sharpened twice by the inverse of the
/// spline's own samples (1/6, 4/6, 1/6) (Unser 1999). No pulse is moved or blurred one by one, and
/// the sum is twice continuously differentiable in every path. The grid is as coarse as the
/// tolerance allows; its error is measured between its cells when it is made.
///
/// If all light that arrives has one path, there is nothing to convolve. Whole paths are then laid
/// directly on the grid of pairs, as splines of one variable that are sharpened once.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "blindcorner/forward/sensor/sensor.h"

namespace blindcorner {

/// Light on the grid. Cells outside of [begin, end) are zero or not there.
struct PathLight {
  std::vector<double> cells;
  int begin = std::numeric_limits<int>::max();
  int end = 0;
  /// Of a leg: the cells [begin, end) in single precision, for the convolution, with a few zeros on
  /// either side. They are in units of their sum (`unit`), because the light of dim scenes would
  /// leave the range of floats.
  std::vector<float> narrow;
  double unit = 0;

  bool dark() const { return begin >= end; }
  /// Zeroes all cells that may hold light.
  void clear();
  /// Counts all cells as lit, dark ones too.
  void take_all() {
    begin = 0;
    end = static_cast<int>(cells.size());
  }
};

class PathGrid {
 public:
  /// What is laid on the grid: the two legs of paths, which are then paired, or whole paths.
  enum class Paths { legs, whole };
  /// Share of the tolerance that the grid may take. By judgement: so little that the sampling may
  /// still take the whole tolerance. The error falls with the fourth power of a cell's width, so a
  /// tenth of the error makes cells 0.56 times as wide.
  static constexpr double kShare = 0.1;

  /// `extra_variance` (s^2) widens the sensor's pulse; `axis_bins` is the length of the time axis;
  /// legs may be as short as -`way_back` (m). `tolerance` is the largest error of a bin relative to
  /// the pulse's peak.
  PathGrid(const Sensor& sensor, Paths paths, double extra_variance, int axis_bins, double way_back,
           double tolerance);

  /// Where paths lie: the first of their four cells, and the weights on the four.
  struct Splines {
    std::vector<int> cell;
    std::array<std::vector<double>, 4> weight;
  };
  /// Finds the splines of paths (m) with weights. Paths beyond the time axis get no weight.
  void find_splines(const double* paths, const double* weights, int count, Splines& splines) const;
  /// Replaces `light` by the legs [begin, end).
  void lay(const Splines& splines, std::size_t begin, std::size_t end, PathLight& light) const;

  /// Adds `scale` times all pairs of legs to `pairs`.
  void pair(const PathLight& in, const PathLight& out, double scale, PathLight& pairs) const;
  /// Adds the whole paths [begin, end) to `pairs`.
  void add(const Splines& splines, std::size_t begin, std::size_t end, PathLight& pairs) const;

  /// Adds the histogram of the pairs to a zone's row [axis_bins]. No bin is below zero afterwards.
  void add_to_row(int zone, const PathLight& pairs, double* row) const;

  Paths paths() const { return paths_; }
  double step() const { return 1 / cells_per_metre_; }  ///< m

 private:
  /// Coefficients of all cells that have the same place within a bin.
  struct Filter {
    int first;  ///< bin of the first tap for a cell at bin 0
    std::vector<double> taps;
  };
  /// Width of a cell in bins: a whole number, or one over a whole number.
  struct CellWidth {
    double bins;
  };
  PathGrid(const Sensor& sensor, Paths paths, double extra_variance, int axis_bins, double way_back,
           CellWidth width);
  static CellWidth coarsest_cell(const Sensor& sensor, Paths paths, double extra_variance,
                                 double tolerance);
  static double error_between_cells(const Sensor& sensor, Paths paths, double extra_variance,
                                    CellWidth width);
  std::vector<Filter> filters(const ImpulseResponse& response, double bin_width,
                              double extra_variance, double offset) const;

  Paths paths_;
  int axis_bins_;
  double cells_per_metre_;
  int phases_;         ///< cells per bin
  int bins_per_cell_;  ///< if phases_ is one; else 1
  int margin_;         ///< cells of a leg before path zero
  int leg_cells_;
  std::size_t pair_cells_;                    ///< number of cells of paired light, in memory
  std::vector<std::vector<Filter>> filters_;  ///< [kind of zone][phase]
  std::vector<int> kind_;                     ///< [zone] by the place of its time zero within a bin
  std::vector<int> start_;                    ///< [zone] whole bins of its time zero
};

}  // namespace blindcorner
