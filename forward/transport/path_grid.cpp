// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/path_grid.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "forward/sensor/least_pulse.h"
#include "forward/support/multiversion.h"

namespace blindcorner {
namespace {

/// Cells beyond each end of a leg: room for the four cells of a path, and for two such legs
/// convolved.
constexpr int kMargin = 8;
/// Cells that the inverse of the spline's samples reaches: 0.27^16 = 1e-9.
constexpr int kSharpening = 16;
/// Share of the pulse's energy that may be cut off at either end, and share of the largest tap
/// below which the taps at either end are left out. By judgement: a tenth of the finest tolerance
/// that a fit asks for.
constexpr double kOutside = 1e-5;
/// Coarsest and finest step in standard deviations of the pulse. From the coarsest on, the first
/// step whose error is small enough is taken. The error falls with the fourth power of the step.
constexpr double kCoarsest = 1.0;
constexpr double kFinest = 0.1;
/// Most cells per bin. By judgement: a bin so much wider than the pulse hides the error that is
/// left.
constexpr int kMaxPhases = 64;
/// Ratio of the next step to a step: it leaves 0.8^4 = 0.4 of the error.
constexpr double kRefinement = 0.8;
/// Number of cells that are convolved at once, and of the zeros that this needs on either side of
/// the light.
constexpr int kBlock = 4;

/// Coefficients [-kSharpening, kSharpening] of the inverse of (1/6, 4/6, 1/6), applied for each
/// variable of the spline: once for a whole path, twice for two legs.
std::vector<double> sharpening(PathGrid::Paths paths) {
  const double pole = std::sqrt(3.0) - 2;
  const auto once = [&](int n) {
    return -6 * pole / (1 - pole * pole) * std::pow(pole, std::abs(n));
  };
  std::vector<double> coefficients;
  for (int n = -kSharpening; n <= kSharpening; ++n) {
    if (paths == PathGrid::Paths::whole) {
      coefficients.push_back(once(n));
      continue;
    }
    double sum = 0;
    for (int k = -40; k <= 40; ++k) sum += once(k) * once(n - k);
    coefficients.push_back(sum);
  }
  return coefficients;
}

BLINDCORNER_MULTIVERSION void place(const double* paths, const double* weights, int count,
                                    double cells_per_metre, int margin, int cells,
                                    PathGrid::Splines& splines) {
  int* __restrict cell = splines.cell.data();
  double* __restrict w0 = splines.weight[0].data();
  double* __restrict w1 = splines.weight[1].data();
  double* __restrict w2 = splines.weight[2].data();
  double* __restrict w3 = splines.weight[3].data();
  const double last = cells - 4;
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < count; ++i) {
    const double position = paths[i] * cells_per_metre + margin;
    const bool inside = position >= 1 && position < last;
    const double at = inside ? position : 1.0;
    const double whole = std::floor(at);
    const double u = at - whole;
    const double t = 1 - u;
    const double weight = inside ? weights[i] / 6 : 0.0;
    cell[i] = static_cast<int>(whole) - 1;
    w0[i] = weight * (t * t * t);
    w1[i] = weight * (4 + u * u * (3 * u - 6));
    w2[i] = weight * (4 + t * t * (3 * t - 6));
    w3[i] = weight * (u * u * u);
  }
}

/// Number of copies of the cells. Legs are added to them in turn, because legs of similar paths
/// would otherwise wait for each other.
constexpr std::size_t kLanes = 4;
/// Least number of legs that are worth the lanes: four for each lane. By judgement: lanes have to
/// be cleared and summed.
constexpr std::size_t kWorthLanes = 16;

/// Adds the legs [begin, end) to `lanes` copies of the cells, each `stride` cells after the one
/// before. Finds the lowest and the highest cell at which a leg begins.
void add_legs(const PathGrid::Splines& splines, std::size_t begin, std::size_t end, double* cells,
              std::size_t lanes, std::size_t stride, int& lowest, int& highest) {
  const int* cell = splines.cell.data();
  const double *w0 = splines.weight[0].data(), *w1 = splines.weight[1].data();
  const double *w2 = splines.weight[2].data(), *w3 = splines.weight[3].data();
  int least = lowest, most = highest;
  for (std::size_t i = begin; i < end; ++i) {
    if (w1[i] <= 0) continue;
    const int c = cell[i];
    least = std::min(least, c);
    most = std::max(most, c);
    double* to = cells + (i & (lanes - 1)) * stride + c;
    const double a = to[0] + w0[i], b = to[1] + w1[i], d = to[2] + w2[i], e = to[3] + w3[i];
    to[0] = a;
    to[1] = b;
    to[2] = d;
    to[3] = e;
  }
  lowest = least;
  highest = most;
}

/// Adds up the lanes and clears them.
BLINDCORNER_MULTIVERSION void join_lanes(double* lanes, std::size_t stride, int begin, int end,
                                         double* __restrict cells) {
  double *l0 = lanes, *l1 = lanes + stride, *l2 = lanes + 2 * stride, *l3 = lanes + 3 * stride;
  BLINDCORNER_INDEPENDENT
  for (int i = begin; i < end; ++i) {
    cells[i] = (l0[i] + l1[i]) + (l2[i] + l3[i]);
    l0[i] = l1[i] = l2[i] = l3[i] = 0;
  }
}

/// out[i + j] += b[j] a[i]; both have kBlock zeros on either side.
BLINDCORNER_MULTIVERSION void convolve(const float* a, int a_count, const float* b, int b_count,
                                       float* __restrict out) {
  for (int j = 0; j < b_count; j += kBlock) {
    const float b0 = b[j], b1 = b[j + 1], b2 = b[j + 2], b3 = b[j + 3];
    float* __restrict to = out + j;
    const int end = a_count + kBlock - 1;
    BLINDCORNER_INDEPENDENT
    for (int i = 0; i < end; ++i) {
      to[i] += (b0 * a[i] + b1 * a[i - 1]) + (b2 * a[i - 2] + b3 * a[i - 3]);
    }
  }
}

/// to += scale from
BLINDCORNER_MULTIVERSION void add_scaled(const float* from, std::size_t count, double scale,
                                         double* __restrict to) {
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < count; ++i) to[i] += scale * static_cast<double>(from[i]);
}

