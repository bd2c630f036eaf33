// SPDX-License-Identifier: Apache-2.0
/// The exception type of the library, with a clear one-line message for the user.
#pragma once

#include <stdexcept>
#include <string>

namespace blindcorner {

/// Wrong input. `what()` is one line that names the place (file, field), what was found there and
/// what is accepted. A scene with several problems gives one such line for each.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;

  /// "where: problem".
  Error(const std::string& where, const std::string& problem)
      : std::runtime_error(where + ": " + problem) {}
};

/// The input is right, but the output could not be written.
class OutputError : public Error {
 public:
  using Error::Error;
};

}  // namespace blindcorner
