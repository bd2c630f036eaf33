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

  /// As std::printf, at once; nothing with --json.
  [[gnu::format(printf, 2, 3)]] void text(const char* pattern, ...) const;
  /// The JSON document; nothing without --json.
  void document(const std::string& json) const;
  /// A file that the command wrote, as the document: .json as it is, .csv as a list of its rows,
  /// each an object by the columns' names. Nothing without --json; throws Error.
  void file(const std::string& path) const;

 private:
  bool json_ = false;
};

}  // namespace blindcorner
