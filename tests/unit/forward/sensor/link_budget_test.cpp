// SPDX-License-Identifier: Apache-2.0
/// From pulse energy, aperture and daylight to counts.
#include "blindcorner/forward/sensor/link_budget.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/io/scene_file.h"
#include "bundled.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using nlohmann::json;
using testing_scenes::at_tolerance;

/// The street LiDAR's figures.
Link street_link() {
  Link link;
  link.pulse_energy = 20e-6;
  link.repetition_rate = 20e3;
  link.exposure = 0.1;
  link.wavelength = 905e-9;
  link.aperture = 0.02;
  link.transmission = 0.7;
  link.detection_efficiency = 0.15;
  link.filter_width = 10e-9;
  return link;
}

json street_json() {
  std::ifstream file(std::string(SOURCE_DIR) + "/scenes/street_corner.json");
  json scene = json::parse(file);
  scene["sensor"]["link"] = {{"pulse_energy_nj", 20000},
                             {"repetition_rate_hz", 20000},
                             {"exposure_s", 0.1},
                             {"wavelength_nm", 905},
                             {"aperture_mm", 20},
                             {"transmission", 0.7},
                             {"detection_efficiency", 0.15},
                             {"filter_width_nm", 10},
                             {"ambient_illuminance_lux", 11000}};
  scene["linear"]["ambient"].erase("counts_per_bin");
  return scene;
}

// 1 W/m^2 on pi (10 mm)^2 for 0.1 s at 1 count in 9.5 photons of 2.195e-19 J.
TEST(LinkBudget, GainIsCountsPerIrradiance) {
  EXPECT_NEAR(photon_energy(905e-9), 2.195e-19, 1e-22);
  EXPECT_NEAR(link_gain(street_link()), kPi * 1e-4 * 0.7 * 0.15 * 0.1 / 2.195e-19, 1e-3 * 1.5e13);
  EXPECT_NEAR(link_radiant_intensity(street_link(), 0.588), 0.4 / 0.588, 1e-9);
}

// S/N of values with Gaussian noise is over that noise, not over counts' own.
TEST(LinkBudget, SignalToNoiseFollowsTheNoiseModel) {
  Scene scene = bundled_scene("denali_like");
  const SensorPlacement sensor = sensor_placement(scene);
  const auto model = make_fast_model(scene, sensor, at_tolerance(0.1));
  PoseVector pose(2);
  for (Eigen::Index i = 0; i < 2; ++i) {
    const Unknown& u = scene.unknowns[static_cast<std::size_t>(i)];
    pose[i] = 0.5 * (u.lower + u.upper);
  }
  scene.sensor.noise = GaussianNoise{4.0, 0.0, false};
  double before = 0;
  for (const double floor : {4.0, 16.0}) {
    std::get<GaussianNoise>(scene.sensor.noise).variance_floor = floor;
    double best = 0;
    for (const ZoneBudget& b : link_budget(scene, *model, pose)) {
      best = std::max(best, b.signal_to_noise);
      if (b.gate_bins > 0) {
        EXPECT_LE(b.signal_to_noise, b.three_bounce / std::sqrt(floor * b.gate_bins) + 1e-12);
        EXPECT_GE(b.signal_to_noise, 0.89 * b.three_bounce / std::sqrt(floor * b.gate_bins));
      }
    }
    ASSERT_GT(best, 0);
    if (before > 0) {
      EXPECT_NEAR(best, before / 2, 1e-6 * before);
    }
    before = best;
  }
}

// Integrated over all wavelengths the spectrum is the illuminance over the efficacy, and the
// efficacy is that of the eye: V(lambda) = 1.019 exp(-285.4 (lambda - 0.559 um)^2), 683 lm/W.
TEST(LinkBudget, DaylightIsABlackBodyOfItsIlluminance) {
  double power = 0;
  double lumen = 0;
  for (double lambda = 0.1; lambda < 40; lambda += 0.001) {
    const double spectral = daylight_irradiance(lambda * 1e-6, 1e5) * 1e-9;  // of 1 nm
    power += spectral;
    lumen += 683 * 1.019 * std::exp(-285.4 * std::pow(lambda - 0.559, 2)) * spectral;
  }
  EXPECT_NEAR(power, 1e5 / 93, 0.005 * 1e5 / 93);
  EXPECT_NEAR(lumen, 1e5, 0.03 * 1e5) << "the efficacy of 93 lm/W is that of the spectrum itself";
  // ASTM G173 has 0.79 W/m^2/nm at 905 nm under 109 klx, within 10 %.
  EXPECT_NEAR(daylight_irradiance(905e-9, 1.09e5) * 1e-9, 0.79, 0.08);
}

