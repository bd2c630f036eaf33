// SPDX-License-Identifier: Apache-2.0
/// Lines, fields and numbers of the texts that sensors and terminal programs write.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace blindcorner {

/// One line of a text, without its end ("\n" or "\r\n"), blanks at its end, or a byte order mark.
struct TextLine {
  int number = 0;  ///< from 1
  std::string_view text;
  bool ended = true;  ///< false: the text ends within it, so that it may be cut
};

/// Where a line stands, for messages: "log.txt: line 3".
std::string line_place(const std::string& path, long line);

/// All lines of a text, which must outlive them.
std::vector<TextLine> lines_of(std::string_view text);

/// What separates the fields of a line: ';' if there is one, else a tab, else ',', else blanks.
char separator_of(std::string_view line);

/// Fields of a line, without blanks and quotation marks around them. Several blanks in a row
/// separate once. A separator at the end begins no further field.
std::vector<std::string_view> fields_of(std::string_view line, char separator);

/// The finite number of a field that holds nothing else. With `decimal_comma`, "0,5" is a half.
std::optional<double> number_of(std::string_view field, bool decimal_comma = false);

/// The whole number of a field that holds nothing else.
std::optional<long> whole_number_of(std::string_view field);

}  // namespace blindcorner
