// SPDX-License-Identifier: Apache-2.0
/// NumPy's .npy format, versions 1 to 3 (numpy.lib.format).
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace blindcorner {

/// One array in C order. Numbers of all kinds become doubles; a unicode array of one element
/// becomes `text` (UTF-8) and has no values.
struct NpyArray {
  std::string dtype;  ///< as in the file: "<f8"
  std::vector<std::size_t> shape;
  std::vector<double> values;
  std::string text;
  bool is_text = false;

  std::string shape_text() const;  ///< "(36, 3, 128)"
};

/// Reads the bytes of a .npy file: signed and unsigned integers, floats of 2, 4 and 8 bytes and
/// unicode text, little or big endian, C or Fortran order. Throws Error for everything else, and
/// for more than `most_values` numbers. `where` begins its messages.
NpyArray parse_npy(std::string_view bytes, const std::string& where,
                   std::size_t most_values = std::numeric_limits<std::size_t>::max());

/// .npy bytes of a little-endian float64 array in C order.
std::string npy_of(const std::vector<std::size_t>& shape, const std::vector<double>& values);

/// .npy bytes of a zero-dimensional unicode array, whose `.item()` is a Python str.
std::string npy_of(const std::string& utf8);

}  // namespace blindcorner