/// Sum of the cells.
BLINDCORNER_MULTIVERSION double sum_of(const double* cells, int count) {
  constexpr int kSums = 8;  // side by side, in one vector
  alignas(64) std::array<double, kSums> sums{};
  int i = 0;
  for (; i + kSums <= count; i += kSums) {
    for (int k = 0; k < kSums; ++k) sums[static_cast<std::size_t>(k)] += cells[i + k];
  }
  double sum = 0;
  for (; i < count; ++i) sum += cells[i];
  for (const double part : sums) sum += part;
  return sum;
}

/// to = scale from
BLINDCORNER_MULTIVERSION void scale_cells(const double* from, int count, double scale,
                                          float* __restrict to) {
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < count; ++i) to[i] = static_cast<float>(scale * from[i]);
}

/// Fills in a leg's cells in single precision. Convolving them is twice as fast, with an error of
/// 1e-7.
void narrow_cells(PathLight& light) {
  const double* from = light.cells.data() + light.begin;
  const int count = light.end - light.begin;
  light.unit = sum_of(from, count);
  light.narrow.assign(static_cast<std::size_t>(count + 2 * kBlock), 0.0F);
  if (light.unit > 0) scale_cells(from, count, 1 / light.unit, light.narrow.data() + kBlock);
}

/// Taps of a cell, ready to be added.
struct Tap {
  const double* taps;
  int start, count;  ///< bins; `start` counts from the cell's bin
};

/// Adds `count` cells to a row. Either `phases` cells make a bin, or a cell has `stride` bins. The
/// first cell has the place `phase` within the bin `bin`.
BLINDCORNER_MULTIVERSION void add_cells(const double* cells, int count, const Tap* taps, int phase,
                                        int phases, int stride, int bin, int bins,
                                        double* __restrict row) {
  for (int c = 0; c < count; ++c) {
    const Tap& tap = taps[phase];
    const double weight = cells[c];
    const int start = bin + tap.start;
    const int begin = std::max(0, -start);
    const int end = std::min(tap.count, bins - start);
    const double* from = tap.taps;
    double* __restrict to = row + start;
    BLINDCORNER_INDEPENDENT
    for (int k = begin; k < end; ++k) to[k] += weight * from[k];
    if (++phase == phases) {
      phase = 0;
      bin += stride;
    }
  }
}

