// SPDX-License-Identifier: Apache-2.0
/// Grey images: pgm, png and bmp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace blindcorner {

/// Pixels row by row, the top row first; 0 is black or transparent, 1 white or opaque.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<double> shade;  ///< mean of the colour channels
  std::vector<double> alpha;  ///< empty where the image has none

  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

/// Reads a pgm (P2 or P5, up to 16 bits), a png (any kind) or a bmp (not compressed), told apart by
/// the first bytes; colours are averaged. Throws Error naming the file.
GreyImage read_grey_image(const std::string& path);

/// The bytes of a binary pgm of 8 bits.
std::string pgm_bytes(int width, int height, const std::vector<std::uint8_t>& grey);

/// The bytes of a png of 8 bits, with transparency where `alpha` is not empty. Throws Error.
std::string png_bytes(int width, int height, const std::vector<std::uint8_t>& grey,
                      const std::vector<std::uint8_t>& alpha);

}  // namespace blindcorner
