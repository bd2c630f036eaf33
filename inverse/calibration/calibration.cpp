// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/calibration/calibration.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/fit.h"
#include "forward/support/quantile.h"
#include "inverse/calibration/calibration_problem.h"
#include "inverse/calibration/static_background.h"

namespace blindcorner {
namespace {

using Evaluations = std::vector<CalibrationProblem::Evaluation>;

constexpr int kRounds = 3;
constexpr int kIterations = 8;
/// Captures that decide between assignments of the spots, and between wraps.
constexpr std::size_t kAssignmentCaptures = 48;
/// What a scene states of a wrap is refuted, or confirmed, where another one, or all others, have a
/// deviance this much less, or larger (five sigma).
constexpr double kWrapGain = 25;
/// Captures that decide about the scale of the noise.
constexpr std::size_t kScaleCaptures = 96;
/// Normalised errors beyond this are taken as this: one disturbed capture must not set the scale.
constexpr double kLargestError = 6.0;
/// Least spread of the ambient light, share of its mean.
constexpr double kAmbientSpread = 0.02;
/// Fewer levels of a zone's ambient light say nothing about their spread.
constexpr std::size_t kLeastLevels = 8;
/// Fewer squared residuals say nothing about the noise model.
constexpr std::size_t kLeastSquares = 100;
/// Squared residuals beyond this many variances are left out of the noise model ...
constexpr double kTrim = 9.0;
/// ... and those within have this mean, E[u^2 | u^2 < 9] of a standard normal u.
constexpr double kTrimmedMean = 0.9733;
/// Median of chi-square with one degree of freedom, and the 97.5 % point of a normal variable.
constexpr double kMedianSquare = 0.455;
constexpr double kNormalPoint = 1.96;
/// Most spots whose assignments are all tried (120 of them).
constexpr std::size_t kMostSpots = 5;

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

/// Whether a zone of the capture holds data: one that does not is observed with next to no exposure
/// and has a variance out of all proportion. `level`: expected counts to compare variances at.
bool has_data(const Observation& observation, const ObservedZone& zone, double level) {
  constexpr double kProportion = 1e4;
  return observation.law(zone).variance(level) <=
         kProportion * observation.likelihood.front()->variance(level);
}

double degrees_of_freedom(const Observation& observation) {
  double bins = 0;
  for (const ObservedZone& zone : observation.zones) {
    if (has_data(observation, zone, 1.0)) bins += zone.bins();
  }
  return std::max(bins, 1.0);
}

/// Huber's weights of whole captures: a capture counts in full while its deviance is within the
/// tolerance, and then less and less.
std::vector<double> huber_weights(const CalibrationProblem& problem, const Evaluations& evaluations,
                                  const std::vector<double>& keep, double sigmas) {
  std::vector<double> ratio;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] > 0) {
      ratio.push_back(evaluations[c].deviance / degrees_of_freedom(problem.observation(c)));
    }
  }
  const double usual = std::max(quantile(ratio, 0.5), 1e-12);
  std::vector<double> weights = keep;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const double bins = degrees_of_freedom(problem.observation(c));
    const double limit = usual * (bins + 0.5 * sigmas * std::sqrt(2 * bins));
    if (evaluations[c].deviance > limit) {
      weights[c] *= std::sqrt(limit / evaluations[c].deviance);
    }
  }
  return weights;
}

/// Drops captures whose deviance is out of all proportion.
void drop_outliers(const CalibrationProblem& problem, const Evaluations& evaluations, double sigmas,
                   std::vector<double>& keep) {
  std::vector<double> ratio;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    ratio.push_back(evaluations[c].deviance / degrees_of_freedom(problem.observation(c)));
  }
  const double usual = std::max(quantile(ratio, 0.5), 1e-12);
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const double bins = degrees_of_freedom(problem.observation(c));
    keep[c] = ratio[c] > usual * (1 + sigmas * std::sqrt(2 / bins)) ? 0.0 : 1.0;
  }
}

/// Zones that never count anything, where others do, carry no information. Returns a line that says
/// so; empty: there are none.
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

