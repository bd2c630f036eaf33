// SPDX-License-Identifier: Apache-2.0
#include "live/recording.h"

#include <algorithm>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_file.h"
#include "io/readers/capture_reader.h"
#include "live/frames.h"

namespace blindcorner::live {
namespace {

constexpr std::string_view kOpenExr = "\x76\x2f\x31\x01";

/// The format in which a sensor of that name prints.
std::string format_of(const std::string& sensor) {
  for (const char* name : {"tmf8829", "tmf8828", "vl53l8ch"}) {
    if (sensor.find(name) != std::string::npos) return name;
  }
  return sensor.find("tmf882") != std::string::npos ? "tmf8828" : "json_lines";
}

const CaptureReader& printer(const std::string& name) {
  std::string names = "auto";
  for (const CaptureReader& reader : capture_readers()) {
    if (reader.print == nullptr) continue;
    if (reader.name == name) return reader;
    names += ", " + std::string(reader.name);
  }
  throw Error("format", "found '" + name + "', accepted for captures: " + names);
}

class CaptureRecording : public Recording {
 public:
  CaptureRecording(const std::string& path, const std::string& format)
      : path_(path), file_(read_captures(path)) {
    printer_ = &printer(format == "auto" ? format_of(file_.sensor) : format);
  }
  std::size_t frames() const override { return file_.captures.size(); }
  std::string text(std::size_t i) const override {
    return printer_->print(file_.captures.at(i), path_ + ": capture " + std::to_string(i));
  }

 private:
  std::string path_;
  CaptureFile file_;
  const CaptureReader* printer_ = nullptr;
};

class LogRecording : public Recording {
 public:
  LogRecording(const ImportSource& source, const std::string& format, ImportOptions options) {
    if (format != "auto") options.format = format;
    // The whole log tells zones and bins, which a stream's reader has to know beforehand.
    const CaptureFile whole = import_captures({source.path()}, options);
    const HistogramCube& cube = whole.captures.front().counts;
    LineOptions lines{cube.rows,           cube.columns,  cube.bins,
                      options.i2c_address, options.array, source.path()};
    std::unique_ptr<LineReader> reader;
    if (format != "auto") reader = stream_reader(format).lines(lines);
    std::string piece;
    for (const TextLine& line : lines_of(source.bytes())) {
      piece.append(line.text) += '\n';
      if (!reader) {
        const CaptureReader* const found = recognise_stream(line.text);
        if (found == nullptr) continue;
        reader = found->lines(lines);
      }
      LineYield yield;
      reader->add(line, yield);
      if (!yield.captures.empty()) pieces_.push_back(std::exchange(piece, {}));
    }
    if (pieces_.empty())
      throw Error(source.path(), "holds no frame in a format that comes in lines");
  }
  std::size_t frames() const override { return pieces_.size(); }
  std::string text(std::size_t i) const override { return pieces_.at(i); }

 private:
  std::vector<std::string> pieces_;
};

}  // namespace

std::unique_ptr<Recording> open_recording(const std::string& path, const std::string& format,
                                          const ImportOptions& options) {
  const ImportSource source(path);
  if (source.is_folder()) throw Error(path, "is a folder, accepted: a capture file or a log");
  if (source.beginning().starts_with(kOpenExr)) {
    return std::make_unique<CaptureRecording>(path, format);
  }
  return std::make_unique<LogRecording>(source, format, options);
}

}  // namespace blindcorner::live
