// SPDX-License-Identifier: Apache-2.0
/// The one exception type of the library: a single clear line for whoever caused it.
#pragma once

#include <stdexcept>
#include <string>

namespace blindcorner {

/// Wrong input. `what()` is one line that names the place (file, field), what was found there and
/// what is accepted; for a scene with several problems, one such line for each.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;

  /// "where: problem".
  Error(const std::string& where, const std::string& problem)
      : std::runtime_error(where + ": " + problem) {}
};

/// Nothing wrong with the input: what came of it could not be written.
class OutputError : public Error {
 public:
  using Error::Error;
};

}  // namespace blindcorner
