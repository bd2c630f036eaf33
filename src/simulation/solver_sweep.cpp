// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/solver_sweep.h"

#include <tbb/task_arena.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "blindcorner/inverse/posterior/evaluation.h"
#include "blindcorner/simulation/claim_study.h"
#include "blindcorner/simulation/claim_tests.h"
#include "blindcorner/simulation/pareto_front.h"
#include "blindcorner/simulation/traced_scene.h"
#include "forward/support/parallel.h"
#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

/// Tolerance of the bound's model, whose own error must not show in an efficiency.
constexpr double kBoundTolerance = 0.02;
/// The least allowed number of empty captures, because the bound's probability of detection is not
/// needed.
constexpr int kFewestEmptyCaptures = 16;
/// Number of errors drawn from the bound of each capture, for the quantiles of a method at the
/// bound.
constexpr int kDrawnErrors = 200;
constexpr double kClaimedRegion = 0.95, kRightRegion = 0.99;
/// Probability that any of the intervals of ratios to the default is wrong.
constexpr double kFamily = 0.05;
/// Level of the sign test for regions that hold the truth less often than the default's.
constexpr double kHoldsLess = 0.01;
/// A smaller error counts as this, m: it is as good as none.
constexpr double kNoDistance = 1e-9;
/// Seeds of captures are far apart.
constexpr std::uint64_t kCaptureSeed = 1'000'003, kLevelSeed = 7'919'000'017;

const double kNone = std::numeric_limits<double>::quiet_NaN();

struct Clocks {
  double cpu = 0, wall = 0;  ///< s
};

/// CPU time of all threads of the process, and wall-clock time. Nothing else may run in the
/// process.
Clocks now() {
  timespec cpu{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
  return {
      static_cast<double>(cpu.tv_sec) + 1e-9 * static_cast<double>(cpu.tv_nsec),
      std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count()};
}

Clocks operator-(const Clocks& a, const Clocks& b) { return {a.cpu - b.cpu, a.wall - b.wall}; }

/// Judges the answers of the sweep.
struct Judge {
  const Scene& scene;
  std::vector<std::string> names = unknown_names(scene);
  double right_distance = boost::math::quantile(
      boost::math::chi_squared_distribution<double>(static_cast<double>(scene.unknowns.size())),
      kRightRegion);

  double distance(const PoseVector& pose, const PoseVector& truth) const {
    return distance_of(pose_error(scene, pose, truth), names);
  }

  void judge(const SweepAnswer& answer, const PoseVector& truth, std::uint64_t seed,
             SweepTrial& trial) const {
    if (!answer.pose.allFinite()) throw Error("answer", "found a value that is not finite");
    trial.distance = distance(answer.pose, truth);
    if (!answer.posterior || answer.posterior->modes.empty()) return;
    trial.level = credible_level(scene, *answer.posterior, truth, 2000, seed);
    const PoseMode& heaviest = answer.posterior->modes.front();
    const PoseVector d = pose_error(scene, heaviest.pose, truth);
    trial.right = d.dot(heaviest.covariance.ldlt().solve(d)) <= right_distance;
    trial.of_heaviest = distance(heaviest.pose, truth);
  }
};

/// Asks a method for one answer. The time of the first answer includes the method's preparation and
/// is kept separately.
void ask(const Judge& judge, const SweptMethod& method, const Capture& capture,
         const DrawnObject& object, std::uint64_t seed, SweepAnswerer& answerer, bool first,
         SweepCell& cell) {
  SweepTrial trial;
  try {
    SweepAnswer answer;
    tbb::task_arena arena(method.threads);
    const Clocks start = now();
    arena.execute([&] {
      if (!answerer) answerer = method.make();
      answer = answerer(capture);
    });
    const Clocks time = now() - start;
    trial.cpu = first ? kNone : time.cpu;
    trial.wall = first ? kNone : time.wall;
    if (first) {
      cell.first_cpu = time.cpu;
      cell.first_wall = time.wall;
    }
    judge.judge(answer, object.pose, seed, trial);
  } catch (const std::exception& error) {
    trial.error = error.what();
  }
  cell.trials.push_back(std::move(trial));
}

/// The covariance's rows and columns for the positions among the unknowns.
Eigen::MatrixXd of_positions(const Scene& scene, const Eigen::MatrixXd& covariance) {
  std::vector<Eigen::Index> places;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].component <= Component::z) places.push_back(static_cast<Eigen::Index>(i));
  }
  return covariance(places, places);
}

