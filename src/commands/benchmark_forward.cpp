// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark forward`: error of the forward models against run time.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>

#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/benchmark.h"
#include "commands/cpu_clock.h"
#include "commands/number_check.h"
#include "commands/progress.h"
#include "forward/support/parallel.h"
#include "forward/support/quantile.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

/// Sampling steps of the fast model, in units of the steps that its closed-form estimates ask for
/// at a tolerance of 1 %.
constexpr double kSamplingSteps[] = {16, 11.3, 8, 5.66, 4, 2.83, 2, 1.41, 1, 0.71, 0.5};
constexpr double kSamplingTolerance = 0.01;
/// Tolerances that a user may ask for; the model finds its sampling itself.
constexpr double kTolerances[] = {0.3, 0.1, 0.04, 0.02, 0.01};
/// Samplings of the reference renderer in units of its own default.
constexpr double kReferenceScales[] = {0.3, 0.45, 0.7, 1.0};
/// Processor time that the timing of one setting takes at most, s.
constexpr double kTimingSeconds = 0.2;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct ForwardArguments : StudyArguments {
  double truth = 1.4;       ///< sampling of the truth, in units of the reference's default
  double slowest_ms = 500;  ///< finer settings are left out once one takes longer
};

struct Setting {
  std::string model, name;
  double relay = 0, object = 0;
  double microseconds = 0, relative_l2 = 0, worst_bin = 0;
};

/// The true light of one scene, and the noise of one capture relative to it.
struct Truth {
  std::vector<PoseVector> poses;
  std::vector<HistogramCube> light;
  double noise_l2 = 0;    ///< root of the summed variances over the root of the summed squares
  double noise_peak = 0;  ///< standard deviation of the brightest bin over its light
};

/// Adds the noise of one capture relative to the object's light. A smaller error of a model hides
/// behind this noise.
void add_noise(const Scene& scene, const HistogramCube& direct, Truth& truth) {
  double variance = 0, square = 0, peak = 0, peak_variance = 0;
  const LinearValues linear{scene.linear.fixed_amplitude, scene.linear.fixed_ambient,
                            scene.linear.fixed_direct};
  for (const HistogramCube& light : truth.light) {
    const HistogramCube counts = expected_counts(scene, light, direct, linear);
    for (int z = 0; z < light.zones(); ++z) {
      const Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
      if (zone.dead) continue;
      for (int k = zone.first_valid_bin; k < scene.sensor.valid_end(z); ++k) {
        const double signal = zone.gain * linear.amplitude * light.zone(z)[k];
        const double v = count_variance(scene.sensor, z, counts.zone(z)[k]);
        variance += v;
        square += signal * signal;
        if (signal > peak) {
          peak = signal;
          peak_variance = v;
        }
      }
    }
  }
  truth.noise_l2 = std::sqrt(variance / square);
  truth.noise_peak = std::sqrt(peak_variance) / peak;
}

Truth make_truth(const ForwardArguments& arguments, const Scene& scene,
                 const SensorPlacement& sensor) {
  Truth truth;
  std::mt19937_64 random(arguments.seed);
  const auto fast = make_fast_model(scene, sensor, at_tolerance(0.3));
  std::vector<double> totals;
  std::mt19937_64 typical(arguments.seed + 1);
  for (int i = 0; i < 32; ++i) totals.push_back(total_light(*fast, draw_pose(scene, typical)));
  // Errors are relative, so poses that are all but dark say nothing.
  const double least = 0.1 * median(totals);
  while (static_cast<int>(truth.poses.size()) < arguments.poses) {
    const PoseVector pose = draw_pose(scene, random);
    if (total_light(*fast, pose) >= least) truth.poses.push_back(pose);
  }
  const auto reference =
      make_reference_renderer(scene, sensor, reference_sampling(arguments.truth));
  truth.light.resize(truth.poses.size());
  Progress progress(scene.name + ": truth", truth.poses.size());
  parallel_for(std::size_t{0}, truth.poses.size(), [&](std::size_t i) {
    reference->three_bounce(truth.poses[i], truth.light[i]);
    progress.advance();
  });
  progress.finish();
  add_noise(scene, reference->static_background(), truth);
  return truth;
}

