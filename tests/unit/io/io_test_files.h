// SPDX-License-Identifier: Apache-2.0
/// Helpers of the file format tests.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_file.h"

namespace blindcorner::test {

/// A folder that vanishes with the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    static int count = 0;
    path_ = std::filesystem::temp_directory_path() /
            ("blindcorner_io_test_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
    std::filesystem::create_directories(path_);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string path() const { return path_.string(); }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_),
                                                  std::filesystem::directory_iterator()));
  }

 private:
  std::filesystem::path path_;
};

inline std::string read_text(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

inline void write_text(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

/// Keeps what a reader refuses, and its message, in the folder that BLINDCORNER_REFUSED names, for
/// the test of the JSON schemas (tests/schema/validate.py).
inline void keep_refused(const std::string& kind, const std::string& document,
                         const std::string& message) {
  const char* folder = std::getenv("BLINDCORNER_REFUSED");
  if (folder == nullptr || message.empty()) return;
  static int count = 0;
  const auto stem = std::filesystem::path(folder) / (kind + "_" + std::to_string(count++));
  write_text(stem.string() + ".json", document);
  write_text(stem.string() + ".txt", message);
}

/// The message of the Error that `action` throws; empty when it throws none.
template <typename Action>
std::string error_of(Action action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "";
}

/// Folder of the shared measurements; empty when it is not there.
inline std::string data_folder() {
  const char* stated = std::getenv("BLINDCORNER_DATA");
  const std::string folder = stated != nullptr ? stated : DATA_DIR;
  return std::filesystem::is_directory(folder) ? folder : "";
}

/// Captures with distinct values, all exact in single precision.
inline CaptureFile make_captures(int captures, int rows, int columns, int bins) {
  CaptureFile file;
  file.bin_width = 88e-12;
  file.sensor = "tmf8828";
  file.description = "made up";
  for (int c = 0; c < captures; ++c) {
    Capture capture;
    capture.counts = HistogramCube(rows, columns, bins);
    for (std::size_t i = 0; i < capture.counts.values.size(); ++i) {
      capture.counts.values[i] = 1000.0 * c + 0.25 * static_cast<double>(i);
    }
    file.captures.push_back(capture);
  }
  return file;
}

/// Bytes of a .npy file, written by hand: `data` are the raw elements.
inline std::string npy_bytes(const std::string& dtype, const std::string& shape,
                             const std::string& data, bool fortran = false, int version = 1) {
  std::string header = "{'descr': '" + dtype +
                       "', 'fortran_order': " + (fortran ? "True" : "False") +
                       ", 'shape': " + shape + ", }";
  const std::size_t start = version == 1 ? 10 : 12;
  while ((start + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string bytes = "\x93NUMPY";
  bytes += static_cast<char>(version);
  bytes += '\0';
  for (std::size_t i = 0; i < start - 8; ++i) {
    bytes += static_cast<char>(header.size() >> (8 * i) & 0xff);
  }
  return bytes + header + data;
}

/// Raw bytes of an integer or of the bits of a float.
inline std::string raw_bytes(std::uint64_t bits, int size, bool big_endian = false) {
  std::string bytes;
  for (int i = 0; i < size; ++i) {
    const int shift = 8 * (big_endian ? size - 1 - i : i);
    bytes += static_cast<char>(bits >> shift & 0xff);
  }
  return bytes;
}

inline std::string raw_bytes(double value, bool big_endian = false) {
  return raw_bytes(std::bit_cast<std::uint64_t>(value), 8, big_endian);
}

}  // namespace blindcorner::test