/// Adds the bound of each capture, and the quantiles of normal errors at the bound.
void add_bounds(const Scene& scene, const std::vector<DrawnObject>& objects, std::uint64_t seed,
                SweepLevel& level) {
  BoundOptions options;
  options.exposures = level.exposure.exposures;
  options.ambient = level.exposure.ambient;
  options.test_poses = 1;
  options.empty_captures = kFewestEmptyCaptures;
  options.model_tolerance = kBoundTolerance;
  const ErrorBound bound(scene, sensor_placement(scene), options);
  const double expected = scene.linear.amplitude == LinearMode::fixed
                              ? scene.linear.fixed_amplitude
                              : scene.linear.amplitude_prior.median;
  std::vector<Eigen::MatrixXd> covariances(objects.size());
  parallel_for(std::size_t{0}, objects.size(), [&](std::size_t i) {
    covariances[i] =
        of_positions(scene, bound.at(objects[i].pose, objects[i].amplitude / expected).with_prior);
  });
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> errors;
  double squares = 0;
  for (const Eigen::MatrixXd& covariance : covariances) {
    squares += covariance.trace();
    level.bound.push_back(std::sqrt(covariance.trace()));
    const Eigen::MatrixXd factor = covariance.llt().matrixL();
    for (int d = 0; d < kDrawnErrors; ++d) {
      errors.push_back((factor * Eigen::VectorXd::NullaryExpr(factor.rows(), [&] {
                          return normal(random);
                        })).norm());
    }
  }
  level.bound_rms = std::sqrt(squares / static_cast<double>(covariances.size()));
  level.bound_median = quantile(errors, 0.5);
  level.bound_p90 = quantile(errors, 0.9);
}

SweepLevel sweep_level(const Scene& scene, const std::vector<SweptMethod>& methods,
                       const std::vector<DrawnObject>& objects, const Exposure& exposure,
                       double pulse, std::uint64_t seed, const std::function<void()>& advance) {
  SweepLevel level;
  level.exposure = exposure;
  add_bounds(scene, objects, seed, level);
  const Judge judge{scene};
  level.cells.resize(methods.size());
  std::vector<SweepAnswerer> answerers(methods.size());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const std::uint64_t own = seed + kCaptureSeed * (i + 1);
    const Capture capture = capture_of(scene, objects[i], exposure, own);
    for (std::size_t m = 0; m < methods.size(); ++m) {
      ask(judge, methods[m], capture, objects[i], own, answerers[m], i == 0, level.cells[m]);
      if (advance) advance();
    }
  }
  for (const SweepCell& cell : level.cells) {
    level.figures.push_back(figures_of(cell, level.bound, pulse, seed));
  }
  return level;
}

double root_mean_square(const std::vector<double>& values) {
  double squares = 0;
  for (const double v : values) squares += v * v;
  return values.empty() ? kNone : std::sqrt(squares / static_cast<double>(values.size()));
}

double quantile_or_none(const std::vector<double>& values, double share) {
  return values.empty() ? kNone : quantile(values, share);
}

/// Mean over clusters of each cluster's mean value, with its interval by Student's t.
struct ClusteredMean {
  double mean = kNone, low = kNone, high = kNone;
};
ClusteredMean clustered_mean(const std::vector<std::vector<double>>& clusters, double confidence) {
  std::vector<double> means;
  for (const std::vector<double>& cluster : clusters) {
    if (cluster.empty()) continue;
    double sum = 0;
    for (const double v : cluster) sum += v;
    means.push_back(sum / static_cast<double>(cluster.size()));
  }
  if (means.size() < 2) return {};
  const auto n = static_cast<double>(means.size());
  double mean = 0, squares = 0;
  for (const double m : means) mean += m / n;
  for (const double m : means) squares += (m - mean) * (m - mean);
  const double half = boost::math::quantile(boost::math::students_t(n - 1), (1 + confidence) / 2) *
                      std::sqrt(squares / (n - 1) / n);
  return {mean, mean - half, mean + half};
}

