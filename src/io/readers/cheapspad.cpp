// SPDX-License-Identifier: Apache-2.0
/// MATLAB files of the CheapSPAD data set (Callenberg et al., SIGGRAPH 2021): `datacubes`
/// {positions}[2, 2, bins, repeats] and `positions` {positions}[3] (m).
///
/// A relay spot (row, column) and a phase make one zone: zone 2 * spot + phase. A capture has a row
/// per spot and two columns. Repeats of a spot alternate between two phases that differ in gain,
/// ambient light and where the time axis wraps. Which phase came first changes from spot to spot
/// and position to position, so that phase 0 is the one whose direct return is brighter. Its time
/// axis wraps after 20 bins: bins 20 to 22 get what the file has in bins 0 to 2. That is of use if
/// no direct return lights those bins. The truth is x_m, y_m, z_m. Rejected repeats are counted by
/// reason. Captures carry the number of repeats that were averaged in each zone.
#include <algorithm>
#include <array>
#include <map>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "io/readers/capture_reader.h"
#include "io/readers/matlab_file.h"
#include "io/repeats.h"

namespace blindcorner {
namespace {

/// Bin width of a VL53L1X: 0.197 m one way.
constexpr double kBinWidth = 1314.2e-12;  // s
constexpr std::size_t kSpots = 4;

/// Repeats of one position, one series per spot; spots row by row.
std::array<RepeatSeries, kSpots> series_of(const MatlabArray& cube, const std::string& where) {
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

/// A row of phase 0 with its late light put back where it belongs. The file's late bins show
/// ambient light only. Its early bins hold the late light, unless a direct return is there.
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
  const std::vector<MatlabArray> cubes = read_matlab_cells(path, "datacubes");
  const std::vector<MatlabArray> places = read_matlab_cells(path, "positions");
  if (places.size() != cubes.size()) {
    throw Error(path, "has " + std::to_string(cubes.size()) + " datacubes and " +
                          std::to_string(places.size()) + " positions, accepted: as many");
  }
  std::vector<Position> positions(cubes.size());
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    const std::string cell = "{" + std::to_string(i) + "}";
    const MatlabArray& place = places[i];
    if (place.values.size() != 3) {
      throw Error(path + ": positions" + cell,
                  "has shape " + place.shape_text() + ", accepted: 3 numbers");
    }
    std::copy(place.values.begin(), place.values.end(), positions[i].place.begin());
    const std::string where = path + ": datacubes" + cell;
    positions[i].spots = series_of(cubes[i], where);
    if (positions[i].spots[0].front().size() != positions[0].spots[0].front().size()) {
      throw Error(where, "has another number of bins than the first");
    }
  }
  return positions;
}

/// The published evaluation keeps positions with the target this near to the wall (m, along y) ...
constexpr double kPublishedLeastY = -1.7;
/// ... and, with mirrors, with at least this much light, counts, after the first bins of the sixth
/// repeat.
constexpr double kPublishedLeastLight = 20000;
constexpr std::ptrdiff_t kPublishedFirstBin = 9;
constexpr std::size_t kPublishedRepeat = 5;

bool published(const Position& position, PublishedFilter filter) {
  if (filter == PublishedFilter::none) return true;
  if (position.place[1] < kPublishedLeastY) return false;
  if (filter == PublishedFilter::without_mirrors) return true;
  // Only the two spots on the right count.
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

bool recognise(const ImportSource& source) {
  if (!is_matlab(source)) return false;
  const std::vector<std::string> names = matlab_names(source.path());
  return std::ranges::count(names, "datacubes") > 0;
}

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& warnings) {
  const std::string& path = source.path();
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

}  // namespace

CaptureReader cheapspad_reader() {
  return {.name = "cheapspad",
          .recognises = "MATLAB file of the CheapSPAD data with datacubes and positions",
          .assumes = "bins of 1314.2 ps, repeats that alternate between two phases",
          .options = {"repeats", "published_filter"},
          .recognise = recognise,
          .read = read};
}

}  // namespace blindcorner
