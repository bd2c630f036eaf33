// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/calibration/calibration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "inverse/calibration/calibration_problem.h"
#include "inverse/calibration/calibration_report.h"
#include "inverse/calibration/capture_statistics.h"
#include "inverse/calibration/layout_search.h"
#include "inverse/calibration/noise_estimate.h"
#include "inverse/calibration/static_background.h"
#include "inverse/calibration/variance_scale.h"

namespace blindcorner {
namespace {

/// Rounds that fit the parameters and then learn from the residuals. The first one has the stated
/// noise and bins, the second one the noise that the first left, and the third one the bins that
/// are usable at the second's noise.
constexpr int kRounds = 3;
/// Most steps of Levenberg and Marquardt in a round, which stops before when it gains no more. By
/// judgement: the next round goes on from where a round stopped.
constexpr int kIterations = 8;

/// True pose of a capture in the order of the scene's unknowns.
PoseVector true_pose(const Scene& scene, const Capture& capture, std::size_t index) {
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  Eigen::Index i = 0;
  for (const std::string& name : unknown_names(scene)) {
    const auto known = capture.truth.find(name);
    if (known == capture.truth.end()) {
      throw Error(capture.source + " capture " + std::to_string(index),
                  "truth." + name +
                      ": found nothing, accepted: the true value of every unknown "
                      "(or captures without an object)");
    }
    pose[i++] = known->second;
  }
  return pose;
}

/// Marks zones dead that never count anything while others do: they carry no information. Returns a
/// line that names them; empty: there are none.
std::string find_dead_zones(const std::vector<Capture>& captures, Sensor& sensor) {
  std::vector<int> dark;
  int live = 0;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
    if (zone.dead) continue;
    const bool counts = std::ranges::any_of(captures, [&](const Capture& capture) {
      const double* row = capture.counts.zone(z);
      return std::any_of(row + zone.first_valid_bin, row + sensor.valid_end(z),
                         [](double value) { return value != 0; });
    });
    if (counts) {
      ++live;
    } else {
      dark.push_back(z);
    }
  }
  if (dark.empty() || live == 0) return {};
  std::string line = "dead zones, without a count in any capture:";
  for (const int z : dark) {
    sensor.zones[static_cast<std::size_t>(z)].dead = true;
    line += " " + std::to_string(z);
  }
  return line;
}

/// What is known while a calibration goes on.
struct CalibrationState {
  const CalibrationOptions& options;
  const bool no_object;
  Scene stated;  ///< less the bins that are always full, and dead zones
  std::function<void(double)> advance = [](double) {};
  std::vector<Capture> captures;
  std::vector<std::optional<PoseVector>> poses;  ///< [captures] true ones; empty: no object
  std::vector<double> usable;                    ///< [captures] 0 for those that saturate, else 1
  std::vector<double> keep;                      ///< [captures] 0 for those left out, else 1
  Calibration result;

  /// Set by pose_problem().
  std::optional<CalibrationProblem> problem;
  Eigen::VectorXd start, u;  ///< [parameters] at the start and at present

  CalibrationState(const Scene& scene, const CalibrationOptions& chosen, bool empty)
      : options(chosen), no_object(empty), stated(scene) {}

