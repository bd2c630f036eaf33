// SPDX-License-Identifier: Apache-2.0
#include "io/matlab_check.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

constexpr std::size_t kHeader = 128;  ///< bytes
constexpr std::uint16_t kMatlab73 = 0x0200;
constexpr int kDeepestCells = 8;
/// Most unpacked bytes: kAlwaysAllowed for any file, kMaxExpansion times the file's size if that is
/// more. Whole-number counts shrink to a tenth, arrays of mostly zeros to a hundredth.
constexpr std::size_t kAlwaysAllowed = std::size_t{1} << 26;
constexpr std::size_t kMaxExpansion = 100;

/// Types of elements and classes of arrays (MAT-File Format, R2023a, tables 1-1 and 1-3).
enum ElementType : std::uint32_t { kInt32 = 5, kUInt32 = 6, kMatrix = 14, kCompressed = 15 };
enum ArrayClass : std::uint32_t { kCell = 1, kChar = 4, kFirstNumber = 6 };
constexpr std::uint32_t kLastNumber = 15;
constexpr std::uint32_t kComplexFlag = 0x0800;

std::size_t number_size(std::uint32_t type) {
  switch (type) {
    case 1:
    case 2:
    case 16:
      return 1;
    case 3:
    case 4:
    case 17:
      return 2;
    case kInt32:
    case kUInt32:
    case 7:
    case 18:
      return 4;
    case 9:
    case 12:
    case 13:
      return 8;
    default:
      return 0;
  }
}

struct Element {
  std::uint32_t type = 0;
  std::string_view data;
};

class Walk {
 public:
  explicit Walk(const std::string& path) : path_(path) {}

  [[noreturn]] void damaged(const std::string& what) const {
    throw Error(path_, "found " + what + ", accepted: a whole MATLAB 5 file");
  }

  /// Takes the next element from the front, with the padding that fills it up to eight bytes.
  Element next(std::string_view& rest, bool aligned) const {
    if (rest.size() < 8) damaged("an element that is cut off");
    const std::uint32_t word = number(rest, 0);
    if (word >> 16 != 0) {  // small: type and size in one word, data in the next
      const std::size_t size = word >> 16;
      if (size > 4) damaged("a short element of more than 4 bytes");
      const Element element{word & 0xFFFFU, rest.substr(4, size)};
      rest.remove_prefix(8);
      return element;
    }
    const std::size_t size = number(rest, 4);
    rest.remove_prefix(8);
    if (size > rest.size()) damaged("an element that declares more bytes than there are");
    const Element element{word, rest.substr(0, size)};
    rest.remove_prefix(aligned ? std::min((size + 7) / 8 * 8, rest.size()) : size);
    return element;
  }

  void array(std::string_view data, int depth) const {
    if (depth > kDeepestCells) damaged("cells nested too deep");
    if (data.empty()) return;  // an empty cell
    const Element flags = next(data, true);
    if (flags.type != kUInt32 || flags.data.size() != 8) damaged("an array without flags");
    const std::uint32_t word = number(flags.data, 0);
    const std::size_t count = numbers(next(data, true));
    next(data, true);  // its name
    const std::uint32_t kind = word & 0xFFU;
    if (kind == kCell) {
      for (std::size_t i = 0; i < count; ++i) {
        const Element cell = next(data, true);
        if (cell.type != kMatrix) damaged("a cell that holds no array");
        array(cell.data, depth + 1);
      }
    } else if (kind == kChar || (kind >= kFirstNumber && kind <= kLastNumber)) {
      real_numbers(data, count);
      if ((word & kComplexFlag) != 0) real_numbers(data, count);
    } else {
      throw Error(path_,
                  "found a sparse array, a structure or an object, accepted: arrays of "
                  "numbers or text, and cells of these");
    }
  }

 private:
  static std::uint32_t number(std::string_view bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  }

  /// Product of the dimensions.
  std::size_t numbers(const Element& sizes) const {
    if (sizes.type != kInt32 || sizes.data.size() % 4 != 0 || sizes.data.size() < 8) {
      damaged("an array without sizes");
    }
    double product = 1;
    for (std::size_t i = 0; i < sizes.data.size(); i += 4) {
      const auto extent = static_cast<std::int32_t>(number(sizes.data, i));
      if (extent < 0) damaged("a negative size");
      product *= extent;
      // Checked for each factor: hundreds of large extents and a zero would give infinity times
      // zero.
      if (product > std::numeric_limits<std::int32_t>::max()) damaged("more than 2^31 numbers");
    }
    return static_cast<std::size_t>(product);
  }

  void real_numbers(std::string_view& data, std::size_t count) const {
    if (count == 0 && data.empty()) return;
    const Element values = next(data, true);
    const std::size_t size = number_size(values.type);
    if (size == 0) damaged("numbers of an unknown type");
    if (values.data.size() / size < count) {
      damaged("an array of " + std::to_string(count) + " numbers that holds " +
              std::to_string(values.data.size() / size));
    }
  }

  const std::string& path_;
};

/// The unpacked element. Refuses more than `most` bytes.
std::string inflated(const Walk& walk, std::string_view packed, std::size_t most) {
  std::string bytes;
  std::string block(1 << 16, '\0');
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) walk.damaged("packed data that cannot be read");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  int status = Z_OK;
  while (status == Z_OK && bytes.size() <= most) {
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    status = inflate(&stream, Z_NO_FLUSH);
    bytes.append(block, 0, block.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (bytes.size() > most) walk.damaged("packed data far larger than the file");
  if (status != Z_STREAM_END) walk.damaged("packed data that are cut off or damaged");
  return bytes;
}

}  // namespace

void check_matlab_file(const std::string& path) {
  const std::string bytes = read_bytes(path);
  const Walk walk(path);
  if (bytes.size() < kHeader + 8) walk.damaged("too few bytes");
  std::uint16_t version = 0;
  std::memcpy(&version, bytes.data() + 124, sizeof version);
  if (version == kMatlab73) return;
  if (bytes.compare(126, 2, "IM") != 0) walk.damaged("no header of a little-endian MATLAB 5 file");
  std::size_t left = std::max(kAlwaysAllowed, kMaxExpansion * bytes.size());
  for (std::string_view rest = std::string_view(bytes).substr(kHeader); !rest.empty();) {
    const Element outer = walk.next(rest, false);
    if (outer.type == kMatrix) walk.array(outer.data, 0);
    if (outer.type != kCompressed) continue;
    const std::string unpacked = inflated(walk, outer.data, left);
    left -= unpacked.size();
    std::string_view inside = unpacked;
    const Element array = walk.next(inside, true);
    if (array.type == kMatrix) walk.array(array.data, 0);
  }
}

}  // namespace blindcorner
