// SPDX-License-Identifier: Apache-2.0
/// Recognises the kind of a file, for commands that want another kind.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace blindcorner {

/// Kinds that commands ask for.
enum class FileKind { scene, drive, capture, result, instrument };

/// The kind that a document plainly is; nothing: it is of no known kind.
std::optional<FileKind> kind_of(const nlohmann::ordered_json& document);
/// Parses a JSON file that should be of kind `wanted`. Throws Error for text that is not JSON. For
/// a file that is plainly of another kind, Error says in one line which kind it is, and which
/// command takes it. A document of no known kind passes.
nlohmann::ordered_json parse_file_kind(FileKind wanted, const std::string& bytes,
                                       const std::string& path);
/// Throws the same Error if the bytes are JSON of another kind. For files that should not be JSON.
void check_file_kind(FileKind wanted, const std::string& bytes, const std::string& path);

}  // namespace blindcorner
