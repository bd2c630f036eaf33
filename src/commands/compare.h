// SPDX-License-Identifier: Apache-2.0
/// `blindcorner compare`.
#pragma once

namespace CLI {
class App;
}

namespace blindcorner {

void add_compare_command(CLI::App& app, int& exit_code);

}  // namespace blindcorner
