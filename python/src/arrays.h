// SPDX-License-Identifier: Apache-2.0
/// numpy arrays from and to the library's types.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <string>
#include <vector>

#include "blindcorner/io/capture_file.h"

namespace blindcorner::python {

namespace nb = nanobind;

template <std::size_t N>
using Array = nb::ndarray<nb::numpy, double, nb::ndim<N>>;
template <std::size_t N>
using Input = nb::ndarray<const double, nb::ndim<N>, nb::c_contig, nb::device::cpu>;

/// An array that owns the vector: nothing is copied.
template <std::size_t N>
Array<N> array_of(std::vector<double> values, const std::array<std::size_t, N>& shape) {
  auto* kept = new std::vector<double>(std::move(values));
  const nb::capsule owner(kept,
                          [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return Array<N>(kept->data(), N, shape.data(), owner);
}

/// An array that looks at memory of `owner`, which it keeps alive.
template <std::size_t N>
Array<N> view_of(const std::vector<double>& values, const std::array<std::size_t, N>& shape,
                 nb::handle owner) {
  return Array<N>(const_cast<double*>(values.data()), N, shape.data(), owner);
}

/// Captures as the package keeps them: counts apart from what accompanies them.
struct CaptureArrays {
  Input<3> counts;       ///< [captures, zones, bins]
  std::string metadata;  ///< JSON of format "blindcorner.capture/1"
  std::vector<std::string> sources;
  std::vector<int> indices;
};

/// The captures as the library takes them; the counts are copied. Throws Error if the metadata does
/// not suit the counts.
CaptureFile captures_of(const CaptureArrays& arrays);

/// (counts, metadata, sources, indices); the captures are used up.
nb::tuple arrays_of(CaptureFile file);

}  // namespace blindcorner::python
