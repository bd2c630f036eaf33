// SPDX-License-Identifier: Apache-2.0
#include "io/obj_check.h"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <sstream>
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

void check_vertex(std::istringstream& words, const Place& place) {
  for (int axis = 0; axis < 3; ++axis) {
    std::string word;
    words >> word;
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != '\0' || !std::isfinite(value)) {
      place.refuse(word, "three finite coordinates");
    }
  }
}

/// The vertex's part of "7", "7/1" or "7//3"; counted from the end where negative.
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

void check_obj(const std::string& text, const std::string& path) {
  struct Use {
    long index, line;
  };
  std::vector<Use> uses;
  long vertices = 0;
  std::istringstream lines(text);
  std::string line;
  for (long number = 1; std::getline(lines, line); ++number) {
    const Place place{path, number};
    std::istringstream words(line.substr(0, line.find('#')));
    std::string kind;
    words >> kind;
    if (kind == "v") {
      check_vertex(words, place);
      ++vertices;
    } else if (kind == "f") {
      for (std::string word; words >> word;) {
        const long index = vertex_index(word, place);
        if (index < 0 && -index > vertices) place.refuse(word, "a vertex that stands before");
        if (index > 0) uses.push_back({index, number});
      }
    }
  }
  for (const Use& use : uses) {
    if (use.index <= vertices) continue;
    Place{path, use.line}.refuse(std::to_string(use.index), "the number of a vertex in the file");
  }
}

}  // namespace blindcorner
