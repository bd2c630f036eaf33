// SPDX-License-Identifier: Apache-2.0
/// Directories that commands write to.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace blindcorner {

/// Makes a directory, and those above it, unless it is there. Throws Error naming it.
void make_directory(const std::string& path);

/// Brings the index page up to date of the directory that the command which was given wrote to; one
/// file is listed where there is such a page already.
void index_output(const CLI::App& program);

}  // namespace blindcorner