  /// Evaluates all captures at the present parameters.
  Evaluations evaluate() const { return problem->evaluate(problem->scene_at(u)); }
};

/// Checks the captures and takes their true poses. Leaves out bins and zones that hold nothing of
/// use.
void take_in(CalibrationState& state) {
  if (state.captures.empty()) throw Error("calibrate", "found no captures, accepted: at least one");
  std::vector<const Capture*> all;
  for (const Capture& capture : state.captures) all.push_back(&capture);
  const std::string saturated = leave_out_saturated_bins(state.stated.sensor, all);
  if (!saturated.empty()) state.result.notes.push_back(saturated);
  // Captures that saturate in the bins that are left are no reason to stop.
  Scene unlimited = state.stated;
  unlimited.sensor.saturation = 0;
  for (std::size_t c = 0; c < state.captures.size(); ++c) {
    const Capture& capture = state.captures[c];
    check_capture(unlimited, capture);
    state.usable.push_back(saturates(state.stated.sensor, capture) ? 0.0 : 1.0);
    state.poses.emplace_back();
    if (!state.no_object) state.poses.back() = true_pose(state.stated, capture, c);
  }
  const std::string dead = find_dead_zones(state.captures, state.stated.sensor);
  if (!dead.empty()) state.result.notes.push_back(dead);
  state.result.scene = state.stated;
  state.keep = state.usable;
}

/// Learns static light before anything is fitted: direct returns that the scene does not model are
/// far brighter than all light that is to be fitted.
void learn_first_background(CalibrationState& state) {
  if (!state.options.background) return;
  Scene& scene = state.result.scene;
  const CalibrationProblem first(scene, state.captures, state.poses, {});
  learn_background(first, first.evaluate(scene, true), state.usable, state.stated.sensor,
                   Knowledge::stated, scene);
}

/// Finds which spot belongs to which zone, and where the time axes wrap.
void learn_layout(CalibrationState& state) {
  if (relay_spots(state.stated).points.size() > kMaxSpots) {
    state.result.notes.emplace_back(
        "assignments of spots: not tried, there are more than five spots");
  }
  if (state.no_object) return;
  Layout layout = find_layout(state.result.scene, state.captures, state.poses, state.options,
                              [&](double share) { state.advance(0.3 * share); });
  state.result.scene = std::move(layout.scene);
  state.result.assignments = std::move(layout.assignments);
  state.result.wraps = std::move(layout.wraps);
}

/// Sets up the instrument's parameters as unknowns, at the values of the scene except for the gain.
void pose_problem(CalibrationState& state) {
  state.problem.emplace(state.result.scene, state.captures, state.poses,
                        instrument_parameters(state.result.scene, state.options));
  CalibrationProblem& problem = *state.problem;
  state.u.setZero(static_cast<Eigen::Index>(problem.parameters().size()));
  const Eigen::Index gain = problem.index_of("gain_factor");
  if (gain >= 0 && !state.no_object) {
    state.u[gain] = typical_log_amplitude(problem.evaluate(problem.base(), true));
  }
  state.start = state.u;
}

void learn_static_background(CalibrationState& state) {
  if (!state.options.background) return;
  Scene base = state.problem->base();
  state.result.background = learn_background(*state.problem, state.evaluate(), state.keep,
                                             state.stated.sensor, Knowledge::fitted, base);
  state.problem->set_base(base);
}

/// Fits the parameters. The residuals then tell outliers, ambient light, noise and static light.
void fit_round(CalibrationState& state) {
  CalibrationProblem& problem = *state.problem;
  const double sigmas = state.options.outlier_sigmas;
  problem.solve(state.u, kIterations, huber_weights(problem, state.evaluate(), state.keep, sigmas));
  const Scene now = problem.scene_at(state.u);
  const Evaluations evaluations = problem.evaluate(now);
  state.keep = fitting_captures(problem, evaluations, sigmas);
  for (std::size_t c = 0; c < state.keep.size(); ++c) state.keep[c] *= state.usable[c];
  Scene base = problem.base();
  if (state.options.ambient) {
    learn_ambient(problem, problem.evaluate(now, false, true), state.keep, base);
  }
  if (state.options.noise) learn_noise(problem, evaluations, state.keep, base);
  problem.set_base(base);
  learn_static_background(state);
}

/// Finds the valid bins anew, starting from the stated ones, with the noise model and the
/// parameters known so far.
void find_valid_bins(CalibrationState& state) {
  if (!state.options.background) return;
  CalibrationProblem& problem = *state.problem;
  Scene base = problem.base();
  for (std::size_t z = 0; z < base.sensor.zones.size(); ++z) {
    const Zone& stated = state.stated.sensor.zones[z];
    base.sensor.zones[z].first_valid_bin = stated.first_valid_bin;
    base.sensor.zones[z].last_valid_bin = stated.last_valid_bin;
    base.sensor.zones[z].dead = stated.dead;
  }
  problem.set_base(base);
  learn_static_background(state);  // once more: the noise of a bin is known once its mean is
  base = problem.base();
  leave_out_unusable_bins(problem, state.evaluate(), state.keep, base);
  problem.set_base(base);
}

/// Sets parameters that the data do not determine back to their priors.
void put_back_undetermined(CalibrationState& state) {
  const Eigen::MatrixXd covariance = state.problem->covariance(state.u, state.keep);
  for (std::size_t i = 0; i < state.problem->parameters().size(); ++i) {
    InstrumentParameter& p = state.problem->parameters()[i];
    const auto k = static_cast<Eigen::Index>(i);
    p.fixed = std::sqrt(covariance(k, k)) > state.options.determined_share * p.sigma;
    if (p.fixed) state.u[k] = 0;
  }
}

/// Reports all that was found, and how well it describes the captures.
void tell(CalibrationState& state) {
  const CalibrationProblem& problem = *state.problem;
  const Sensor& sensor = problem.base().sensor;
  Calibration& result = state.result;
  const std::string bins = valid_bins_note(state.stated.sensor.zones, sensor);
  if (!bins.empty()) result.notes.push_back(bins);
  std::erase_if(result.background, [&](const BackgroundBin& found) {
    const Zone& zone = sensor.zones[static_cast<std::size_t>(found.zone)];
    return zone.dead || found.bin < zone.first_valid_bin ||
           found.bin >= sensor.valid_end(found.zone);
  });
  const Evaluations before = problem.evaluate(problem.scene_at(state.start));
  const Evaluations after = state.evaluate();
  result.parameters = estimates(problem, state.u, problem.covariance(state.u, state.keep));
  tell_captures(state.stated.sensor, problem, after, state.keep, result);
  result.scene = problem.scene_at(state.u);
  result.deviance_before = total_deviance(before, state.keep);
  result.deviance_after = total_deviance(after, state.keep);
  result.views = views(problem, before, after, state.keep);
}

/// Learns the spread of the object's brightness. The gain has taken up its mean.
void learn_brightness(CalibrationState& state) {
  Calibration& result = state.result;
  result.brightness_log =
      brightness_spread(state.problem->evaluate(result.scene, true), state.keep);
  LinearUnknowns& linear = result.scene.linear;
  if (linear.amplitude == LinearMode::fixed) {
    linear.fixed_amplitude = 1;
  } else {
    linear.amplitude_prior = {1.0,
                              std::max(result.brightness_log, state.options.least_brightness_log)};
  }
}

/// Sets the outlier probability, and scales the noise to the errors of fits.
void learn_errors(CalibrationState& state) {
  Scene& scene = state.result.scene;
  if (scene.outlier_probability <= 0) {
    scene.outlier_probability = state.options.outlier_probability;
  }
  if (!state.options.variance_scale) return;
  state.result.variance_scale = find_variance_scale(scene, *state.problem, state.keep);
  scale_variance(scene, state.result.variance_scale);
}

}  // namespace

