// SPDX-License-Identifier: Apache-2.0
/// A study: how the Cramer-Rao bound falls with the exposures. docs/adding.md shows it;
/// adding_test.cpp runs it.
#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>

#include "adding/examples.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "report/chart.h"
#include "report/html.h"
#include "report/table.h"

namespace blindcorner {
namespace {

// [study]
struct BoundArguments {
  std::string scene;
  std::string output = "out/benchmark";
  std::vector<double> exposures{1, 10, 100};
};

/// Bound on the position's error at the middle of the search region, m.
double position_bound(const Scene& scene, double exposures) {
  const ErrorBound bound(scene, sensor_placement(scene), {.exposures = exposures});
  return std::sqrt(position_trace(scene, bound.cramer_rao(middle_of_prior(scene))));
}

void run(const BoundArguments& arguments) {
  const Scene scene = read_scene(arguments.scene);
  ChartSeries series{"Cramer-Rao bound"};
  std::vector<TableRow> rows;
  for (const double exposures : arguments.exposures) {
    const double bound = position_bound(scene, exposures);
    series.points.push_back({exposures, bound});
    rows.push_back({{{"exposures", "exposures", "%9g", exposures},
                     {"position_m", "position, mm", "%12.3g", bound, 1e3}}});
  }
  const Chart chart{"Error of the position", "exposures", "m", {series}, {}, true};
  std::filesystem::create_directories(arguments.output);
  write_atomically(arguments.output + "/bound.csv", table_csv(rows));
  write_atomically(arguments.output + "/bound.html",
                   plain_page("Bound by exposures", "", table_html(rows) + chart_svg(chart)));
}

void add_bound_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand("bound", "the bound by exposures");
  const auto arguments = std::make_shared<BoundArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command.add_option("-o,--output", arguments->output, "directory to write to");
  command.callback([arguments, &exit_code] {
    run(*arguments);
    exit_code = 0;
  });
}
// [/study]

}  // namespace

void example_study(CLI::App& benchmark, int& exit_code) {
  add_bound_benchmark(benchmark, exit_code);
}

}  // namespace blindcorner
