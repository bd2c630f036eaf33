// SPDX-License-Identifier: Apache-2.0
#include "io/readers/text_table.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_lines.h"

namespace blindcorner {
namespace {

constexpr std::array<std::string_view, 6> kIndices = {"capture", "zone", "row",
                                                      "column",  "bin",  "count"};
constexpr std::size_t kMostFields = 1 << 16;

/// What each column of a line is.
struct Pattern {
  /// A column: its place in kIndices, or kSkip, or kWord and the word that stands there.
  struct Column {
    int index = kSkip;
    std::string word;
  };
  static constexpr int kSkip = -1;
  static constexpr int kWord = -2;
  std::vector<Column> columns;
  bool counts = false;  ///< all columns that follow are bins

  bool has(std::string_view name) const {
    return std::ranges::any_of(columns, [&](const Column& column) {
      return column.index >= 0 && kIndices[static_cast<std::size_t>(column.index)] == name;
    });
  }
};

[[noreturn]] void fail(const std::string& pattern, const std::string& problem) {
  throw Error("pattern", "found \"" + pattern + "\": " + problem +
                             "; accepted a list of capture, zone, row, column, bin, count, skip, "
                             "'words' and, at its end, counts");
}

Pattern parse_pattern(const std::string& text) {
  Pattern pattern;
  for (const std::string_view name : fields_of(text, ',')) {
    if (pattern.counts) fail(text, "counts is not the last");
    const auto known = std::ranges::find(kIndices, name);
    if (known != kIndices.end()) {
      if (pattern.has(name)) fail(text, std::string(name) + " comes twice");
      pattern.columns.push_back({static_cast<int>(known - kIndices.begin()), {}});
    } else if (name == "skip") {
      pattern.columns.push_back({});
    } else if (name == "counts") {
      pattern.counts = true;
    } else if (name.size() > 2 && name.front() == '\'' && name.back() == '\'') {
      pattern.columns.push_back({Pattern::kWord, std::string(name.substr(1, name.size() - 2))});
    } else {
      fail(text, "'" + std::string(name) + "' is no column");
    }
  }
  if (pattern.counts == pattern.has("count")) fail(text, "either count or counts is needed");
  if (pattern.counts && pattern.has("bin")) fail(text, "counts are all bins, bin goes with count");
  if (pattern.has("row") != pattern.has("column")) fail(text, "row and column go together");
  if (pattern.has("zone") && pattern.has("row")) fail(text, "zone stands for row and column");
  return pattern;
}

/// The numbers of one line.
struct Entry {
  int line = 0;
  std::array<std::optional<long>, kIndices.size()> index;
  std::vector<double> counts;

  std::optional<long> at(std::string_view name) const {
    return index[static_cast<std::size_t>(std::ranges::find(kIndices, name) - kIndices.begin())];
  }
};

/// What became of a line.
enum class Match { good, other, damaged };

Match match(const TextLine& line, const Pattern& pattern, Entry& entry) {
  const char separator = separator_of(line.text);
  const std::vector<std::string_view> fields = fields_of(line.text, separator);
  const auto number = [&](std::string_view field) { return number_of(field, separator != ','); };
  entry.line = line.number;
  for (std::size_t i = 0; i < pattern.columns.size(); ++i) {
    const Pattern::Column& column = pattern.columns[i];
    if (column.index == Pattern::kWord && (i >= fields.size() || fields[i] != column.word)) {
      return Match::other;
    }
  }
  // A line without any number where numbers are meant is a heading or talk.
  bool any = false;
  bool all = fields.size() >= pattern.columns.size() + (pattern.counts ? 1 : 0) &&
             fields.size() <= kMostFields;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const int index = i < pattern.columns.size() ? pattern.columns[i].index : Pattern::kSkip;
    const bool bin = i >= pattern.columns.size() && pattern.counts;
    if (index < 0 && !bin) continue;
    const std::optional<double> value = number(fields[i]);
    any |= value.has_value();
    all &= value.has_value();
    if (!value) continue;
    if (bin || kIndices[static_cast<std::size_t>(index)] == "count") {
      entry.counts.push_back(*value);
    } else if (*value >= 0 && *value < 1e9) {
      entry.index[static_cast<std::size_t>(index)] = static_cast<long>(*value);
    } else {
      all = false;
    }
  }
  if (all) return Match::good;
  return any ? Match::damaged : Match::other;
}

/// Puts entries together into captures.
class Table {
 public:
  Table(const std::string& path, ImportNotes& notes) : path_(path), notes_(notes) {}

  std::vector<Entry> entries;