double at_least_blurred(const Sensor& sensor, double extra_variance) {
  return std::max(extra_variance, least_pulse_blur(sensor.response, sensor.bin_width));
}

}  // namespace

void PathLight::clear() {
  if (begin < end) std::fill(cells.begin() + begin, cells.begin() + end, 0.0);
  begin = std::numeric_limits<int>::max();
  end = 0;
}

PathGrid::PathGrid(const Sensor& sensor, Paths paths, double asked_variance, int axis_bins,
                   double way_back, double tolerance)
    : PathGrid(sensor, paths, at_least_blurred(sensor, asked_variance), axis_bins, way_back,
               coarsest_cell(sensor, paths, at_least_blurred(sensor, asked_variance), tolerance)) {}

PathGrid::PathGrid(const Sensor& sensor, Paths paths, double extra_variance, int axis_bins,
                   double way_back, CellWidth width)
    : paths_(paths),
      axis_bins_(axis_bins),
      cells_per_metre_(1 / (width.bins * sensor.bin_width * kSpeedOfLight)),
      phases_(width.bins >= 1 ? 1 : static_cast<int>(std::lround(1 / width.bins))),
      bins_per_cell_(std::max(1, static_cast<int>(std::lround(width.bins)))),
      margin_(kMargin + static_cast<int>(std::ceil(way_back * cells_per_metre_))),
      leg_cells_(static_cast<int>(std::ceil(axis_bins / width.bins)) + 2 * margin_),
      pair_cells_(static_cast<std::size_t>(2 * (leg_cells_ + kBlock))) {
  const double bin = sensor.bin_width;
  std::vector<double> offsets;
  for (const Zone& zone : sensor.zones) {
    const double start = std::floor(zone.time_zero / bin);
    const double offset = zone.time_zero / bin - start;
    start_.push_back(static_cast<int>(start));
    const auto known = std::ranges::find(offsets, offset);
    kind_.push_back(static_cast<int>(known - offsets.begin()));
    if (known != offsets.end()) continue;
    offsets.push_back(offset);
    filters_.push_back(filters(sensor.response, bin, extra_variance, offset));
  }
}

/// The coarsest cell that meets the tolerance. It has a whole number of bins, or a whole number of
/// cells make a bin, so that cells have few different places within a bin.
PathGrid::CellWidth PathGrid::coarsest_cell(const Sensor& sensor, Paths paths,
                                            double extra_variance, double tolerance) {
  const double bin = sensor.bin_width;
  const double sigma = std::hypot(sensor.response.core_sigma(), std::sqrt(extra_variance));
  const auto whole = [](double bins) {
    return CellWidth{bins >= 1 ? std::floor(bins) : 1 / std::ceil(1 / bins - 1e-9)};
  };
  CellWidth width = whole(std::max(kCoarsest * sigma / bin, 1.0 / kMaxPhases));
  while (width.bins * bin > kFinest * sigma && width.bins * kRefinement * kMaxPhases >= 1 &&
         error_between_cells(sensor, paths, extra_variance, width) > kShare * tolerance) {
    width = whole(kRefinement * width.bins);
  }
  return width;
}

