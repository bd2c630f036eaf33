// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark light`: errors and claims of the fit at every level of light. An
/// independent path tracer computed the light of the captures.
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/credible_level.h"
#include "blindcorner/simulation/traced_scene.h"
#include "commands/benchmark.h"
#include "commands/interrupt.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "commands/synthetic_trials.h"
#include "commands/thread_limit.h"
#include "forward/support/quantile.h"
#include "report/colours.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

/// Tolerance of the model that judges whether an optimum is the right one.
constexpr double kJudge = 0.01;
/// Sampling of rendered objects, in units of the reference renderer's default. At 100,000 photons
/// of the oblique floor, the default is 0.3 to 0.5 standard deviations off a denser sampling. Twice
/// the density takes sixteen times as long.
constexpr double kRenderedSampling = 1;
/// A deviance this many standard deviations above its expectation is a misfit.
constexpr double kMisfit = 5;
constexpr double kRegion = 0.95;

struct LightArguments : StudyArguments {
  LightArguments() { poses = 0; }
  std::string data;
  std::vector<double> photons = {10, 100, 1e3, 1e4, 1e5, 1e6};
  int seeds = 20;
  std::string own_light = "tracer";
  std::string object_light = "tracer";
  std::string captures_directory;
  int threads = 0;
  std::vector<std::string> without;
  bool each_rule = false;
  FitOptions fit;
};

/// Result of one capture.
struct Trial {
  std::string error;                ///< not empty if the fit failed
  double squared = 0, claimed = 0;  ///< m^2, positions: the mean's squared error; covariance trace
  double normalised = 0;            ///< d' C^-1 d / unknowns, for the posterior's mean
  bool in_region = false, in_heaviest = false;
  bool flagged = false, misfit = false;
  double missed = 0;  ///< log posterior that the best mode lacks against the truth's optimum
  double time_ms = 0;
  long evaluations = 0;  ///< number of renders of exact light
  bool wrong() const { return missed > kReached; }
};

/// One scene at one level of light.
struct Row {
  std::string scene;
  std::string without;  ///< rule that was left out, in a table of rules
  double photons = 0;
  double bound = 0, file_limit = 0;  ///< m
  double expected_ratio = 1;         ///< normalised error of an honest fit, with the file's noise
  double first_ms = 0;
  std::vector<Trial> trials;

  int captures() const { return static_cast<int>(trials.size()); }
  template <typename Member>
  int count(Member member) const {
    return static_cast<int>(std::ranges::count_if(
        trials, [&](const Trial& t) { return t.error.empty() && std::invoke(member, t); }));
  }
  int failed() const {
    return static_cast<int>(
        std::ranges::count_if(trials, [](const Trial& t) { return !t.error.empty(); }));
  }
  int fitted() const { return captures() - failed(); }
  /// Root of the mean of a member over the fitted captures.
  double root_mean(double Trial::*member) const {
    double sum = 0;
    for (const Trial& t : trials) sum += t.error.empty() ? t.*member : 0;
    return std::sqrt(sum / fitted());
  }
  double median_of(double (*value)(const Trial&)) const {
    std::vector<double> values;
    for (const Trial& t : trials) {
      if (t.error.empty()) values.push_back(value(t));
    }
    return median(values);
  }
  double median_error() const {
    return median_of([](const Trial& t) { return std::sqrt(t.squared); });
  }
  /// Quantile of the time of the captures after the first.
  double following_ms(double share) const {
    std::vector<double> times;
    for (std::size_t i = 1; i < trials.size(); ++i) {
      if (trials[i].error.empty()) times.push_back(trials[i].time_ms);
    }
    return times.empty() ? first_ms : quantile(times, share);
  }
  double median_evaluations() const {
    return median_of([](const Trial& t) { return static_cast<double>(t.evaluations); });
  }
  template <typename Member>
  double share(Member member) const {
    return static_cast<double>(count(member)) / fitted();
  }
  ShareInterval held() const { return wilson_interval(count(&Trial::in_region), fitted()); }
};

bool is_position(const Unknown& unknown) { return unknown.component <= Component::z; }

/// Whether the result has a flag, except "sampled", which only says how the posterior was computed.
bool warns(const FitResult& result) {
  return std::ranges::any_of(result.flags, [](const std::string& f) { return f != "sampled"; });
}

