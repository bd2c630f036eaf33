// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark solver`: the solver against an exhaustive search, on captures that the
/// reference renderer made.
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/benchmark.h"
#include "commands/benchmark_sweep.h"
#include "commands/interrupt.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "commands/synthetic_trials.h"
#include "forward/support/parallel.h"
#include "forward/support/quantile.h"
#include "report/table.h"

namespace blindcorner {
namespace {

/// 99 % quantile of chi-square with n degrees of freedom. It bounds the region of a mode.
constexpr double kRegion[] = {0, 6.635, 9.210, 11.345, 13.277, 15.086};

struct SolverArguments {
  std::vector<std::string> scenes;
  std::string output;
  CaptureDirectories directories;
  int captures = 200;
  double least_photons = 10;
  double most_photons = 1000;
  double amplitude_spread = 0.3;
  double truth = 1;  ///< sampling of the captures' renderer, in units of its default
  std::uint64_t seed = 1;
  Printout out;
  FitOptions fit;
  ExhaustiveOptions exhaustive;
  SweepArguments sweep;
};

/// The first fit of a new fitter is timed on this many captures.
constexpr std::size_t kFirstCaptures = 3;

/// What became of one synthetic capture.
struct Trial {
  double photons = 0;
  bool done = false;
  bool failed = false;
  std::string error;
  bool reached = false;
  double missed = 0;  ///< log posterior
  bool right = false;
  bool exhaustive_right = false;
  double error_m = 0;  ///< position error of the heaviest mode
  double time_ms = 0;
  double presence = 0;
  StageTimes stages;
};

/// Whether the truth lies in the mode's 99 % region.
bool holds(const Scene& scene, const PoseMode& mode, const PoseVector& truth) {
  const PoseVector d = pose_error(scene, mode.pose, truth);
  const double distance = d.dot(mode.covariance.ldlt().solve(d));
  return distance <= kRegion[d.size()];
}

bool finite(const FitResult& result) {
  if (!std::isfinite(result.posterior.presence_probability) ||
      !std::isfinite(result.false_alarm_probability.value_or(0))) {
    return false;
  }
  for (const PoseMode& mode : result.posterior.modes) {
    if (!mode.pose.allFinite() || !mode.covariance.allFinite() || !std::isfinite(mode.weight)) {
      return false;
    }
  }
  return !result.posterior.modes.empty();
}

Trial run_trial(const Scene& scene, const Capture& capture, const PoseVector& truth,
                const Fitter& fitter, const ExhaustiveSearch& exhaustive) {
  Trial trial;
  FitResult result;
  try {
    result = fitter.fit(capture);
    if (!finite(result)) throw Error("result", "found a value that is not finite");
  } catch (const std::exception& error) {
    trial.failed = true;
    trial.error = error.what();
    return trial;
  }
  trial.stages = result.time_ms;
  trial.time_ms = result.time_ms.total;
  trial.presence = result.posterior.presence_probability;
  const MissedOptimum missed = missed_optimum(exhaustive, capture, result, truth);
  trial.missed = missed.log_posterior;
  trial.reached = trial.missed <= kReached;
  trial.right = holds(scene, result.posterior.modes.front(), truth);
  trial.exhaustive_right = holds(scene, missed.bound.heaviest, truth);
  trial.error_m = position_error(scene, result.posterior.modes.front().pose, truth);
  return trial;
}

struct Study {
  std::vector<Trial> trials;
  std::vector<double> first_ms;
  std::size_t planned = 0;  ///< trials; an interruption leaves fewer
};

TableRow summary(const std::string& scene, const Study& study) {
  std::vector<double> errors, times;
  for (const Trial& t : study.trials) {
    if (t.failed) continue;
    errors.push_back(t.error_m);
    times.push_back(t.time_ms);
  }
  for (auto* none : {&errors, &times}) {
    if (none->empty()) none->push_back(std::nan(""));
  }
  const auto count = [&](bool Trial::*what) {
    return static_cast<double>(std::ranges::count(study.trials, true, what));
  };
  const auto all = static_cast<double>(study.trials.size());
  return {{{"", "scene", "%-18s", scene},
           {"", "captures", "%8d", study.trials.size()},
           {"", "failed", "%8.0f", count(&Trial::failed)},
           {"", "optimum %", "%8.1f", count(&Trial::reached) / all, 100},
           {"", "right %", "%7.1f", count(&Trial::right) / all, 100},
           {"", "(bound) %", "%7.1f", count(&Trial::exhaustive_right) / all, 100},
           {"", "median m", "%9.3f", quantile(errors, 0.5)},
           {"", "90 % m", "%9.3f", quantile(errors, 0.9)},
           {"", "first ms", "%9.1f", quantile(study.first_ms, 0.5)},
           {"", "median ms", "%9.1f", quantile(times, 0.5)},
           {"", "most ms", "%9.1f", quantile(times, 1)}}};
}

nlohmann::json to_json(const std::string& scene, const Study& study) {
  nlohmann::json list = nlohmann::json::array();
  for (const Trial& t : study.trials) {
    nlohmann::json item = {{"photons", t.photons}};
    if (t.failed) {
      item["error"] = t.error;
    } else {
      item.update({{"missed_log_posterior", t.missed},
                   {"right", t.right},
                   {"exhaustive_right", t.exhaustive_right},
                   {"position_error_m", t.error_m},
                   {"presence_probability", t.presence},
                   {"time_ms",
                    {{"score", t.stages.score},
                     {"refine", t.stages.refine},
                     {"uncertainty", t.stages.uncertainty},
                     {"detect", t.stages.detect},
                     {"total", t.time_ms}}}});
    }
    list.push_back(std::move(item));
  }
  return {{"scene", scene}, {"first_ms", study.first_ms}, {"trials", std::move(list)}};
}

std::vector<Capture> render_captures(const SolverArguments& arguments, const Scene& scene,
                                     const std::vector<PoseVector>& truths,
                                     const std::vector<LightBudget>& budgets) {
  const auto reference =
      make_reference_renderer(scene, sensor_placement(scene), reference_sampling(arguments.truth));
  std::vector<Capture> captures(truths.size());
  Progress rendering(scene.name + ": rendering", truths.size());
  parallel_for(std::size_t{0}, truths.size(), [&](std::size_t i) {
    if (Interruptible::asked()) return;
    captures[i] = make_capture(scene, *reference, truths[i], budgets[i],
                               arguments.seed + 1'000'003 * (i + 1));
    captures[i].source = scene.name;
    captures[i].index = static_cast<int>(i);
    rendering.advance();
  });
  rendering.finish();
  if (Interruptible::asked()) return {};
  save_captures(arguments.directories, scene, captures);
  return captures;
}

/// Captures of an earlier run with the same seed and scene: their truths must be the ones drawn.
std::vector<Capture> known_captures(const SolverArguments& arguments, const Scene& scene,
                                    const std::vector<PoseVector>& truths) {
  std::vector<Capture> captures = saved_captures(arguments.directories, scene, truths.size());
  for (std::size_t i = 0; i < truths.size(); ++i) {
    const PoseVector known = true_pose(scene, captures[i]);
    if (known.allFinite() && (known - truths[i]).cwiseAbs().maxCoeff() < 1e-5) continue;
    throw Error(
        captures_path(arguments.directories.read, scene),
        "capture " + std::to_string(i) + " is not of the pose that this scene and seed give");
  }
  return captures;
}

Study run_study(const SolverArguments& arguments, const std::string& path) {
  const Scene scene = read_scene(path);
  const auto count = static_cast<std::size_t>(arguments.captures);
  std::vector<PoseVector> truths(count);
  std::vector<LightBudget> budgets(count);
  std::mt19937_64 random(arguments.seed);
  std::uniform_real_distribution<double> log_photons(std::log(arguments.least_photons),
                                                     std::log(arguments.most_photons));
  std::normal_distribution<double> log_amplitude(0.0, arguments.amplitude_spread);
  const ShownPoses shown(scene, arguments.seed);
  for (std::size_t i = 0; i < count; ++i) {
    truths[i] = shown.draw(random);
    budgets[i].third_bounce_photons = std::exp(log_photons(random));
    budgets[i].amplitude = std::exp(log_amplitude(random));
  }
  const std::vector<Capture> captures = arguments.directories.read.empty()
                                            ? render_captures(arguments, scene, truths, budgets)
                                            : known_captures(arguments, scene, truths);
  if (captures.empty()) {  // interrupted
    Study none;
    none.planned = count;
    return none;
  }
  std::vector<const Capture*> firsts;
  for (std::size_t i = 0; i < std::min(count, kFirstCaptures); ++i) firsts.push_back(&captures[i]);
  Study study;
  study.first_ms = first_capture_times(scene, arguments.fit, firsts);
  const Fitter fitter(scene, arguments.fit);
  fitter.fit(captures.front());  // so that the others' times are those of following captures
  const ExhaustiveSearch exhaustive(scene, arguments.exhaustive);
  study.trials.resize(count);
  Progress fitting(scene.name + ": " + std::to_string(exhaustive.poses()) + " poses each", count);
  parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    if (Interruptible::asked()) return;
    study.trials[i] = run_trial(scene, captures[i], truths[i], fitter, exhaustive);
    study.trials[i].photons = *budgets[i].third_bounce_photons;
    study.trials[i].done = true;
    fitting.advance();
  });
  fitting.finish();
  study.planned = count;
  std::erase_if(study.trials, [](const Trial& trial) { return !trial.done; });
  return study;
}

