// SPDX-License-Identifier: Apache-2.0
#include "io/exr_check.h"

#include <cstdint>
#include <map>
#include <string_view>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr std::size_t kMagic = 4, kMagicAndVersion = 8;
/// Flag in the version: a header for each part follows.
constexpr std::int32_t kSeveralParts = 0x1000;
/// Flag in the version: pixels hold lists of values.
constexpr std::int32_t kDeep = 0x800;

/// A little-endian number. Four bytes have to stand at `at`.
std::int32_t integer_at(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) {
    value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  }
  return static_cast<std::int32_t>(value);
}

/// Bytes of values that OpenEXR reads by their type, whatever size the file states.
const std::map<std::string_view, std::size_t> kFixedSizes = {
    {"box2f", 16},      {"box2i", 16},   {"chromaticities", 32},
    {"compression", 1}, {"double", 8},   {"envmap", 1},
    {"float", 4},       {"int", 4},      {"keycode", 28},
    {"lineOrder", 1},   {"m33f", 36},    {"m33d", 72},
    {"m44f", 64},       {"m44d", 128},   {"rational", 8},
    {"tiledesc", 9},    {"timecode", 8}, {"v2d", 16},
    {"v2f", 8},         {"v2i", 8},      {"v3d", 24},
    {"v3f", 12},        {"v3i", 12},     {"deepImageState", 1}};

/// Whether a list of channels ends where its size says. Each channel has a name, a zero and 16
/// bytes; an empty name ends the list.
bool is_channel_list(std::string_view value) {
  while (!value.empty() && value.front() != '\0') {
    const std::size_t end = value.find('\0');
    if (end == std::string_view::npos || value.size() - end < 17) return false;
    value.remove_prefix(end + 17);
  }
  return value.size() == 1;
}

bool has_size_of_its_type(std::string_view type, std::string_view value) {
  if (type == "chlist") return is_channel_list(value);
  if (type == "preview" || type == "idmanifest") return false;  // no part of a capture
  const auto fixed = kFixedSizes.find(type);
  return fixed == kFixedSizes.end() || fixed->second == value.size();
}

/// Most pixels of a row, as many as a capture may have bins. Also most pixels of a tile.
constexpr std::int64_t kWidest = 1 << 20;

/// Whether the file can hold the pixels of a box. Rows are stored in blocks of at most 32 (PIZ),
/// and each block has at least 16 bytes of its own.
bool fits(const std::string& bytes, std::size_t box) {
  const auto extent = [&](std::size_t axis) {
    return 1 + std::int64_t{integer_at(bytes, box + 8 + 4 * axis)} -
           std::int64_t{integer_at(bytes, box + 4 * axis)};
  };
  return extent(0) <= kWidest && extent(1) <= 2 * static_cast<std::int64_t>(bytes.size());
}

/// OpenEXR allocates a tile of the size that the file states, whatever follows.
bool is_small_tile(const std::string& bytes, std::size_t tile) {
  const std::int64_t width = integer_at(bytes, tile), height = integer_at(bytes, tile + 4);
  return width >= 1 && height >= 1 && width * height <= kWidest;
}

}  // namespace

void check_exr_header(const std::string& bytes, const std::string& path) {
  if (bytes.size() < kMagicAndVersion) throw Error(path, "is truncated: its header has no end");
  if ((integer_at(bytes, kMagic) & kSeveralParts) != 0) {
    throw Error(path, "has several parts, accepted one");
  }
  if ((integer_at(bytes, kMagic) & kDeep) != 0) {
    throw Error(path, "has deep pixels, accepted plain ones");
  }
  // Attributes follow each other: name, type (both end with a zero), size, value; an empty name
  // ends the header (OpenEXR file layout).
  std::size_t at = kMagicAndVersion;
  while (at < bytes.size() && bytes[at] != '\0') {
    const std::size_t name_end = bytes.find('\0', at);
    const std::size_t type_end =
        name_end == std::string::npos ? name_end : bytes.find('\0', name_end + 1);
    if (type_end == std::string::npos || bytes.size() - type_end < 5) {
      throw Error(path, "is damaged or truncated: its header has no end");
    }
    const std::int32_t size = integer_at(bytes, type_end + 1);
    const std::size_t value = type_end + 5;
    if (size < 0 || static_cast<std::size_t>(size) > bytes.size() - value) {
      throw Error(path, "is damaged or truncated: found an attribute of " + std::to_string(size) +
                            " bytes in its header, accepted: at most the " +
                            std::to_string(bytes.size() - value) + " that follow");
    }
    const std::string_view type(bytes.data() + name_end + 1, type_end - name_end - 1);
    const auto length = static_cast<std::size_t>(size);
    if (!has_size_of_its_type(type, {bytes.data() + value, length})) {
      throw Error(path, "is damaged: found an attribute of type " + std::string(type) + " with " +
                            std::to_string(size) +
                            " bytes in its header, accepted: what a "
                            "capture file has, of its type's size");
    }
    if (type == "box2i" && !fits(bytes, value)) {
      throw Error(path, "is damaged or truncated: its header declares more pixels than " +
                            std::to_string(bytes.size()) + " bytes can hold");
    }
    if (type == "tiledesc" && !is_small_tile(bytes, value)) {
      throw Error(path, "found tiles of more than 2^20 pixels, accepted: at most that many");
    }
    at = value + length;
  }
}

}  // namespace blindcorner