Trial run_trial(const Fitter& fitter, const ExhaustiveSearch& judge, const Capture& capture,
                const PoseVector& truth) {
  const Scene& scene = fitter.scene();
  Trial trial;
  try {
    const auto start = std::chrono::steady_clock::now();
    const FitResult result = fitter.fit(capture);
    trial.time_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    trial.evaluations = result.renders;
    const PoseMixture& posterior = result.posterior;
    const PoseVector d = pose_error(scene, posterior.mean, truth);
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      const double error = d[static_cast<Eigen::Index>(i)];
      if (is_position(scene.unknowns[i])) trial.squared += error * error;
    }
    trial.claimed = position_trace(scene, posterior.covariance);
    trial.normalised = d.dot(posterior.covariance.ldlt().solve(d)) / static_cast<double>(d.size());
    if (!std::isfinite(trial.squared + trial.claimed + trial.normalised)) {
      throw Error("result", "found a value that is not finite");
    }
    trial.in_region = credible_level(scene, posterior, truth) <= kRegion;
    PoseMixture heaviest = posterior;
    heaviest.modes.resize(1);
    trial.in_heaviest = credible_level(scene, heaviest, truth) <= kRegion;
    trial.flagged = warns(result);
    const GoodnessOfFit& fit = result.goodness_of_fit;
    trial.misfit = fit.deviance > fit.expected + kMisfit * fit.standard_deviation;
    double best = -std::numeric_limits<double>::infinity();
    for (const PoseMode& mode : posterior.modes) {
      best = std::max(best, judge.descend(capture, mode.optimum).log_posterior);
    }
    trial.missed = judge.descend(capture, truth).log_posterior - best;
  } catch (const std::exception& error) {
    trial.error = error.what();
  }
  return trial;
}

/// Bounds of the position's error, root mean square over the poses.
struct Bounds {
  double photon = 0;  ///< m, Cramer-Rao
  double file = 0;    ///< m, from the tracer's own noise, at any exposure
  /// Ratio of the tracer's noise to the photons' noise, as variances, mean over the unknowns. It
  /// adds to the square of the normalised error.
  double against = 0;
};

/// Correlation of the traced light's errors between the bins of a zone, [bins, bins]. A traced path
/// lights all bins under its pulse. The errors of bins d apart therefore overlap as two Gaussian
/// pulses do, by exp(-d^2 / 4 sigma^2).
Eigen::MatrixXd traced_correlation(const Sensor& sensor) {
  const double sigma = sensor.response.core_sigma() / sensor.bin_width;
  Eigen::MatrixXd correlation(sensor.bins, sensor.bins);
  for (int i = 0; i < sensor.bins; ++i) {
    for (int k = 0; k < sensor.bins; ++k) {
      correlation(i, k) = std::exp(-std::pow((i - k) / sigma, 2) / 4);
    }
  }
  return correlation;
}

Bounds bounds_of(const Scene& scene, const TracedCaptures& captures, std::size_t poses,
                 double photons) {
  BoundOptions options;
  options.exposures = captures.exposures(photons);
  options.ambient = captures.ambient();
  const ErrorBound bound(scene, sensor_placement(scene), options);
  const Eigen::MatrixXd correlation = traced_correlation(scene.sensor);
  const double share = 1 / static_cast<double>(poses);
  Bounds mean;
  for (std::size_t i = 0; i < poses; ++i) {
    const PoseVector& pose = captures.traced().poses[i];
    const Eigen::MatrixXd photon = bound.cramer_rao(pose);
    const Eigen::MatrixXd file = bound.carried_error(pose, captures.standard_error(i), correlation);
    mean.photon += share * position_trace(scene, photon);
    mean.file += share * position_trace(scene, file);
    mean.against += share * photon.ldlt().solve(file).trace() / static_cast<double>(pose.size());
  }
  return {std::sqrt(mean.photon), std::sqrt(mean.file), mean.against};
}

std::vector<std::string> light_scenes(const LightArguments& arguments) {
  if (!arguments.scenes.empty()) return arguments.scenes;
  std::vector<std::string> scenes = scene_files({});
  std::erase_if(scenes, [&](const std::string& path) {
    return !fs::path(path).filename().string().starts_with("reference_");
  });
  if (scenes.empty()) throw Error("SCENE", "found none, accepted: scenes of traced light");
  return scenes;
}

void save_captures(const LightArguments& arguments, const Scene& scene, double photons,
                   std::vector<Capture> captures) {
  CaptureFile file;
  file.bin_width = scene.sensor.bin_width;
  file.sensor = scene.sensor.name;
  file.description = scene.name + formatted(", traced light, %g photons of the object", photons);
  file.captures = std::move(captures);
  write_captures(
      (fs::path(arguments.captures_directory) / (scene.name + formatted("_%g.exr", photons)))
          .string(),
      file);
}

