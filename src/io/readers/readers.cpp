// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include "io/file_bytes.h"
#include "io/gzip.h"
#include "io/readers/capture_reader.h"

namespace blindcorner {

CaptureReader person_tracking_reader();
CaptureReader numpy_reader();
CaptureReader cheapspad_reader();
CaptureReader matlab_reader();
CaptureReader tal_reader();
CaptureReader tmf8829_json_reader();
CaptureReader tmf8828_log_reader();
CaptureReader tmf882x_lines_reader();
CaptureReader vl53l8ch_csv_reader();
CaptureReader vl53l8ch_log_reader();
CaptureReader json_lines_reader();
CaptureReader text_table_reader();

const std::vector<CaptureReader>& capture_readers() {
  static const std::vector<CaptureReader> readers = {
      person_tracking_reader(), numpy_reader(),         cheapspad_reader(),
      matlab_reader(),          tal_reader(),           tmf8829_json_reader(),
      tmf8828_log_reader(),     tmf882x_lines_reader(), vl53l8ch_csv_reader(),
      vl53l8ch_log_reader(),    json_lines_reader(),    text_table_reader()};
  return readers;
}

std::string ImportSource::ending() const {
  std::filesystem::path name(path_);
  if (name.extension() == ".gz") name = name.stem();
  return name.extension().string();
}

bool ImportSource::is_folder() const {
  std::error_code error;
  return std::filesystem::is_directory(path_, error);
}

const std::string& ImportSource::beginning() const {
  constexpr std::size_t kEnough = 1 << 20;
  if (!beginning_) {
    beginning_.emplace();
    if (!is_folder()) {
      *beginning_ = read_bytes(path_, kEnough);
      if (is_gzip(*beginning_)) beginning_ = gunzip(*beginning_, path_, kEnough).bytes;
    }
  }
  return *beginning_;
}

const std::string& ImportSource::bytes() const {
  if (!bytes_) {
    bytes_ = read_bytes(path_);
    if (is_gzip(*bytes_)) {
      Unpacked unpacked = gunzip(*bytes_, path_);
      bytes_ = std::move(unpacked.bytes);
      cut_ = unpacked.cut;
    }
  }
  return *bytes_;
}

}  // namespace blindcorner