std::vector<PathGrid::Filter> PathGrid::filters(const ImpulseResponse& response, double bin_width,
                                                double extra_variance, double offset) const {
  const std::vector<double> sharp = sharpening(paths_);
  const auto [early, late] = response.support(kOutside, extra_variance);
  const int reach = (kSharpening * bins_per_cell_ + phases_ - 1) / phases_ + 2;
  const int first = static_cast<int>(std::floor(early / bin_width)) - reach;
  const int last = static_cast<int>(std::ceil(late / bin_width)) + reach;
  // The response's integral up to k parts after bin `origin`; a bin has `phases_` parts.
  const int origin = first - reach;
  std::vector<double> integral;
  for (int k = 0; k <= (last + reach + 1 - origin) * phases_; ++k) {
    integral.push_back(response.cumulative(
        (origin + static_cast<double>(k) / phases_ - offset) * bin_width, extra_variance));
  }
  std::vector<Filter> made;
  for (int phase = 0; phase < phases_; ++phase) {
    Filter filter{first, {}};
    double most = 0;
    for (int b = first; b < last; ++b) {
      double sum = 0;
      for (int n = -kSharpening; n <= kSharpening; ++n) {
        // A pulse at `phase` parts of a bin, moved back by n cells.
        const auto low =
            static_cast<std::size_t>((b - origin) * phases_ - phase + n * bins_per_cell_);
        sum += sharp[static_cast<std::size_t>(n + kSharpening)] *
               (integral[low + static_cast<std::size_t>(phases_)] - integral[low]);
      }
      filter.taps.push_back(sum);
      most = std::max(most, std::abs(sum));
    }
    const auto matters = [&](double tap) { return std::abs(tap) > kOutside * most; };
    const auto front = std::ranges::find_if(filter.taps, matters);
    filter.first += static_cast<int>(front - filter.taps.begin());
    filter.taps.erase(filter.taps.begin(), front);
    while (!filter.taps.empty() && !matters(filter.taps.back())) filter.taps.pop_back();
    made.push_back(std::move(filter));
  }
  return made;
}

/// Largest error of a bin, relative to the largest bin, of pulses whose whole path, or whose two
/// legs, end between cells.
double PathGrid::error_between_cells(const Sensor& sensor, Paths paths, double extra_variance,
                                     CellWidth width) {
  const double bin = sensor.bin_width;
  const auto [early, late] = sensor.response.support(kOutside, extra_variance);
  // One zone, whose axis holds the whole pulse.
  Sensor one = sensor;
  one.zones.assign(1, Zone{});
  const int before = 2 - static_cast<int>(std::floor(early / bin));
  const int bins = before + static_cast<int>(std::ceil(late / bin)) + 12;
  one.zones[0].time_zero = before * bin;
  const PathGrid grid(one, paths, extra_variance, bins, 0, width);
  const auto spline = [&](double cells) {
    const double path = cells * grid.step();
    const double weight = 1;
    Splines splines;
    grid.find_splines(&path, &weight, 1, splines);
    return splines;
  };
  const auto leg = [&](double cells) {
    PathLight light;
    grid.lay(spline(cells), 0, 1, light);
    return light;
  };
  double largest = 0, peak = 0;
  for (const double u : {0.0, 0.25, 0.5}) {
    for (const double v : {0.0, 0.25, 0.5}) {
      PathLight pairs;
      if (paths == Paths::whole) {
        grid.add(spline(u + v), 0, 1, pairs);
      } else {
        grid.pair(leg(u), leg(v), 1, pairs);
      }
      std::vector<double> row(static_cast<std::size_t>(bins), 0.0);
      grid.add_to_row(0, pairs, row.data());
      const double position = before + (u + v) * width.bins;
      for (int b = 0; b < bins; ++b) {
        const double exact = sensor.response.cumulative((b + 1 - position) * bin, extra_variance) -
                             sensor.response.cumulative((b - position) * bin, extra_variance);
        peak = std::max(peak, exact);
        largest = std::max(largest, std::abs(row[static_cast<std::size_t>(b)] - exact));
      }
    }
  }
  return largest / peak;
}

void PathGrid::find_splines(const double* paths, const double* weights, int count,
                            Splines& splines) const {
  const auto n = static_cast<std::size_t>(count);
  if (splines.cell.size() < n) {
    splines.cell.resize(n);
    for (auto& w : splines.weight) w.resize(n);
  }
  // Whole paths lie on the grid of pairs, whose path zero is twice as far in.
  const int legs = paths_ == Paths::whole ? 2 : 1;
  place(paths, weights, count, cells_per_metre_, legs * margin_, legs * leg_cells_, splines);
}