nlohmann::json to_json(const std::vector<Row>& rows) {
  nlohmann::json list = nlohmann::json::array();
  for (const Row& r : rows) {
    nlohmann::json trials = nlohmann::json::array();
    for (const Trial& t : r.trials) {
      if (!t.error.empty()) {
        trials.push_back({{"error", t.error}});
        continue;
      }
      trials.push_back({{"position_error_m", std::sqrt(t.squared)},
                        {"claimed_m", std::sqrt(t.claimed)},
                        {"normalised_square", t.normalised},
                        {"in_region", t.in_region},
                        {"in_region_of_heaviest_mode", t.in_heaviest},
                        {"flagged", t.flagged},
                        {"misfit", t.misfit},
                        {"missed_log_posterior", number_or_null(t.missed)},
                        {"time_ms", t.time_ms},
                        {"exact_evaluations", t.evaluations}});
    }
    list.push_back({{"scene", r.scene},
                    {"without", r.without},
                    {"photons", r.photons},
                    {"photon_bound_m", number_or_null(r.bound)},
                    {"file_limit_m", number_or_null(r.file_limit)},
                    {"expected_ratio", number_or_null(r.expected_ratio)},
                    {"first_ms", r.first_ms},
                    {"trials", std::move(trials)}});
  }
  return list;
}

std::vector<Chart> charts(const std::vector<Row>& rows) {
  std::vector<Chart> list;
  for (std::size_t first = 0, end = 0; first < rows.size(); first = end) {
    while (end < rows.size() && rows[end].scene == rows[first].scene) ++end;
    Chart error{rows[first].scene + ": error", "photons of the object", "error of the position, m"};
    error.logarithmic = true;
    error.series = {{"RMS error", {}, SeriesStyle::marked_line},
                    {"claimed", {}, SeriesStyle::marked_line},
                    {"median error", {}, SeriesStyle::marked_line},
                    {"photon bound", {}, SeriesStyle::marked_line}};
    if (rows[first].file_limit > 0) {
      error.rules = {{"noise of the traced light", rows[first].file_limit, false}};
    }
    Chart share{rows[first].scene + ": truth in the 95 % region",
                "log10 of the photons of the object", "share of captures"};
    share.series = {{"posterior", {}, SeriesStyle::marked_line},
                    {"its 95 % interval", {}, SeriesStyle::marked_line, colour::kLine},
                    {"", {}, SeriesStyle::marked_line, colour::kLine}};
    share.rules = {{"95 %", kRegion, false}};
    for (Chart* chart : {&error, &share}) chart->width = 560, chart->height = 330;
    for (std::size_t i = first; i < end; ++i) {
      const Row& r = rows[i];
      if (!r.without.empty()) continue;
      error.series[0].points.push_back({r.photons, r.root_mean(&Trial::squared)});
      error.series[1].points.push_back({r.photons, r.root_mean(&Trial::claimed)});
      error.series[2].points.push_back({r.photons, r.median_error()});
      error.series[3].points.push_back({r.photons, r.bound});
      const double x = std::log10(r.photons);
      share.series[0].points.push_back({x, r.share(&Trial::in_region)});
      share.series[1].points.push_back({x, r.held().low});
      share.series[2].points.push_back({x, r.held().high});
    }
    list.push_back(std::move(error));
    list.push_back(std::move(share));
  }
  return list;
}

TableRow row_of(const Row& r) {
  return {{{"scene", "", "", r.scene},
           {"without", "", "", r.without},
           {"", "scene", "%-28s", r.without.empty() ? r.scene : "  without " + r.without},
           {"photons", "photons", "%8g", r.photons},
           {"captures", "fits", "%5d", r.captures()},
           {"failed", "fail", "%4d", r.failed()},
           {"median_error_m", "median mm", "%9.1f", r.median_error(), 1e3},
           {"rms_error_m", "RMS mm", "%9.1f", r.root_mean(&Trial::squared), 1e3},
           {"claimed_rms_m", "claimed", "%9.1f", r.root_mean(&Trial::claimed), 1e3},
           {"normalised_error", "ratio", "%6.2f", r.root_mean(&Trial::normalised)},
           {"expected_ratio", "(file)", "%6.2f", r.expected_ratio},
           {"in_region", "in 95%", "%6.3f", r.share(&Trial::in_region)},
           {"in_region_low", "", "", r.held().low},
           {"in_region_high", "", "", r.held().high},
           {"in_region_of_heaviest_mode", "mode", "%6.3f", r.share(&Trial::in_heaviest)},
           {"flagged", "flag", "%6.3f", r.share(&Trial::flagged)},
           {"misfit", "misfit", "%6.3f", r.share(&Trial::misfit)},
           {"wrong_optima", "wrong", "%5d", r.count(&Trial::wrong)},
           {"wrong_optima_flagged", "flag", "%4d",
            r.count([](const Trial& t) { return t.wrong() && t.flagged; })},
           {"photon_bound_m", "bound mm", "%9.2f", r.bound, 1e3},
           {"file_limit_m", "file mm", "%9.2f", r.file_limit, 1e3},
           {"first_ms", "first ms", "%9.0f", r.first_ms},
           {"following_median_ms", "median", "%8.1f", r.following_ms(0.5)},
           {"following_90_ms", "90 %", "%8.1f", r.following_ms(0.9)},
           {"following_longest_ms", "longest", "%8.0f", r.following_ms(1)},
           {"exact_evaluations", "exact", "%6.0f", r.median_evaluations()}}};
}

