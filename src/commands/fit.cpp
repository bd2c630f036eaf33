// SPDX-License-Identifier: Apache-2.0
/// `blindcorner fit SCENE CAPTURE... -o DIR [--joint | --track]`.
#include "blindcorner/inverse/fit.h"

#include <tbb/partitioner.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/batch.h"
#include "blindcorner/inverse/tracking/tracker.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/headline.h"
#include "blindcorner/report/page.h"
#include "blindcorner/report/result_file.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/fit_table.h"
#include "commands/interrupt.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "commands/thread_limit.h"
#include "forward/support/parallel.h"

namespace blindcorner {

namespace {

namespace fs = std::filesystem;

struct FitArguments {
  std::string scene;
  std::string instrument;
  std::vector<std::string> captures;
  std::string chosen;
  std::string output;
  bool joint = false;
  bool track = false;
  bool no_page = false;
  Printout out;
  int threads = 0;
  FitOptions options;
};

/// Runs a fit; whatever it throws becomes the result's error.
template <typename Fit>
FitResult guarded(const Fit& fit) {
  try {
    return fit();
  } catch (const std::bad_alloc&) {
    FitResult failed;
    failed.error = "out of memory";
    return failed;
  } catch (const std::exception& error) {
    FitResult failed;
    failed.error = error.what();
    return failed;
  }
}

FitResult failure(const CaptureInput& input) {
  FitResult failed;
  failed.sources = {input.source};
  if (input.index >= 0) failed.indices = {input.index};
  failed.error = input.error;
  return failed;
}

/// Names the capture of a result of a single one.
void name_capture(const Capture& capture, FitResult& result) {
  const Capture* const only = &capture;
  name_captures({&only, 1}, result);
}

/// Each capture on its own, in parallel; results in the order of the inputs.
std::vector<FitResult> fit_each(const Fitter& fitter, const std::vector<CaptureInput>& inputs) {
  std::vector<FitResult> results(inputs.size());
  std::optional<Progress> progress;  // a single capture shows its stages instead
  if (inputs.size() > 1) progress.emplace("captures", inputs.size());
  const auto fit_one = [&](std::size_t i) {
    if (!inputs[i].capture) {
      results[i] = failure(inputs[i]);
    } else if (Interruptible::asked()) {
      results[i].error = kInterrupted;
      name_capture(*inputs[i].capture, results[i]);
    } else {
      results[i] = fit_named(fitter, *inputs[i].capture);
    }
    if (progress) progress->advance();
  };
  // One task per capture: their times differ by an order of magnitude.
  parallel_for(std::size_t{0}, inputs.size(), fit_one, tbb::simple_partitioner());
  return results;
}

/// One fit of all readable captures, then those that could not be read.
std::vector<FitResult> fit_joint(const Fitter& fitter, const std::vector<CaptureInput>& inputs) {
  std::vector<Capture> captures;
  std::vector<FitResult> results(1);
  for (const CaptureInput& input : inputs) {
    if (input.capture) {
      captures.push_back(*input.capture);
    } else {
      results.push_back(failure(input));
    }
  }
  results[0] = fit_joint_named(fitter, captures);
  return results;
}

/// The captures in their order as frames of one moving object. A frame that cannot be used is
/// passed over: the object is predicted across it.
std::vector<FitResult> fit_track(const Fitter& fitter, const Motion& motion,
                                 const std::vector<CaptureInput>& inputs) {
  const Scene& scene = fitter.scene();
  Tracker tracker(scene, motion);
  std::vector<FitResult> results;
  std::vector<FitResult> tracked;
  std::vector<std::size_t> places;
  Progress progress("frames", inputs.size());
  double since = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    since += i > 0 ? motion.frame_interval : 0;
    if (!inputs[i].capture) {
      results.push_back(failure(inputs[i]));
    } else if (Interruptible::asked()) {
      results.emplace_back().error = kInterrupted;
      name_capture(*inputs[i].capture, results.back());
    } else {
      const Capture& capture = *inputs[i].capture;
      results.push_back(guarded([&] { return track_frame(fitter, tracker, capture, since); }));
      name_capture(capture, results.back());
      if (results.back().track) {
        results.back().track->time = static_cast<double>(i) * motion.frame_interval;
        places.push_back(i);
        since = 0;
      }
    }
    progress.advance();
  }
  for (const std::size_t i : places) tracked.push_back(std::move(results[i]));
  add_smoothed(scene, tracker, tracked);
  for (std::size_t k = 0; k < places.size(); ++k) results[places[k]] = std::move(tracked[k]);
  return results;
}

/// How the captures of each result were taken, for the page.
std::vector<std::vector<CaptureConditions>> conditions_of_all(
    const Scene& scene, const std::vector<CaptureInput>& inputs, bool joint) {
  std::vector<std::vector<CaptureConditions>> conditions(joint ? 1 : inputs.size());
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (inputs[i].capture) {
      conditions[joint ? 0 : i].push_back(conditions_of(scene, *inputs[i].capture));
    }
  }
  return conditions;
}

