// SPDX-License-Identifier: Apache-2.0
#include "io/gzip.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <memory>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// zlib's number for a window of 32 KiB and the header of gzip.
constexpr int kGzipWindow = 16 + MAX_WBITS;

class Inflater {
 public:
  explicit Inflater(std::string_view packed) {
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream_.avail_in = static_cast<uInt>(packed.size());
    if (inflateInit2(&stream_, kGzipWindow) != Z_OK) throw Error("zlib", "cannot be started");
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() { inflateEnd(&stream_); }

  /// Appends the next block. Returns zlib's verdict.
  int next(std::string& bytes) {
    stream_.next_out = reinterpret_cast<Bytef*>(block_.data());
    stream_.avail_out = static_cast<uInt>(block_.size());
    const int verdict = inflate(&stream_, Z_NO_FLUSH);
    bytes.append(block_.data(), block_.size() - stream_.avail_out);
    return verdict;
  }
  bool empty() const { return stream_.avail_in == 0; }
  void begin_member() { inflateReset2(&stream_, kGzipWindow); }
  const char* message() const { return stream_.msg != nullptr ? stream_.msg : "unknown"; }

 private:
  z_stream stream_{};
  std::array<char, 1 << 16> block_{};
};

}  // namespace

bool is_gzip(std::string_view bytes) { return bytes.starts_with("\x1f\x8b\x08"); }

Unpacked gunzip(std::string_view packed, const std::string& path, std::size_t most) {
  if (packed.size() > std::numeric_limits<uInt>::max()) {
    throw Error(path, "is packed and of more than 4 GiB, accepted: up to 4 GiB, or unpacked");
  }
  Unpacked unpacked;
  Inflater inflater(packed);
  while (unpacked.bytes.size() < most) {
    const int verdict = inflater.next(unpacked.bytes);
    if (verdict == Z_STREAM_END) {
      if (inflater.empty()) break;
      inflater.begin_member();
    } else if (verdict == Z_BUF_ERROR) {  // the data end too early
      unpacked.cut = true;
      break;
    } else if (verdict != Z_OK) {
      throw Error(path, std::string("is a damaged gzip file: ") + inflater.message());
    }
  }
  unpacked.bytes.resize(std::min(unpacked.bytes.size(), most));
  return unpacked;
}

}  // namespace blindcorner
