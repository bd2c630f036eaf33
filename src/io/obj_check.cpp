// SPDX-License-Identifier: Apache-2.0
#include "io/obj_check.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>
#include <vector>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Longest word that is quoted, characters.
constexpr std::size_t kLongestQuote = 24;

struct Place {
  const std::string& path;
  long line;

  [[noreturn]] void refuse(const std::string& word, const char* accepted) const {
    const std::string quoted =
        word.size() > kLongestQuote ? word.substr(0, kLongestQuote) + "..." : word;
    throw Error(path + ": line " + std::to_string(line),
                "found '" + quoted + "', accepted: " + accepted);
  }
};

void check_vertex(const std::vector<std::string>& words, const Place& place) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string word = axis + 1 < words.size() ? words[axis + 1] : "";
    // from_chars takes no plus sign.
    const std::string_view digits = std::string_view(word).substr(word.starts_with('+') ? 1 : 0);
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value)) {
      place.refuse(word, "three finite coordinates");
    }
  }
}

/// The vertex in "7", "7/1" or "7//3". A negative index counts back from the last vertex.
long vertex_index(const std::string& word, const Place& place) {
  const std::string number = word.substr(0, word.find('/'));
  long index = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), index);
  if (error != std::errc() || end != number.data() + number.size() || index == 0) {
    place.refuse(word, "the number of a vertex, from 1 on or from -1 back");
  }
  return index;
}

}  // namespace

std::string checked_obj(std::string text, const std::string& path) {
  struct Use {
    long index, line;
  };
  std::vector<Use> uses;
  long vertices = 0;
  std::size_t triangles = 0;
  if (text.find('\n') == std::string::npos)
    std::ranges::replace(text, '\r', '\n');  // classic Mac OS
  std::string plain;
  std::istringstream lines(text);
  std::string line;
  for (long number = 1; std::getline(lines, line); ++number) {
    const Place place{path, number};
    std::istringstream words(line.substr(0, line.find('#')));
    std::vector<std::string> list;
    for (std::string word; words >> word;) list.push_back(std::move(word));
    for (const std::string& word : list) plain += word + ' ';
    plain += '\n';
    if (list.empty()) continue;
    if (list[0] == "v") {
      check_vertex(list, place);
      ++vertices;
    } else if (list[0] == "f") {
      // Triangles are counted here, before parsing: the parser's time goes with the square of a
      // face's corners.
      triangles += list.size() < 3 ? 0 : list.size() - 3;
      if (triangles > kMaxTriangles) {
        throw Error(path, "found more than " + std::to_string(kMaxTriangles) +
                              " triangles, accepted: at most that many (a simplified mesh)");
      }
      for (std::size_t i = 1; i < list.size(); ++i) {
        const long index = vertex_index(list[i], place);
        if (index < 0 && -index > vertices) place.refuse(list[i], "a vertex that stands before");
        if (index > 0) uses.push_back({index, number});
      }
    }
  }
  for (const Use& use : uses) {
    if (use.index <= vertices) continue;
    Place{path, use.line}.refuse(std::to_string(use.index), "the number of a vertex in the file");
  }
  return plain;
}

}  // namespace blindcorner
