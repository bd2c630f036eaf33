// SPDX-License-Identifier: Apache-2.0
/// `blindcorner compare`, on simulated and on measured captures.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/simulation/comparison_conditions.h"
#include "blindcorner/simulation/measured_comparison.h"
#include "commands/printout.h"
#include "report/comparison_page.h"

namespace CLI {
class App;
}

namespace blindcorner {

struct CompareArguments {
  std::vector<std::string> scenes;
  std::vector<std::string> networks;  ///< weights
  std::string output;
  int threads = 0;
  Printout out;
  ComparisonOptions options;
  std::vector<PublishedFigure> published;

  std::string measured;  ///< captures; empty: they are simulated
  std::string samples;   ///< of the same places; may be empty
  MeasuredComparisonOptions of_measured;
  std::vector<std::string> trained{"published", "wide"};  ///< networks
  int epochs = 600, early_stopping = 60;                  ///< of their training
};

/// Says on the standard error stream what failed. Returns the number of failed captures.
int failures_of(const SceneComparison& comparison);

/// Writes page, table and JSON, and says where the page is.
void write_comparison(const CompareArguments& arguments, const ComparisonReport& report);

/// Options of `--measured`.
void add_measured_options(CLI::App& command, CompareArguments& arguments);
/// Compares on measured captures. Returns the exit code; throws Error.
int run_measured(const CompareArguments& arguments);

void add_compare_command(CLI::App& app, int& exit_code);

}  // namespace blindcorner
