// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark moving`: run time, memory and accuracy with a sensor that stands
/// elsewhere in every frame.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/inverse/tracking/tracker.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/benchmark.h"
#include "commands/number_check.h"
#include "commands/pose_text.h"
#include "commands/process_memory.h"
#include "commands/progress.h"
#include "commands/synthetic_trials.h"
#include "commands/thread_limit.h"
#include "forward/support/parallel.h"
#include "forward/support/quantile.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
/// Tolerance of the exhaustive search's model. It is finer than any tolerance that the fit of a
/// capture asks for; otherwise a missed optimum could be the judge's own error.
constexpr double kJudge = 0.02;
/// Number of times that a fresh fitter's first answer is measured.
constexpr int kFirstAnswers = 3;
/// In the endurance run, one in this many frames is also fitted without a prediction.
constexpr std::size_t kFitEvery = 10;
constexpr std::size_t kMemorySamples = 200;
constexpr std::size_t kMemoryLines = 10;

struct MovingArguments : StudyArguments {
  int frames = 100;
  int objects = 4;
  std::string from, to, pose, sensor_path;
  double photons = 0;
  double truth = 1;  ///< sampling of the captures' renderer, in units of its default
  int exhaustive_every = 10;
  int endurance = 0;
  int threads = 0;
  CaptureDirectories directories;
  FitOptions fit;
  ExhaustiveOptions exhaustive;
};

/// Results of one frame: times in ms, errors in m; NaN: not measured.
struct Frame {
  bool starts = false;  ///< first frame of a new object, without a prediction
  std::string error;
  double fit_ms = kNone, fit_error = kNone;
  double tracked_ms = kNone, tracked_error = kNone;
  double missed = kNone, exhaustive_error = kNone;
  double memory = 0;  ///< MB, resident after the frame's fit
};

/// Memory along an endurance run. At the end of each tenth it also has the times of that tenth.
struct Endurance {
  int frames = 0;
  double resident = 0, peak = 0;              ///< MB
  double tracked_ms = kNone, fit_ms = kNone;  ///< medians of the tenth; NaN: within it
};

struct Run {
  std::string scene;
  std::vector<Frame> frames;
  std::vector<Transform> sensors;  ///< [frames]
  std::vector<double> first_ms;
  double memory_before = 0, memory_peak = 0;  ///< MB
  std::vector<Endurance> endurance;
};

using Clock = std::chrono::steady_clock;
double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

std::vector<Transform> wanted_path(const MovingArguments& arguments, const Scene& scene) {
  std::vector<Transform> through;
  if (!arguments.sensor_path.empty()) {
    through = read_sensor_poses(scene, arguments.sensor_path);
  } else {
    through.push_back(arguments.from.empty() ? scene.T_world_sensor
                                             : parse_sensor_pose(scene, "--from", arguments.from));
    through.push_back(arguments.to.empty() ? forward_end(seen_from(scene, through.front()))
                                           : parse_sensor_pose(scene, "--to", arguments.to));
  }
  return sensor_path(through, arguments.frames + 1);
}

/// Renders the capture for a fresh fitter's first answer, then the captures of the frames.
std::vector<Capture> render(const MovingArguments& arguments, const Scene& scene) {
  const std::vector<Transform> path = wanted_path(arguments, scene);
  std::vector<Scene> seen;
  for (const Transform& pose : path) seen.push_back(seen_from(scene, pose));
  std::vector<PoseVector> objects;
  if (!arguments.pose.empty()) {
    objects.push_back(pose_of(parse_pose(scene, arguments.pose), scene.unknowns));
  } else {
    const ShownPoses shown(scene, arguments.seed);
    std::mt19937_64 random(arguments.seed);
    for (int i = 0; i < arguments.objects; ++i) objects.push_back(shown.draw(random));
  }
  LightBudget budget;
  if (arguments.photons > 0) budget.third_bounce_photons = arguments.photons;
  std::vector<Capture> captures(path.size());
  Progress progress(scene.name + ": rendering", path.size());
  parallel_for(std::size_t{0}, path.size(), [&](std::size_t i) {
    const auto renderer = make_reference_renderer(seen[i], sensor_placement(seen[i]),
                                                  reference_sampling(arguments.truth));
    // The first capture shows the first object, as the first frame does.
    const std::size_t object = i == 0 ? 0 : (i - 1) * objects.size() / (path.size() - 1);
    captures[i] = make_capture(seen[i], *renderer, objects[object], budget,
                               arguments.seed + 1'000'003 * (i + 1));
    captures[i].source = scene.name;
    captures[i].index = static_cast<int>(i);
    progress.advance();
  });
  return captures;
}

