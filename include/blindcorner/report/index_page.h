// SPDX-License-Identifier: Apache-2.0
/// `index.html`: the contents of a directory of results; a line explains each file.
#pragma once

#include <string>

namespace blindcorner {

/// Whether a file is a page of this program: an .html file whose head says so.
bool is_own_page(const std::string& path);

/// Writes a new `directory`/index.html. It links the directory's pages with their headlines, the
/// pages of the directories below (two levels), pictures, results, tables and captures. Does
/// nothing if there is neither a page to link nor an index yet. Leaves an index.html alone if
/// is_own_page denies it. Throws Error.
void write_index(const std::string& directory);

/// The same, but only if such an index already exists.
void refresh_index(const std::string& directory);

}  // namespace blindcorner
