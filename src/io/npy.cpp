// SPDX-License-Identifier: Apache-2.0
#include "io/npy.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

static_assert(std::numeric_limits<double>::is_iec559 && sizeof(double) == 8);

constexpr std::string_view kMagic("\x93NUMPY", 6);
/// numpy's own limit.
constexpr std::size_t kMostDimensions = 64;

/// Unsigned integer of `bytes.size()` <= 8 bytes.
std::uint64_t integer_of(std::string_view bytes, bool big_endian) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::size_t at = big_endian ? i : bytes.size() - 1 - i;
    value = value << 8 | static_cast<unsigned char>(bytes[at]);
  }
  return value;
}

void append_little_endian(std::string& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i) & 0xff));
}

/// IEEE 754 binary16: 1 sign, 5 exponent, 10 fraction bits.
double half_of(std::uint64_t bits) {
  const int exponent = static_cast<int>(bits >> 10 & 0x1f);
  const double fraction = static_cast<double>(bits & 0x3ff);
  double magnitude = 0.0;
  if (exponent == 0x1f) {
    magnitude = fraction > 0.0 ? std::numeric_limits<double>::quiet_NaN()
                               : std::numeric_limits<double>::infinity();
  } else if (exponent == 0) {
    magnitude = std::ldexp(fraction, -24);
  } else {
    magnitude = std::ldexp(1024.0 + fraction, exponent - 25);
  }
  return (bits & 0x8000) != 0 ? -magnitude : magnitude;
}

struct ElementType {
  char kind = 'f';  ///< i, u, f or U, as numpy names them
  std::size_t size = 8;
  bool big_endian = false;
};

double element_of(std::string_view bytes, const ElementType& type) {
  const std::uint64_t bits = integer_of(bytes, type.big_endian);
  switch (type.kind) {
    case 'u':
      return static_cast<double>(bits);
    case 'i': {
      const int unused = static_cast<int>(64 - 8 * type.size);
      return static_cast<double>(static_cast<std::int64_t>(bits << unused) >> unused);
    }
    default:
      if (type.size == 2) return half_of(bits);
      if (type.size == 4) {
        return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
      }
      return std::bit_cast<double>(bits);
  }
}

/// "<f8", "|u1", ">i4", "<U12".
ElementType parse_type(const std::string& dtype, const std::string& where) {
  const auto fail = [&](const std::string& what) -> void {
    throw Error(where, what + " (dtype " + dtype +
                           "), accepted integers of 1, 2, 4 or 8 bytes and floats of 2, 4 or 8 "
                           "bytes");
  };
  ElementType type;
  std::size_t i = 0;
  if (!dtype.empty() && std::string_view("<>|=").find(dtype[0]) != std::string_view::npos) {
    type.big_endian = dtype[0] == '>';
    i = 1;
  }
  if (i >= dtype.size()) fail("unknown element type");
  type.kind = dtype[i++];
  const char* const end = dtype.data() + dtype.size();
  const auto [stop, error] = std::from_chars(dtype.data() + i, end, type.size);
  if (type.kind == 'O') fail("holds Python objects");
  if (error != std::errc() || stop != end) fail("unknown element type");
  if (type.kind == 'b') fail("holds booleans");
  if (type.kind == 'c') fail("holds complex numbers");
  const bool known_size = type.size == 1 || type.size == 2 || type.size == 4 || type.size == 8;
  const bool number = ((type.kind == 'i' || type.kind == 'u') && known_size) ||
                      (type.kind == 'f' && known_size && type.size > 1);
  const bool text = type.kind == 'U' && type.size < (std::size_t{1} << 30);
  if (!number && !text) fail("unknown element type");
  if (text) type.size *= 4;  // counted in characters
  return type;
}

