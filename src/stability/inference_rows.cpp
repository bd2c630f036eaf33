// SPDX-License-Identifier: Apache-2.0
/// Rows about fits.
#include <tbb/global_control.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>

#include "blindcorner/inverse/fit.h"
#include "inverse/likelihood/background_error.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/search/compiled_scene.h"
#include "inverse/search/derivative_study.h"
#include "inverse/search/refine.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kInferenceTheme = "Inference";

struct FitCase {
  Scene scene = wall_scene();
  double photons = 3000;
  double background_ratio = 1;
  std::uint64_t seed = 3;
};

FitResult fitted(const FitCase& c) {
  return fit(c.scene, photon_capture(c.scene, c.photons, c.background_ratio, c.seed),
             without_empty_captures());
}

StabilityMeasurement soundness(const FitCase& c) {
  return {is_sound(c.scene, fitted(c)) ? 0.0 : 1.0, ""};
}

/// Smallest squared Mahalanobis distance of the truth from a mode.
StabilityMeasurement distance(const FitCase& c) {
  return {mode_distance(c.scene, fitted(c).posterior, stated_pose(c.scene)), ""};
}

StabilityRow sound_row(const std::string& name, const std::string& what,
                       const std::function<void(FitCase&)>& change) {
  return {name,
          kInferenceTheme,
          what +
              ": 0 where the fit gives finite poses, probabilities within 0 and 1 and "
              "covariances that are none below zero",
          0,
          "1",
          LimitOrigin::arithmetic,
          "What data leave open is the prior's; nothing may become no number.",
          [change] {
            FitCase c;
            change(c);
            return soundness(c);
          }};
}

StabilityRow distance_row(const std::string& name, const std::string& what,
                          const std::function<void(FitCase&)>& change) {
  return {name,
          kInferenceTheme,
          what + ": squared distance of the truth from the nearest mode by its covariance",
          18.4,
          "1",
          LimitOrigin::physics,
          "Chi-squared of 2 unknowns; one honest fit in 10,000 is beyond 18.4.",
          [change] {
            FitCase c;
            change(c);
            return distance(c);
          }};
}

void set_range(FitCase& c, std::size_t unknown, double half) {
  Unknown& u = c.scene.unknowns[unknown];
  const double value = c.scene.hidden.placement.get(u.component);
  u.lower = value - half;
  u.upper = value + half;
}

/// Largest error of central differences over all steps, relative to the error allowed for the step.
StabilityMeasurement difference_steps_row() {
  const Scene scene = wall_scene();
  const auto model = make_fast_model(scene, sensor_placement(scene));
  std::vector<double> steps;
  for (int decade = -10; decade <= -2; ++decade) steps.push_back(std::pow(10.0, decade));
  double worst = 0;
  for (Eigen::Index unknown = 0; unknown < 2; ++unknown) {
    const DerivativeErrors errors =
        derivative_errors(*model, stated_pose(scene), unknown, steps, 1e-3);
    for (std::size_t i = 0; i < steps.size(); ++i) {
      // Rounding and truncation. The model rounds at 2e-8 of the light, because its legs are
      // convolved in single precision; the light changes over about 5 cm.
      const double allowed = 2e-8 * 0.05 / steps[i] + std::pow(steps[i] / 0.01, 2) + 1e-4;
      worst = std::max(worst, errors.errors[i] / allowed);
    }
  }
  return {worst, ""};
}

StabilityMeasurement dead_zones() {
  FitCase c;
  const Capture capture = photon_capture(c.scene, 3000, 1, 1);
  for (Zone& zone : c.scene.sensor.zones) zone.dead = true;
  return refusal([&] { fit(c.scene, capture, without_empty_captures()); });
}

/// 0 if an unknown that nothing depends on is reported as open.
StabilityMeasurement left_open(const FitCase& c, int unknown) {
  const FitResult result = fitted(c);
  if (result.posterior.modes.empty() || !is_sound(c.scene, result)) return {1, "no sound mode"};
  const PoseMode& mode = result.posterior.modes.front();
  const Unknown& u = c.scene.unknowns[static_cast<std::size_t>(unknown)];
  const double sigma = std::sqrt(mode.covariance(unknown, unknown));
  const double prior = u.range() / std::sqrt(12.0);
  const bool named = std::ranges::find(mode.undetermined, unknown) != mode.undetermined.end();
  return {named && sigma > 0.9 * prior ? 0.0 : 1.0, named ? "" : "not named as undetermined"};
}

StabilityMeasurement yaw_of_a_sphere() {
  FitCase c;
  c.scene.hidden.shape = SphereShape{0.1};
  c.scene.unknowns.push_back({Component::yaw, -1, 1, std::nullopt});
  return left_open(c, 2);
}

/// Size and brightness trade off. The standard deviation of the size must not fall below what the
/// prior of the brightness leaves open.
StabilityMeasurement size_against_brightness() {
  FitCase c;
  c.scene.hidden.shape = SphereShape{0.01};
  c.scene.unknowns.push_back({Component::size, 0.2, 5, std::nullopt});
  c.photons = 300;
  const FitResult result = fitted(c);
  if (result.posterior.modes.empty() || !is_sound(c.scene, result)) return {1, "no sound mode"};
  const double sigma = std::sqrt(result.posterior.covariance(2, 2));
  return {0.2 / sigma, ""};
}