/// Logarithms of ratios to the default, gathered over scenes and levels.
struct RatioSums {
  SweepRatio ratio;
  std::vector<std::vector<double>> error, time;  ///< [objects of all scenes][levels]
  std::vector<double> wall, first;
  int claims = 0, held = 0, right = 0;
};

void add_cell(const SweepCell& cell, const SweepCell& of_default, std::size_t objects_before,
              RatioSums& sums) {
  const auto add = [](double value, double base, std::vector<double>& logs) {
    if (value > 0 && base > 0) logs.push_back(std::log(value / base));
  };
  add(cell.first_cpu, of_default.first_cpu, sums.first);
  if (sums.error.size() < objects_before + cell.trials.size()) {
    sums.error.resize(objects_before + cell.trials.size());
    sums.time.resize(objects_before + cell.trials.size());
  }
  for (std::size_t i = 0; i < cell.trials.size(); ++i) {
    const SweepTrial &own = cell.trials[i], &base = of_default.trials[i];
    if (!own.error.empty() || !base.error.empty()) continue;
    ++sums.ratio.captures;
    sums.error[objects_before + i].push_back(
        std::log(std::max(own.distance, kNoDistance) / std::max(base.distance, kNoDistance)));
    add(own.cpu, base.cpu, sums.time[objects_before + i]);
    add(own.wall, base.wall, sums.wall);
    if (!own.level) continue;
    ++sums.claims;
    const bool held = *own.level <= kClaimedRegion;
    const bool base_held = base.level && *base.level <= kClaimedRegion;
    sums.held += held ? 1 : 0;
    sums.right += own.right ? 1 : 0;
    sums.ratio.held_alone += held && !base_held ? 1 : 0;
    sums.ratio.default_alone += !held && base_held ? 1 : 0;
  }
}

double geometric_mean(const std::vector<double>& logs) {
  double sum = 0;
  for (const double v : logs) sum += v;
  return logs.empty() ? kNone : std::exp(sum / static_cast<double>(logs.size()));
}

SweepRatio ratio_of(const RatioSums& sums, double confidence) {
  SweepRatio ratio = sums.ratio;
  const ClusteredMean error = clustered_mean(sums.error, confidence);
  ratio.error = std::exp(error.mean);
  ratio.error_low = std::exp(error.low);
  ratio.error_high = std::exp(error.high);
  const ClusteredMean time = clustered_mean(sums.time, confidence);
  ratio.time = std::exp(time.mean);
  ratio.time_low = std::exp(time.low);
  ratio.time_high = std::exp(time.high);
  ratio.wall = geometric_mean(sums.wall);
  ratio.first_time = geometric_mean(sums.first);
  ratio.coverage = sums.claims > 0 ? static_cast<double>(sums.held) / sums.claims : kNone;
  ratio.right = sums.claims > 0 ? static_cast<double>(sums.right) / sums.claims : kNone;
  return ratio;
}

/// Whether no method at this level of light is both cheaper than the default and better, beyond the
/// intervals.
bool default_on_front(const SweepLevel& level, double confidence) {
  return std::ranges::none_of(level.cells, [&](const SweepCell& cell) {
    RatioSums sums;
    add_cell(cell, level.cells.front(), 0, sums);
    const SweepRatio ratio = ratio_of(sums, confidence);
    return ratio.cheaper() && ratio.better();
  });
}

/// Draws objects from the priors, or takes the traced objects in turn.
std::vector<DrawnObject> objects_of(const Scene& scene, const SweepOptions& options) {
  if (options.traced.empty()) {
    DrawOptions draw;
    draw.objects = options.captures;
    draw.light = options.light;
    draw.sampling = options.sampling;
    draw.wrong = options.wrong;
    draw.seed = options.seed;
    return draw_objects(scene, draw);
  }
  const TracedScene traced = read_traced_scene(scene, options.traced);
  std::vector<DrawnObject> objects;
  for (int i = 0; i < options.captures; ++i) {
    const std::size_t pose = static_cast<std::size_t>(i) % traced.poses.size();
    objects.push_back({traced.poses[pose], 1.0, object_light(traced, pose), traced.empty.mean});
  }
  return objects;
}

}  // namespace

void SweepOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("SweepOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(captures >= 2, "captures", "at least 2, of which the first is timed by itself");
  require(!photons.empty(), "photons", "at least one");
  require(std::ranges::all_of(photons, [](double p) { return p > 0 && std::isfinite(p); }),
          "photons", "above 0");
}

SweepScene sweep_scene(const Scene& scene, const std::vector<SweptMethod>& methods,
                       const SweepOptions& options, const std::function<void()>& advance) {
  options.validate();
  const std::vector<DrawnObject> objects = objects_of(scene, options);
  SweepScene sweep;
  sweep.name = scene.name;
  sweep.file = scene.path;
  sweep.methods = methods;
  sweep.pulse =
      kSpeedOfLight * 2 * std::sqrt(2 * std::log(2.0)) * scene.sensor.response.core_sigma();
  FastModelOptions fast;
  fast.tolerance = kBoundTolerance;
  const auto model = make_fast_model(scene, sensor_placement(scene), fast);
  std::uint64_t seed = options.seed;
  try {
    for (const double photons : options.photons) {
      seed += kLevelSeed;
      const Exposure exposure = exposure_for(scene, *model, photons, options.seed);
      sweep.levels.push_back(
          sweep_level(scene, methods, objects, exposure, sweep.pulse, seed, advance));
      sweep.levels.back().photons = photons;
    }
  } catch (const StudyInterrupted&) {  // the sweep keeps the finished levels
  }
  return sweep;
}

SweepFigures figures_of(const SweepCell& cell, const std::vector<double>& bound, double pulse,
                        std::uint64_t seed) {
  SweepFigures figures;
  std::vector<double> distances, cpu, wall, right, squared_ratios;
  for (std::size_t i = 0; i < cell.trials.size(); ++i) {
    const SweepTrial& trial = cell.trials[i];
    if (!trial.error.empty()) {
      ++figures.failures;
      continue;
    }
    ++figures.answers;
    distances.push_back(trial.distance);
    if (std::isfinite(trial.cpu)) {
      cpu.push_back(trial.cpu);
      wall.push_back(trial.wall);
    }
    if (!trial.level) continue;
    ++figures.claims;
    figures.held += *trial.level <= kClaimedRegion ? 1 : 0;
    if (!trial.right) continue;
    ++figures.right;
    right.push_back(trial.of_heaviest);
    if (bound[i] < kFineBound * pulse) {
      squared_ratios.push_back(std::pow(trial.of_heaviest / bound[i], 2));
    }
  }
  figures.median = quantile_or_none(distances, 0.5);
  figures.p90 = quantile_or_none(distances, 0.9);
  figures.rms = root_mean_square(distances);
  figures.following_cpu = quantile_or_none(cpu, 0.5);
  figures.following_wall = quantile_or_none(wall, 0.5);
  figures.right_rms = root_mean_square(right);
  const BootstrapInterval efficiency = bootstrap(
      squared_ratios,
      [](const std::vector<double>& squares) {
        return std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) /
                         static_cast<double>(squares.size()));
      },
      seed);
  figures.efficiency = efficiency.value;
  figures.efficiency_low = efficiency.low;
  figures.efficiency_high = efficiency.high;
  figures.efficiency_captures = static_cast<int>(squared_ratios.size());
  return figures;
}

bool SweepRatio::holds_less() const {
  // Probability that so few of the differing captures are held by this method alone, if both
  // methods were alike.
  const int differing = held_alone + default_alone;
  if (differing == 0) return false;
  const boost::math::binomial_distribution<double> alike(differing, 0.5);
  return boost::math::cdf(alike, held_alone) < kHoldsLess;
}