/// Valid bins that are not as stated, and of which zones; empty: all are.
std::string valid_bins_note(const std::vector<Zone>& stated, const Sensor& sensor) {
  std::map<std::string, std::string> zones;  // by what is said of them
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const Zone& was = stated[static_cast<std::size_t>(z)];
    const Zone& now = sensor.zones[static_cast<std::size_t>(z)];
    const int was_last = was.last_valid_bin < 0 ? sensor.bins - 1 : was.last_valid_bin;
    const int now_last = sensor.valid_end(z) - 1;
    if (was.dead == now.dead && was.first_valid_bin == now.first_valid_bin &&
        was_last == now_last) {
      continue;
    }
    const auto range = [](int first, int last) {
      return std::to_string(first) + " to " + std::to_string(last);
    };
    zones[(now.dead ? "none" : range(now.first_valid_bin, now_last)) + " (stated " +
          range(was.first_valid_bin, was_last) + ")"] += " " + std::to_string(z);
  }
  std::string line;
  for (const auto& [bins, of] : zones) {
    line += (line.empty() ? "valid bins: " : "; ") + bins + " in zones" + of;
  }
  return line;
}

/// Brightness that the captures have in common, as a start for the gain.
double typical_log_amplitude(const Evaluations& evaluations) {
  std::vector<double> logs;
  for (const auto& e : evaluations) {
    if (e.log_amplitude_error < 1) logs.push_back(e.log_amplitude);
  }
  if (logs.empty()) {
    for (const auto& e : evaluations) logs.push_back(e.log_amplitude);
  }
  return quantile(std::move(logs), 0.5);
}

Eigen::Index index_of(const CalibrationProblem& problem, const std::string& name) {
  for (std::size_t i = 0; i < problem.parameters().size(); ++i) {
    if (problem.parameters()[i].name == name) return static_cast<Eigen::Index>(i);
  }
  return -1;
}

/// Ambient light of each zone over the captures: median, and the spread that holds 95 % of them,
/// less what the noise of one estimate makes of it.
void learn_ambient(const CalibrationProblem& problem, const Evaluations& flat,
                   const std::vector<double>& keep, Scene& scene) {
  if (scene.linear.ambient != LinearMode::per_zone) return;
  const std::size_t zones = scene.sensor.zones.size();
  std::vector<std::vector<double>> levels(zones), variances(zones);
  for (std::size_t c = 0; c < flat.size(); ++c) {
    if (keep[c] <= 0) continue;
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      const double level = flat[c].linear.ambient[i];
      const double lit = std::max(level, 1e-12);
      if (!has_data(observation, zone, lit)) continue;
      levels[static_cast<std::size_t>(zone.zone)].push_back(level);
      variances[static_cast<std::size_t>(zone.zone)].push_back(observation.law(zone).variance(lit) /
                                                               zone.bins());
    }
  }
  std::vector<NormalPrior> priors(zones, NormalPrior{0, 1e6});
  for (std::size_t z = 0; z < zones; ++z) {
    if (levels[z].size() < kLeastLevels) {
      if (!scene.sensor.zones[z].dead) return;  // too few to say anything about a spread
      continue;
    }
    const double middle = quantile(levels[z], 0.5);
    std::vector<double> away;
    for (const double level : levels[z]) away.push_back(std::abs(level - middle));
    const double spread = quantile(std::move(away), 0.95) / kNormalPoint;
    const double noise = quantile(variances[z], 0.5);
    priors[z] = {middle,
                 std::sqrt(std::max(spread * spread - noise,
                                    std::pow(kAmbientSpread * std::abs(middle), 2) + 1e-12))};
  }
  scene.linear.ambient_prior = std::move(priors);
}

/// A squared residual of one exposure.
struct Square {
  std::size_t zone;
  double mean, square;
};

std::vector<Square> squared_residuals(const CalibrationProblem& problem,
                                      const Evaluations& evaluations,
                                      const std::vector<double>& keep, const Scene& scene) {
  std::vector<Square> squares;
  const double captures = std::accumulate(keep.begin(), keep.end(), 0.0);
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] <= 0) continue;
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      const double exposures = problem.capture(c).exposures_of(zone.zone);
      if (exposures <= 0) continue;
      const auto index = static_cast<std::size_t>(zone.zone);
      // What the fitted ambient light took away.
      double lost = 0;
      if (scene.linear.ambient == LinearMode::per_zone) {
        const double own =
            observation.law(zone).variance(std::max(evaluations[c].linear.ambient[i], 1e-12)) /
            zone.bins();
        const auto& priors = scene.linear.ambient_prior;
        const double prior = priors.empty() ? 1e300 : std::pow(priors[index].sigma, 2);
        lost = prior / (prior + own);
      }
      const double correction = zone.bins() / std::max(zone.bins() - lost, 0.5);
      for (std::size_t k = 0; k < zone.counts.size(); ++k) {
        // A mean over the captures was taken away from bins with a background.
        const int bin = zone.first + static_cast<int>(k);
        const bool fitted = scene.sensor.zones[index].background_at(bin) != 0;
        if (fitted && captures < 2) continue;
        const double left = fitted ? captures / (captures - 1) : 1.0;
        const double r = zone.counts[k] - evaluations[c].mean[i][k];
        squares.push_back({index, std::max(evaluations[c].mean[i][k], 0.0),
                           r * r * exposures * correction * left});
      }
    }
  }
  return squares;
}