/// Removes what was made from an older result in the same directory. It must not stand beside a new
/// result.
void remove_stale(const fs::path& directory) {
  for (const char* name : {"result.html", "evaluation.html", "evaluation.json"}) {
    std::error_code unimportant;  // most often there is none
    fs::remove(directory / name, unimportant);
  }
}

/// Writes the page first: a program that waits for result.json then finds both.
void write_outputs(const FitArguments& arguments, const Scene& scene,
                   const std::vector<FitResult>& results, const std::vector<CaptureInput>& inputs) {
  const fs::path directory = arguments.output;
  remove_stale(directory);
  if (!arguments.no_page) {
    const auto conditions = conditions_of_all(scene, inputs, arguments.joint);
    write_atomically((directory / "result.html").string(), result_page(scene, results, conditions));
  }
  write_result(directory.string(), scene, results);
}

/// Prints the sentences about what is odd, each once and at most kMaxHints of them.
void tell_hints(const std::vector<FitResult>& results) {
  std::vector<std::string> hints;
  for (const FitResult& result : results) {
    for (const std::string& hint : result.hints) {
      if (std::ranges::find(hints, hint) == hints.end()) hints.push_back(hint);
    }
  }
  constexpr std::size_t kMaxHints = 5;
  for (std::size_t i = 0; i < std::min(hints.size(), kMaxHints); ++i) {
    std::fprintf(stderr, "blindcorner: hint: %s\n", hints[i].c_str());
  }
  if (hints.size() > kMaxHints) {
    std::fprintf(stderr, "blindcorner: hint: %zu more like these, in result.json\n",
                 hints.size() - kMaxHints);
  }
}

/// Suits sensor and options to the captures. Says on the standard error stream what was left out.
void suit_inputs(const std::vector<CaptureInput>& inputs, Sensor& sensor, FitOptions& options) {
  std::vector<const Capture*> captures;
  for (const CaptureInput& input : inputs) {
    captures.push_back(input.capture ? &*input.capture : nullptr);
  }
  const std::string said = suit_captures(captures, sensor, options);
  if (!said.empty()) std::fprintf(stderr, "blindcorner: %s\n", said.c_str());
}