void CalibrationOptions::validate() const {
  const auto require = [](bool good, const char* field, const char* accepted) {
    if (!good) {
      throw Error(std::string("CalibrationOptions.") + field, std::string("accepted: ") + accepted);
    }
  };
  for (const auto& [value, name] : {std::pair{time_zero_bins, "time_zero_bins"},
                                    {zone_time_zero_bins, "zone_time_zero_bins"},
                                    {bin_width_relative, "bin_width_relative"},
                                    {pulse_log, "pulse_log"},
                                    {gain_log, "gain_log"},
                                    {zone_gain_log, "zone_gain_log"},
                                    {spot_m, "spot_m"},
                                    {cosine_exponent, "cosine_exponent"},
                                    {distance_exponent, "distance_exponent"},
                                    {law_axis, "law_axis"}}) {
    require(value >= 0 && std::isfinite(value), name, "at least 0");
  }
  require(outlier_sigmas > 0, "outlier_sigmas", "above 0");
  require(determined_share > 0 && determined_share <= 1, "determined_share", "above 0, at most 1");
  require(least_brightness_log > 0, "least_brightness_log", "above 0");
  require(outlier_probability >= 0 && outlier_probability < 1, "outlier_probability",
          "at least 0, below 1");
}

/// The method, top to bottom.
Calibration calibrate(const Scene& stated, std::span<const Capture> captures,
                      const CalibrationOptions& options, bool no_object,
                      const std::function<void(double)>& advance) {
  options.validate();
  validate(stated);
  CalibrationState state(stated, options, no_object);
  state.captures.assign(captures.begin(), captures.end());
  if (advance) state.advance = advance;
  take_in(state);
  learn_first_background(state);
  learn_layout(state);
  pose_problem(state);
  for (int round = 0; round < kRounds; ++round) {
    fit_round(state);
    find_valid_bins(state);
    state.advance(0.3 + 0.4 * (round + 1) / (kRounds + 1));
  }
  put_back_undetermined(state);
  fit_round(state);
  tell(state);
  state.advance(0.7);
  if (!no_object) {
    learn_brightness(state);
    learn_errors(state);
  }
  state.advance(1.0);
  return std::move(state.result);
}

}  // namespace blindcorner
