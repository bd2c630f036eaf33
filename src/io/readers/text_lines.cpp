// SPDX-License-Identifier: Apache-2.0
#include "io/readers/text_lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace blindcorner {
namespace {

std::string_view trimmed(std::string_view text, std::string_view what = " \t\r") {
  text.remove_prefix(std::min(text.find_first_not_of(what), text.size()));
  text.remove_suffix(text.size() - (text.find_last_not_of(what) + 1));
  return text;
}

}  // namespace

std::string line_place(const std::string& path, long line) {
  return path + ": line " + std::to_string(line);
}

std::vector<TextLine> lines_of(std::string_view text) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  std::vector<TextLine> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line = text.substr(begin, end - begin);
    line.remove_suffix(line.size() - (line.find_last_not_of(" \r") + 1));
    lines.push_back({static_cast<int>(lines.size()) + 1, line, end < text.size()});
    begin = end + 1;
  }
  return lines;
}

char separator_of(std::string_view line) {
  for (const char separator : {';', '\t', ','}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  return ' ';
}

std::vector<std::string_view> fields_of(std::string_view line, char separator) {
  line = trimmed(line, separator == '\t' ? " \r" : " \t\r");
  std::vector<std::string_view> fields;
  for (std::size_t begin = 0; begin < line.size();) {
    const std::size_t end =
        std::min(separator == ' ' ? line.find_first_of(" \t", begin) : line.find(separator, begin),
                 line.size());
    const std::string_view field = trimmed(line.substr(begin, end - begin));
    if (separator != ' ' || !field.empty()) fields.push_back(trimmed(field, "\""));
    begin = end + 1;
  }
  return fields;
}

std::optional<double> number_of(std::string_view field, bool decimal_comma) {
  std::string copy;
  if (decimal_comma && std::ranges::count(field, ',') == 1) {
    copy = field;
    copy[copy.find(',')] = '.';
    field = copy;
  }
  if (field.starts_with('+')) field.remove_prefix(1);
  double value = 0.0;
  const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || stop != field.data() + field.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<long> whole_number_of(std::string_view field) {
  long value = 0;
  const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || stop != field.data() + field.size()) return std::nullopt;
  return value;
}

}  // namespace blindcorner
