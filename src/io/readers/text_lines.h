// SPDX-License-Identifier: Apache-2.0
/// Lines, fields and numbers of the texts that sensors and terminal programs write.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace blindcorner {

/// One line of a text, without its end ("\n" or "\r\n"), blanks there, or a byte order mark.
struct TextLine {
  int number = 0;  ///< from 1
  std::string_view text;
  bool ended = true;  ///< false: the text ends within it, so that it may be cut
};

/// Where a line stands, for messages: "log.txt: line 3".
std::string line_place(const std::string& path, long line);

/// All lines of a text, which must outlive them.
std::vector<TextLine> lines_of(std::string_view text);

/// What parts the fields of a line: ';' where there is one, else a tab, else ',', else blanks.
char separator_of(std::string_view line);

/// Fields of a line, without blanks and quotation marks about them. Several blanks in a row part
/// once; a separator at the end begins no further field.
std::vector<std::string_view> fields_of(std::string_view line, char separator);

/// The number that a field holds and nothing else, finite. With `decimal_comma`, "0,5" is a half.
std::optional<double> number_of(std::string_view field, bool decimal_comma = false);

/// The whole number that a field holds and nothing else.
std::optional<long> whole_number_of(std::string_view field);

}  // namespace blindcorner