  std::vector<Capture> captures(const Pattern& pattern, const ImportOptions& options) {
    find_first_numbers(pattern);
    const auto [rows, columns] = layout(pattern, options);
    const auto zones = static_cast<long>(rows) * columns;
    const long bins = pattern.counts ? usual_counts() : 1 + largest("bin");
    check_size(zones, bins);
    const bool bins_follow =
        entries.size() < 2 || !pattern.has("bin") || entries[0].at("bin") != entries[1].at("bin");
    std::vector<Capture> captures;
    std::vector<char> filled;
    std::optional<long> capture_number;
    long last_order = std::numeric_limits<long>::max();
    long next_zone = 0;
    int first_line = 0;
    const auto finish = [&] {
      if (captures.empty()) return;
      const auto missing = std::ranges::count(filled, 0);
      if (missing == 0) return;
      notes_.push_back(line_place(path_, first_line) + ": the capture that begins here lacks " +
                       std::to_string(missing) + " of " + std::to_string(filled.size()) +
                       " bins; left out");
      captures.pop_back();
    };
    for (const Entry& entry : entries) {
      if (pattern.counts && std::ssize(entry.counts) != bins) {
        notes_.push_back(line_place(path_, entry.line) + ": has " +
                         std::to_string(entry.counts.size()) + " bins, most lines have " +
                         std::to_string(bins) + "; the line is left out");
        continue;
      }
      const bool placed = pattern.has("zone") || pattern.has("row");
      const long zone = pattern.has("row")
                            ? number(entry, "row") * columns + number(entry, "column")
                        : pattern.has("zone") ? number(entry, "zone")
                        : pattern.counts      ? (next_zone >= zones ? 0 : next_zone)
                                              : 0;
      const long bin = pattern.has("bin") ? number(entry, "bin") : 0;
      const long place = zone * bins + bin;
      const long order = bins_follow ? place : bin * zones + zone;
      const bool begins =
          captures.empty() ||
          (pattern.has("capture") ? entry.at("capture") != capture_number : order <= last_order);
      if (begins) {
        finish();
        captures.emplace_back();
        captures.back().counts = HistogramCube(rows, columns, static_cast<int>(bins));
        filled.assign(static_cast<std::size_t>(zones * bins), 0);
        first_line = entry.line;
        capture_number = entry.at("capture");
      }
      last_order = order;
      next_zone = placed ? 0 : zone + 1;
      for (std::size_t k = 0; k < entry.counts.size(); ++k) {
        const auto at = static_cast<std::size_t>(place) + k;
        captures.back().counts.values[at] = entry.counts[k];
        filled[at] = 1;
      }
    }
    finish();
    return captures;
  }

 private:
  long largest(std::string_view name) const {
    long most = 0;
    for (const Entry& entry : entries) most = std::max(most, number(entry, name));
    return most;
  }
  long number(const Entry& entry, std::string_view name) const {
    const auto place =
        static_cast<std::size_t>(std::ranges::find(kIndices, name) - kIndices.begin());
    return entry.index[place].value_or(0) - first_[place];
  }

  /// Zones and bins may count from 1.
  void find_first_numbers(const Pattern& pattern) {
    for (const std::string_view name : {"zone", "row", "column", "bin"}) {
      if (!pattern.has(name)) continue;
      const auto smallest = std::ranges::min_element(
          entries, {}, [&](const Entry& entry) { return entry.at(name).value_or(0); });
      if (smallest->at(name) != 1) continue;
      first_[static_cast<std::size_t>(std::ranges::find(kIndices, name) - kIndices.begin())] = 1;
      notes_.push_back(path_ + ": column " + std::string(name) + " counts from 1");
    }
  }

  std::pair<int, int> layout(const Pattern& pattern, const ImportOptions& options) {
    if (pattern.has("row")) {
      const long rows = 1 + largest("row");
      const long columns = 1 + largest("column");
      check_size(rows * columns, 1);
      return {static_cast<int>(rows), static_cast<int>(columns)};
    }
    if (!pattern.has("zone")) {
      return {std::max(options.rows, 1), std::max(options.columns, 1)};
    }
    const long zones = 1 + largest("zone");
    check_size(zones, 1);
    return zone_layout(static_cast<std::size_t>(zones), options, path_, notes_);
  }

  void check_size(long zones, long bins) const {
    constexpr long kMostZones = 1 << 16;
    constexpr long kMostBins = 1 << 16;
    if (zones <= kMostZones && bins <= kMostBins) return;
    throw Error(path_, "names " + std::to_string(zones) + " zones of " + std::to_string(bins) +
                           " bins, accepted up to 65536 of either: are these columns what the "
                           "pattern says?");
  }

  long usual_counts() const {
    std::vector<std::size_t> sizes;
    for (const Entry& entry : entries) sizes.push_back(entry.counts.size());
    std::nth_element(sizes.begin(), sizes.begin() + std::ssize(sizes) / 2, sizes.end());
    return static_cast<long>(sizes[sizes.size() / 2]);
  }

  std::string path_;
  ImportNotes& notes_;
  std::array<long, kIndices.size()> first_{};
};

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  const std::string& path = source.path();
  if (options.pattern.empty()) {
    throw Error("pattern",
                "is missing: it says what the columns of " + path + " are, as 'zone,counts'");
  }
  const Pattern pattern = parse_pattern(options.pattern);
  Table table(path, notes);
  std::size_t others = 0;
  for (const TextLine& line : lines_of(source.bytes())) {
    if (line.text.empty()) continue;
    Entry entry;
    switch (match(line, pattern, entry)) {
      case Match::good:
        table.entries.push_back(std::move(entry));
        break;
      case Match::damaged:
        notes.push_back(line_place(path, line.number) +
                        ": does not have the columns of the pattern; the line is left out");
        break;
      case Match::other:
        ++others;
        break;
    }
  }
  if (table.entries.empty()) {
    throw Error(path, "no line has the columns of the pattern \"" + options.pattern + "\"");
  }
  if (others > 0) {
    notes.push_back(path + ": " + std::to_string(others) +
                    " lines without numbers where the pattern has them were passed over");
  }
  CaptureFile file;
  file.captures = table.captures(pattern, options);
  if (file.captures.empty()) throw Error(path, "holds no whole capture");
  return file;
}

}  // namespace

void check_pattern(const std::string& pattern) { parse_pattern(pattern); }

CaptureReader text_table_reader() {
  return {.name = "table",
          .recognises = "any text table, its columns stated by --pattern",
          .assumes = "another capture begins where zone and bin do not go on",
          .options = {"pattern", "rows"},
          .recognise = [](const ImportSource&) { return false; },
          .read = read};
}

}  // namespace blindcorner
