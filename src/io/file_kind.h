// SPDX-License-Identifier: Apache-2.0
/// What kind of file somebody named, where a command wants another kind.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace blindcorner {

/// Kinds that commands ask for.
enum class FileKind { scene, drive, capture, result, instrument };

/// The kind that a document plainly is; none: of no kind that is known.
std::optional<FileKind> kind_of(const nlohmann::ordered_json& document);
/// Parses a JSON file of a kind. Throws Error: of what is no JSON, and of what is plainly a file of
/// another kind one line that says which, and which command takes it. A document of no kind that is
/// known passes.
nlohmann::ordered_json parse_file_kind(FileKind wanted, const std::string& bytes,
                                       const std::string& path);
/// Throws that Error where the bytes are JSON of a kind; for files that are not to be JSON.
void check_file_kind(FileKind wanted, const std::string& bytes, const std::string& path);

}  // namespace blindcorner
