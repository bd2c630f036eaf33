// SPDX-License-Identifier: Apache-2.0
/// `blindcorner calibrate SCENE CAPTURES -o instrument.json`.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/instrument_file.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "report/calibration_page.h"

namespace blindcorner {

namespace {

struct CalibrateArguments {
  std::string scene;
  std::vector<std::string> captures;
  std::string output;
  bool no_object = false;
  bool no_page = false;
  bool no_assignments = false;
  bool no_wraps = false;
  bool no_background = false;
  bool no_scale = false;
  Printout out;
  CalibrationOptions options;
};

/// Steps of the progress bar.
constexpr std::size_t kSteps = 100;

std::string page_path(const std::string& output) {
  return std::filesystem::path(output).replace_extension(".html").string();
}

int run_calibrate(const CalibrateArguments& arguments) {
  if (std::filesystem::path(arguments.output).extension() != ".json") {
    throw Error("--output", "found " + arguments.output + ", accepted: a name that ends in .json");
  }
  CalibrationOptions options = arguments.options;
  options.permutations = !arguments.no_assignments;
  options.wraps = !arguments.no_wraps;
  options.background = !arguments.no_background;
  options.variance_scale = !arguments.no_scale;
  options.validate();
  const Scene scene = read_scene(arguments.scene);
  const std::vector<CaptureInput> inputs =
      read_capture_inputs(arguments.captures, scene.sensor.bin_width);
  require_readable(inputs);
  std::vector<Capture> captures;
  bool failed = false;
  for (const CaptureInput& input : inputs) {
    if (input.capture) {
      captures.push_back(*input.capture);
    } else {
      std::fprintf(stderr, "blindcorner: %s: %s\n", input.source.c_str(), input.error.c_str());
      failed = true;
    }
  }
  Progress progress("per cent", kSteps);
  std::size_t shown = 0;
  const Calibration calibration =
      calibrate(scene, captures, options, arguments.no_object, [&](double share) {
        const auto now = static_cast<std::size_t>(share * static_cast<double>(kSteps));
        if (now > shown) progress.advance(now - shown);
        shown = std::max(shown, now);
      });
  progress.finish();
  if (arguments.no_page) {
    // A page of an older calibration must not stand beside the new one.
    std::error_code unimportant;
    std::filesystem::remove(page_path(arguments.output), unimportant);
  } else {
    write_atomically(page_path(arguments.output), calibration_page(scene, calibration));
  }
  write_atomically(arguments.output, instrument_json(scene, calibration).dump(1) + "\n");
  arguments.out.file(arguments.output);
  arguments.out.text("%s", calibration_text(calibration).c_str());
  return failed ? kSomeFailed : kAllWell;
}

}  // namespace

void add_calibrate_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "calibrate", "measure the instrument from captures of known objects, or without an object");
  const auto arguments = std::make_shared<CalibrateArguments>();
  CalibrationOptions& options = arguments->options;
  command.add_option("SCENE", arguments->scene, "scene file; its values are the priors")
      ->required();
  command.add_option("CAPTURES", arguments->captures, "captures with their truth")->required();
  command.add_option("-o,--output", arguments->output, "instrument file to write, .json")
      ->required()
      ->type_name("FILE");
  command.add_flag("--no-object", arguments->no_object,
                   "the captures show no object: direct return and background only");
  arguments->out.add_option(command, "the instrument file");
  command.add_flag("--no-page", arguments->no_page, "do not write the page beside the file");
  command.add_flag("--no-assignments", arguments->no_assignments,
                   "do not try which relay spot belongs to which zone");
  command.add_flag("--no-wraps", arguments->no_wraps, "do not try where zones' time axes wrap");
  command.add_flag("--no-background", arguments->no_background,
                   "do not estimate static background, nor look for bins that cannot be used");
  command.add_flag("--no-variance-scale", arguments->no_scale,
                   "do not scale the noise until fits of these captures are honest");
  command.add_option("--time-zero-sigma", options.time_zero_bins, "prior, bins");
  command.add_option("--zone-time-zero-sigma", options.zone_time_zero_bins, "of each zone, bins");
  command.add_option("--bin-width-sigma", options.bin_width_relative, "prior, relative");
  command.add_option("--pulse-sigma", options.pulse_log, "prior of the pulse's widths, logarithm");
  command.add_option("--zone-gain-sigma", options.zone_gain_log, "of each zone's gain, logarithm");
  command.add_option("--spot-sigma", options.spot_m, "prior of the relay spots, m");
  command.add_option("--law-axis-sigma", options.law_axis,
                     "of a measured law's axis against the relay's normal, tangent");
  command.add_option("--outlier-sigmas", options.outlier_sigmas,
                     "captures whose deviance is this far off are left out");
  command.add_option("--outlier-probability", options.outlier_probability,
                     "share of captures that something unknown disturbs");
  command.callback([arguments, &exit_code] { exit_code = run_calibrate(*arguments); });
}

}  // namespace blindcorner