/// A scene compiled as a fit compiles it, and a capture of it.
struct Compiled {
  Scene scene = wall_scene();
  Capture capture = photon_capture(scene, 3000, 1, 3);
  std::unique_ptr<CompiledScene> compiled;
  Observation observation;

  Compiled() {
    GridOptions grid;
    grid.closed_form = true;
    compiled = compile(scene, {sensor_placement(scene)}, without_empty_captures(), grid);
    observation = observe(*compiled, {&capture, 1});
  }
};

/// Distance, in standard deviations, between the end of a descent from the truth and the best end
/// of descents from the corners of the search region.
StabilityMeasurement starts_on_the_bounds() {
  const Compiled known;
  const auto& unknowns = known.scene.unknowns;
  std::vector<PoseVector> corners;
  for (const double x : {unknowns[0].lower, unknowns[0].upper}) {
    for (const double y : {unknowns[1].lower, unknowns[1].upper}) {
      corners.push_back(Eigen::Vector2d(x, y));
    }
  }
  const PoseObjective objective(*known.compiled, known.observation);
  const PoseVector truth = stated_pose(known.scene);
  const std::vector<Refined> found = find_optima(objective, corners, 12);
  const std::vector<Refined> near = find_optima(objective, {truth}, 12);
  if (found.empty() || near.empty()) return {std::nan(""), "no optimum"};
  const PoseVector d = pose_error(known.scene, near.front().pose, found.front().pose);
  const Eigen::MatrixXd information = pose_information(objective, near.front()).pose;
  return {std::sqrt(d.dot(information * d)), ""};
}

FitResult fitted_with_threads(const Scene& scene, const Capture& capture, std::size_t threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  return fit(scene, capture);
}

/// 0 if a whole fit, detection included, is the same with one thread and with 16.
StabilityMeasurement same_fit() {
  const Scene scene = nine_zone_scene();
  const Capture capture = photon_capture(scene, 1000, 1, 5);
  const FitResult one = fitted_with_threads(scene, capture, 1);
  const FitResult many = fitted_with_threads(scene, capture, 16);
  const bool same = one.posterior.mean == many.posterior.mean &&
                    one.posterior.covariance == many.posterior.covariance &&
                    one.posterior.presence_probability == many.posterior.presence_probability &&
                    one.false_alarm_probability == many.false_alarm_probability;
  return {same ? 0.0 : 1.0, ""};
}

/// Fits the same capture at the origin and far from it. Returns how far the poses differ after the
/// move is taken off, in standard deviations.
StabilityMeasurement fit_moved(double distance) {
  const Scene scene = occluded_scene();
  const Eigen::Vector3d by(distance, -0.7 * distance, 0.4 * distance);
  const Scene far = moved(scene, by);
  Capture capture = photon_capture(scene, 10'000, 1, 3);
  const FitResult here = fit(scene, capture, without_empty_captures());
  capture.T_world_sensor = far.T_world_sensor;
  const FitResult there = fit(far, capture, without_empty_captures());
  if (here.posterior.modes.empty() || there.posterior.modes.empty())
    return {std::nan(""), "no mode"};
  const PoseVector d = there.posterior.mean - here.posterior.mean - Eigen::Vector2d(by.x(), by.y());
  return {std::sqrt(d.dot(here.posterior.covariance.ldlt().solve(d))), ""};
}

StabilityRow fit_moved_row(const std::string& name, double distance) {
  return {name,
          kInferenceTheme,
          "One capture fitted at the origin and " + name.substr(10, name.size() - 12) +
              " m away, occluder and all: distance of the optima",
          0.1,
          "standard deviations",
          LimitOrigin::arithmetic,
          "Coordinates in double precision are good to 1e-10 m there; 0.1 allows for another local "
          "origin of the rays.",
          [=] { return fit_moved(distance); }};
}

/// Photons in bins that neither the object nor the known surfaces light, in a scene that fixes the
/// ambient light at 0.
StabilityMeasurement dark_bins_stay_dark() {
  Scene scene = wall_scene();
  scene.linear.ambient = LinearMode::fixed;
  scene.linear.fixed_ambient = 0;
  const Capture capture = photon_capture(scene, 1e6, 1, 1);
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  const HistogramCube object = model->three_bounce(stated_pose(scene));
  double photons = 0;
  for (std::size_t i = 0; i < object.values.size(); ++i) {
    const bool dark = object.values[i] == 0 && model->static_background().values[i] == 0;
    if (dark) photons += capture.counts.values[i];
  }
  return {photons, ""};
}

}  // namespace

