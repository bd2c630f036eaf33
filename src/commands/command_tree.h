// SPDX-License-Identifier: Apache-2.0
/// Completion scripts for shells and the manual page, made from the commands' own declarations.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace blindcorner {

/// Lets --help show the default of every option whose description does not tell it.
void show_defaults(CLI::App& app);

/// Script that completes commands, options and files in "bash", "zsh" or "fish".
std::string completion_script(const CLI::App& app, const std::string& shell);

/// The manual page blindcorner(1).
std::string manual_page(const CLI::App& app, const std::string& version);

/// `completion SHELL` and `man`, which print them.
void add_command_tree_commands(CLI::App& app, const std::string& version);

}  // namespace blindcorner
