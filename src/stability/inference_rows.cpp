// SPDX-License-Identifier: Apache-2.0
/// Rows about fits.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>

#include "blindcorner/inverse/fit.h"
#include "inverse/search/derivative_study.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kTheme = "Inference";

FitOptions quick() {
  FitOptions options;
  options.empty_captures = 0;  // no question here is about false alarms
  return options;
}

struct FitCase {
  Scene scene = wall_scene();
  double photons = 3000;
  double background_ratio = 1;
  std::uint64_t seed = 3;
};

FitResult fitted(const FitCase& c) {
  return fit(c.scene, photon_capture(c.scene, c.photons, c.background_ratio, c.seed), quick());
}

StabilityMeasurement soundness(const FitCase& c) {
  return {is_sound(c.scene, fitted(c)) ? 0.0 : 1.0, ""};
}

/// Smallest squared Mahalanobis distance of the truth from a mode.
StabilityMeasurement distance(const FitCase& c) {
  const FitResult result = fitted(c);
  double least = std::nan("");
  for (const PoseMode& mode : result.posterior.modes) {
    const PoseVector d = pose_error(c.scene, mode.pose, stated_pose(c.scene));
    least = std::fmin(least, d.dot(mode.covariance.ldlt().solve(d)));
  }
  return {least, ""};
}

StabilityRow sound_row(const std::string& name, const std::string& what,
                       const std::function<void(FitCase&)>& change) {
  return {name,
          kTheme,
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
          kTheme,
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

/// Error of central differences at the best of the steps between, and at the default one.
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
      // Rounding of the model (1e-12 of the light, which changes over about 5 cm) and truncation.
      const double allowed = 1e-12 * 0.05 / steps[i] + std::pow(steps[i] / 0.01, 2) + 1e-4;
      worst = std::max(worst, errors.errors[i] / allowed);
    }
  }
  return {worst, ""};
}

StabilityMeasurement dead_zones() {
  FitCase c;
  const Capture capture = photon_capture(c.scene, 3000, 1, 1);
  for (Zone& zone : c.scene.sensor.zones) zone.dead = true;
  return refusal([&] { fit(c.scene, capture, quick()); });
}

/// Whether an unknown that nothing depends on is reported as open: 0 where it is.
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

/// Size and brightness trade: the spread of log size must not fall below what the brightness' prior
/// leaves of it.
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

}  // namespace

std::vector<StabilityRow> inference_rows() {
  return {
      sound_row("one_photon", "One photon", [](FitCase& c) { c.photons = 1; }),
      sound_row("no_light_at_all", "1e-9 photons without background",
                [](FitCase& c) { c.photons = 1e-9, c.background_ratio = 0; }),
      distance_row("photons_3000", "3000 photons", [](FitCase&) {}),
      distance_row("photons_1e6", "10^6 photons", [](FitCase& c) { c.photons = 1e6; }),
      distance_row("photons_1e9", "10^9 photons", [](FitCase& c) { c.photons = 1e9; }),
      sound_row("photons_1e12_sound", "10^12 photons", [](FitCase& c) { c.photons = 1e12; }),
      distance_row("photons_1e12", "10^12 photons", [](FitCase& c) { c.photons = 1e12; }),
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
      {"yaw_of_a_sphere", kTheme,
       "Yaw of a sphere is free: 0 where it is named as undetermined with the prior's width", 0,
       "1", LimitOrigin::physics, "A sphere looks alike from all sides.", yaw_of_a_sphere},
      {"size_against_brightness", kTheme,
       "Size and brightness of a sphere of 1 cm are free: 0.2 over the standard deviation of the "
       "size",
       1, "1", LimitOrigin::physics,
       "Light goes with size squared times brightness; the prior of the brightness (1.5 in its "
       "logarithm) leaves more than 0.2 of the size open.",
       size_against_brightness},
      {"all_zones_dead", kTheme, "A capture of which all zones are dead: 0 for a clear refusal", 0,
       "1", LimitOrigin::arithmetic, "There is nothing to fit.", dead_zones},
      {"difference_steps", kTheme,
       "Central differences of the light at steps of 1e-10 to 1e-2 m: largest error over rounding "
       "and truncation",
       1, "1", LimitOrigin::arithmetic,
       "1e-12 of the light over the step, and (step / 1 cm)^2, 1 cm a quarter of the pulse's "
       "length; 1e-4 for the reference.",
       difference_steps_row},
  };
}

}  // namespace blindcorner
