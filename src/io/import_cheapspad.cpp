// SPDX-License-Identifier: Apache-2.0
#include "io/import_cheapspad.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "io/matlab_check.h"
#include "io/repeats.h"

#ifdef BLINDCORNER_HAS_MATIO
#include <matio.h>
#endif

namespace blindcorner {

#ifdef BLINDCORNER_HAS_MATIO

namespace {

/// VL53L1X: 0.197 m one way.
constexpr double kBinWidth = 1314.2e-12;  // s
constexpr std::size_t kSpots = 4;

struct MatCloser {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct VariableFreer {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using MatFile = std::unique_ptr<mat_t, MatCloser>;
using Variable = std::unique_ptr<matvar_t, VariableFreer>;

Variable read_cells(mat_t* file, const std::string& path, const char* name) {
  Variable variable(Mat_VarRead(file, name));
  if (!variable) throw Error(path, std::string("variable ") + name + " is missing");
  if (variable->class_type != MAT_C_CELL || variable->data == nullptr) {
    throw Error(path + ": variable " + name, "found no cell array, accepted: a cell per position");
  }
  return variable;
}

std::size_t cell_count(const matvar_t& variable) {
  std::size_t count = 1;
  for (int i = 0; i < variable.rank; ++i) count *= variable.dims[i];
  return count;
}

/// Numbers of one cell, first index fastest.
struct Numbers {
  std::vector<std::size_t> shape;
  std::vector<double> values;