const Study<Row> kStudy{
    "light", "Errors and claims at every level of light",
    "Captures of scenes whose light an independent path tracer computed, photon noise added; "
    "photons are those of the object, averaged over the poses, over an equal background. The "
    "photon bound is the Cramer-Rao bound without priors of the pose, root mean square over the "
    "poses: it falls with the root of the photons, but for what the brightness's prior tells and "
    "what the static background may be off by. The noise of the traced light is the error that the "
    "files' own "
    "standard errors cause, which no number of photons averages out. The 95 % region is that of "
    "highest density of the whole posterior, its interval Wilson's.",
    row_of, charts};

TracedCaptures traced_captures(const LightArguments& arguments, const Scene& scene,
                               const std::string& path) {
  TracedScene traced = read_traced_scene(scene, traced_file(arguments.data, path));
  if (arguments.object_light == "renderer") {
    traced = rendered_objects(scene, traced, kRenderedSampling);
  }
  if (arguments.own_light == "tracer") return {scene, std::move(traced)};
  if (arguments.own_light == "none") {
    const HistogramCube dark(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
    return {scene, std::move(traced), &dark};
  }
  const auto renderer = make_reference_renderer(scene, sensor_placement(scene));
  return {scene, std::move(traced), &renderer->static_background()};
}

/// Adds the rule of that name, if there is one, to the rules that are left out.
void leave_out(const std::string& name, FitOptions& options) {
  for (const auto& [rule, own] : fit_rules()) {
    if (own == name) options.left_out.push_back(rule);
  }
}

/// Rules to leave out in turn, first none. Rules that the arguments leave out are always left out.
std::vector<std::string> rules_to_leave_out(const LightArguments& arguments) {
  std::vector<std::string> rules{""};
  for (const auto& [rule, name] : fit_rules()) {
    if (arguments.each_rule && arguments.fit.uses(rule)) rules.push_back(name);
  }
  return rules;
}

/// A scene's captures at one level of light. They are saved if the arguments name a directory.
std::vector<Capture> captures_of(const LightArguments& arguments, const Scene& scene,
                                 const TracedCaptures& truth, std::size_t poses, double photons) {
  std::vector<Capture> captures(poses * static_cast<std::size_t>(arguments.seeds));
  for (std::size_t i = 0; i < captures.size(); ++i) {
    captures[i] = truth.capture(i % poses, photons, arguments.seed + 1'000'003 * (i + 1));
    captures[i].index = static_cast<int>(i);
  }
  if (!arguments.captures_directory.empty()) save_captures(arguments, scene, photons, captures);
  return captures;
}

/// Fits all these captures with a new fitter, which knows nothing yet.
Row study(const LightArguments& arguments, const Scene& scene, const TracedCaptures& truth,
          std::size_t poses, const ExhaustiveSearch& judge, const std::vector<Capture>& captures,
          double photons, const std::string& without) {
  Row row;
  row.without = without;
  row.scene = scene.name;
  row.photons = photons;
  const std::size_t count = captures.size();
  FitOptions options = arguments.fit;
  leave_out(without, options);
  const Fitter fitter(scene, options);
  Progress progress(scene.name + formatted(", %g photons", photons), count);
  // One after the other, so that each fit is timed with the machine for itself.
  for (std::size_t i = 0; i < count && !Interruptible::asked(); ++i) {
    row.trials.push_back(run_trial(fitter, judge, captures[i], truth.traced().poses[i % poses]));
    progress.advance();
  }
  progress.finish();
  if (!row.trials.empty()) row.first_ms = row.trials.front().time_ms;
  if (row.trials.size() < count) {
    tell_interrupted(row.trials.size(), count,
                     "captures of " + scene.name + formatted(" at %g photons", photons),
                     "the table holds these");
  }
  return row;
}

int run_light(const LightArguments& arguments) {
  const ThreadLimit threads(arguments.threads);
  if (!arguments.captures_directory.empty()) make_directory(arguments.captures_directory);
  StudyRun run(kStudy, arguments);
  int failed = 0;
  const Interruptible interruptible;
  for (const std::string& path : light_scenes(arguments)) {
    Scene scene = read_scene(path);
    if (arguments.own_light == "none") scene.linear.fixed_direct = 0;
    const TracedCaptures truth = traced_captures(arguments, scene, path);
    const std::size_t poses =
        arguments.poses > 0 ? std::min(truth.poses(), static_cast<std::size_t>(arguments.poses))
                            : truth.poses();
    ExhaustiveOptions judging;
    judging.model_tolerance = kJudge;
    judging.max_poses = 1;  // the judge only descends
    const ExhaustiveSearch judge(scene, judging);
    for (const double photons : arguments.photons) {
      if (Interruptible::asked()) return kSomeFailed;
      const Bounds bounds = bounds_of(scene, truth, poses, photons);
      const std::vector<Capture> captures = captures_of(arguments, scene, truth, poses, photons);
      for (const std::string& without : rules_to_leave_out(arguments)) {
        if (Interruptible::asked()) return kSomeFailed;
        Row row = study(arguments, scene, truth, poses, judge, captures, photons, without);
        if (row.trials.empty()) return kSomeFailed;
        row.bound = bounds.photon;
        row.file_limit = bounds.file;
        row.expected_ratio = std::sqrt(1 + bounds.against);
        failed += row.failed();
        for (const Trial& t : row.trials) {
          if (!t.error.empty()) std::fprintf(stderr, "blindcorner: %s\n", t.error.c_str());
        }
        run.add(std::move(row));
        write_atomically((fs::path(arguments.output) / "light.json").string(),
                         to_json(run.units()).dump(1) + "\n");
      }
    }
  }
  run.end();
  return failed > 0 || Interruptible::asked() ? kSomeFailed : kAllWell;
}

}  // namespace