void PathGrid::lay(const Splines& splines, std::size_t begin, std::size_t end,
                   PathLight& light) const {
  light.clear();
  const auto size = static_cast<std::size_t>(leg_cells_ + 2 * kBlock);
  if (light.cells.size() < size) light.cells.resize(size, 0.0);
  int lowest = leg_cells_, highest = -1;
  double* cells = light.cells.data() + kBlock;
  if (end - begin < kWorthLanes) {
    add_legs(splines, begin, end, cells, 1, size, lowest, highest);
    if (highest < lowest) return;
  } else {
    thread_local std::vector<double> lanes;  // zero between calls
    if (lanes.size() < kLanes * size) lanes.resize(kLanes * size, 0.0);
    add_legs(splines, begin, end, lanes.data(), kLanes, size, lowest, highest);
    if (highest < lowest) return;
    join_lanes(lanes.data(), size, lowest, highest + 4, cells);
  }
  light.begin = lowest + kBlock;
  light.end = highest + 4 + kBlock;
  narrow_cells(light);
}

void PathGrid::pair(const PathLight& in, const PathLight& out, double scale,
                    PathLight& pairs) const {
  if (in.dark() || out.dark()) return;
  if (pairs.cells.size() < pair_cells_) pairs.cells.resize(pair_cells_, 0.0);
  // Cells of a leg count from kBlock. Path zero lies at cell margin_ of a leg, and at cell 2
  // margin_ of the pairs.
  const int first = in.begin + out.begin - 2 * kBlock;
  const int a_count = in.end - in.begin;
  const int b_count = out.end - out.begin;
  // The longer one runs along the vector registers.
  thread_local std::vector<float> product;
  const float* a = in.narrow.data() + kBlock;
  const float* b = out.narrow.data() + kBlock;
  const auto count = static_cast<std::size_t>(a_count + b_count - 1);
  product.assign(count + 2 * kBlock, 0.0F);
  if (a_count >= b_count) {
    convolve(a, a_count, b, b_count, product.data());
  } else {
    convolve(b, b_count, a, a_count, product.data());
  }
  add_scaled(product.data(), count, scale * in.unit * out.unit, pairs.cells.data() + first);
  pairs.begin = std::min(pairs.begin, first);
  pairs.end = std::max(pairs.end, first + a_count + b_count - 1);
}

void PathGrid::add(const Splines& splines, std::size_t begin, std::size_t end,
                   PathLight& pairs) const {
  if (pairs.cells.size() < pair_cells_) pairs.cells.resize(pair_cells_, 0.0);
  int lowest = static_cast<int>(pair_cells_), highest = -1;
  add_legs(splines, begin, end, pairs.cells.data(), 1, 0, lowest, highest);
  if (highest < lowest) return;
  pairs.begin = std::min(pairs.begin, lowest);
  pairs.end = std::max(pairs.end, highest + 4);
}

void PathGrid::add_to_row(int zone, const PathLight& pairs, double* row) const {
  if (pairs.dark()) return;
  const auto z = static_cast<std::size_t>(zone);
  std::array<Tap, kMaxPhases> taps{};
  int earliest = axis_bins_, latest = -axis_bins_;
  for (std::size_t p = 0; p < static_cast<std::size_t>(phases_); ++p) {
    const Filter& filter = filters_[static_cast<std::size_t>(kind_[z])][p];
    taps[p] = {filter.taps.data(), filter.first, static_cast<int>(filter.taps.size())};
    earliest = std::min(earliest, taps[p].start);
    latest = std::max(latest, taps[p].start + taps[p].count);
  }
  const int cell = pairs.begin - 2 * margin_;
  const int count = pairs.end - pairs.begin;
  const int whole = static_cast<int>(std::floor(static_cast<double>(cell) / phases_));
  const int phase = cell - whole * phases_;
  const int bin = start_[z] + whole * bins_per_cell_;
  add_cells(pairs.cells.data() + pairs.begin, count, taps.data(), phase, phases_, bins_per_cell_,
            bin, axis_bins_, row);
  // Splines swing about zero where a pulse ends; light does not.
  const int begin = std::max(bin + earliest, 0);
  const int end =
      std::min(bin + (phase + count - 1) / phases_ * bins_per_cell_ + latest, axis_bins_);
  for (int b = begin; b < end; ++b) row[b] = std::max(row[b], 0.0);
}

}  // namespace blindcorner