std::vector<Capture> captures_of(const MovingArguments& arguments, const Scene& scene) {
  if (arguments.directories.read.empty()) {
    std::vector<Capture> captures = render(arguments, scene);
    save_captures(arguments.directories, scene, captures);
    return captures;
  }
  return saved_captures(arguments.directories, scene,
                        static_cast<std::size_t>(arguments.frames) + 1);
}

/// Reads the scene, makes a fitter and fits the capture each time, as a new process would.
std::vector<double> first_answers(const MovingArguments& arguments, const std::string& path,
                                  const Capture& capture) {
  std::vector<double> times;
  for (int i = 0; i < kFirstAnswers; ++i) {
    const auto start = Clock::now();
    Fitter(read_scene(path), arguments.fit).fit(capture);
    times.push_back(milliseconds_since(start));
  }
  return times;
}

/// Fits every frame by itself, one after the other.
std::vector<FitResult> fit_frames(const Fitter& fitter, std::span<const Capture> captures,
                                  Run& run) {
  std::vector<FitResult> results(captures.size());
  Progress progress(run.scene + ": frames by themselves", captures.size());
  for (std::size_t i = 0; i < captures.size(); ++i) {
    Frame& frame = run.frames[i];
    try {
      const auto start = Clock::now();
      results[i] = fitter.fit(captures[i]);
      frame.fit_ms = milliseconds_since(start);
      frame.fit_error = position_error(fitter.scene(), results[i]);
      results[i].histograms.clear();  // the memory figures count the fit alone
    } catch (const std::exception& error) {
      frame.error = error.what();
    }
    frame.memory = process_memory().resident;
    progress.advance();
  }
  return results;
}

void track_frames(const Fitter& fitter, const Motion& motion, std::span<const Capture> captures,
                  Run& run) {
  Progress progress(run.scene + ": frames tracked", captures.size());
  std::optional<Tracker> tracker;
  for (std::size_t i = 0; i < captures.size(); ++i) {
    Frame& frame = run.frames[i];
    if (frame.starts) tracker.emplace(fitter.scene(), motion);
    try {
      const auto start = Clock::now();
      const FitResult result = track_frame(fitter, *tracker, captures[i], motion.frame_interval);
      frame.tracked_ms = milliseconds_since(start);
      frame.tracked_error = position_error(fitter.scene(), result);
    } catch (const std::exception& error) {
      frame.error = error.what();
    }
    progress.advance();
  }
}

/// Compares every n-th frame with an exhaustive search at the sensor's pose.
void search_frames(const MovingArguments& arguments, const Scene& scene,
                   std::span<const Capture> captures, const std::vector<FitResult>& results,
                   Run& run) {
  if (arguments.exhaustive_every == 0) return;
  const auto every = static_cast<std::size_t>(arguments.exhaustive_every);
  Progress progress(run.scene + ": exhaustive searches", (captures.size() + every - 1) / every);
  for (std::size_t i = 0; i < captures.size(); i += every) {
    if (!std::isnan(run.frames[i].fit_ms)) {
      const ExhaustiveSearch search(seen_from(scene, run.sensors[i]), arguments.exhaustive);
      const PoseVector truth = true_pose(scene, captures[i]);
      const MissedOptimum missed = missed_optimum(search, captures[i], results[i], truth);
      run.frames[i].missed = missed.log_posterior;
      run.frames[i].exhaustive_error = position_error(scene, missed.bound.heaviest.pose, truth);
    }
    progress.advance();
  }
}

