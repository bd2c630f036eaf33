// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark derivatives`: how good numeric derivatives of the fast model are, by
/// step.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/benchmark.h"
#include "commands/progress.h"
#include "inverse/search/derivative_study.h"
#include "inverse/search/difference_steps.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

struct DerivativeArguments : StudyArguments {
  DerivativeArguments() { poses = 3; }
  double tolerance = 0.1;  ///< that a fit begins with
};

/// One unknown of a scene.
struct Derivative {
  std::string scene, unknown;
  double lever = 1;  ///< m per unit of the unknown
  double step = 0;   ///< default step, in the unknown's unit
  std::vector<DerivativeErrors> poses;

  /// The largest error of all poses.
  template <typename ErrorOf>
  double worst(ErrorOf error) const {
    double most = 0;
    for (const DerivativeErrors& pose : poses) most = std::max(most, error(pose));
    return most;
  }
};

/// How far the farthest point of the object moves per unit of an unknown, m.
double lever_of(const Scene& scene, const Unknown& unknown) {
  if (unknown.component <= Component::z) return 1.0;
  const HiddenObject& object = hidden_object(scene, unknown.object);
  return object.placement.size * bounding_radius(object.shape, Anchor::center);
}

std::vector<Derivative> study(const DerivativeArguments& arguments, const Scene& scene,
                              const SensorPlacement& sensor) {
  const auto model = make_fast_model(scene, sensor, at_tolerance(arguments.tolerance));
  const PoseVector steps = difference_steps(scene, sensor);
  const std::vector<std::string> names = unknown_names(scene);
  std::mt19937_64 random(arguments.seed);
  std::vector<PoseVector> poses;
  for (int i = 0; i < arguments.poses; ++i) poses.push_back(draw_pose(scene, random));
  std::vector<Derivative> studies;
  Progress progress(scene.name + ": derivatives", names.size() * poses.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    Derivative s{scene.name, names[i], lever_of(scene, scene.unknowns[i]), steps[k], {}};
    for (const PoseVector& pose : poses) {
      // Movements of 1 micrometre to 10 cm, five steps a decade.
      std::vector<double> sizes;
      for (int n = 0; n <= 25; ++n) sizes.push_back(1e-6 * std::pow(10.0, n / 5.0) / s.lever);
      s.poses.push_back(derivative_errors(*model, pose, k, sizes, steps[k]));
      progress.advance();
    }
    studies.push_back(std::move(s));
  }
  progress.finish();
  return studies;
}

std::string csv(const std::vector<Derivative>& studies) {
  std::string text = "scene,unknown,pose,step,movement_m,relative_error\n";
  for (const Derivative& s : studies) {
    for (std::size_t p = 0; p < s.poses.size(); ++p) {
      const DerivativeErrors& pose = s.poses[p];
      for (std::size_t n = 0; n < pose.steps.size(); ++n) {
        text += formatted("%s,%s,%zu,%.5g,%.5g,%.5g\n", s.scene.c_str(), s.unknown.c_str(), p,
                          pose.steps[n], pose.steps[n] * s.lever, pose.errors[n]);
      }
    }
  }
  return text;
}

std::vector<Chart> charts(const std::vector<Derivative>& studies) {
  std::vector<Chart> list;
  for (const Derivative& s : studies) {
    Chart chart{s.scene + ": " + s.unknown, "step, as movement of the object, m",
                "relative error of the derivative"};
    chart.logarithmic = true;
    chart.width = 560;
    chart.height = 330;
    chart.rules = {{"default", s.step * s.lever, true}};
    for (std::size_t p = 0; p < s.poses.size(); ++p) {
      ChartSeries series{"pose " + std::to_string(p + 1), {}, SeriesStyle::marked_line};
      for (std::size_t n = 0; n < s.poses[p].steps.size(); ++n) {
        series.points.push_back({s.poses[p].steps[n] * s.lever, s.poses[p].errors[n]});
      }
      chart.series.push_back(std::move(series));
    }
    list.push_back(std::move(chart));
  }
  return list;
}

TableRow row_of(const Derivative& d) {
  return {
      {{"scene", "scene", "%-18s", d.scene},
       {"unknown", "unknown", "%-8s", d.unknown},
       {"", "default step, mm", "%16.3g", d.step * d.lever, 1e3},
       {"", "error there, %", "%14.2g", d.worst([](const auto& p) { return p.at_default; }), 100},
       {"", "least error, %", "%14.2g",
        d.worst([](const auto& p) { return std::ranges::min(p.errors); }), 100}}};
}

const Study<Derivative> kStudy{
    "derivatives",
    "Error of numeric derivatives by step",
    "Central differences of the fast model's histogram against a Richardson extrapolation from "
    "steps about the default one, relative L2. Steps of yaw and size are drawn as the movement of "
    "the object's farthest point.",
    row_of,
    charts,
    csv};

int run_derivatives(const DerivativeArguments& arguments) {
  StudyRun run(kStudy, arguments);
  for_each_scene(arguments, [&](const Scene& scene, const SensorPlacement& sensor) {
    for (Derivative& d : study(arguments, scene, sensor)) run.add(std::move(d));
  });
  run.end();
  return kAllWell;
}

}  // namespace

void add_derivatives_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command =
      *benchmark.add_subcommand("derivatives",
                                "error of numeric derivatives by step; writes derivatives.csv and "
                                "derivatives.html");
  const auto arguments = std::make_shared<DerivativeArguments>();
  add_study_options(command, *arguments, 100);
  command.add_option("--tolerance", arguments->tolerance, "of the fast model");
  command.callback([arguments, &exit_code] { exit_code = run_derivatives(*arguments); });
}

}  // namespace blindcorner