/// The header is a Python dictionary of three known keys; this reads just that.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, std::string where) : text_(text), where_(std::move(where)) {}

  void parse() {
    expect('{');
    while (!accept('}')) {
      const std::string key = quoted();
      expect(':');
      if (key == "descr") {
        if (peek() == '[') throw Error(where_, "holds records, accepted plain numbers");
        dtype = quoted();
      } else if (key == "fortran_order") {
        fortran_order = boolean();
      } else if (key == "shape") {
        shape = tuple();
      } else {
        fail();
      }
      if (peek() != '}') expect(',');
    }
    if (dtype.empty()) fail();
  }

  std::string dtype;
  bool fortran_order = false;
  std::vector<std::size_t> shape;

 private:
  [[noreturn]] void fail() const { throw Error(where_, "the .npy header is damaged"); }
  char peek() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool accept(char c) {
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  void expect(char c) {
    if (!accept(c)) fail();
  }
  std::string quoted() {
    const char quote = peek();
    if (quote != '\'' && quote != '"') fail();
    const std::size_t end = text_.find(quote, ++at_);
    if (end == std::string_view::npos) fail();
    std::string result(text_.substr(at_, end - at_));
    at_ = end + 1;
    return result;
  }
  bool boolean() {
    peek();
    for (const std::string_view word : {"True", "False"}) {
      if (text_.substr(at_, word.size()) != word) continue;
      at_ += word.size();
      return word == "True";
    }
    fail();
  }
  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> result;
    expect('(');
    while (!accept(')')) {
      peek();
      std::size_t extent = 0;
      const char* const end = text_.data() + text_.size();
      const auto [stop, error] = std::from_chars(text_.data() + at_, end, extent);
      if (error != std::errc()) fail();
      at_ = static_cast<std::size_t>(stop - text_.data());
      if (result.size() == kMostDimensions) fail();
      result.push_back(extent);
      if (peek() != ')') expect(',');
    }
    return result;
  }

  std::string_view text_;
  std::string where_;
  std::size_t at_ = 0;
};

/// Splits a file into header text and data.
std::pair<std::string_view, std::string_view> split(std::string_view bytes,
                                                    const std::string& where) {
  if (bytes.substr(0, kMagic.size()) != kMagic) {
    throw Error(where, "is not a .npy array (its first bytes are wrong)");
  }
  const auto truncated = [&] { return Error(where, "is truncated within its header"); };
  if (bytes.size() < 8) throw truncated();
  const int version = static_cast<unsigned char>(bytes[6]);
  if (version < 1 || version > 3) {
    throw Error(where, ".npy version is " + std::to_string(version) + ", accepted 1 to 3");
  }
  const std::size_t length_size = version == 1 ? 2 : 4;
  if (bytes.size() < 8 + length_size) throw truncated();
  const std::size_t length =
      static_cast<std::size_t>(integer_of(bytes.substr(8, length_size), false));
  const std::size_t start = 8 + length_size;
  if (bytes.size() - start < length) throw truncated();
  return {bytes.substr(start, length), bytes.substr(start + length)};
}

std::size_t element_count(const std::vector<std::size_t>& shape, std::size_t element_size,
                          std::size_t data_size, const std::string& where) {
  std::size_t count = 1;
  bool overflow = false;
  for (const std::size_t extent : shape) overflow |= __builtin_mul_overflow(count, extent, &count);
  std::size_t needed = 0;
  overflow |= __builtin_mul_overflow(count, element_size, &needed);
  if (overflow || needed != data_size) {
    throw Error(where, (overflow || needed > data_size ? "is truncated: " : "is too long: ") +
                           std::to_string(data_size) + " bytes of data, the header promises " +
                           (overflow ? "far more" : std::to_string(needed)));
  }
  return count;
}

/// Values in Fortran order (first index fastest) to C order (last index fastest).
std::vector<double> to_c_order(const std::vector<double>& values,
                               const std::vector<std::size_t>& shape) {
  std::vector<double> result(values.size());
  std::vector<std::size_t> index(shape.size(), 0);
  for (const double value : values) {
    std::size_t at = 0;
    for (std::size_t d = 0; d < shape.size(); ++d) at = at * shape[d] + index[d];
    result[at] = value;
    for (std::size_t d = 0; d < shape.size() && ++index[d] == shape[d]; ++d) index[d] = 0;
  }
  return result;
}