/// Runs many more sensor poses along the same path, none of which the fitter has met before. Each
/// takes the light of the nearest frame: this run measures memory and time, not accuracy.
void endure(const MovingArguments& arguments, const Fitter& fitter, const Motion& motion,
            std::span<const Capture> captures, Run& run) {
  if (arguments.endurance == 0) return;
  const auto count = static_cast<std::size_t>(arguments.endurance);
  // The fitter has met both ends of the path; they are left out.
  const std::vector<Transform> path = sensor_path(run.sensors, arguments.endurance + 2);
  Progress progress(run.scene + ": endurance", count);
  std::optional<Tracker> tracker;
  std::size_t last = captures.size();
  std::vector<double> tracked, fitted;
  const std::size_t every = std::max<std::size_t>(1, count / kMemorySamples);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t nearest = i * (captures.size() - 1) / std::max<std::size_t>(1, count - 1);
    if (nearest != last && (!tracker || run.frames[nearest].starts)) {
      tracker.emplace(fitter.scene(), motion);
    }
    last = nearest;
    Capture capture = captures[nearest];
    capture.T_world_sensor = path[i + 1];
    try {
      auto start = Clock::now();
      track_frame(fitter, *tracker, capture, motion.frame_interval);
      tracked.push_back(milliseconds_since(start));
      if (i % kFitEvery == 0) {
        start = Clock::now();
        fitter.fit(capture);
        fitted.push_back(milliseconds_since(start));
      }
    } catch (const std::exception& error) {
      run.frames[nearest].error = error.what();
    }
    const bool line = (i + 1) * kMemoryLines / count > i * kMemoryLines / count;
    if (line || (i + 1) % every == 0) {
      const ProcessMemory memory = process_memory();
      run.endurance.push_back({static_cast<int>(i + 1), memory.resident, memory.peak});
    }
    if (line) {
      run.endurance.back().tracked_ms = median(tracked);
      run.endurance.back().fit_ms = median(fitted);
      tracked.clear();
      fitted.clear();
    }
    progress.advance();
  }
}

Run measure(const MovingArguments& arguments, const std::string& path) {
  const Scene scene = read_scene(path);
  const Motion motion = read_motion(path);
  const std::vector<Capture> all = captures_of(arguments, scene);
  const std::span<const Capture> captures = std::span(all).subspan(1);
  Run run;
  run.scene = scene.name;
  run.frames.resize(captures.size());
  for (std::size_t i = 0; i < captures.size(); ++i) {
    run.sensors.push_back(sensor_placement(scene, &captures[i]).T_world_sensor);
    run.frames[i].starts = i == 0 || captures[i].truth != captures[i - 1].truth;
  }
  reset_peak_memory();
  run.memory_before = process_memory().resident;
  run.first_ms = first_answers(arguments, path, all.front());
  std::vector<FitResult> results;
  {
    const Fitter fitter(scene, arguments.fit);
    fitter.fit(all.front());  // work done once for a scene counts to the first answer
    results = fit_frames(fitter, captures, run);
  }
  {
    const Fitter fitter(scene, arguments.fit);
    fitter.fit(all.front());
    track_frames(fitter, motion, captures, run);
    run.memory_peak = process_memory().peak;
    endure(arguments, fitter, motion, captures, run);
  }
  search_frames(arguments, scene, captures, results, run);
  return run;
}

/// Values of a member over the frames where it was measured.
std::vector<double> values_of(const Run& run, double Frame::*member, bool followers = false) {
  std::vector<double> values;
  for (const Frame& frame : run.frames) {
    if (!std::isnan(frame.*member) && !(followers && frame.starts)) values.push_back(frame.*member);
  }
  return values;
}

/// A quantile of the measured values; NaN if there are none.
double quantile_or_none(const std::vector<double>& values, double share) {
  return values.empty() ? kNone : quantile(values, share);
}

