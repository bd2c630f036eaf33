// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/movingai.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

/// Most cells along a side: the set's largest maps have 1550, and indices stay within 32 bits.
constexpr int kMaxCells = 32'768;
/// C++ streams write this many digits unless told otherwise, and leave out zeros at the end.
constexpr int kStreamDigits = 6;

/// Lines of a text one after the other, without their ends ("\n" or "\r\n").
class LineReader {
 public:
  explicit LineReader(const std::string& path) : path_(path), text_(read_bytes(path)) {}

  bool at_end() const { return next_ >= text_.size(); }
  /// The next line. Refuses the end of the file, naming what was expected.
  std::string_view next(const std::string& accepted) {
    ++number_;
    if (at_end()) fail("the end of the file", accepted);
    const std::size_t end = std::min(text_.find('\n', next_), text_.size());
    std::string_view line(text_.data() + next_, end - next_);
    next_ = end + 1;
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }
  /// Refuses the line that was read last.
  [[noreturn]] void fail(const std::string& found, const std::string& accepted) const {
    throw Error(path_,
                "line " + std::to_string(number_) + ": found " + found + ", accepted: " + accepted);
  }

 private:
  std::string path_, text_;
  std::size_t next_ = 0;
  int number_ = 0;
};

/// Text as messages show it: in quotation marks, a long text only by its beginning, and '?' for
/// characters that do not print.
std::string quoted(std::string_view text) {
  constexpr std::size_t kMax = 40;
  std::string shown = "\"" + std::string(text.substr(0, kMax));
  if (text.size() > kMax) shown += "...";
  std::ranges::replace_if(
      shown, [](char c) { return c < ' ' || c > '~'; }, '?');
  return shown + "\"";
}