  std::string shape_text() const {
    std::string text;
    for (const std::size_t extent : shape) {
      text += (text.empty() ? "" : " x ") + std::to_string(extent);
    }
    return text;
  }
};

template <typename T>
void copy_numbers(const matvar_t& cell, std::vector<double>& values) {
  const T* data = static_cast<const T*>(cell.data);
  std::transform(data, data + values.size(), values.begin(),
                 [](T value) { return static_cast<double>(value); });
}

Numbers numbers_of(matvar_t* cells, std::size_t index, const std::string& where) {
  const matvar_t* cell = Mat_VarGetCell(cells, static_cast<int>(index));
  if (cell == nullptr || cell->data == nullptr || cell->isComplex != 0) {
    throw Error(where, "found an empty cell, accepted: real numbers");
  }
  Numbers numbers;
  numbers.shape.assign(cell->dims, cell->dims + cell->rank);
  numbers.values.resize(std::accumulate(numbers.shape.begin(), numbers.shape.end(), std::size_t{1},
                                        std::multiplies<>()));
  switch (cell->class_type) {
    case MAT_C_DOUBLE:
      copy_numbers<double>(*cell, numbers.values);
      break;
    case MAT_C_SINGLE:
      copy_numbers<float>(*cell, numbers.values);
      break;
    case MAT_C_INT8:
      copy_numbers<std::int8_t>(*cell, numbers.values);
      break;
    case MAT_C_UINT8:
      copy_numbers<std::uint8_t>(*cell, numbers.values);
      break;
    case MAT_C_INT16:
      copy_numbers<std::int16_t>(*cell, numbers.values);
      break;
    case MAT_C_UINT16:
      copy_numbers<std::uint16_t>(*cell, numbers.values);
      break;
    case MAT_C_INT32:
      copy_numbers<std::int32_t>(*cell, numbers.values);
      break;
    case MAT_C_UINT32:
      copy_numbers<std::uint32_t>(*cell, numbers.values);
      break;
    default:
      throw Error(where, "found a cell that holds no numbers, accepted: real numbers");
  }
  if (!std::ranges::all_of(numbers.values, [](double value) { return std::isfinite(value); })) {
    throw Error(where, "found a number that is not finite, accepted: finite numbers");
  }
  return numbers;
}

/// Repeats of one position, one series per spot; spots row by row.
std::array<RepeatSeries, kSpots> series_of(const Numbers& cube, const std::string& where) {
  if (cube.shape.size() != 4 || cube.shape[0] != 2 || cube.shape[1] != 2 || cube.shape[2] < 2 ||
      cube.shape[3] < 1) {
    throw Error(where, "has shape " + cube.shape_text() + ", accepted: 2 x 2 x bins x repeats");
  }
  const std::size_t bins = cube.shape[2];
  std::array<RepeatSeries, kSpots> spots;
  for (std::size_t s = 0; s < kSpots; ++s) {
    const std::size_t offset = s / 2 + 2 * (s % 2);
    for (std::size_t r = 0; r < cube.shape[3]; ++r) {
      std::vector<double> row(bins);
      for (std::size_t b = 0; b < bins; ++b) row[b] = cube.values[offset + 4 * (b + bins * r)];
      spots[s].push_back(std::move(row));
    }
  }
  return spots;
}

/// Light of phase 0 that comes after this many bins is found this many bins earlier.
constexpr std::size_t kWrap = 20;

/// A row of phase 0 with its late bins put back where they belong. They show ambient light only;
/// the early ones hold what came late, unless a direct return is there.
std::vector<double> unwrapped(const std::vector<double>& row) {
  std::vector<double> out = row;
  for (std::size_t b = kWrap; b + 1 < row.size(); ++b) out[b] = row[b - kWrap];
  return out;
}

struct Position {
  std::array<double, 3> place{};
  std::array<RepeatSeries, kSpots> spots;
};

std::vector<Position> read_positions(const std::string& path) {
  check_matlab_file(path);
  const MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) throw Error(path, "is no MATLAB file that can be read");
  const Variable cubes = read_cells(file.get(), path, "datacubes");
  const Variable places = read_cells(file.get(), path, "positions");
  const std::size_t count = cell_count(*cubes);
  if (cell_count(*places) != count) {
    throw Error(path, "has " + std::to_string(count) + " datacubes and " +
                          std::to_string(cell_count(*places)) + " positions, accepted: as many");
  }
  std::vector<Position> positions(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::string cell = "{" + std::to_string(i) + "}";
    const Numbers place = numbers_of(places.get(), i, path + ": positions" + cell);
    if (place.values.size() != 3) {
      throw Error(path + ": positions" + cell,
                  "has shape " + place.shape_text() + ", accepted: 3 numbers");
    }
    std::copy(place.values.begin(), place.values.end(), positions[i].place.begin());
    const std::string where = path + ": datacubes" + cell;
    positions[i].spots = series_of(numbers_of(cubes.get(), i, where), where);
    if (positions[i].spots[0].front().size() != positions[0].spots[0].front().size()) {
      throw Error(where, "has another number of bins than the first");
    }
  }
  return positions;
}

/// The filter of the published evaluation: the target this near to the wall (m, along y) ...
constexpr double kPublishedLeastY = -1.7;
/// ... and at least this much light, counts, after the first bins of the sixth repeat.
constexpr double kPublishedLeastLight = 20000;
constexpr std::ptrdiff_t kPublishedFirstBin = 9;
constexpr std::size_t kPublishedRepeat = 5;

bool published(const Position& position, PublishedFilter filter) {
  if (filter == PublishedFilter::none) return true;
  if (position.place[1] < kPublishedLeastY) return false;
  if (filter == PublishedFilter::without_mirrors) return true;
  // In the two spots on the right.
  for (const std::size_t spot : {std::size_t{1}, std::size_t{3}}) {
    const RepeatSeries& series = position.spots[spot];
    if (series.size() <= kPublishedRepeat) return false;
    const std::vector<double>& row = series[kPublishedRepeat];
    const auto first = row.begin() + std::min(kPublishedFirstBin, std::ssize(row));
    if (std::accumulate(first, row.end(), 0.0) < kPublishedLeastLight) return false;
  }
  return true;
}

void add_captures(const Position& position, const std::vector<SortedRepeats>& sorted,
                  std::size_t per_sample, std::vector<Capture>& captures) {
  const std::size_t repeats = position.spots[0].size();
  const std::size_t length = per_sample == 0 ? repeats : per_sample;
  const auto bins = static_cast<int>(position.spots[0].front().size());
  for (std::size_t begin = 0; begin + length <= repeats; begin += length) {
    Capture capture;
    capture.counts = HistogramCube(kSpots, 2, bins);
    capture.zone_exposures.emplace(2 * kSpots, 0.0);
    capture.truth = {
        {"x_m", position.place[0]}, {"y_m", position.place[1]}, {"z_m", position.place[2]}};
    for (std::size_t s = 0; s < kSpots; ++s) {
      for (std::size_t r = begin; r < begin + length; ++r) {
        if (sorted[s].rejected[r] != Rejection::none) continue;
        const std::size_t zone = 2 * s + static_cast<std::size_t>(sorted[s].phase[r]);
        const RepeatSeries& series = position.spots[s];
        const std::vector<double> row = sorted[s].phase[r] == 0 ? unwrapped(series[r]) : series[r];
        double* out = capture.counts.zone(static_cast<int>(zone));
        for (int b = 0; b < bins; ++b) out[b] += row[static_cast<std::size_t>(b)];
        ++(*capture.zone_exposures)[zone];
      }
    }
    double most = 0;
    for (std::size_t z = 0; z < 2 * kSpots; ++z) {
      const double exposures = (*capture.zone_exposures)[z];
      most = std::max(most, exposures);
      double* out = capture.counts.zone(static_cast<int>(z));
      for (int b = 0; b < bins && exposures > 0; ++b) out[b] /= exposures;
    }
    if (most == 0) continue;
    capture.exposures = most;
    captures.push_back(std::move(capture));
  }
}

}  // namespace

bool reads_matlab() { return true; }

CaptureFile import_cheapspad(const std::string& path, const ImportOptions& options,
                             std::vector<std::string>& warnings) {
  const std::vector<Position> positions = read_positions(path);
  // Where each spot sees its direct return, from all positions together.
  std::array<RepeatReference, kSpots> references;
  for (std::size_t s = 0; s < kSpots; ++s) {
    std::vector<const RepeatSeries*> all;
    for (const Position& position : positions) all.push_back(&position.spots[s]);
    references[s] = repeat_reference(all);
  }
  CaptureFile file;
  file.bin_width = kBinWidth;
  file.sensor = "vl53l1x_2x2";
  file.description =
      "CheapSPAD; a row per relay spot, a column per phase (the brighter one first); truth from "
      "the file";
  std::map<Rejection, std::size_t> rejected;
  std::size_t kept = 0;
  std::size_t filtered = 0;
  for (const Position& position : positions) {
    if (!published(position, options.published_filter)) {
      ++filtered;
      continue;
    }
    std::vector<SortedRepeats> sorted;
    for (std::size_t s = 0; s < kSpots; ++s) {
      sorted.push_back(sort_repeats(position.spots[s], references[s]));
      for (const Rejection reason : sorted.back().rejected) {
        if (reason == Rejection::none) {
          ++kept;
        } else {
          ++rejected[reason];
        }
      }
    }
    add_captures(position, sorted, static_cast<std::size_t>(options.repeats_per_sample),
                 file.captures);
  }
  if (file.captures.empty()) throw Error(path, "no position is left by the filter");
  if (filtered > 0) {
    warnings.push_back(path + ": " + std::to_string(filtered) + " of " +
                       std::to_string(positions.size()) +
                       " positions left out by the published filter");
  }
  for (const auto& [reason, count] : rejected) {
    warnings.push_back(path + ": " + std::to_string(count) + " repeats of a spot left out (" +
                       std::to_string(kept) + " kept): " + rejection_text(reason));
  }
  return file;
}

#else

bool reads_matlab() { return false; }

CaptureFile import_cheapspad(const std::string& path, const ImportOptions&,
                             std::vector<std::string>&) {
  throw Error(path, "is a MATLAB file, but this build is without matio (Debian: libmatio-dev)");
}

#endif

}  // namespace blindcorner