/// Median processor time of an evaluation and its error against the truth.
Setting run(const ForwardModel& model, const Truth& truth) {
  Setting setting;
  double square = 0;
  std::vector<double> times;
  HistogramCube light;
  const double start = cpu_seconds();
  for (std::size_t i = 0; i < truth.poses.size(); ++i) {
    const double before = cpu_seconds();
    model.three_bounce(truth.poses[i], light);
    times.push_back(cpu_seconds() - before);
    double difference = 0, norm = 0, peak = 0, worst = 0;
    for (std::size_t k = 0; k < light.values.size(); ++k) {
      const double d = light.values[k] - truth.light[i].values[k];
      difference += d * d;
      norm += truth.light[i].values[k] * truth.light[i].values[k];
      peak = std::max(peak, truth.light[i].values[k]);
      worst = std::max(worst, std::abs(d));
    }
    square += difference / norm / static_cast<double>(truth.poses.size());
    setting.worst_bin = std::max(setting.worst_bin, worst / peak);
  }
  setting.relative_l2 = std::sqrt(square);
  for (std::size_t i = 0; cpu_seconds() - start < kTimingSeconds; ++i) {
    const double before = cpu_seconds();
    model.three_bounce(truth.poses[i % truth.poses.size()], light);
    times.push_back(cpu_seconds() - before);
  }
  setting.microseconds = 1e6 * median(times);
  return setting;
}

std::vector<Setting> study(const ForwardArguments& arguments, const Scene& scene,
                           const SensorPlacement& sensor, const Truth& truth) {
  std::vector<Setting> settings;
  Progress progress(
      scene.name + ": settings",
      2 * std::size(kSamplingSteps) + std::size(kTolerances) + std::size(kReferenceScales));
  const auto add = [&](Setting setting, const std::string& model, const std::string& name,
                       const ForwardModel& of) {
    setting.model = model;
    setting.name = name;
    const SamplingStep sampling_step = of.sampling_step().value_or(SamplingStep{0, 0});
    setting.relay = sampling_step.relay;
    setting.object = sampling_step.object;
    settings.push_back(setting);
    progress.advance();
    return setting.microseconds < 1e3 * arguments.slowest_ms;
  };
  bool narrow_lobe = false;
  const auto add_sampling_steps = [&](bool pairs) {
    for (const double sampling_step : kSamplingSteps) {
      FastModelOptions options = at_tolerance(kSamplingTolerance);
      options.sampling_step = SamplingStep{sampling_step, sampling_step, pairs};
      const auto model = make_fast_model(scene, sensor, options);
      if (pairs && model->plan().kernel != Kernel::retro_pairs) break;  // there is no lobe
      narrow_lobe = narrow_lobe || model->plan().kernel == Kernel::retro_single;
      const std::string name = formatted("sampling step %g", sampling_step);
      if (!add(run(*model, truth), pairs ? "fast with lobe pairs" : "fast", name, *model)) break;
    }
  };
  add_sampling_steps(false);
  if (narrow_lobe) {
    add_sampling_steps(true);
  } else {
    progress.advance(std::size(kSamplingSteps));
  }
  for (const double tolerance : kTolerances) {
    const auto model = make_fast_model(scene, sensor, at_tolerance(tolerance));
    const std::string name = formatted("tolerance %g", tolerance);
    if (!add(run(*model, truth), "fast at tolerance", name, *model)) break;
  }
  for (const double scale : kReferenceScales) {
    const auto model = make_reference_renderer(scene, sensor, reference_sampling(scale));
    if (!add(run(*model, truth), "reference", formatted("sampling %g", scale), *model)) break;
  }
  progress.finish();
  return settings;
}

/// A scene with all its settings.
struct SceneStudy {
  std::string scene;
  Truth truth;
  std::vector<Setting> settings;

  /// Microseconds of the cheapest setting whose error is at most 1 %, of the fast model or of the
  /// reference. NaN: there is none.
  double cheapest(bool fast) const {
    double best = kNone;
    for (const Setting& s : settings) {
      if ((s.model == "reference") == fast || s.relative_l2 > 0.01) continue;
      if (!(s.microseconds >= best)) best = s.microseconds;
    }
    return best;
  }
  /// A figure of the fast model at a tolerance of 1 %. NaN: it was not measured.
  double asked(double Setting::*what) const {
    const auto found = std::ranges::find(settings, "tolerance 0.01", &Setting::name);
    return found == settings.end() ? kNone : (*found).*what;
  }
};