double trimmed_dispersion(const std::vector<Square>& squares, double dispersion) {
  for (int i = 0; i < 20; ++i) {
    double numerator = 0, denominator = 0;
    for (const Square& s : squares) {
      if (s.square > kTrim * dispersion * std::max(s.mean, 1e-9)) continue;
      numerator += s.square / kTrimmedMean;
      denominator += s.mean;
    }
    if (denominator > 0 && numerator > 0) dispersion = numerator / denominator;
  }
  return dispersion;
}

/// Floor of each group and the slope that they share, [groups + 1], by reweighted least squares;
/// none is negative. `group` is [zones].
Eigen::VectorXd trimmed_law(const std::vector<Square>& squares, const std::vector<int>& group,
                            Eigen::VectorXd law) {
  const Eigen::Index groups = law.size() - 1;
  for (int i = 0; i < 30; ++i) {
    Eigen::MatrixXd h = Eigen::MatrixXd::Zero(groups + 1, groups + 1);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(groups + 1);
    for (const Square& s : squares) {
      const Eigen::Index own = group[s.zone];
      const double v = law[own] + law[groups] * s.mean;
      if (s.square > kTrim * v) continue;
      const double weight = 1 / (v * v);
      h(own, own) += weight;
      h(own, groups) += weight * s.mean;
      h(groups, groups) += weight * s.mean * s.mean;
      g[own] += weight * s.square / kTrimmedMean;
      g[groups] += weight * s.mean * s.square / kTrimmedMean;
    }
    // The slope by elimination of the floors, then the floors, and once more the slope where a
    // floor had to be raised.
    const auto floors = [&](double slope) {
      for (Eigen::Index k = 0; k < groups; ++k) {
        if (h(k, k) <= 0) continue;
        const double level = g[k] / h(k, k);
        law[k] = std::max(level - slope * h(k, groups) / h(k, k), 1e-3 * level);
      }
    };
    double numerator = g[groups];
    double denominator = h(groups, groups);
    for (Eigen::Index k = 0; k < groups; ++k) {
      if (h(k, k) <= 0) continue;
      numerator -= g[k] * h(k, groups) / h(k, k);
      denominator -= h(k, groups) * h(k, groups) / h(k, k);
    }
    floors(denominator > 1e-12 * h(groups, groups) ? std::max(numerator / denominator, 0.0) : 0.0);
    const double rest = g[groups] - law.head(groups).dot(h.col(groups).head(groups));
    law[groups] = h(groups, groups) > 0 ? std::max(rest / h(groups, groups), 0.0) : 0.0;
  }
  return law;
}

/// Noise from squared residuals, trimmed at three standard deviations: where the noise model states
/// a line, variance = the zone's floor + per_count * mean, zones of few residuals with a floor in
/// common; else the dispersion.
void learn_noise(const CalibrationProblem& problem, const Evaluations& evaluations,
                 const std::vector<double>& keep, Scene& scene) {
  const std::vector<Square> squares = squared_residuals(problem, evaluations, keep, scene);
  if (squares.size() < kLeastSquares) return;
  Sensor& sensor = scene.sensor;
  if (!sensor.noise.stated_line()) {
    sensor.dispersion = trimmed_dispersion(squares, sensor.dispersion);
    return;
  }
  std::vector<std::size_t> count(sensor.zones.size());
  for (const Square& s : squares) ++count[s.zone];
  std::vector<int> group(sensor.zones.size(), 0);  // 0: those of few
  int groups = 1;
  for (std::size_t z = 0; z < count.size(); ++z) {
    if (count[z] >= kLeastSquares) group[z] = groups++;
  }
  // Start from what holds half of the squares, so that a poor guess does not trim everything.
  const auto before = [&](std::size_t zone) {
    return *sensor.noise_of(static_cast<int>(zone)).stated_line();
  };
  std::vector<double> ratio;
  for (const Square& s : squares) {
    const VarianceLine own = before(s.zone);
    ratio.push_back(s.square / (own.floor + own.per_count * s.mean));
  }
  const double scale = quantile(std::move(ratio), 0.5) / kMedianSquare;
  VarianceLine line = *sensor.noise.stated_line();
  Eigen::VectorXd law(groups + 1);
  law[0] = line.floor * scale;
  law[groups] = line.per_count * scale;
  for (std::size_t z = 0; z < group.size(); ++z) {
    if (group[z] > 0) law[group[z]] = before(z).floor * scale;
  }
  law = trimmed_law(squares, group, law);
  line.per_count = law[groups];
  if (groups > 1) line.floor = law.segment(1, groups - 1).mean();
  if (std::ranges::any_of(squares, [&](const Square& s) { return group[s.zone] == 0; })) {
    line.floor = law[0];
  }
  sensor.noise.state_line(line);
  for (std::size_t z = 0; z < group.size(); ++z) {
    if (group[z] > 0) sensor.zones[z].variance_floor = law[group[z]];
  }
}

