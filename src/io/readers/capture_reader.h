// SPDX-License-Identifier: Apache-2.0
/// The interface of readers of other programs' captures. Each reader is one file of this folder and
/// one line in readers.cpp.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "blindcorner/io/import_file.h"
#include "io/readers/line_reader.h"

namespace blindcorner {

/// A file or folder that `import` was given. Its content is read when it is first asked for, and
/// unpacked if it is gzipped.
class ImportSource {
 public:
  explicit ImportSource(std::string path) : path_(std::move(path)) {}

  const std::string& path() const { return path_; }
  /// Ending of the file's name: ".json". For a file "name.json.gz" it is also ".json".
  std::string ending() const;
  bool is_folder() const;
  /// At most the first MiB, for recognising the file; empty for a folder. Throws Error as
  /// `read_bytes` does.
  const std::string& beginning() const;
  /// Whole content. Throws Error. A cut gzip file gives the content that is there, and sets `cut`.
  const std::string& bytes() const;
  bool cut() const { return cut_; }

 private:
  std::string path_;
  mutable std::optional<std::string> beginning_;
  mutable std::optional<std::string> bytes_;
  mutable bool cut_ = false;
};

/// Lines for the user: what was left out or assumed, with the file and, where it applies, the line.
using ImportNotes = std::vector<std::string>;

/// One format.
struct CaptureReader {
  std::string_view name;        ///< as `--format` takes it
  std::string_view recognises;  ///< what its files are: ".npy or .npz"
  std::string_view assumes;     ///< what such a file does not say and the reader takes for granted
  /// Options that the reader heeds beside those that count for all formats. Others are refused:
  /// an option without an effect is more likely a mistake than meant.
  std::vector<std::string_view> options;
  /// Whether a file is of this format, judged by its content. Cheap: looks at the beginning.
  bool (*recognise)(const ImportSource&);
  /// Captures of a file. Throws Error (one line: file, place, what was found, what is accepted).
  CaptureFile (*read)(const ImportSource&, const ImportOptions&, ImportNotes&);
  /// Files of a folder in their order, for formats that are folders.
  std::vector<std::string> (*files)(const ImportSource&) = nullptr;
  /// For formats that come in lines: whether a line of a stream is of this format, and what reads
  /// its lines.
  bool (*recognise_line)(std::string_view line) = nullptr;
  std::unique_ptr<LineReader> (*lines)(const LineOptions&) = nullptr;
  /// One capture as the sensor prints it. Throws Error naming `where` if the sensor cannot make it.
  std::string (*print)(const Capture& capture, const std::string& where) = nullptr;
};

/// All readers, in the order in which they are asked whether they recognise a file.
const std::vector<CaptureReader>& capture_readers();

}  // namespace blindcorner