std::string csv(const std::vector<SceneStudy>& studies) {
  std::string text =
      "scene,model,setting,relay_step,object_step,microseconds,relative_l2,worst_bin,"
      "noise_relative_l2,noise_peak_bin\n";
  for (const auto& [scene, truth, settings] : studies) {
    for (const Setting& s : settings) {
      text += formatted("%s,%s,%s,%g,%g,%.5g,%.5g,%.5g,%.5g,%.5g\n", scene.c_str(), s.model.c_str(),
                        s.name.c_str(), s.relay, s.object, s.microseconds, s.relative_l2,
                        s.worst_bin, truth.noise_l2, truth.noise_peak);
    }
  }
  return text;
}

/// A noise of at least this many times the largest error is stated in the title, not drawn.
constexpr double kFarAbove = 10;

std::vector<Chart> charts(const std::vector<SceneStudy>& studies) {
  std::vector<Chart> list;
  for (const auto& [scene, truth, settings] : studies) {
    for (const bool worst : {false, true}) {
      const auto error = [&](const Setting& s) { return worst ? s.worst_bin : s.relative_l2; };
      double largest = 0;
      for (const Setting& s : settings) largest = std::max(largest, error(s));
      if (largest <= 0) continue;
      Chart chart{scene + (worst ? ": worst bin" : ": relative L2"),
                  "microseconds an evaluation, one core",
                  worst ? "largest error / peak" : "relative L2 error"};
      chart.logarithmic = true;
      chart.width = 560;
      chart.height = 330;
      // Noise far above all errors would press them into a corner.
      const double noise = worst ? truth.noise_peak : truth.noise_l2;
      if (noise < kFarAbove * largest) {
        chart.rules = {{"noise of one capture", noise, false}};
      } else {
        chart.title += formatted(", noise of one capture %.2g", noise);
      }
      for (const Setting& s : settings) {
        if (chart.series.empty() || chart.series.back().name != s.model) {
          const bool joined = s.model != "fast at tolerance";
          chart.series.push_back(
              {s.model, {}, joined ? SeriesStyle::marked_line : SeriesStyle::circles});
        }
        chart.series.back().points.push_back({s.microseconds, error(s), s.name});
      }
      list.push_back(std::move(chart));
    }
  }
  return list;
}

TableRow row_of(const SceneStudy& s) {
  return {{{"", "scene", "%-18s", s.scene},
           {"", "at 1 %, us", "%12.4g", s.asked(&Setting::microseconds)},
           {"", "rel. L2, %", "%10.2g", s.asked(&Setting::relative_l2), 100},
           {"", "fast 1 %, us", "%14.4g", s.cheapest(true)},
           {"", "reference, us", "%14.4g", s.cheapest(false)},
           {"", "ratio", "%9.0f", s.cheapest(false) / s.cheapest(true)},
           {"", "noise, %", "%9.2g", s.truth.noise_l2, 100}}};
}

const Study<SceneStudy> kStudy{
    "forward",
    "Error of the forward model against run time",
    "Each point is one sampling of the fast model or of the reference renderer, its error measured "
    "against a denser reference. Below the dashed line, the noise of one capture at the scene's "
    "own counts, more time stops paying; where it lies far above all errors, the title tells it. "
    "Relay points with a measured law are one formula, without an error and a picture.",
    row_of,
    charts,
    csv};

int run_forward(const ForwardArguments& arguments) {
  StudyRun run(kStudy, arguments);
  for_each_scene(arguments, [&](const Scene& scene, const SensorPlacement& sensor) {
    Truth truth = make_truth(arguments, scene, sensor);
    std::vector<Setting> settings = study(arguments, scene, sensor, truth);
    run.add({scene.name, std::move(truth), std::move(settings)});
  });
  run.end();
  return kAllWell;
}

}  // namespace

void add_forward_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "forward",
      "error of the forward models against run time; writes forward.csv and "
      "forward.html");
  const auto arguments = std::make_shared<ForwardArguments>();
  add_study_options(command, *arguments, 1000);
  command
      .add_option("--truth", arguments->truth,
                  "sampling of the truth, in units of the reference renderer's default")
      ->check(CLI::Range(0.1, 10.0));
  command
      .add_option("--slowest-ms", arguments->slowest_ms,
                  "finer settings of a model are left out once one takes longer")
      ->check(positive_number());
  command.callback([arguments, &exit_code] { exit_code = run_forward(*arguments); });
}

}  // namespace blindcorner
