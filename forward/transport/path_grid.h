// SPDX-License-Identifier: Apache-2.0
/// Paths of light on an even grid: what makes pairing what arrives with what leaves a convolution.
///
/// A leg of path x is laid on the grid as cubic B-splines about x, four cells each. Two legs of
/// paths x and y, convolved, are then a tensor product of B-splines in x and y, and the histogram
/// of a pulse at x + y is a smooth function of both that such splines interpolate: its
/// coefficients are the pulses at the grid's paths sharpened twice by the inverse of the spline's
/// own samples (1/6, 4/6, 1/6) (Unser 1999). No pulse is moved or blurred one by one, and the sum
/// is twice continuously differentiable in every path. The grid is as coarse as the tolerance
/// allows, which is measured between its cells when it is made.
///
/// Where all light that arrives has one path, there is nothing to convolve: whole paths are laid on
/// the grid of pairs at once, as splines of one variable, sharpened once.
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
  /// Of a leg: the cells from `begin` to `end` in single precision, in which legs are convolved,
  /// with a few zeros on either side. In units of their sum, because the light of dim scenes would
  /// leave the range of floats.
  std::vector<float> narrow;
  double unit = 0;

  bool dark() const { return begin >= end; }
  /// Zero all cells that may not be.
  void clear();
  /// Counts all cells as lit, dark ones too.
  void take_all() {
    begin = 0;
    end = static_cast<int>(cells.size());
  }
};

class PathGrid {
 public:
  /// What is laid on the grid: the two legs of a path, to be paired, or whole paths.
  enum class Paths { legs, whole };
  /// Share of the tolerance that the grid may take: by judgement, so little that sampling is to
  /// have all of it. The error falls with the fourth power of a cell, which a tenth makes 0.56 as
  /// wide.
  static constexpr double kShare = 0.1;

  /// `extra_variance` (s^2) widens the sensor's pulse; `axis_bins` is the length of the time axis;
  /// legs may be as short as -`way_back` (m). `tolerance` is the largest error of a bin relative to
  /// the pulse's peak.
  PathGrid(const Sensor& sensor, Paths paths, double extra_variance, int axis_bins, double way_back,
           double tolerance);

  /// Where paths lie: the first of four cells, and the weights on them.
  struct Splines {
    std::vector<int> cell;
    std::array<std::vector<double>, 4> weight;
  };
  /// Of paths (m) and weights; those beyond the time axis have no weight.
  void find_splines(const double* paths, const double* weights, int count, Splines& splines) const;
  /// Replaces `light` by the legs [begin, end).
  void lay(const Splines& splines, std::size_t begin, std::size_t end, PathLight& light) const;

  /// Adds `scale` times all pairs of legs to `pairs`.
  void pair(const PathLight& in, const PathLight& out, double scale, PathLight& pairs) const;
  /// Adds the whole paths [begin, end) to `pairs`.
  void add(const Splines& splines, std::size_t begin, std::size_t end, PathLight& pairs) const;

  /// Adds the histogram of the pairs to a zone's row [axis_bins], none of which is then below zero.
  void add_to_row(int zone, const PathLight& pairs, double* row) const;

  Paths paths() const { return paths_; }
  double step() const { return 1 / cells_per_metre_; }  ///< m

 private:
  /// Coefficients of all cells whose pulses lie alike within the bins.
  struct Filter {
    int first;  ///< bin of the first tap for a cell at bin 0
    std::vector<double> taps;
  };
  /// With cells of this many bins: a whole number, or one over a whole number.
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
  int phases_;         ///< cells to the bin
  int bins_per_cell_;  ///< where phases_ is one
  int margin_;         ///< cells of a leg before path zero
  int leg_cells_;
  std::size_t pair_cells_;                    ///< of light of pairs, in memory
  std::vector<std::vector<Filter>> filters_;  ///< [kind of zone][phase]
  std::vector<int> kind_;                     ///< [zone], by where in a bin its time zero lies
  std::vector<int> start_;                    ///< [zone] whole bins of its time zero
};

}  // namespace blindcorner
