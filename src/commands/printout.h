// SPDX-License-Identifier: Apache-2.0
/// Standard output of a command: text for people or, with --json, one document for programs.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace blindcorner {

class Printout {
 public:
  /// Declares --json; `document` completes "print ... as JSON".
  void add_option(CLI::App& command, const std::string& document);
  bool json() const { return json_; }

  /// Prints like std::printf, at once. Prints nothing with --json.
  [[gnu::format(printf, 2, 3)]] void text(const char* pattern, ...) const;
  /// Prints the JSON document. Prints nothing without --json.
  void document(const std::string& json) const;
  /// Prints, as the document, a file that the command wrote: .json as it is, .csv as a list of its
  /// rows, each an object by the columns' names. Prints nothing without --json. Throws Error.
  void file(const std::string& path) const;

 private:
  bool json_ = false;
};

}  // namespace blindcorner