/// Spread of log amplitudes beyond their own errors.
double brightness_spread(const Evaluations& free, const std::vector<double>& keep) {
  double sum = 0, weight = 0;
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double error = free[c].log_amplitude_error;
    if (keep[c] <= 0 || error > 0.4) continue;
    const double excess =
        std::min(std::pow(free[c].log_amplitude, 2), 9 * (error * error + 0.02)) - error * error;
    const double w = 1 / std::pow(error * error + 0.01, 2);
    sum += w * excess;
    weight += w;
  }
  return weight > 0 ? std::sqrt(std::max(sum / weight, 0.0)) : 0.0;
}

/// Captures spread over those given, enough to tell a few discrete choices apart.
struct FewCaptures {
  std::vector<Capture> captures;
  std::vector<std::optional<PoseVector>> poses;

  FewCaptures(const std::vector<Capture>& all,
              const std::vector<std::optional<PoseVector>>& where) {
    const std::size_t stride = std::max<std::size_t>(1, all.size() / kAssignmentCaptures);
    for (std::size_t c = 0; c < all.size(); c += stride) {
      captures.push_back(all[c]);
      poses.push_back(where[c]);
    }
  }
};

/// What gains and time zero make of a scene whose other parameters are as stated.
struct CoarseFit {
  CalibrationProblem problem;
  std::vector<double> weights;
  Scene scene;
  Evaluations evaluations;

  CoarseFit(const Scene& stated, const FewCaptures& few, const CalibrationOptions& options)
      : problem(stated, few.captures, few.poses, instrument_parameters(stated, options)) {
    for (InstrumentParameter& p : problem.parameters()) {
      p.fixed = !p.name.starts_with("gain_factor") && p.name != "time_zero_ps";
    }
    Eigen::VectorXd u =
        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem.parameters().size()));
    if (const Eigen::Index gain = index_of(problem, "gain_factor"); gain >= 0) {
      u[gain] = typical_log_amplitude(problem.evaluate(stated, true));
    }
    const std::vector<double> all(few.captures.size(), 1.0);
    weights =
        huber_weights(problem, problem.evaluate(problem.scene_at(u)), all, options.outlier_sigmas);
    problem.solve(u, 4, weights);
    scene = problem.scene_at(u);
    evaluations = problem.evaluate(scene);
  }
};

/// All assignments of spots, best first.
std::vector<SpotAssignment> try_assignments(const Scene& scene,
                                            const std::vector<Capture>& captures,
                                            const std::vector<std::optional<PoseVector>>& poses,
                                            const CalibrationOptions& options,
                                            const std::function<void(double)>& advance) {
  const RelaySpots spots = relay_spots(scene);
  const FewCaptures few(captures, poses);
  std::vector<SpotAssignment> assignments;
  std::vector<int> order(spots.points.size());
  std::iota(order.begin(), order.end(), 0);
  double total = 1;
  for (std::size_t i = 2; i <= order.size(); ++i) total *= static_cast<double>(i);
  do {
    Scene trial = scene;
    std::vector<Eigen::Vector3d> points;
    for (const int i : order) points.push_back(spots.points[static_cast<std::size_t>(i)]);
    move_spots(trial, spots, points);
    const CoarseFit fit(trial, few, options);
    SpotAssignment assignment{order, 0};
    for (std::size_t c = 0; c < fit.evaluations.size(); ++c) {
      assignment.deviance += fit.weights[c] * fit.evaluations[c].deviance;
    }
    assignments.push_back(assignment);
    if (advance) advance(0.3 * static_cast<double>(assignments.size()) / total);
  } while (std::next_permutation(order.begin(), order.end()));
  std::stable_sort(assignments.begin(), assignments.end(),
                   [](const auto& a, const auto& b) { return a.deviance < b.deviance; });
  return assignments;
}

