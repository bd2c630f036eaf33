// SPDX-License-Identifier: Apache-2.0
/// Rows about captures of scenes that are not as stated.
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/simulation/synthetic.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kAssumptionTheme = "Wrong assumptions";
constexpr int kCaptures = 10;
/// Squared distance at the border of the 99.9 % region of two unknowns.
constexpr double kOutside = 13.8;

/// The scene at the i-th of several poses over the search region. They lie on a line that meets no
/// symmetry of the scene.
Scene posed(const Scene& scene, int i) {
  Scene at = scene;
  for (std::size_t u = 0; u < at.unknowns.size(); ++u) {
    const Unknown& unknown = at.unknowns[u];
    const double share = std::fmod(0.37 + (u == 0 ? 0.618 : 0.755) * i, 1.0);
    at.hidden.placement.set(unknown.component,
                            unknown.lower + (0.1 + 0.8 * share) * unknown.range());
  }
  return at;
}

std::uint64_t seed_of(int capture) { return static_cast<std::uint64_t>(capture) + 1; }

bool warned(const FitResult& result) {
  const auto tells = [](const std::string& flag) {
    return flag == "model_misfit" || flag == "unexplained_light" || flag == "nothing_detected" ||
           flag == "at_bound";
  };
  return std::ranges::any_of(result.flags, tells);
}

Scene with_plate(double edge) {
  Scene scene = nine_zone_scene();
  scene.hidden.shape = RectangleShape{edge, edge};
  return scene;
}

Scene with_sphere(double radius) {
  Scene scene = nine_zone_scene();
  scene.hidden.shape = SphereShape{radius};
  return scene;
}

/// How many flags are missing, of those that the misfit of the light makes due, in standard
/// deviations. The misfit is the deviance of a capture without noise. A deviance is flagged if it
/// is three of its standard deviations above the expected one.
StabilityMeasurement missing_flags(const Scene& truth, const Scene& assumed, double photons) {
  const Fitter fitter(assumed, without_empty_captures());
  double due = 0, variance = 0;
  int flagged = 0;
  for (int i = 0; i < kCaptures; ++i) {
    const Scene real = posed(truth, i);
    const Capture capture = photon_capture(real, photons, 1, seed_of(i));
    const FitResult result = fitter.fit(capture);
    flagged += warned(result) ? 1 : 0;
    // The same capture without noise: what is left of its deviance is the misfit.
    const auto model = make_reference_renderer(real, sensor_placement(real));
    const HistogramCube light = model->three_bounce(stated_pose(real));
    Capture still = capture;
    still.counts = expected_counts(real, light, model->shadowed_background(stated_pose(real)),
                                   {1.0, equal_ambient(real, light), 1.0});
    const double misfit = std::max(fitter.fit(still).goodness_of_fit.deviance, 0.0);
    const double p = boost::math::cdf(boost::math::normal(),
                                      misfit / result.goodness_of_fit.standard_deviation - 3);
    due += p;
    variance += p * (1 - p);
  }
  return {(due - flagged) / std::sqrt(variance + 0.25),
          std::to_string(flagged) + " of 10 flagged, due " + std::to_string(due)};
}

/// `what` says which object is fitted as something else.
StabilityRow misfit_row(const std::string& name, const std::string& what, const Scene& truth,
                        const Scene& assumed) {
  return {name,
          kAssumptionTheme,
          what +
              ", 100,000 photons at each of ten places: flags that are missing of those that the "
              "light's misfit without noise makes due",
          3,
          "standard deviations",
          LimitOrigin::physics,
          "A deviance's mean grows by the misfit without noise, its spread is known: how many are "
          "flagged follows. A misfit below the noise cannot be seen.",
          [truth, assumed] { return missing_flags(truth, assumed, 100'000); }};
}

/// Number of wrong fits with no flag, and with no hint at the time zero either.
StabilityMeasurement time_zero_hint_missing() {
  Scene truth = nine_zone_scene();
  truth.linear.direct = LinearMode::fixed;
  truth.linear.fixed_direct = 0;
  Scene assumed = truth;
  for (Zone& zone : truth.sensor.zones) zone.time_zero += 0.5 * truth.sensor.bin_width;
  const Fitter fitter(assumed, without_empty_captures());
  int missing = 0;
  for (int i = 0; i < kCaptures; ++i) {
    const Scene real = posed(truth, i);
    const FitResult result = fitter.fit(photon_capture(real, 30'000, 1, seed_of(i)));
    const bool told = std::ranges::any_of(result.hints, [](const std::string& hint) {
      return hint.find("time_zero_ps") != std::string::npos;
    });
    const bool far = !(mode_distance(assumed, result.posterior, stated_pose(real)) <= kOutside);
    missing += far && !told && !warned(result) ? 1 : 0;
  }
  return {static_cast<double>(missing), ""};
}

}  // namespace

std::vector<StabilityRow> assumption_rows() {
  return {
      misfit_row("size_half_of_stated", "A plate of 0.2 m fitted as one of 0.4 m", with_plate(0.2),
                 with_plate(0.4)),
      misfit_row("size_twice_as_stated", "A plate of 0.4 m fitted as one of 0.2 m", with_plate(0.4),
                 with_plate(0.2)),
      misfit_row("sphere_fitted_as_a_plate", "A sphere of 0.2 m fitted as a plate of 0.2 m",
                 with_sphere(0.1), with_plate(0.2)),
      {"time_zero_without_direct_return", kAssumptionTheme,
       "No direct return and time zero off by half a bin, ten places: fits that are wrong (outside "
       "of 99.9 %) without a flag or a hint",
       0, "fits", LimitOrigin::physics,
       "A pose takes up a shift of the time axis: no data can tell, so the fit has to say so.",
       time_zero_hint_missing},
  };
}

}  // namespace blindcorner
