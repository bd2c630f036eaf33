// SPDX-License-Identifier: Apache-2.0
/// `live` and `replay`.
#pragma once

namespace CLI {
class App;
}

namespace blindcorner {

void add_live_command(CLI::App& app, int& exit_code);
void add_replay_command(CLI::App& app, int& exit_code);

}  // namespace blindcorner