/// Deviance of each zone over the captures, [zones]; linear in what is far off (Huber's function).
std::vector<double> zone_deviances(const CalibrationProblem& problem,
                                   const Evaluations& evaluations,
                                   const std::vector<double>& weights) {
  std::vector<double> deviances(problem.base().sensor.zones.size(), 0.0);
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const Observation& observation = problem.observation(c);
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      const BinLikelihood& law = observation.law(zone);
      for (std::size_t k = 0; k < zone.counts.size(); ++k) {
        const double mean = evaluations[c].mean[i][k];
        const double square =
            std::pow(zone.counts[k] - mean, 2) / law.variance(std::max(mean, 1e-12));
        deviances[static_cast<std::size_t>(zone.zone)] +=
            weights[c] * (square < kTrim ? square : 2 * std::sqrt(kTrim * square) - kTrim);
      }
    }
  }
  return deviances;
}

/// Evaluates every wrap in the farther half of the time axis, none, and what is stated, for all
/// zones at once, with the gains and the time zero that suit the wraps known so far; zones choose
/// for themselves, until none changes its mind.
std::vector<ZoneWrap> try_wraps(const Scene& scene, const std::vector<Capture>& captures,
                                const std::vector<std::optional<PoseVector>>& poses,
                                const CalibrationOptions& options) {
  constexpr int kTurns = 4;
  const FewCaptures few(captures, poses);
  const Sensor& sensor = scene.sensor;
  std::vector<int> candidates{0};
  for (int wrap = (sensor.bins + 1) / 2; wrap <= sensor.bins; ++wrap) candidates.push_back(wrap);
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const int stated = sensor.wrap(z);
    if (std::ranges::find(candidates, stated) == candidates.end()) candidates.push_back(stated);
  }
  std::vector<ZoneWrap> found;
  Scene now = scene;
  for (int turn = 0; turn < kTurns; ++turn) {
    const CoarseFit fit(now, few, options);
    std::vector<std::vector<double>> deviances;  // [candidate][zone]
    for (const int wrap : candidates) {
      Scene trial = fit.scene;
      for (Zone& zone : trial.sensor.zones) zone.wrap_bins = wrap;
      deviances.push_back(zone_deviances(fit.problem, fit.problem.evaluate(trial), fit.weights));
    }
    found.clear();
    bool settled = true;
    for (int z = 0; z < sensor.zone_count(); ++z) {
      if (sensor.zones[static_cast<std::size_t>(z)].dead) continue;
      std::vector<std::pair<double, int>> order;
      for (std::size_t k = 0; k < candidates.size(); ++k) {
        order.emplace_back(deviances[k][static_cast<std::size_t>(z)], candidates[k]);
      }
      std::sort(order.begin(), order.end());
      const auto [best, wrap] = order.front();
      const int stated = sensor.wrap(z);
      const auto of_stated = std::ranges::find(order, stated, &std::pair<double, int>::second);
      const bool refuted = of_stated->first - best >= kWrapGain;
      const double margin = order[1].first - best;
      const int taken = refuted ? wrap : stated;
      if (refuted || (wrap == stated && margin >= kWrapGain)) {
        found.push_back({z, stated, taken, margin, order[1].second});
      }
      settled = settled && now.sensor.wrap(z) == taken;
      now.sensor.zones[static_cast<std::size_t>(z)].wrap_bins = taken;
    }
    if (settled) break;
  }
  return found;
}

/// Mean squared normalised error of fits to the calibration's own captures.
double normalised_error(const Scene& scene, const CalibrationProblem& problem,
                        const std::vector<double>& keep) {
  std::vector<std::size_t> chosen;
  for (std::size_t c = 0; c < keep.size(); ++c) {
    if (keep[c] > 0 && problem.pose(c)) chosen.push_back(c);
  }
  const std::size_t stride = (chosen.size() + kScaleCaptures - 1) / kScaleCaptures;
  FitOptions options;
  options.empty_captures = 0;
  const Fitter fitter(scene, options);
  std::vector<double> errors(chosen.size(), 0.0);
  tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t i) {
    if (i % stride != 0) return;
    const FitResult result = fitter.fit(problem.capture(chosen[i]));
    const PoseVector error = pose_error(scene, result.posterior.mean, *problem.pose(chosen[i]));
    errors[i] = std::min(error.dot(result.posterior.covariance.ldlt().solve(error)) /
                             static_cast<double>(error.size()),
                         kLargestError);
  });
  const double count = std::ceil(static_cast<double>(chosen.size()) / static_cast<double>(stride));
  return std::accumulate(errors.begin(), errors.end(), 0.0) / count;
}

void scale_variance(Scene& scene, double factor) {
  if (const auto line = scene.sensor.noise.stated_line()) {
    scene.sensor.noise.state_line({line->floor * factor, line->per_count * factor});
    for (Zone& zone : scene.sensor.zones) {
      if (zone.variance_floor > 0) zone.variance_floor *= factor;
    }
  } else {
    scene.sensor.dispersion *= factor;
  }
  for (NormalPrior& prior : scene.linear.ambient_prior) prior.sigma *= std::sqrt(factor);
}

