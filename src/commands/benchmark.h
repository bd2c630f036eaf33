// SPDX-License-Identifier: Apache-2.0
/// The family `blindcorner benchmark ...`.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace blindcorner {

void add_solver_benchmark(CLI::App& benchmark, int& exit_code);
void add_forward_benchmark(CLI::App& benchmark, int& exit_code);
void add_derivatives_benchmark(CLI::App& benchmark, int& exit_code);

/// The scene files asked for; without any, those of the folder `scenes` here, sorted. Throws Error
/// when there is none.
std::vector<std::string> benchmark_scenes(const std::vector<std::string>& asked);

}  // namespace blindcorner
