// SPDX-License-Identifier: Apache-2.0
/// `blindcorner drive DRIVE -o DIR --perception NAME`: one simulated drive around a corner.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/report/drive_report.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/report/side_by_side.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/lit_drive.h"
#include "blindcorner/simulation/perception.h"
#include "commands/commands.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/printout.h"

namespace blindcorner {
namespace {

struct DriveArguments {
  std::string drive;
  std::string output;
  std::vector<std::string> perceptions;
  std::vector<std::string> weights;
  double speed = 0;
  double light = 0;
  int check_sensor = 0;
  bool no_page = false;
  bool animation = false;
  bool require_goal = false;
  Printout out;
  DriveOptions options;
};

double relative_difference(const HistogramCube& a, const HistogramCube& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    difference += std::pow(a.values[i] - b.values[i], 2);
    size += b.values[i] * b.values[i];
  }
  return size > 0 ? std::sqrt(difference / size) : 0.0;
}

/// Size of a difference of counts, in standard deviations of the photon noise of all counts
/// together. It moves no estimate from the frame by more than this many of the estimate's own
/// standard deviations.
double against_noise(const HistogramCube& counts, const HistogramCube& expected) {
  double square = 0;
  for (std::size_t i = 0; i < expected.values.size(); ++i) {
    if (expected.values[i] > 0) square += std::pow(counts.values[i], 2) / expected.values[i];
  }
  return std::sqrt(square);
}

HistogramCube difference(HistogramCube a, const HistogramCube& b) {
  for (std::size_t i = 0; i < a.values.size(); ++i) a.values[i] -= b.values[i];
  return a;
}

/// Expected counts of a frame: all of them, those of light by way of the object, and the others.
struct FrameCounts {
  HistogramCube all, object, rest;
};

FrameCounts counts_of(const Scene& scene, const SensedLight& light) {
  const LinearUnknowns& linear = scene.linear;
  const HistogramCube dark(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  FrameCounts counts;
  counts.all = expected_counts(scene, light.three_bounce, light.static_background,
                               {linear.fixed_amplitude, linear.fixed_ambient, linear.fixed_direct});
  counts.object = expected_counts(scene, light.three_bounce, dark, {linear.fixed_amplitude, 0, 0});
  counts.rest = difference(counts.all, counts.object);
  return counts;
}

/// Compares the simulated light with that of the reference renderer on frames spread over the
/// drive: relative L2, and relative to the photon noise.
void check_sensor(const Printout& out, const SimulatedSensor& sensor, const DriveResult& result,
                  int count) {
  std::vector<const DriveFrame*> sensed;
  for (const DriveFrame& frame : result.frames) {
    if (frame.counts) sensed.push_back(&frame);
  }
  const std::size_t frames = std::min(static_cast<std::size_t>(count), sensed.size());
  out.text(
      "simulated sensor against the reference renderer: relative L2, and in standard deviations\n"
      "of all counts' photon noise the difference and, of the object, the light itself\n"
      "  %8s %12s %12s %12s %12s %12s\n",
      "time s", "object", "/ noise", "its light", "static", "/ noise");
  for (std::size_t i = 0; i < frames; ++i) {
    const DriveFrame& frame = *sensed[i * sensed.size() / frames];
    const SensedLight light = sensor.light(frame.T_world_sensor, frame.truth);
    const SensedLight reference = sensor.reference_light(frame.T_world_sensor, frame.truth);
    const FrameCounts counts = counts_of(sensor.scene(), light);
    const FrameCounts right = counts_of(sensor.scene(), reference);
    out.text("  %8.2f %12.5f %12.2f %12.2f %12.6f %12.2f\n", frame.time,
             relative_difference(light.three_bounce, reference.three_bounce),
             against_noise(difference(counts.object, right.object), right.all),
             against_noise(right.object, right.all),
             relative_difference(light.static_background, reference.static_background),
             against_noise(difference(counts.rest, right.rest), right.all));
  }
}

/// Prints the run times of one stage over the frames in which it ran, ms.
void print_stage(const Printout& out, const char* name, const DriveResult& result,
                 double DriveTimes::*stage, double interval) {
  std::vector<double> times;
  for (const DriveFrame& frame : result.frames) {
    if (frame.time_ms.*stage > 0) times.push_back(frame.time_ms.*stage);
  }
  if (times.empty()) return;
  std::ranges::sort(times);
  const double middle = times[times.size() / 2], longest = times.back();
  const auto late = std::ranges::count_if(times, [&](double t) { return t > interval; });
  out.text("  %-10s %8zu %10.1f %10.1f   %s\n", name, times.size(), middle, longest,
           late == 0 ? "keeps the sensor's rate"
                     : ("too slow in " + std::to_string(late) + " frames").c_str());
}

void print_real_time(const Printout& out, const Drive& drive, const DriveResult& result) {
  const double interval = 1000 / drive.sensor.rate;
  out.text("run times against the sensor's interval of %.0f ms\n", interval);
  out.text("  %-10s %8s %10s %10s\n", "stage", "frames", "median ms", "longest ms");
  print_stage(out, "perceive", result, &DriveTimes::perceive, interval);
  print_stage(out, "map", result, &DriveTimes::map, interval);
  print_stage(out, "plan", result, &DriveTimes::plan, interval);
  print_stage(out, "control", result, &DriveTimes::control, interval);
  print_stage(out, "(sense)", result, &DriveTimes::sense, interval);
  const auto passed = std::ranges::count(result.frames, FrameFate::busy, &DriveFrame::fate);
  out.text("  frames passed over while perception was busy: %td of %zu\n", passed,
           result.frames.size());
}

/// The perceptions that are driven with: those of `--perception`, or that of the file.
std::vector<std::string> perceptions_of(const DriveArguments& arguments, const Drive& drive) {
  if (arguments.perceptions.empty()) return {drive.perception};
  for (const std::string& name : arguments.perceptions) check_perception(name, "--perception");
  const std::set<std::string> different(arguments.perceptions.begin(), arguments.perceptions.end());
  if (different.size() != arguments.perceptions.size()) {
    throw Error("--perception", "a perception is named twice");
  }
  return arguments.perceptions;
}

/// One drive, and its files in a directory.
struct Driven {
  DriveOptions options;
  DriveResult result;
};

void write_drive(const DriveArguments& arguments, const Drive& drive, const Driven& driven,
                 const std::filesystem::path& directory) {
  const auto& [options, result] = driven;
  make_directory(directory.string());
  // The page is written first: a program that waits for drive.json then finds both.
  if (!arguments.no_page) {
    write_atomically((directory / "drive.html").string(), drive_page(drive, options, result));
  }
  write_atomically((directory / "drive.json").string(),
                   dump_json(drive_json(drive, options, result), 1) + "\n");
  arguments.out.file((directory / "drive.json").string());
  arguments.out.text("%s: %s with %s after %.1f s and %.1f m (mean %.2f m/s), clearance %.2f m\n",
                     drive.name.c_str(), outcome_word(result.outcome).c_str(),
                     options.perception.c_str(), result.time, result.length, result.mean_speed,
                     result.clearance);
}

/// The page that plays the first drive beside each of the others.
void write_side_by_side(const Drive& drive, const std::vector<Driven>& all,
                        const std::filesystem::path& directory) {
  nlohmann::json pairs = nlohmann::json::array(), first;
  for (const Driven& driven : all) {
    nlohmann::json replay = drive_replay(drive, driven.options, driven.result);
    if (first.is_null()) {
      first = std::move(replay);
      continue;
    }
    pairs.push_back(replay_pair(first, std::move(replay),
                                {all.front().options.perception + "/drive.html",
                                 driven.options.perception + "/drive.html"}));
  }
  write_atomically((directory / "drive.html").string(), side_by_side_page(drive.name, pairs));
}

void write_animation(const Drive& drive, const std::vector<Driven>& all,
                     const std::filesystem::path& directory) {
  std::vector<AnimatedDrive> shown;
  for (const Driven& driven : all) {
    shown.push_back({perception_phrase(driven.options.perception), &driven.result});
  }
  write_atomically(
      (directory / "drive.svg").string(),
      all.size() == 1 ? drive_animation(drive, all.front().result) : drive_animation(drive, shown));
}

int run_drive(const DriveArguments& arguments) {
  const Drive drive = read_lit_drive(arguments.drive, arguments.light);
  const std::vector<std::string> names = perceptions_of(arguments, drive);
  DriveOptions options = arguments.options;
  options.networks = load_networks(drive, weight_files(drive, arguments.weights, names));
  if (arguments.speed > 0) options.speed = arguments.speed;
  options.keep_pictures = !arguments.no_page || arguments.check_sensor > 0;
  const SimulatedSensor sensor(drive.scene);
  make_directory(arguments.output);
  const std::filesystem::path directory = arguments.output;
  std::vector<Driven> all;
  for (const std::string& name : names) {
    options.perception = name;
    all.push_back({options, drive_through(drive, sensor, options)});
    const Driven& driven = all.back();
    write_drive(arguments, drive, driven, names.size() == 1 ? directory : directory / name);
    if (options.real_time) print_real_time(arguments.out, drive, driven.result);
    if (arguments.check_sensor > 0) {
      check_sensor(arguments.out, sensor, driven.result, arguments.check_sensor);
    }
  }
  if (all.size() > 1 && !arguments.no_page) write_side_by_side(drive, all, directory);
  if (arguments.animation) write_animation(drive, all, directory);
  const bool missed = std::ranges::any_of(
      all, [](const Driven& d) { return d.result.outcome != DriveOutcome::reached; });
  return arguments.require_goal && missed ? kSomeFailed : kAllWell;
}

}  // namespace

void add_drive_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "drive", "drive around a corner in simulation; writes DIR/drive.json and DIR/drive.html");
  const auto arguments = std::make_shared<DriveArguments>();
  command.add_option("DRIVE", arguments->drive, "drive file")->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("--perception", arguments->perceptions,
                  "los, solver, cnn, cnn_wide or oracle; default: the drive file's. Several, with "
                  "commas: DIR/NAME/drive.json of each, and a page that plays them side by side")
      ->delimiter(',');
  command.add_option("--weights", arguments->weights,
                     "weights.pt of cnn train, for perceptions that are networks; default: the "
                     "drive file's");
  command
      .add_option("--injected-error", arguments->options.injected_error,
                  "m, by which oracle_disc and oracle_covariance miss the truth")
      ->check(number_from_zero());
  command.add_option("--seed", arguments->options.seed, "of hidden objects, photons and faults");
  command
      .add_option("--speed,--speed-m-per-s", arguments->speed,
                  "wanted speed, m/s; default: the drive file's")
      ->check(positive_number());
  command
      .add_option("--light", arguments->light,
                  "factor on the laser's light; daylight stays; default: the drive file's")
      ->check(positive_number());
  command.add_flag("--real-time", arguments->options.real_time,
                   "answers take as long as on this machine, and frames that come meanwhile are "
                   "passed over; prints the times of each stage");
  command
      .add_option("--check-sensor", arguments->check_sensor,
                  "compare the simulated light with the reference renderer's on so many frames")
      ->check(number_from_zero());
  command.add_flag("--animation", arguments->animation,
                   "write DIR/drive.svg, which moves, as well");
  command.add_flag("--require-goal", arguments->require_goal,
                   "exit with code 1 unless the vehicle reaches its goal");
  command.add_flag("--no-page", arguments->no_page, "do not write pages");
  arguments->out.add_option(command, "drive.json");
  command.callback([arguments, &exit_code] { exit_code = run_drive(*arguments); });
}

}  // namespace blindcorner
