// SPDX-License-Identifier: Apache-2.0
/// What to say to somebody who mistyped a subcommand.
#pragma once

#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace blindcorner {

/// One line about the first word where a subcommand is expected that is none, with the one that it
/// resembles; empty where there is no such word.
std::optional<std::string> unknown_command(const CLI::App& app, int argc, const char* const* argv);

}  // namespace blindcorner