/// Factor on the variance that brings the normalised error to one: it falls nearly as a power of
/// the factor, so a secant in logarithms converges in a few steps.
double find_variance_scale(const Scene& scene, const CalibrationProblem& problem,
                           const std::vector<double>& keep) {
  double low = 1;
  double low_error = normalised_error(scene, problem, keep);
  if (low_error <= 1) return 1;
  double high = std::min(low_error, 3.0);
  for (int i = 0; i < 3; ++i) {
    Scene scaled = scene;
    scale_variance(scaled, high);
    const double error = normalised_error(scaled, problem, keep);
    if (std::abs(std::log(error)) < 0.03) return high;
    const double slope = (std::log(error) - std::log(low_error)) / (std::log(high) - std::log(low));
    const double next = slope < -0.05 ? high * std::exp(-std::log(error) / slope) : 1.3 * high;
    low = high;
    low_error = error;
    high = std::clamp(next, 1.0, 6.0);
  }
  return high;
}

/// Mean histograms over captures without the static background, each shifted so that the object's
/// light arrives together.
std::vector<CalibrationView> views(const CalibrationProblem& problem, const Evaluations& before,
                                   const Evaluations& after, const std::vector<double>& keep) {
  std::vector<CalibrationView> list;
  const Sensor& sensor = problem.base().sensor;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const auto bins = static_cast<std::size_t>(2 * sensor.bins);
    std::vector<double> measured(bins), old(bins), fitted(bins), count(bins);
    for (std::size_t c = 0; c < problem.captures(); ++c) {
      if (keep[c] <= 0 || problem.capture(c).exposures_of(z) <= 0) continue;
      const Observation& observation = problem.observation(c);
      for (std::size_t i = 0; i < observation.zones.size(); ++i) {
        const ObservedZone& zone = observation.zones[i];
        if (zone.zone != z) continue;
        std::ptrdiff_t center = zone.bins() / 2;
        const auto& light = after[c].object[i];
        const auto brightest = std::max_element(light.begin(), light.end());
        if (brightest != light.end() && *brightest > 0) center = brightest - light.begin();
        for (std::size_t k = 0; k < zone.counts.size(); ++k) {
          const auto at =
              static_cast<std::size_t>(static_cast<std::ptrdiff_t>(k) - center + sensor.bins);
          const double known =
              after[c].linear.direct[i] * sensor.zones[static_cast<std::size_t>(z)].background_at(
                                              zone.first + static_cast<int>(k));
          measured[at] += zone.counts[k] - known;
          old[at] += before[c].mean[i][k] - known;
          fitted[at] += after[c].mean[i][k] - known;
          count[at] += 1;
        }
      }
    }
    CalibrationView view;
    view.zone = z;
    const double most = *std::max_element(count.begin(), count.end());
    for (std::size_t k = 0; k < bins && most > 0; ++k) {
      if (count[k] < 0.3 * most) continue;
      view.measured.push_back(measured[k] / count[k]);
      view.before.push_back(old[k] / count[k]);
      view.after.push_back(fitted[k] / count[k]);
    }
    if (!view.measured.empty()) list.push_back(std::move(view));
  }
  return list;
}

/// The parameters in the units of their names.
std::vector<CalibratedParameter> estimates(const CalibrationProblem& problem,
                                           const Eigen::VectorXd& u,
                                           const Eigen::MatrixXd& covariance) {
  std::vector<CalibratedParameter> list;
  for (std::size_t i = 0; i < problem.parameters().size(); ++i) {
    const InstrumentParameter& p = problem.parameters()[i];
    const auto k = static_cast<Eigen::Index>(i);
    const double factor = p.logarithmic ? 1 : p.unit;
    list.push_back({p.name, p.prior, factor * p.sigma, p.value(u[k]),
                    factor * (p.fixed ? p.sigma : std::sqrt(covariance(k, k))), p.logarithmic,
                    !p.fixed});
  }
  return list;
}