std::vector<StabilityRow> inference_rows() {
  return {
      sound_row("one_photon", "One photon", [](FitCase& c) { c.photons = 1; }),
      sound_row("no_light_at_all", "1e-9 photons without background",
                [](FitCase& c) { c.photons = 1e-9, c.background_ratio = 0; }),
      distance_row("photons_3000", "3000 photons", [](FitCase&) {}),
      distance_row("photons_1e6", "10^6 photons", [](FitCase& c) { c.photons = 1e6; }),
      sound_row("photons_1e12_sound", "10^12 photons", [](FitCase& c) { c.photons = 1e12; }),
      sound_row("background_1e6", "Background 10^6 times the signal of 3000 photons",
                [](FitCase& c) { c.background_ratio = 1e6; }),
      distance_row("no_background", "3000 photons without background",
                   [](FitCase& c) { c.background_ratio = 0; }),
      distance_row("albedo_1e-6", "Albedo of 1e-6, exposed for 3000 photons, prior about it",
                   [](FitCase& c) { c.scene.hidden.albedo = 1e-6; }),
      distance_row(
          "truth_on_the_bounds", "Truth in a corner of the search region",
          [](FitCase& c) { c.scene.hidden.placement.position = Eigen::Vector3d(0.1, 0.35, 0.1); }),
      sound_row("range_1e-6_m", "Search region of 2e-6 m",
                [](FitCase& c) { set_range(c, 0, 1e-6), set_range(c, 1, 1e-6); }),
      sound_row("range_1e3_m", "Search region of 1 km to the left of the sensor",
                [](FitCase& c) { c.scene.unknowns[1].upper = 1000; }),
      distance_row("badly_scaled", "x known to 2e-5 m, y to 0.35 m",
                   [](FitCase& c) { set_range(c, 0, 1e-5); }),
      sound_row("prior_sigma_1e-9", "Prior of x with a standard deviation of 1e-9 m",
                [](FitCase& c) {
                  c.scene.unknowns[0].prior = NormalPrior{0.2, 1e-9};
                }),
      distance_row("prior_sigma_1e-9_distance", "Prior of x with a standard deviation of 1e-9 m",
                   [](FitCase& c) {
                     c.scene.unknowns[0].prior = NormalPrior{0.2, 1e-9};
                   }),
      {"yaw_of_a_sphere", kInferenceTheme,
       "Yaw of a sphere is free: 0 where it is named as undetermined with the prior's width", 0,
       "1", LimitOrigin::physics, "A sphere looks alike from all sides.", yaw_of_a_sphere},
      {"size_against_brightness", kInferenceTheme,
       "Size and brightness of a sphere of 1 cm are free: 0.2 over the standard deviation of the "
       "size",
       1, "1", LimitOrigin::physics,
       "Light goes with size squared times brightness; the prior of the brightness (1.5 in its "
       "logarithm) leaves more than 0.2 of the size open.",
       size_against_brightness},
      {"starts_on_the_bounds", kInferenceTheme,
       "Descents from the four corners of the search region, the best of them against one from the "
       "truth: "
       "distance",
       0.1, "standard deviations", LimitOrigin::arithmetic,
       "Descents end where the log posterior gains less than 0.005, a tenth of a standard "
       "deviation.",
       starts_on_the_bounds},
      fit_moved_row("fit_moved_9e4_m", 9e4),
      fit_moved_row("fit_moved_1e6_m", 1e6),
      {"fit_threads_1_and_16", kInferenceTheme,
       "A fit with 1 and with 16 threads: 0 where mean, covariance and probabilities are the same "
       "to the last bit",
       0, "1", LimitOrigin::arithmetic, "Sums are made in one order at any number of threads.",
       same_fit},
      sound_row("bins_65536", "65,536 bins of 0.5 ps",
                [](FitCase& c) {
                  c.scene.sensor.bins = 65'536;
                  c.scene.sensor.bin_width = 5e-13;
                }),
      {"prior_median_1e300", kInferenceTheme,
       "Prior of the brightness about 1e300: 0 for a clear refusal", 0, "1",
       LimitOrigin::arithmetic, "Its square is beyond double precision.",
       [] {
         FitCase c;
         const Capture capture = photon_capture(c.scene, 3000, 1, 1);
         c.scene.linear.amplitude_prior.median = 1e300;
         return refusal([&] { fit(c.scene, capture, without_empty_captures()); });
       }},
      {"no_background_where_it_is_fixed_at_0", kInferenceTheme,
       "A million photons over a background that the scene fixes at 0: photons in bins that no "
       "model lights",
       0, "photons", LimitOrigin::physics, "Where there is no light there are no photons.",
       dark_bins_stay_dark},
      {"all_zones_dead", kInferenceTheme,
       "A capture of which all zones are dead: 0 for a clear refusal", 0, "1",
       LimitOrigin::arithmetic, "There is nothing to fit.", dead_zones},
      {"difference_steps", kInferenceTheme,
       "Central differences of the light at steps of 1e-10 to 1e-2 m: largest error over rounding "
       "and truncation",
       1, "1", LimitOrigin::arithmetic,
       "2e-8 of the light over the step, because single precision convolves it, and (step / 1 "
       "cm)^2, 1 cm a quarter of the pulse's "
       "length; 1e-4 for the reference.",
       difference_steps_row},
  };
}

}  // namespace blindcorner
