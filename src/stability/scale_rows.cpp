// SPDX-License-Identifier: Apache-2.0
/// Rows about lengths: scenes made smaller, larger, and moved away from the origin.
#include <algorithm>
#include <cmath>

#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kScaleTheme = "Scale and place";

using Light = HistogramCube (*)(const Scene&);

HistogramCube direct_light(const Scene& scene) {
  return make_fast_model(scene, sensor_placement(scene))->static_background();
}

/// Relative difference (L2) of a scaled scene's bins, times factor^2, from the scene's bins.
StabilityMeasurement scale_invariance(Light light, double factor) {
  HistogramCube big = light(scaled(wall_scene(), factor));
  for (double& value : big.values) value *= factor * factor;
  return {relative_difference(big, light(wall_scene())), ""};
}

StabilityRow scale_row(const std::string& name, const std::string& model, Light light,
                       double factor, const std::string& size) {
  return {name,
          kScaleTheme,
          model + ", all lengths and times scaled so that the wall is " + size +
              " away: difference of the bins times the square of the factor",
          1e-4,
          "1",
          LimitOrigin::physics,
          "Irradiance falls with the square of all lengths together, and nothing else changes; "
          "1e-4 is the share of a path at which single precision rays may end.",
          [=] { return scale_invariance(light, factor); }};
}

StabilityMeasurement move_invariance(Light light, const Scene& scene, double distance) {
  const HistogramCube far = light(moved(scene, {distance, -0.7 * distance, 0.4 * distance}));
  return {relative_difference(far, light(scene)), ""};
}

StabilityRow move_row(const std::string& name, const std::string& model, Light light,
                      double distance) {
  return {name,
          kScaleTheme,
          model + " of a scene with an occluder, " + name.substr(name.rfind('_') + 1) +
              " from the origin: difference of the bins from those at the origin",
          1e-3,
          "1",
          LimitOrigin::arithmetic,
          "At 10^6 m coordinates in double precision are good to 1e-10 m, a ten-millionth of a "
          "bin's path; 1e-3 is what an edge of a shadow may move in single precision about a "
          "local origin.",
          [=] { return move_invariance(light, occluded_scene(), distance); }};
}

}  // namespace

std::vector<StabilityRow> scale_rows() {
  return {
      scale_row("fast_scale_1_cm", "Fast model", fast_light, 1.0 / 60, "1 cm"),
      scale_row("fast_scale_1_km", "Fast model", fast_light, 1000 / 0.6, "1 km"),
      scale_row("reference_scale_1_cm", "Reference renderer", reference_light, 1.0 / 60, "1 cm"),
      scale_row("reference_scale_180_m", "Reference renderer", reference_light, 300, "180 m"),
      scale_row("reference_scale_6_km", "Reference renderer", reference_light, 1e4, "6 km"),
      scale_row("direct_scale_1_cm", "Direct return", direct_light, 1.0 / 60, "1 cm"),
      scale_row("direct_scale_1_km", "Direct return", direct_light, 1000 / 0.6, "1 km"),
      move_row("fast_moved_10_m", "Fast model", fast_light, 10),
      move_row("fast_moved_1e3_m", "Fast model", fast_light, 1e3),
      move_row("fast_moved_1e6_m", "Fast model", fast_light, 1e6),
      move_row("reference_moved_1e3_m", "Reference renderer", reference_light, 1e3),
      move_row("reference_moved_1e6_m", "Reference renderer", reference_light, 1e6),
      move_row("direct_moved_1e3_m", "Direct return", direct_light, 1e3),
      move_row("direct_moved_9e4_m", "Direct return", direct_light, 9e4),
      move_row("direct_moved_1e6_m", "Direct return", direct_light, 1e6),
  };
}

}  // namespace blindcorner