void append_utf8(std::string& text, std::uint32_t code) {
  const auto push = [&text](std::uint32_t byte) { text.push_back(static_cast<char>(byte)); };
  if (code < 0x80) {
    push(code);
  } else if (code < 0x800) {
    push(0xc0 | code >> 6);
    push(0x80 | (code & 0x3f));
  } else if (code < 0x10000) {
    push(0xe0 | code >> 12);
    push(0x80 | (code >> 6 & 0x3f));
    push(0x80 | (code & 0x3f));
  } else {
    push(0xf0 | (code >> 18 & 0x07));
    push(0x80 | (code >> 12 & 0x3f));
    push(0x80 | (code >> 6 & 0x3f));
    push(0x80 | (code & 0x3f));
  }
}

/// Code points of valid UTF-8 (the caller's JSON writer guarantees that).
std::vector<std::uint32_t> code_points(const std::string& utf8) {
  std::vector<std::uint32_t> codes;
  for (const char c : utf8) {
    const std::uint32_t byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0) == 0x80 && !codes.empty()) {
      codes.back() = codes.back() << 6 | (byte & 0x3f);
    } else if (byte < 0x80) {
      codes.push_back(byte);
    } else {
      codes.push_back(byte & (byte < 0xe0 ? 0x1f : byte < 0xf0 ? 0x0f : 0x07));
    }
  }
  return codes;
}

std::string npy_start(const std::string& dtype, const std::vector<std::size_t>& shape) {
  std::string dictionary = "{'descr': '" + dtype + "', 'fortran_order': False, 'shape': (";
  for (const std::size_t extent : shape) dictionary += std::to_string(extent) + ", ";
  if (shape.size() > 1) dictionary.resize(dictionary.size() - 2);
  if (shape.size() == 1) dictionary.pop_back();  // "(5,)"
  dictionary += "), }";
  // The format asks for data that begin at a multiple of 64 bytes, and a line break before them.
  const std::size_t unpadded = kMagic.size() + 4 + dictionary.size() + 1;
  dictionary.append((64 - unpadded % 64) % 64, ' ');
  dictionary += '\n';
  std::string bytes(kMagic);
  bytes += '\x01';
  bytes += '\x00';
  append_little_endian(bytes, dictionary.size(), 2);
  return bytes + dictionary;
}

}  // namespace

std::string NpyArray::shape_text() const {
  std::string result = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    result += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  }
  return result + ")";
}

NpyArray parse_npy(std::string_view bytes, const std::string& where, std::size_t most_values) {
  const auto [head, data] = split(bytes, where);
  HeaderParser header(head, where);
  header.parse();
  const ElementType type = parse_type(header.dtype, where);
  const std::size_t count = element_count(header.shape, type.size, data.size(), where);

  if (count > most_values) {
    throw Error(where, "found " + std::to_string(count) + " values, accepted: at most " +
                           std::to_string(most_values) + " in a file of this size");
  }

  NpyArray array;
  array.dtype = header.dtype;
  array.shape = header.shape;
  if (type.kind == 'U') {
    if (count != 1) throw Error(where, "holds several texts, accepted numbers");
    array.is_text = true;
    for (std::size_t i = 0; i < type.size; i += 4) {
      const std::uint64_t code = integer_of(data.substr(i, 4), type.big_endian);
      if (code == 0) break;  // numpy pads with zeros
      append_utf8(array.text, static_cast<std::uint32_t>(code));
    }
    return array;
  }
  array.values.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    array.values.push_back(element_of(data.substr(i * type.size, type.size), type));
  }
  if (header.fortran_order) array.values = to_c_order(array.values, array.shape);
  return array;
}

std::string npy_of(const std::vector<std::size_t>& shape, const std::vector<double>& values) {
  std::string bytes = npy_start("<f8", shape);
  bytes.reserve(bytes.size() + 8 * values.size());
  for (const double value : values) {
    append_little_endian(bytes, std::bit_cast<std::uint64_t>(value), 8);
  }
  return bytes;
}

std::string npy_of(const std::string& utf8) {
  const std::vector<std::uint32_t> codes = code_points(utf8);
  std::string bytes = npy_start("<U" + std::to_string(codes.size()), {});
  for (const std::uint32_t code : codes) append_little_endian(bytes, code, 4);
  return bytes;
}

}  // namespace blindcorner
