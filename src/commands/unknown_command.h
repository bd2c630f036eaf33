// SPDX-License-Identifier: Apache-2.0
/// What to say to somebody who mistyped a subcommand or an option.
#pragma once

#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace blindcorner {

/// One line about the first word that is no subcommand where one is expected, or no option of the
/// subcommand. It names the one that the word resembles. Empty: there is no such word.
std::optional<std::string> unknown_word(const CLI::App& app, int argc, const char* const* argv);

}  // namespace blindcorner
