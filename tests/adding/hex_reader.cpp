// SPDX-License-Identifier: Apache-2.0
/// A reader of captures: lines `H<zone>:` with a bin in each four hexadecimal digits.
/// docs/adding.md shows it; adding_test.cpp imports a log.
#include <charconv>

#include "adding/examples.h"
#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/text_lines.h"

namespace blindcorner {
namespace {

// [reader]
constexpr std::size_t kDigits = 4;

bool recognise(const ImportSource& source) { return source.beginning().starts_with("H0:"); }

/// The bins of a line. Throws Error naming `where` for one that is cut or damaged.
std::vector<double> read_bins(std::string_view text, const std::string& where) {
  text.remove_prefix(std::min(text.find(':') + 1, text.size()));
  std::vector<double> bins;
  for (; !text.empty(); text.remove_prefix(kDigits)) {
    unsigned count = 0;
    const char* end = text.data() + std::min(kDigits, text.size());
    const auto [stop, error] = std::from_chars(text.data(), end, count, 16);
    if (error != std::errc() || stop != end || text.size() < kDigits) {
      throw Error(where, "found \"" + std::string(text.substr(0, kDigits)) +
                             "\", accepted: four hexadecimal digits a bin");
    }
    bins.push_back(count);
  }
  return bins;
}

/// One capture, a zone a line.
CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  NpyArray counts;
  std::size_t zones = 0;
  for (const TextLine& line : lines_of(source.bytes())) {
    if (!line.text.starts_with('H')) continue;  // what a terminal program wrote between them
    const std::string where = line_place(source.path(), line.number);
    const std::vector<double> bins = read_bins(line.text, where);
    if (zones > 0 && bins.size() * zones != counts.values.size()) {
      throw Error(where,
                  "found " + std::to_string(bins.size()) + " bins, accepted: as many as before");
    }
    counts.values.insert(counts.values.end(), bins.begin(), bins.end());
    ++zones;
  }
  if (zones == 0) throw Error(source.path(), "found no line, accepted: H<zone>:<bins>");
  counts.shape = {zones, counts.values.size() / zones};
  ImportOptions axes = options;
  axes.axes = "zone,bin";
  CaptureFile file;
  file.captures = arrange(counts, axes, source.path(), notes);
  file.bin_width = 250e-12;  // s, of this sensor's data sheet
  file.sensor = "hex";
  return file;
}
// [/reader]

}  // namespace

CaptureReader hex_reader() {
  return {.name = "hex",
          .recognises = "text of lines H<zone>:<four hexadecimal digits a bin>",
          .assumes = "bins of 250 ps, a capture a file",
          .options = {"rows"},
          .recognise = recognise,
          .read = read};
}

}  // namespace blindcorner
