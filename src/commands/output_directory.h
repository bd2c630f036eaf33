// SPDX-License-Identifier: Apache-2.0
/// Directories that commands write to.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace blindcorner {

/// Makes a directory, and those above it, unless it is there. Throws Error naming it.
void make_directory(const std::string& path);

/// Updates the index page of the directory that the given command wrote to. For a command that
/// wrote a single file, this happens only if the file's directory has an index page already.
void index_output(const CLI::App& program);

}  // namespace blindcorner