template <typename Number>
bool parse(std::string_view text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

/// Reads a line like "height 1024".
int read_size(LineReader& lines, const std::string& word) {
  const std::string accepted = "\"" + word + " N\", N from 1 to " + std::to_string(kMaxCells);
  const std::string_view line = lines.next(accepted);
  int size = 0;
  if (!line.starts_with(word + " ") || !parse(line.substr(word.size() + 1), size) || size < 1 ||
      size > kMaxCells) {
    lines.fail(quoted(line), accepted);
  }
  return size;
}

void expect(LineReader& lines, const std::string& wanted) {
  const std::string_view line = lines.next("\"" + wanted + "\"");
  if (line != wanted) lines.fail(quoted(line), "\"" + wanted + "\"");
}

/// Refuses text other than empty lines after the last line of a map.
void expect_end(LineReader& lines, int rows) {
  while (!lines.at_end()) {
    const std::string_view line = lines.next("");
    if (!line.empty()) {
      lines.fail(quoted(line), "nothing after " + std::to_string(rows) + " rows");
    }
  }
}

Terrain terrain_of(char letter, int column, const LineReader& lines) {
  switch (letter) {
    case '.':
    case 'G':
    case 'S':
      return Terrain::ground;
    case 'W':
      return Terrain::water;
    case '@':
    case 'O':
    case 'T':
      return Terrain::blocked;
    default:
      lines.fail(quoted(std::string_view(&letter, 1)) + " in column " + std::to_string(column + 1),
                 "'.', 'G', 'S', 'W', '@', 'O', 'T'");
  }
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t begin = 0; begin < line.size();) {
    const std::size_t end = std::min(line.find_first_of("\t ", begin), line.size());
    if (end > begin) words.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

/// Half a unit of the last digit that counts, cells.
double rounding_of(std::string_view text, double value) {
  const auto digits =
      static_cast<int>(std::ranges::count_if(text, [](char c) { return c >= '0' && c <= '9'; }));
  const int before_point = value >= 1 ? static_cast<int>(std::floor(std::log10(value))) + 1 : 1;
  const std::size_t point = text.find('.');
  const int after_point =
      point == std::string_view::npos ? 0 : static_cast<int>(text.size() - point) - 1;
  const int last = digits > kStreamDigits ? after_point : kStreamDigits - before_point;
  return 0.5 * std::pow(10.0, -last);
}

/// A cell of the map from the file's column and row.
Cell read_cell(const LineReader& lines, std::string_view column, std::string_view row,
               const GridGeometry& geometry, const char* what) {
  int x = 0, y = 0;
  if (!parse(column, x) || !parse(row, y) || !geometry.contains({x, y})) {
    lines.fail(std::string(what) + " " + quoted(std::string(column) + ", " + std::string(row)),
               "column 0 to " + std::to_string(geometry.columns - 1) + ", row 0 to " +
                   std::to_string(geometry.rows - 1));
  }
  return {x, geometry.rows - 1 - y};
}

MovingAiProblem read_problem(const LineReader& lines, std::string_view line,
                             const GridGeometry& geometry) {
  const std::vector<std::string_view> words = words_of(line);
  if (words.size() != 9) {
    lines.fail(std::to_string(words.size()) + " words",
               "9: bucket, map, width, height, start x, start y, goal x, goal y, length");
  }
  MovingAiProblem problem;
  if (!parse(words[0], problem.bucket) || problem.bucket < 0) {
    lines.fail("bucket " + quoted(words[0]), "a whole number >= 0");
  }
  int width = 0, height = 0;
  if (!parse(words[2], width) || !parse(words[3], height) || width != geometry.columns ||
      height != geometry.rows) {
    lines.fail("a map of " + quoted(std::string(words[2]) + " x " + std::string(words[3])),
               "the map's size, " + std::to_string(geometry.columns) + " x " +
                   std::to_string(geometry.rows));
  }
  problem.start = read_cell(lines, words[4], words[5], geometry, "start");
  problem.goal = read_cell(lines, words[6], words[7], geometry, "goal");
  if (!parse(words[8], problem.length) || !(problem.length >= 0) ||
      !std::isfinite(problem.length)) {
    lines.fail("length " + quoted(words[8]), "a number of cells >= 0");
  }
  problem.rounding = rounding_of(words[8], problem.length);
  return problem;
}

}  // namespace

std::vector<double> MovingAiMap::occupancy(Terrain free) const {
  std::vector<double> occupancy(terrain.size());
  std::ranges::transform(terrain, occupancy.begin(),
                         [free](Terrain t) { return t == free ? 0 : 1; });
  return occupancy;
}

MovingAiMap read_movingai_map(const std::string& path) {
  LineReader lines(path);
  expect(lines, "type octile");
  MovingAiMap map;
  map.geometry = {.columns = 0, .rows = read_size(lines, "height"), .cell_size = 1};
  map.geometry.columns = read_size(lines, "width");
  expect(lines, "map");
  const std::string accepted = "a row of " + std::to_string(map.geometry.columns) + " cells";
  // Rows are added as they come, northmost first: a file's head may promise more than follows.
  for (int row = 0; row < map.geometry.rows; ++row) {
    const std::string_view line = lines.next(accepted);
    if (line.size() != static_cast<std::size_t>(map.geometry.columns)) {
      lines.fail(std::to_string(line.size()) + " cells", accepted);
    }
    for (int column = 0; column < map.geometry.columns; ++column) {
      map.terrain.push_back(terrain_of(line[static_cast<std::size_t>(column)], column, lines));
    }
  }
  const auto begin = map.terrain.begin();
  for (int south = 0, north = map.geometry.rows - 1; south < north; ++south, --north) {
    std::swap_ranges(begin + south * std::ptrdiff_t{map.geometry.columns},
                     begin + (south + 1) * std::ptrdiff_t{map.geometry.columns},
                     begin + north * std::ptrdiff_t{map.geometry.columns});
  }
  expect_end(lines, map.geometry.rows);
  return map;
}

std::vector<MovingAiProblem> read_movingai_scenario(const std::string& path,
                                                    const GridGeometry& geometry) {
  LineReader lines(path);
  const std::string accepted = "\"version 1\" or \"version 1.0\"";
  const std::string_view version = lines.next(accepted);
  if (version != "version 1" && version != "version 1.0") lines.fail(quoted(version), accepted);
  std::vector<MovingAiProblem> problems;
  while (!lines.at_end()) {
    const std::string_view line = lines.next("");
    if (!line.empty()) problems.push_back(read_problem(lines, line, geometry));
  }
  if (problems.empty()) throw Error(path, "found no problems, accepted: one or more");
  return problems;
}

}  // namespace blindcorner
