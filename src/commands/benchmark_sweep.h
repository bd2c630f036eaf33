// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark solver --sweep`.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/simulation/solver_sweep.h"
#include "commands/printout.h"

namespace CLI {
class App;
}

namespace blindcorner {

struct SweepArguments {
  bool wanted = false;
  std::vector<std::string> networks;  ///< weights
  std::vector<std::string> settings;  ///< names of those wanted; empty: all
  std::string light = "reference";
  std::string data;  ///< directory of traced light
  SweepOptions options;
};

/// Options that go with --sweep.
void add_sweep_options(CLI::App& command, SweepArguments& arguments);

/// Runs the sweep over scene files and writes it to the directory. Returns the exit code; throws
/// Error.
int run_sweep(const SweepArguments& arguments, std::vector<std::string> scenes,
              const std::string& output, const Printout& out);

}  // namespace blindcorner