int run_solver(const SolverArguments& arguments) {
  if (!arguments.output.empty()) make_directory(arguments.output);
  nlohmann::json all = nlohmann::json::array();
  const Interruptible interruptible;
  for (const std::string& path : arguments.scenes) {
    const Study study = run_study(arguments, path);
    if (study.trials.empty()) {
      tell_interrupted(0, study.planned, "captures of " + path);
      return kSomeFailed;
    }
    const std::string name = std::filesystem::path(path).stem().string();
    const TableRow row = summary(name, study);
    arguments.out.text("%s%s", all.empty() ? table_head(row).c_str() : "", table_line(row).c_str());
    all.push_back(to_json(name, study));
    if (!arguments.output.empty()) {
      write_atomically((std::filesystem::path(arguments.output) / "solver.json").string(),
                       all.dump(1) + "\n");
    }
    if (Interruptible::asked()) {
      tell_interrupted(study.trials.size(), study.planned, "captures of " + path,
                       "the table holds these");
      arguments.out.document(all.dump(1));
      return kSomeFailed;
    }
  }
  arguments.out.document(all.dump(1));
  return kAllWell;
}

}  // namespace

void add_solver_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "solver",
      "fit synthetic captures of the reference renderer and compare with an exhaustive "
      "search; prints a table, one row a scene");
  const auto arguments = std::make_shared<SolverArguments>();
  command.add_option("SCENE", arguments->scenes, "scene files");
  const auto captures = command
                            .add_option("-n,--captures", arguments->captures,
                                        "captures per scene; unless told, a sweep has " +
                                            std::to_string(arguments->sweep.options.captures) +
                                            " at each level of light")
                            ->check(positive_number());
  command.add_option("--least-photons", arguments->least_photons, "of the third bounce")
      ->check(positive_number());
  command.add_option("--most-photons", arguments->most_photons, "of the third bounce")
      ->check(positive_number());
  command.add_option("--amplitude-spread", arguments->amplitude_spread,
                     "standard deviation of the log of the object's true brightness");
  command
      .add_option("--truth", arguments->truth,
                  "sampling of the captures, in units of the reference renderer's default")
      ->check(CLI::Range(0.1, 10.0));
  command.add_option("--starts", arguments->fit.max_starts, "refined starts of the fit");
  command.add_option("--tolerance", arguments->exhaustive.model_tolerance, "of the fast model");
  command.add_option("--density", arguments->exhaustive.density,
                     "points of the exhaustive grid per grid step of the fit");
  command.add_option("--max-poses", arguments->exhaustive.max_poses, "of the exhaustive grid");
  command.add_option("--seed", arguments->seed, "of poses and photons");
  command.add_option("-o,--output", arguments->output, "directory for solver.json, all trials");
  arguments->out.add_option(command, "solver.json, or sweep.json with --sweep,");
  add_capture_directories(command, arguments->directories);
  add_sweep_options(command, arguments->sweep);
  for (const char* own :
       {"--least-photons", "--most-photons", "--amplitude-spread", "--starts", "--tolerance",
        "--density", "--max-poses", "--save-captures", "--saved-captures"}) {
    command.get_option(own)->excludes("--sweep");
  }
  command.callback([arguments, captures, &exit_code] {
    if (arguments->sweep.wanted) {
      SweepOptions& options = arguments->sweep.options;
      if (captures->count() > 0) options.captures = arguments->captures;
      options.seed = arguments->seed;
      options.sampling = arguments->truth;
      const std::string& output = arguments->output;
      exit_code = run_sweep(arguments->sweep, arguments->scenes,
                            output.empty() ? "out/benchmark" : output, arguments->out);
      return;
    }
    if (arguments->scenes.empty()) throw Error("SCENE", "found none, accepted: scene files");
    // Both search the likelihood of one model.
    arguments->fit.model_tolerance = arguments->exhaustive.model_tolerance;
    arguments->fit.validate();
    exit_code = run_solver(*arguments);
  });
}

}  // namespace blindcorner
