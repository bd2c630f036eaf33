// SPDX-License-Identifier: Apache-2.0
/// The subcommand `stability`.
#pragma once

namespace CLI {
class App;
}

namespace blindcorner {

void add_stability_command(CLI::App& app, int& exit_code);

}  // namespace blindcorner
