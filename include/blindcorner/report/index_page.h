// SPDX-License-Identifier: Apache-2.0
/// `index.html`: what a directory of results holds, each file with a line that says what it is.
#pragma once

#include <string>

namespace blindcorner {

/// Whether a file is a page of this program, by what its head says.
bool is_own_page(const std::string& path);

/// Writes `directory`/index.html anew: it links the directory's pages with their headlines, those
/// of the directories below it, pictures, results, tables and captures. Does nothing where there is
/// no page to link, and leaves an index.html alone that is_own_page denies. Throws Error.
void write_index(const std::string& directory);

/// The same, but only where there is such an index already.
void refresh_index(const std::string& directory);

}  // namespace blindcorner