void add_light_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "light",
      "errors and claims of the fit from few photons to many, on light that a path tracer "
      "computed; writes light.csv, light.json and light.html");
  const auto arguments = std::make_shared<LightArguments>();
  const char* data = std::getenv("BLINDCORNER_DATA");
  arguments->data = data != nullptr ? data : "../shared/data";
  command.add_option("SCENE", arguments->scenes,
                     "scene files, reference_NAME.json; default: those in scenes/");
  command.add_option(
      "--data", arguments->data,
      "directory of the traced light, NAME.npz, or one that holds it in mitransient/; "
      "unless told, what BLINDCORNER_DATA says");
  command.add_option("-o,--output", arguments->output, "directory to write to");
  command.add_option("--photons", arguments->photons, "of the object, a list with commas")
      ->delimiter(',')
      ->check(positive_number());
  command.add_option("--poses", arguments->poses, "first poses of each file; 0: all")
      ->check(number_from_zero());
  command.add_option("--seeds", arguments->seeds, "captures of each pose")
      ->check(positive_number());
  command.add_option("--seed", arguments->seed, "of the photons");
  command
      .add_option("--own-light", arguments->own_light,
                  "whose light of the known scene the captures hold: the tracer's, whose time "
                  "discretisation is up to 1 % of a bin off, the reference renderer's, or none")
      ->check(CLI::IsMember({"tracer", "renderer", "none"}));
  command
      .add_option("--object-light", arguments->object_light,
                  "whose light of the object they hold: the tracer's, or the reference renderer's "
                  "at the same poses, which has no noise of its own")
      ->check(CLI::IsMember({"tracer", "renderer"}));
  command.add_option("--tolerance", arguments->fit.model_tolerance,
                     "of the fit's model; default: as each capture asks for");
  std::vector<std::string> names;
  for (const auto& [rule, name] : fit_rules()) names.push_back(name);
  command
      .add_option("--without", arguments->without,
                  "rules of the fit that are left out, a list with commas")
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  command.add_flag("--each-rule", arguments->each_rule,
                   "a further row for each rule of the fit: the same captures without it");
  command.add_option("--threads", arguments->threads, "threads; 0: one per processor")
      ->check(CLI::Range(0, 1024));
  command.add_option("--save-captures", arguments->captures_directory,
                     "directory for the captures, a file for each scene and number of photons");
  arguments->out.add_option(command, "the rows of light.csv");
  command.callback([arguments, &exit_code] {
    for (const std::string& name : arguments->without) leave_out(name, arguments->fit);
    arguments->fit.validate();
    exit_code = run_light(*arguments);
  });
}

}  // namespace blindcorner
