// SPDX-License-Identifier: Apache-2.0
#include "io/grey_image.h"

#include <png.h>

#include <cctype>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

/// More pixels than this (a gigabyte as numbers) are a mistake in the file's head.
constexpr std::size_t kMaxPixels = std::size_t{1} << 27;

// --- pgm
// ------------------------------------------------------------------------------------------

/// Walks through the words of a pgm (netpbm, "pgm format specification").
class PgmReader {
 public:
  PgmReader(const std::string& bytes, const std::string& path) : rest_(bytes), path_(path) {
    binary_ = bytes[1] == '5';
    rest_.remove_prefix(2);
  }

  GreyImage read() {
    GreyImage image;
    image.width = number("width", 1, 1 << 24);
    image.height = number("height", 1, 1 << 24);
    const int brightest = number("maxval", 1, 65535);
    if (image.pixels() > kMaxPixels) fail("it has more than 2^27 pixels");
    if (binary_) {
      read_binary(brightest, image);
    } else {
      for (std::size_t i = 0; i < image.pixels(); ++i) {
        image.shade.push_back(static_cast<double>(number("pixel", 0, brightest)) / brightest);
      }
    }
    return image;
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const { throw Error(path_, problem); }

  void skip_space() {
    while (!rest_.empty()) {
      if (rest_.front() == '#') {
        const std::size_t end = rest_.find_first_of("\r\n");
        rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end);
      } else if (std::isspace(static_cast<unsigned char>(rest_.front())) != 0) {
        rest_.remove_prefix(1);
      } else {
        return;
      }
    }
  }

  int number(const std::string& what, int lower, int upper) {
    skip_space();
    int value = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc{} || value < lower || value > upper) {
      const std::string_view word = rest_.substr(0, rest_.find_first_of(" \t\r\n"));
      fail(what + ": found " +
           (word.empty() ? "the end of the file" : std::string(word.substr(0, 40))) +
           ", accepted: a whole number from " + std::to_string(lower) + " to " +
           std::to_string(upper));
    }
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }

  void read_binary(int brightest, GreyImage& image) {
    if (!rest_.empty()) rest_.remove_prefix(1);  // one space ends the head
    const std::size_t width = brightest > 255 ? 2 : 1;
    if (rest_.size() < width * image.pixels()) {
      fail("pixels: found " + std::to_string(rest_.size()) +
           " bytes, accepted: " + std::to_string(width * image.pixels()));
    }
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      int value = 0;
      for (std::size_t k = 0; k < width; ++k) {
        value = 256 * value + static_cast<unsigned char>(rest_[width * i + k]);
      }
      image.shade.push_back(static_cast<double>(std::min(value, brightest)) / brightest);
    }
  }

  std::string_view rest_;
  std::string path_;
  bool binary_ = false;
};

// --- png
// ------------------------------------------------------------------------------------------

/// libpng's image in memory, freed in any case.
struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
  ~PngImage() { png_image_free(this); }
};

GreyImage read_png(const std::string& bytes, const std::string& path) {
  PngImage png;
  if (png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()) == 0) {
    throw Error(path, "is no readable png: " + one_line(png.message));
  }
  GreyImage image{static_cast<int>(png.width), static_cast<int>(png.height), {}, {}};
  if (image.pixels() > kMaxPixels) throw Error(path, "it has more than 2^27 pixels");
  // Each pixel has at least one bit, and the bytes are deflated.
  if (image.pixels() > 8 * kDeflateExpansion * bytes.size()) {
    throw Error(path, "is damaged: " + std::to_string(bytes.size()) + " bytes cannot hold " +
                          std::to_string(image.width) + " x " + std::to_string(image.height) +
                          " pixels");
  }
  const bool transparent = (png.format & PNG_FORMAT_FLAG_ALPHA) != 0;
  png.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;  // values as they are, not as amounts of light
  png.format = PNG_FORMAT_RGBA;
  std::vector<std::uint8_t> values(PNG_IMAGE_SIZE(png));
  if (png_image_finish_read(&png, nullptr, values.data(), 0, nullptr) == 0) {
    throw Error(path, "is no readable png: " + one_line(png.message));
  }
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const std::uint8_t* pixel = &values[4 * i];
    image.shade.push_back((pixel[0] + pixel[1] + pixel[2]) / (3 * 255.0));
    if (transparent) image.alpha.push_back(pixel[3] / 255.0);
  }
  return image;
}

// --- bmp
// ------------------------------------------------------------------------------------------