// The preset's own figures were worked out by hand from the same quantities.
TEST(LinkBudget, SceneWithALinkHasThePresetsGains) {
  const Scene with = parse_scene(street_json(), "street.json");
  EXPECT_NEAR(with.sensor.zones[0].gain, 1.5e13, 0.02 * 1.5e13);
  EXPECT_NEAR(with.sensor.radiant_intensity, 0.68, 0.01);
  // Overcast daylight of 0.8 W/m^2 in 10 nm: 2.8e5 counts a bin from a facade of albedo 0.4. Zones
  // that look at the road, at the sky or at both see less.
  EXPECT_LT(with.linear.fixed_ambient, 2.8e5);
  EXPECT_GT(with.linear.fixed_ambient, 0.5 * 2.8e5);
}

TEST(LinkBudget, StatedAmbientLightIsKept) {
  json scene = street_json();
  scene["linear"]["ambient"]["counts_per_bin"] = 123;
  EXPECT_EQ(parse_scene(scene, "street.json").linear.fixed_ambient, 123);
}

TEST(LinkBudget, WrongLinksAreRefusedByName) {
  const auto message = [](const std::function<void(json&)>& change) -> std::string {
    json scene = street_json();
    change(scene["sensor"]);
    try {
      parse_scene(scene, "street.json");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  using testing::HasSubstr;
  EXPECT_THAT(message([](json& s) { s["link"].erase("exposure_s"); }),
              HasSubstr("sensor.link.exposure_s: found nothing"));
  EXPECT_THAT(message([](json& s) { s["link"]["detection_efficiency"] = 1.5; }),
              HasSubstr("sensor.link.detection_efficiency: found 1.5"));
  EXPECT_THAT(message([](json& s) { s["link"]["aperture"] = 3; }),
              HasSubstr("sensor.link.aperture"));
  EXPECT_THAT(message([](json& s) { s["link"] = 3; }), HasSubstr("sensor.link: found 3"));
  EXPECT_THAT(message([](json& s) { s["gain"] = 3; }), HasSubstr("sensor.gain: found 3"));
  EXPECT_THAT(message([](json& s) { s["illumination"]["radiant_intensity_w_per_sr"] = 3; }),
              HasSubstr("sensor.illumination.radiant_intensity_w_per_sr: found 3"));
}

TEST(LinkBudget, ZonesAddUpToTheExpectedCounts) {
  Scene scene = parse_scene(street_json(), "street.json");
  scene.sensor.zones[0].background.assign(static_cast<std::size_t>(scene.sensor.bins), 1e4);
  const auto model = make_fast_model(scene, sensor_placement(scene), at_tolerance(0.3));
  const PoseVector pose = pose_of(scene.hidden.placement, scene.unknowns);
  const auto zones = link_budget(scene, *model, pose);
  const HistogramCube counts =
      expected_counts(scene, model->three_bounce(pose), model->static_background(),
                      {1.0, scene.linear.fixed_ambient, scene.linear.fixed_direct});
  for (int z = 0; z < counts.zones(); ++z) {
    const ZoneBudget& b = zones[static_cast<std::size_t>(z)];
    const double sum = std::accumulate(counts.zone(z), counts.zone(z) + counts.bins, 0.0);
    EXPECT_NEAR(b.direct + b.three_bounce + counts.bins * b.background, sum, 1e-9 * sum);
  }
}

// Coates' law: a pulse that has been detected sees nothing more. No bin may lose more than the
// plan's bound, in shares of its own counts.
TEST(LinkBudget, PileUpStaysWithinItsBound) {
  json given = street_json();
  given["sensor"]["link"]["detectors_per_zone"] = 100'000;
  given["sensor"]["link"]["ambient_illuminance_lux"] = 1000;
  const Scene scene = parse_scene(given, "street.json");
  const auto model = make_fast_model(scene, sensor_placement(scene), at_tolerance(0.3));
  const PoseVector pose = pose_of(scene.hidden.placement, scene.unknowns);
  TransportPlan plan = model->plan();
  decide_pile_up(plan, scene, link_budget(scene, *model, pose));
  const double bound = plan.decision(Term::pile_up).bound;
  ASSERT_GT(bound, 0.0);
  ASSERT_LT(bound, 1.0);
  const HistogramCube counts =
      expected_counts(scene, model->three_bounce(pose), model->static_background(),
                      {1.0, scene.linear.fixed_ambient, scene.linear.fixed_direct});
  const double pulses = scene.sensor.link->pulses() * scene.sensor.link->detectors;
  double largest = 0;
  for (int z = 0; z < counts.zones(); ++z) {
    double before = 0;  // mean detections of a pulse in earlier bins
    for (int k = 0; k < counts.bins; ++k) {
      const double mean = counts.zone(z)[k] / pulses;
      const double detected = -std::expm1(-mean) * std::exp(-before);
      if (mean > 0) largest = std::max(largest, 1 - detected / mean);
      before += mean;
    }
  }
  EXPECT_LE(largest, bound);
  EXPECT_GT(largest, 0.2 * bound) << "a bound that is met by far says nothing";
}

TEST(LinkBudget, WithoutALinkPileUpIsNotKnown) {
  const Scene scene = bundled_scene("tmf8828_wall");
  TransportPlan plan;
  decide_pile_up(plan, scene, std::vector<ZoneBudget>(9));
  EXPECT_TRUE(std::isinf(plan.decision(Term::pile_up).bound));
}

/// One narrow zone and field on a large wall, a small object far from both.
Scene far_scene(const Material& material, double field_deg) {
  Scene scene;
  Zone zone;
  const double h = 0.1 * kDegree;
  zone.footprint = AngularRectangle{-h, h, -h, h};
  scene.sensor.zones = {zone};
  scene.sensor.bins = 512;
  scene.sensor.bin_width = 1e-10;
  const double f = field_deg / 2 * kDegree;
  scene.sensor.field = AngularRectangle{-f, f, -f, f};
  Surface wall;
  wall.shape = RectangleShape{40, 40};
  wall.T_world_surface.linear() =
      Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  wall.T_world_surface.translation() = Eigen::Vector3d(1, 0, 0);
  wall.relay = true;
  scene.surfaces = {wall};
  scene.hidden.shape = RectangleShape{0.01, 0.01};
  scene.hidden.material = material;
  scene.hidden.placement.position = Eigen::Vector3d(-0.5, 2, 0);
  scene.hidden.placement.yaw = -53 * kDegree;
  return scene;
}

// The formulas' limits: d^-2 for the direct return, r^-4 and no d for a Lambertian object under a
// narrow field, d^-2 r^-2 for a retroreflector whose lobe is small against the spot.
TEST(LinkBudget, DistanceExponentsHaveTheirLimits) {
  const Scene matt = far_scene(LambertianMaterial{}, 0.2);
  const auto lambert = distance_exponents(matt, sensor_placement(matt), matt.hidden.placement);
  EXPECT_NEAR(lambert.direct_relay, -2.0, 0.01);
  EXPECT_NEAR(lambert.three_bounce_relay, 0.0, 0.01);
  EXPECT_NEAR(lambert.three_bounce_object, -4.0, 0.02);
  const Scene bright = far_scene(RetroreflectiveMaterial{0.3 * kDegree}, 40);
  const auto retro = distance_exponents(bright, sensor_placement(bright), bright.hidden.placement);
  EXPECT_NEAR(retro.three_bounce_relay, -2.0, 0.02);
  EXPECT_NEAR(retro.three_bounce_object, -2.0, 0.02);
}

// Of several objects the first one moves by itself: another one that stays where it is, and sends
// most of the light, would make every exponent small.
TEST(LinkBudget, DistanceExponentsAreOfTheFirstObjectAlone) {
  Scene scene = far_scene(LambertianMaterial{}, 0.2);
  HiddenObject other = scene.hidden;
  scene.hidden.name = "near";
  other.name = "bright";
  other.shape = RectangleShape{0.1, 0.1};
  other.placement.position.z() += 0.5;
  scene.further_hidden = {other};
  const auto exponents = distance_exponents(scene, sensor_placement(scene), scene.hidden.placement);
  EXPECT_NEAR(exponents.three_bounce_object, -4.0, 0.02);
}

}  // namespace
}  // namespace blindcorner
