// SPDX-License-Identifier: Apache-2.0
#include "io/file_kind.h"

#include <array>
#include <optional>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "io/json_reader.h"

namespace blindcorner {
namespace {

using Json = JsonReader::Json;

struct KnownKind {
  FileKind kind;
  const char* name;
  const char* use;  ///< a command that takes it; @: the file
};
constexpr std::array kKinds = {
    KnownKind{FileKind::scene, "a scene file", "blindcorner info @"},
    KnownKind{FileKind::drive, "a drive file", "blindcorner drive @ -o DIR"},
    KnownKind{FileKind::capture, "a capture file", "blindcorner fit SCENE @ -o DIR"},
    KnownKind{FileKind::result, "a result of fit", "blindcorner evaluate @"},
    KnownKind{FileKind::instrument, "an instrument file",
              "blindcorner fit SCENE CAPTURE --instrument @ -o DIR"},
};

const KnownKind& known_kind(FileKind kind) { return kKinds.at(static_cast<std::size_t>(kind)); }

void require_kind(FileKind wanted, std::optional<FileKind> found, const std::string& path) {
  if (!found || *found == wanted) return;
  std::string use = known_kind(*found).use;
  use.replace(use.find('@'), 1, path);
  throw Error(path, std::string("is ") + known_kind(*found).name +
                        ", accepted: " + known_kind(wanted).name + "; it is for `" + use + "`");
}

}  // namespace

std::optional<FileKind> kind_of(const Json& document) {
  if (!document.is_object()) return std::nullopt;
  if (document.contains("format")) {
    if (document["format"] == "blindcorner.result/1") return FileKind::result;
    if (document["format"] == "blindcorner.instrument/1") return FileKind::instrument;
    return std::nullopt;
  }
  if (document.contains("scene") && document.contains("vehicle")) return FileKind::drive;
  if (document.contains("surfaces") && document.contains("hidden")) return FileKind::scene;
  return std::nullopt;
}

Json parse_file_kind(FileKind wanted, const std::string& bytes, const std::string& path) {
  constexpr std::string_view kOpenExr = "\x76\x2f\x31\x01";
  if (bytes.starts_with(kOpenExr)) require_kind(wanted, FileKind::capture, path);
  Json document = JsonReader::parse(bytes, path);
  require_kind(wanted, kind_of(document), path);
  return document;
}

void check_file_kind(FileKind wanted, const std::string& bytes, const std::string& path) {
  Json document;
  try {
    document = JsonReader::parse(bytes, path);
  } catch (const Error&) {
    return;
  }
  require_kind(wanted, kind_of(document), path);
}

}  // namespace blindcorner