TableRow row_of(const Run& run) {
  const auto failed =
      std::ranges::count_if(run.frames, [](const Frame& f) { return !f.error.empty(); });
  const std::vector<double> fits = values_of(run, &Frame::fit_ms);
  const std::vector<double> tracks = values_of(run, &Frame::tracked_ms, true);
  const std::vector<double> missed = values_of(run, &Frame::missed);
  const auto reached = std::ranges::count_if(missed, [](double m) { return m <= kReached; });
  // Fit errors beside those of the exhaustive search come from the same frames.
  std::vector<double> fit_errors;
  for (const Frame& frame : run.frames) {
    if (missed.empty() ? !std::isnan(frame.fit_error) : !std::isnan(frame.missed)) {
      fit_errors.push_back(frame.fit_error);
    }
  }
  return {{{"", "scene", "%-18s", run.scene},
           {"", "frames", "%6d", run.frames.size()},
           {"", "fail", "%4d", failed},
           {"", "first ms", "%8.1f", median(run.first_ms)},
           {"", "fit ms", "%8.1f", quantile_or_none(fits, 0.5)},
           {"", "90 %", "%8.1f", quantile_or_none(fits, 0.9)},
           {"", "longest", "%8.1f", quantile_or_none(fits, 1)},
           {"", "track ms", "%8.1f", quantile_or_none(tracks, 0.5)},
           {"", "90 %", "%8.1f", quantile_or_none(tracks, 0.9)},
           {"", "longest", "%8.1f", quantile_or_none(tracks, 1)},
           {"", "optimum", "%9s", formatted("%td/%zu", reached, missed.size())},
           {"", "fit m", "%8.3f", median(fit_errors)},
           {"", "(bound)", "%8.3f", median(values_of(run, &Frame::exhaustive_error))},
           {"", "track m", "%8.3f", median(values_of(run, &Frame::tracked_error, true))},
           {"", "MB", "%7.0f", run.memory_before},
           {"", "peak", "%7.0f", run.memory_peak}}};
}

std::string csv(const std::vector<Run>& runs) {
  std::string text =
      "scene,frame,sensor_x_m,sensor_y_m,sensor_z_m,sensor_yaw_deg,sensor_pitch_deg,"
      "sensor_roll_deg,new_object,fit_ms,fit_error_m,tracked_ms,tracked_error_m,"
      "missed_log_posterior,exhaustive_error_m,memory_mb\n";
  for (const Run& run : runs) {
    for (std::size_t i = 0; i < run.frames.size(); ++i) {
      const Frame& f = run.frames[i];
      const Eigen::Vector3d at = run.sensors[i].translation();
      const Eigen::Vector3d angles = yaw_pitch_roll_of(run.sensors[i].linear()) / kDegree;
      text += formatted("%s,%zu,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%d", run.scene.c_str(), i, at.x(),
                        at.y(), at.z(), angles[0], angles[1], angles[2], f.starts ? 1 : 0);
      for (const double value : {f.fit_ms, f.fit_error, f.tracked_ms, f.tracked_error, f.missed,
                                 f.exhaustive_error, f.memory}) {
        text += std::isnan(value) ? "," : formatted(",%.5g", value);
      }
      text += "\n";
    }
  }
  return text;
}

std::vector<Chart> charts(const std::vector<Run>& runs) {
  std::vector<Chart> list;
  for (const Run& run : runs) {
    const auto series = [&](const char* name, double Frame::*member, SeriesStyle style) {
      ChartSeries result{name, {}, style};
      for (std::size_t i = 0; i < run.frames.size(); ++i) {
        result.points.push_back({static_cast<double>(i), run.frames[i].*member});
      }
      return result;
    };
    Chart time{run.scene + ": time", "frame", "ms a frame"};
    time.series = {series("without a prediction", &Frame::fit_ms, SeriesStyle::line),
                   series("tracked", &Frame::tracked_ms, SeriesStyle::line)};
    Chart error{run.scene + ": error", "frame", "error of the heaviest mode's position, m"};
    error.series = {series("without a prediction", &Frame::fit_error, SeriesStyle::line),
                    series("tracked", &Frame::tracked_error, SeriesStyle::line),
                    series("exhaustive search", &Frame::exhaustive_error, SeriesStyle::circles)};
    list.push_back(std::move(time));
    list.push_back(std::move(error));
    if (run.endurance.empty()) continue;
    Chart memory{run.scene + ": memory", "sensor poses", "MB"};
    memory.series = {{"resident"}, {"peak"}};
    for (const Endurance& e : run.endurance) {
      memory.series[0].points.push_back({static_cast<double>(e.frames), e.resident});
      memory.series[1].points.push_back({static_cast<double>(e.frames), e.peak});
    }
    list.push_back(std::move(memory));
  }
  for (Chart& chart : list) chart.width = 560, chart.height = 330;
  return list;
}