int run_fit(const FitArguments& arguments) {
  arguments.options.validate();
  const ThreadLimit threads(arguments.threads);
  Scene scene = read_scene(arguments.scene, arguments.instrument);
  // Captures state the nominal width of a bin, which a calibration may have corrected.
  const double nominal = arguments.instrument.empty()
                             ? scene.sensor.bin_width
                             : read_scene(arguments.scene).sensor.bin_width;
  std::vector<CaptureInput> inputs = read_capture_inputs(arguments.captures, nominal);
  if (!arguments.chosen.empty() && !inputs.empty()) choose_captures(inputs, arguments.chosen);
  require_readable(inputs);
  FitOptions options = arguments.options;
  suit_inputs(inputs, scene.sensor, options);
  std::vector<FitResult> results;
  make_directory(arguments.output);
  // A single fit has nothing finished to keep, so Ctrl-C ends it at once.
  std::optional<Interruptible> interruptible;
  if (!arguments.joint && inputs.size() > 1) interruptible.emplace();
  {
    std::optional<StageProgress> stages;
    if (arguments.joint || inputs.size() == 1) {
      stages.emplace("preparing");
      options.progress = [&](const char* doing, double share) { stages->now(doing, share); };
    }
    const Fitter fitter(scene, options);
    results = arguments.joint   ? fit_joint(fitter, inputs)
              : arguments.track ? fit_track(fitter, read_motion(arguments.scene), inputs)
                                : fit_each(fitter, inputs);
  }
  write_outputs(arguments, scene, results, inputs);
  arguments.out.file((fs::path(arguments.output) / "result.json").string());
  arguments.out.text(
      "%s%s\n", fit_table(scene, results).c_str(),
      (results.size() == 1 ? fit_headline(scene, results.front()) : fits_headline(results))
          .c_str());
  tell_hints(results);
  const auto undone = static_cast<std::size_t>(
      std::ranges::count(results, std::string(kInterrupted), &FitResult::error));
  if (undone > 0) tell_interrupted(results.size() - undone, results.size(), "captures");
  std::erase_if(results, [](const FitResult& r) { return r.error == kInterrupted; });
  const std::string failures = failure_lines(results);
  std::fputs(failures.c_str(), stderr);
  return failures.empty() && undone == 0 ? kAllWell : kSomeFailed;
}

void add_fit_options(CLI::App& command, FitArguments& arguments) {
  FitOptions& options = arguments.options;
  command.add_option("--seed", options.seed, "seed of everything random");
  command.add_option("--threads", arguments.threads, "threads; 0: one per processor")
      ->check(CLI::Range(0, 1024));
  command.add_option("--starts", options.max_starts, "most candidates that are refined");
  command.add_option("--scored-poses", options.max_scored_poses,
                     "most poses scored before refinement");
  command.add_option(
      "--tolerance", options.model_tolerance,
      "tolerated error of the fast model, relative to the peak of the signal; default: as "
      "each capture asks for");
  command.add_option(
      "--cache-bytes", options.cache_bytes,
      "most memory for compiled sensor placements; the least recently used go first");
  command.add_option("--importance-samples", options.importance_samples,
                     "samples where Laplace's approximation fails; 0: never");
  command.add_option("--empty-captures", options.empty_captures,
                     "empty captures simulated for the false-alarm probability; 0: leave it out");
}

}  // namespace

void add_fit_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "fit", "find the hidden object; writes DIR/result.json and DIR/result.html");
  const auto arguments = std::make_shared<FitArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command
      .add_option("CAPTURE", arguments->captures,
                  "capture files, or directories whose .exr files are taken in sorted order")
      ->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("--instrument", arguments->instrument,
                  "what `calibrate` found out about the instrument")
      ->type_name("FILE");
  command
      .add_option("--captures", arguments->chosen,
                  "only these captures, from 0 over all files in their order: 0-9,12,20-")
      ->type_name("LIST");
  CLI::Option* joint =
      command.add_flag("--joint", arguments->joint, "one object seen in all captures: one fit");
  command
      .add_flag("--track", arguments->track,
                "captures are frames in the order of time, of one object that moves")
      ->excludes(joint);
  arguments->out.add_option(command, "result.json");
  command.add_flag("--no-page", arguments->no_page, "do not write pages");
  add_fit_options(command, *arguments);
  command.callback([arguments, &exit_code] { exit_code = run_fit(*arguments); });
}

}  // namespace blindcorner
