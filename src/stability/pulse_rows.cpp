// SPDX-License-Identifier: Apache-2.0
/// Rows about pulses, bins and zones.
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "blindcorner/forward/constants.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kPulseTheme = "Pulses, bins and zones";

/// The wall scene with another pulse and time axis. Time zero lies six sigma after the start of the
/// axis, so that the whole pulse of any path is on the axis.
Scene with_axis(double sigma, double bin_width, int bins) {
  Scene scene = wall_scene();
  scene.sensor.response = ImpulseResponse(GaussianResponse{sigma});
  scene.sensor.bin_width = bin_width;
  scene.sensor.bins = bins;
  scene.sensor.zones[0].time_zero = 6 * sigma;
  return scene;
}

double least(const HistogramCube& light) {
  return *std::min_element(light.values.begin(), light.values.end());
}

double peak(const HistogramCube& light) {
  return *std::max_element(light.values.begin(), light.values.end());
}

/// Relative difference of the light in all bins from that on the usual axis, for the worse model.
StabilityMeasurement energy_kept(const Scene& scene) {
  const double want = total(fast_light(wall_scene()));
  const double fast = total(fast_light(scene)), reference = total(reference_light(scene));
  return {std::max(std::abs(fast / want - 1), std::abs(reference / want - 1)), ""};
}

StabilityRow energy_row(const std::string& name, const std::string& what, double sigma,
                        double bin_width, int bins) {
  return {name,
          kPulseTheme,
          what + ": difference of the light in all bins from that of the usual axis",
          0.01,
          "1",
          LimitOrigin::physics,
          "A pulse integrates to 1 however wide it is; 1 % is the fast model's tolerance.",
          [=] { return energy_kept(with_axis(sigma, bin_width, bins)); }};
}

/// The most negative bin over the brightest one, turned positive, for the worse of both models.
StabilityMeasurement negative_light(const Scene& scene) {
  const HistogramCube fast = fast_light(scene), reference = reference_light(scene);
  if (!(peak(fast) > 0) || !(peak(reference) > 0)) return {std::nan(""), "no light"};
  const double worst = std::max(-least(fast) / peak(fast), -least(reference) / peak(reference));
  return {std::max(worst, 0.0), ""};
}

StabilityRow negative_row(const std::string& name, double bins_wide) {
  return {name,
          kPulseTheme,
          "Pulse of " + name.substr(name.rfind("of_") + 3) +
              " bins: the most negative bin of either model, over its brightest",
          0,
          "1",
          LimitOrigin::physics,
          "Light is never negative.",
          [=] { return negative_light(with_axis(bins_wide * 1e-10, 1e-10, 128)); }};
}

HistogramCube with_threads(std::size_t threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  return fast_light(nine_zone_scene());
}

StabilityMeasurement same_bytes() {
  const HistogramCube one = with_threads(1), many = with_threads(16);
  const bool same =
      one.values.size() == many.values.size() &&
      std::memcmp(one.values.data(), many.values.data(), one.values.size() * sizeof(double)) == 0;
  return {same ? 0.0 : 1.0, ""};
}

/// Relative difference of the light of n x n zones from that of one zone of 30 degrees which they
/// tile. The zones' solid angles add up.
StabilityMeasurement zones_add_up(int n) {
  const auto tiled = [](int count) {
    Scene scene = wall_scene();
    Sensor& sensor = scene.sensor;
    sensor.rows = sensor.columns = count;
    sensor.zones.clear();
    const double edge = 30 * kDegree / count, start = -15 * kDegree;
    for (int z = 0; z < count * count; ++z) {
      const int row = z / count, column = z % count;
      Zone zone;
      zone.time_zero = 1e-9;
      zone.footprint = AngularRectangle{start + column * edge, start + (column + 1) * edge,
                                        start + row * edge, start + (row + 1) * edge};
      sensor.zones.push_back(zone);
    }
    return scene;
  };
  return {std::abs(total(fast_light(tiled(n))) / total(fast_light(tiled(1))) - 1), ""};
}

}  // namespace

std::vector<StabilityRow> pulse_rows() {
  return {
      energy_row("pulse_10_ps_over_5_m", "Pulse of 10 ps, 334 bins of 100 ps (5 m)", 10e-12, 1e-10,
                 334),
      energy_row("pulse_5_ns", "Pulse of 5 ns, 1024 bins of 100 ps", 5e-9, 1e-10, 1024),
      energy_row("one_bin", "One bin of 100 ns", 150e-12, 1e-7, 1),
      energy_row("bins_100000", "100,000 bins of 0.2 ps, pulse of 150 ps", 150e-12, 2e-13, 100'000),
      energy_row("bins_30_pulses_wide", "Bins of 4.5 ns, pulse of 150 ps", 150e-12, 4.5e-9, 8),
      energy_row("bins_hundredth_of_pulse", "Bins of a hundredth of the pulse of 150 ps", 150e-12,
                 1.5e-12, 16'384),
      negative_row("pulse_of_0.1", 0.1),
      negative_row("pulse_of_0.01", 0.01),
      negative_row("pulse_of_0.0001", 1e-4),
      {"pulse_of_0.0001_nine_zones", kPulseTheme,
       "Pulse of 0.0001 bins seen by nine zones: the most negative bin of either model, over its "
       "brightest",
       0, "1", LimitOrigin::physics, "Light is never negative.",
       [] {
         Scene scene = nine_zone_scene();
         scene.sensor.response = ImpulseResponse(GaussianResponse{1e-14});
         return negative_light(scene);
       }},
      {"zones_64_x_64", kPulseTheme,
       "64 x 64 zones that tile one of 30 degrees: difference of all light", 0.01, "1",
       LimitOrigin::physics,
       "The zones' solid angles add up to that of the one; 1 % is the fast model's tolerance.",
       [] { return zones_add_up(64); }},
      {"zones_128_x_128", kPulseTheme, "128 x 128 zones: 0 for a clear refusal", 0, "1",
       LimitOrigin::arithmetic,
       "The limit is 4096 zones: a light leg for each zone, patch and cell grows with them.",
       [] { return refusal([] { zones_add_up(128); }); }},
      {"zones_32_x_32", kPulseTheme,
       "32 x 32 zones that tile one of 30 degrees: difference of all light", 0.01, "1",
       LimitOrigin::physics,
       "The zones' solid angles add up to that of the one; 1 % is the fast model's tolerance.",
       [] { return zones_add_up(32); }},
      {"threads_1_and_16", kPulseTheme,
       "The light of nine zones with 1 and with 16 threads: 0 where all bytes are the same", 0, "1",
       LimitOrigin::arithmetic, "Sums are made in one order at any number of threads.", same_bytes},
  };
}

}  // namespace blindcorner