/// An uncompressed Windows bitmap (BITMAPINFOHEADER and later): 1, 4 or 8 bits with a palette, or
/// 24 or 32 bits of blue, green and red.
class BmpReader {
 public:
  BmpReader(const std::string& bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  GreyImage read() const {
    constexpr std::size_t kHead = 14;
    const std::uint32_t info = number(kHead, 4);
    const int width = static_cast<int>(number(kHead + 4, 4));
    const int height = static_cast<int>(number(kHead + 8, 4));  // negative: the top row is first
    const std::size_t bits = number(kHead + 14, 2);
    const std::uint32_t compression = number(kHead + 16, 4);
    const bool known = bits == 1 || bits == 4 || bits == 8 || bits == 24 || bits == 32;
    if (info < 40 || !known || compression != 0) {
      fail("is a bmp of " + std::to_string(bits) + " bits, compression " +
           std::to_string(compression) + ", accepted: 1, 4, 8, 24 or 32 bits, not compressed");
    }
    GreyImage image;
    image.width = width;
    image.height = std::abs(height);
    if (width < 1 || height == 0 || width > (1 << 24) || image.height > (1 << 24) ||
        image.pixels() > kMaxPixels) {
      fail("is damaged: it has " + std::to_string(width) + " x " + std::to_string(height) +
           " pixels");
    }
    const std::size_t first = number(10, 4);
    const std::size_t row_bytes = (bits * static_cast<std::size_t>(width) + 31) / 32 * 4;
    const std::size_t palette = kHead + info;
    if (first + row_bytes * static_cast<std::size_t>(image.height) > bytes_.size()) {
      fail("pixels: found " + std::to_string(bytes_.size()) + " bytes, accepted: " +
           std::to_string(first + row_bytes * static_cast<std::size_t>(image.height)));
    }
    for (int row = 0; row < image.height; ++row) {
      const int stored = height < 0 ? row : image.height - 1 - row;
      const std::size_t begin = first + row_bytes * static_cast<std::size_t>(stored);
      for (int column = 0; column < width; ++column) {
        const std::size_t bit = bits * static_cast<std::size_t>(column);
        std::size_t colour = begin + bit / 8;
        if (bits <= 8) {
          const std::size_t shift = 8 - bits - bit % 8;
          colour = palette + 4 * (number(colour, 1) >> shift & ((1U << bits) - 1));
        }
        const double sum = number(colour, 1) + number(colour + 1, 1) + number(colour + 2, 1);
        image.shade.push_back(sum / (3 * 255.0));
      }
    }
    return image;
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const { throw Error(path_, problem); }

  /// Little-endian number of `size` bytes.
  std::uint32_t number(std::size_t at, std::size_t size) const {
    if (at + size > bytes_.size()) fail("is a bmp that ends early");
    std::uint32_t value = 0;
    for (std::size_t i = size; i-- > 0;) {
      value = value << 8U | static_cast<unsigned char>(bytes_[at + i]);
    }
    return value;
  }

  const std::string& bytes_;
  const std::string& path_;
};

}  // namespace

GreyImage read_grey_image(const std::string& path) {
  const std::string bytes = read_bytes(path);
  if (bytes.starts_with("P5") || bytes.starts_with("P2")) return PgmReader(bytes, path).read();
  if (bytes.starts_with("\x89PNG")) return read_png(bytes, path);
  if (bytes.starts_with("BM")) return BmpReader(bytes, path).read();
  throw Error(path, "is neither a pgm (P2, P5) nor a png nor a bmp");
}

std::string pgm_bytes(int width, int height, const std::vector<std::uint8_t>& grey) {
  std::string bytes = "P5\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n";
  bytes.append(grey.begin(), grey.end());
  return bytes;
}

std::string png_bytes(int width, int height, const std::vector<std::uint8_t>& grey,
                      const std::vector<std::uint8_t>& alpha) {
  std::vector<std::uint8_t> values;
  for (std::size_t i = 0; i < grey.size(); ++i) {
    values.push_back(grey[i]);
    if (!alpha.empty()) values.push_back(alpha[i]);
  }
  PngImage png;
  png.width = static_cast<png_uint_32>(width);
  png.height = static_cast<png_uint_32>(height);
  png.format = alpha.empty() ? PNG_FORMAT_GRAY : PNG_FORMAT_GA;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, values.data(), 0, nullptr) == 0) {
    throw Error("png", "cannot be written: " + one_line(png.message));
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace blindcorner