/// Where a capture is furthest from the model, and whether that is light before any that the object
/// can send by way of the relay (below a thousandth of the zone's peak).
std::string worst_bin_text(const Observation& observation,
                           const CalibrationProblem::Evaluation& evaluation) {
  double worst = 0;
  std::string text;
  for (std::size_t i = 0; i < observation.zones.size(); ++i) {
    const ObservedZone& zone = observation.zones[i];
    const std::vector<double>& light = evaluation.object[i];
    const double least = kDarkShare * *std::ranges::max_element(light);
    bool early = true;
    for (std::size_t k = 0; k < zone.counts.size(); ++k) {
      early = early && light[k] <= least;
      const double mean = evaluation.mean[i][k];
      const double off = zone.counts[k] - mean;
      const double square = off * off / observation.law(zone).variance(std::max(mean, 1e-12));
      if (square <= worst) continue;
      worst = square;
      char line[160];
      std::snprintf(line, sizeof line, "; most in zone %d, bin %zu: %.4g counts where %.4g fit%s",
                    zone.zone, static_cast<std::size_t>(zone.first) + k, zone.counts[k], mean,
                    early && least > 0 && off > 0
                        ? ", before the object's light can arrive (in direct view?)"
                        : "");
      text = line;
    }
  }
  return text;
}

/// Which captures were used, and why the others were not.
void tell_captures(const Scene& scene, const CalibrationProblem& problem,
                   const Evaluations& evaluations, const std::vector<double>& keep,
                   Calibration& result) {
  for (std::size_t c = 0; c < keep.size(); ++c) {
    const double bins = degrees_of_freedom(problem.observation(c));
    if (keep[c] > 0) {
      ++result.used;
      result.expected_deviance += bins;
      continue;
    }
    if (saturates(scene.sensor, problem.capture(c))) {
      result.left_out.push_back({static_cast<int>(c), "saturates in bins where others do not"});
      continue;
    }
    char text[96];
    std::snprintf(text, sizeof text, "does not fit: deviance %.0f where about %.0f is usual",
                  evaluations[c].deviance, bins);
    result.left_out.push_back(
        {static_cast<int>(c), text + worst_bin_text(problem.observation(c), evaluations[c])});
  }
}