const Study<Run> kStudy{
    "moving",
    "A sensor that stands elsewhere in every frame",
    "Captures of the reference renderer along a path of the sensor, photon noise added, each "
    "fitted by itself and tracked, one after the other in one process on all its cores. Times "
    "count everything that a new pose of the sensor costs. Errors of the exhaustive search, in "
    "frames where there was one, are those of its heaviest mode.",
    row_of,
    charts,
    csv};

int run_moving(const MovingArguments& arguments) {
  const ThreadLimit threads(arguments.threads);
  StudyRun study(kStudy, arguments);
  int failed = 0;
  for (const std::string& path : arguments.scenes) {
    study.add(measure(arguments, path));
    const Run& run = study.units().back();
    for (const Endurance& e : run.endurance) {
      if (std::isnan(e.tracked_ms)) continue;
      arguments.out.text("  %7d poses: %6.0f MB, peak %6.0f MB, tracked %7.1f ms, fit %7.1f ms\n",
                         e.frames, e.resident, e.peak, e.tracked_ms, e.fit_ms);
    }
    for (std::size_t i = 0; i < run.frames.size(); ++i) {
      if (run.frames[i].error.empty()) continue;
      std::fprintf(stderr, "blindcorner: frame %zu: %s\n", i, run.frames[i].error.c_str());
      ++failed;
    }
  }
  study.end();
  return failed > 0 ? kSomeFailed : kAllWell;
}

}  // namespace

void add_moving_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "moving",
      "run time, memory and accuracy with a sensor that stands elsewhere in every frame; writes "
      "moving.csv and moving.html");
  const auto arguments = std::make_shared<MovingArguments>();
  command.add_option("SCENE", arguments->scenes, "scene files")->required();
  command.add_option("-o,--output", arguments->output, "directory to write to");
  command.add_option("--frames", arguments->frames, "sensor poses along the path")
      ->check(positive_number());
  CLI::Option* from = command.add_option(
      "--from", arguments->from, "first pose of the sensor, as of `render`; default: the scene's");
  CLI::Option* to = command.add_option(
      "--to", arguments->to,
      "its last one; default: forward by 0.3 of the distance to the surface that it looks at, "
      "turned by 0.1 rad towards the search region");
  command
      .add_option("--sensor-path", arguments->sensor_path,
                  "table (.csv) of poses that the path leads through, as of `render`")
      ->type_name("FILE")
      ->excludes(from)
      ->excludes(to);
  command
      .add_option("--objects", arguments->objects,
                  "poses of the object drawn from the prior, each for an equal part of the frames")
      ->check(positive_number());
  command.add_option("--pose", arguments->pose, "one pose of the object for all frames instead");
  command
      .add_option("--photons", arguments->photons,
                  "of the object in each frame, over an equal background; 0: the scene's own "
                  "exposure")
      ->check(number_from_zero());
  command
      .add_option("--truth", arguments->truth,
                  "sampling of the captures, in units of the reference renderer's default")
      ->check(CLI::Range(0.1, 10.0));
  command
      .add_option("--exhaustive-every", arguments->exhaustive_every,
                  "an exhaustive search in one frame of so many; 0: never")
      ->check(number_from_zero());
  command.add_option("--density", arguments->exhaustive.density,
                     "points of the exhaustive grid per grid step of the fit");
  command.add_option("--max-poses", arguments->exhaustive.max_poses, "of the exhaustive grid");
  command
      .add_option("--endurance", arguments->endurance,
                  "then so many more sensor poses along the path, for the memory that they take")
      ->check(number_from_zero());
  command.add_option("--tolerance", arguments->fit.model_tolerance,
                     "of the fit's model; default: as each capture asks for");
  command.add_option("--threads", arguments->threads, "threads; 0: one per processor")
      ->check(CLI::Range(0, 1024));
  command.add_option("--seed", arguments->seed, "of poses and photons");
  add_capture_directories(command, arguments->directories);
  arguments->out.add_option(command, "the rows of moving.csv");
  command.callback([arguments, &exit_code] {
    arguments->exhaustive.model_tolerance = arguments->fit.model_tolerance.value_or(kJudge);
    arguments->fit.validate();
    exit_code = run_moving(*arguments);
  });
}

}  // namespace blindcorner
