// SPDX-License-Identifier: Apache-2.0
/// The file readers that are fed with arbitrary bytes: whatever a file holds, a reader returns or
/// throws an Error.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace blindcorner::fuzzing {

struct Reader {
  const char* file;  ///< what the bytes are called: some readers look at the name
  std::function<void(const std::string& path)> read;
};

/// By name, which is also that of the folder of seeds in tests/fuzz/corpus.
const std::map<std::string, Reader, std::less<>>& readers();

/// A folder with what files refer to: the bundled scenes, a map's image. Removed in the end.
class Folder {
 public:
  explicit Folder(const Reader& reader);
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  /// Writes the reader's file into it; its path.
  std::string write(const Reader& reader, std::string_view bytes) const;

 private:
  std::filesystem::path path_;
};

}  // namespace blindcorner::fuzzing
