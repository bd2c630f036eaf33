// SPDX-License-Identifier: Apache-2.0
#include "arrays.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_metadata.h"

namespace blindcorner::python {

CaptureFile captures_of(const CaptureArrays& arrays) {
  CaptureFile file = parse_metadata(arrays.metadata, "captures");
  const std::size_t count = file.captures.size();
  if (arrays.counts.shape(0) != count || arrays.sources.size() != count ||
      arrays.indices.size() != count) {
    throw Error("captures", "found counts of " + std::to_string(arrays.counts.shape(0)) +
                                " captures, accepted: " + std::to_string(count) +
                                ", as the metadata says");
  }
  for (std::size_t i = 0; i < count; ++i) {
    Capture& capture = file.captures[i];
    HistogramCube& cube = capture.counts;
    const auto zones = static_cast<std::size_t>(cube.zones());
    const auto bins = static_cast<std::size_t>(cube.bins);
    if (arrays.counts.shape(1) != zones || arrays.counts.shape(2) != bins) {
      throw Error("captures", "found counts of " + std::to_string(arrays.counts.shape(1)) +
                                  " zones and " + std::to_string(arrays.counts.shape(2)) +
                                  " bins, accepted: " + std::to_string(zones) + " and " +
                                  std::to_string(bins) + ", as the metadata says");
    }
    const double* first = arrays.counts.data() + i * zones * bins;
    cube.values.assign(first, first + zones * bins);
    capture.source = arrays.sources[i];
    capture.index = arrays.indices[i];
  }
  return file;
}

nb::tuple arrays_of(CaptureFile file) {
  check_captures(file, "captures");
  const std::string metadata = metadata_text(file);
  std::vector<std::string> sources;
  std::vector<int> indices;
  const HistogramCube& first = file.captures.front().counts;
  const std::array<std::size_t, 3> shape{file.captures.size(),
                                         static_cast<std::size_t>(first.zones()),
                                         static_cast<std::size_t>(first.bins)};
  std::vector<double> counts;
  if (file.captures.size() == 1) {
    counts = std::move(file.captures.front().counts.values);
  } else {
    counts.reserve(shape[0] * shape[1] * shape[2]);
  }
  for (Capture& capture : file.captures) {
    counts.insert(counts.end(), capture.counts.values.begin(), capture.counts.values.end());
    capture.counts.values = {};  // so that no capture is in memory twice
    sources.push_back(std::move(capture.source));
    indices.push_back(capture.index);
  }
  return nb::make_tuple(array_of<3>(std::move(counts), shape), metadata, sources, indices);
}

}  // namespace blindcorner::python
