// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace CLI {
class App;
}

namespace blindcorner {

/// `blindcorner init`: a scene file to begin with.
void add_init_command(CLI::App& app, int& exit_code);

}  // namespace blindcorner