double total_deviance(const Evaluations& evaluations, const std::vector<double>& keep) {
  double total = 0;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    if (keep[c] > 0) total += evaluations[c].deviance;
  }
  return total;
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
  const auto report = [&](double share) {
    if (advance) advance(share);
  };
  Calibration result;
  std::vector<Capture> list(captures.begin(), captures.end());
  std::vector<const Capture*> all;
  for (const Capture& capture : list) all.push_back(&capture);
  if (list.empty()) throw Error("calibrate", "found no captures, accepted: at least one");
  Scene scene = stated;
  const std::string saturated = leave_out_saturated_bins(scene.sensor, all);
  if (!saturated.empty()) result.notes.push_back(saturated);
  // Captures that saturate all the same are no reason to stop.
  Scene unlimited = scene;
  unlimited.sensor.saturation = 0;
  std::vector<double> usable;
  std::vector<std::optional<PoseVector>> poses;
  for (std::size_t c = 0; c < list.size(); ++c) {
    check_capture(unlimited, list[c]);
    usable.push_back(saturates(scene.sensor, list[c]) ? 0.0 : 1.0);
    poses.emplace_back();
    if (!no_object) poses.back() = true_pose(scene, list[c], c);
  }
  if (const std::string dead = find_dead_zones(list, scene.sensor); !dead.empty()) {
    result.notes.push_back(dead);
  }
  result.scene = scene;

  // Static light before anything is fitted: direct returns that the scene does not model are far
  // brighter than all that is to be.
  if (options.background) {
    const CalibrationProblem first(result.scene, list, poses, {});
    learn_background(first, first.evaluate(result.scene, true), usable, scene.sensor,
                     Knowledge::stated, result.scene);
  }

  // Which spot is which.
  const RelaySpots spots = relay_spots(scene);
  if (options.permutations && !no_object && spots.points.size() > 1 &&
      spots.points.size() <= kMostSpots) {
    result.assignments = try_assignments(result.scene, list, poses, options, advance);
    std::vector<Eigen::Vector3d> points;
    for (const int i : result.assignments.front().spot) {
      points.push_back(spots.points[static_cast<std::size_t>(i)]);
    }
    move_spots(result.scene, spots, points);
  } else if (spots.points.size() > kMostSpots) {
    result.notes.push_back("assignments of spots: not tried, there are more than five spots");
  }

  // Where the time axes wrap.
  if (options.wraps && !no_object) {
    result.wraps = try_wraps(result.scene, list, poses, options);
    for (const ZoneWrap& wrap : result.wraps) {
      result.scene.sensor.zones[static_cast<std::size_t>(wrap.zone)].wrap_bins = wrap.found;
    }
  }

  CalibrationProblem problem(result.scene, list, poses,
                             instrument_parameters(result.scene, options));
  Eigen::VectorXd u = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem.parameters().size()));
  std::vector<double> keep = usable;
  const auto learn_static_light = [&] {
    if (!options.background) return;
    Scene base = problem.base();
    result.background = learn_background(problem, problem.evaluate(problem.scene_at(u)), keep,
                                         scene.sensor, Knowledge::fitted, base);
    problem.set_base(base);
  };
  // Anew from the stated valid bins, with the noise and the model known so far.
  const auto find_valid_bins = [&] {
    if (!options.background) return;
    Scene base = problem.base();
    for (std::size_t z = 0; z < base.sensor.zones.size(); ++z) {
      base.sensor.zones[z].first_valid_bin = scene.sensor.zones[z].first_valid_bin;
      base.sensor.zones[z].last_valid_bin = scene.sensor.zones[z].last_valid_bin;
      base.sensor.zones[z].dead = scene.sensor.zones[z].dead;
    }
    problem.set_base(base);
    learn_static_light();  // once more: the noise of a bin is known once its mean is
    base = problem.base();
    leave_out_unusable_bins(problem, problem.evaluate(problem.scene_at(u)), keep, base);
    problem.set_base(base);
  };
  const Eigen::Index gain = index_of(problem, "gain_factor");
  if (gain >= 0 && !no_object) {
    u[gain] = typical_log_amplitude(problem.evaluate(problem.base(), true));
  }
  Evaluations evaluations = problem.evaluate(problem.scene_at(u));
  const Eigen::VectorXd start = u;

  // Parameters; then what is left over tells outliers, noise and ambient light.
  std::vector<double> weights;
  const auto round = [&](int iterations) {
    weights =
        huber_weights(problem, problem.evaluate(problem.scene_at(u)), keep, options.outlier_sigmas);
    problem.solve(u, iterations, weights);
    const Scene now = problem.scene_at(u);
    evaluations = problem.evaluate(now);
    drop_outliers(problem, evaluations, options.outlier_sigmas, keep);
    for (std::size_t c = 0; c < keep.size(); ++c) keep[c] *= usable[c];
    Scene base = problem.base();
    if (options.ambient) learn_ambient(problem, problem.evaluate(now, false, true), keep, base);
    if (options.noise) learn_noise(problem, evaluations, keep, base);
    problem.set_base(base);
    learn_static_light();
  };
  for (int r = 0; r < kRounds; ++r) {
    round(kIterations);
    find_valid_bins();
    report(0.3 + 0.4 * (r + 1) / (kRounds + 1));
  }

  // What the data do not determine goes back to its prior; the rest is estimated once more.
  Eigen::MatrixXd covariance = problem.covariance(u, keep);
  for (std::size_t i = 0; i < problem.parameters().size(); ++i) {
    InstrumentParameter& p = problem.parameters()[i];
    const auto k = static_cast<Eigen::Index>(i);
    p.fixed = std::sqrt(covariance(k, k)) > options.determined_share * p.sigma;
    if (p.fixed) u[k] = 0;
  }
  round(kIterations);
  covariance = problem.covariance(u, keep);
  evaluations = problem.evaluate(problem.scene_at(u));
  report(0.7);

  if (const std::string bins = valid_bins_note(scene.sensor.zones, problem.base().sensor);
      !bins.empty()) {
    result.notes.push_back(bins);
  }
  std::erase_if(result.background, [&](const BackgroundBin& found) {
    const Zone& zone = problem.base().sensor.zones[static_cast<std::size_t>(found.zone)];
    return zone.dead || found.bin < zone.first_valid_bin ||
           found.bin >= problem.base().sensor.valid_end(found.zone);
  });
  result.parameters = estimates(problem, u, covariance);
  tell_captures(scene, problem, evaluations, keep, result);
  result.scene = problem.scene_at(u);
  const Evaluations before = problem.evaluate(problem.scene_at(start));
  result.deviance_before = total_deviance(before, keep);
  result.deviance_after = total_deviance(evaluations, keep);
  result.views = views(problem, before, evaluations, keep);

  // The object's brightness: the gain has taken up its mean.
  if (!no_object) {
    result.brightness_log = brightness_spread(problem.evaluate(result.scene, true), keep);
    LinearUnknowns& linear = result.scene.linear;
    if (linear.amplitude == LinearMode::fixed) {
      linear.fixed_amplitude = 1;
    } else {
      linear.amplitude_prior = {1.0, std::max(result.brightness_log, options.least_brightness_log)};
    }
    if (scene.outlier_probability <= 0) {
      result.scene.outlier_probability = options.outlier_probability;
    }
    if (options.variance_scale) {
      result.variance_scale = find_variance_scale(result.scene, problem, keep);
      scale_variance(result.scene, result.variance_scale);
    }
  }
  report(1.0);
  return result;
}

}  // namespace blindcorner