SweepVerdict verdict_of(const std::vector<SweepScene>& scenes) {
  SweepVerdict verdict;
  std::vector<RatioSums> sums;
  std::map<std::string, std::size_t> places;  // index into `sums` by the method's name
  std::size_t objects = 0;
  for (const SweepScene& scene : scenes) {
    for (std::size_t m = 0; m < scene.methods.size(); ++m) {
      const SweptMethod& method = scene.methods[m];
      const auto [place, fresh] = places.try_emplace(method.name, sums.size());
      if (fresh) {
        sums.emplace_back();
        sums.back().ratio.name = method.name;
        sums.back().ratio.varies = method.varies;
        sums.back().ratio.solver = method.solver;
      }
      for (const SweepLevel& level : scene.levels) {
        add_cell(level.cells[m], level.cells.front(), objects, sums[place->second]);
      }
    }
    verdict.pictures += static_cast<int>(scene.levels.size());
    if (!scene.levels.empty()) objects += scene.levels.front().bound.size();
  }
  // Each method except the default has an interval for its time and one for its error.
  const int intervals = 2 * (static_cast<int>(sums.size()) - 1);
  for (const SweepScene& scene : scenes) {
    for (const SweepLevel& level : scene.levels) {
      const double confidence = bonferroni(1 - kFamily, intervals * verdict.pictures);
      verdict.on_front += default_on_front(level, confidence) ? 1 : 0;
    }
  }
  std::vector<CostAndError> points;
  for (const RatioSums& one : sums) {
    verdict.ratios.push_back(ratio_of(one, bonferroni(1 - kFamily, intervals)));
    points.push_back({verdict.ratios.back().time, verdict.ratios.back().error});
  }
  verdict.front = pareto_front(points);
  for (std::size_t i = 1; i < verdict.ratios.size(); ++i) {
    const SweepRatio& ratio = verdict.ratios[i];
    if (!ratio.cheaper()) continue;
    if (ratio.better()) verdict.better.push_back(i);
    if (!ratio.better() && !ratio.worse()) verdict.level.push_back(i);
  }
  return verdict;
}

std::string SweepVerdict::headline() const {
  const auto names = [&](const std::vector<std::size_t>& places) {
    std::string list;
    for (const std::size_t i : places) list += (list.empty() ? "" : ", ") + ratios[i].name;
    return list;
  };
  std::string text;
  if (!better.empty()) {
    text =
        "The default is not on the front: " + names(better) + " costs less with a smaller error.";
  } else if (level.empty()) {
    text = "The default is on the front: whatever costs less has a larger error.";
  } else {
    text =
        "The default is on the front within the intervals: nothing that costs less has a smaller "
        "error beyond them. Not told from it: " +
        names(level) + "; what else costs less has a larger error.";
  }
  char counts[160];
  std::snprintf(counts, sizeof counts,
                " At single levels of light, within the wider intervals of each, it is on the "
                "front in %d of %d.",
                on_front, pictures);
  return text + counts;
}

std::vector<std::string> SweepVerdict::remarks() const {
  std::vector<std::string> lines;
  const auto add = [&](const std::vector<std::size_t>& places, const char* what) {
    for (const std::size_t i : places) {
      const SweepRatio &r = ratios[i], &own = ratios.front();
      char line[320];
      std::snprintf(line, sizeof line,
                    "%s: %s; %.2f of the time (%.2f to %.2f), %.3f of the error (%.3f to %.3f)",
                    r.name.c_str(), what, r.time, r.time_low, r.time_high, r.error, r.error_low,
                    r.error_high);
      lines.emplace_back(line);
      if (!std::isfinite(r.coverage)) continue;
      std::snprintf(line, sizeof line,
                    "; its 95 %% regions held the truth in %.1f %% (the default's: %.1f %%; only "
                    "its own in %d captures, only the default's in %d%s)",
                    100 * r.coverage, 100 * own.coverage, r.held_alone, r.default_alone,
                    r.holds_less() ? ": less often, beyond chance" : "");
      lines.back() += line;
    }
  };
  add(better, "cheaper, with a smaller error");
  add(level, "cheaper, with an error that these captures do not tell from the default's");
  return lines;
}

}  // namespace blindcorner
