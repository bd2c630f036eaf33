// SPDX-License-Identifier: Apache-2.0
/// Calibration finds again what synthetic captures were made with.
#include "blindcorner/inverse/calibration/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <tuple>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "bundled.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

/// Captures of an instrument at random poses of the search region, by the reference renderer.
/// Gaussian noise by the instrument's own law, ambient light as given.
std::vector<Capture> captures_of(const Scene& instrument, int count, double ambient,
                                 std::uint64_t seed) {
  const auto model = make_reference_renderer(instrument, sensor_placement(instrument));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Capture> captures;
  for (int i = 0; i < count; ++i) {
    Capture capture;
    const PoseVector pose = testing_scenes::random_pose(instrument, random);
    const auto names = unknown_names(instrument);
    for (std::size_t k = 0; k < names.size(); ++k) {
      capture.truth[names[k]] = pose[static_cast<Eigen::Index>(k)];
    }
    capture.counts = model->three_bounce(pose);
    for (int z = 0; z < capture.counts.zones(); ++z) {
      const double gain = instrument.sensor.zones[static_cast<std::size_t>(z)].gain;
      for (int b = 0; b < capture.counts.bins; ++b) {
        double& n = capture.counts.zone(z)[b];
        const double mean = gain * n + ambient;
        n = mean + std::sqrt(count_variance(instrument.sensor, z, mean)) * normal(random);
      }
    }
    capture.source = "synthetic";
    capture.index = i;
    captures.push_back(std::move(capture));
  }
  return captures;
}

const CalibratedParameter& parameter(const Calibration& calibration, std::string_view name) {
  for (const CalibratedParameter& p : calibration.parameters) {
    if (p.name == name) return p;
  }
  throw Error("parameter", std::string(name) + " is missing");
}

/// Within four standard errors, and the standard error small against the prior.
void expect_found(const Calibration& calibration, const std::string& name, double truth) {
  const CalibratedParameter& p = parameter(calibration, name);
  EXPECT_TRUE(p.determined) << name;
  const double off = p.logarithmic ? std::log(p.value / truth) : p.value - truth;
  EXPECT_LT(std::abs(off), 4 * p.standard_error) << name << " " << p.value << " for " << truth;
  EXPECT_LT(p.standard_error, 0.8 * p.prior_sigma) << name;
}

/// No bin left out, no time axis that wraps.
void open_time_axis(Scene& scene) {
  scene.sensor.wrap_bins = 0;
  for (Zone& zone : scene.sensor.zones) {
    zone.first_valid_bin = 0;
    zone.last_valid_bin = scene.sensor.bins - 1;
    zone.wrap_bins = -1;
  }
}

/// Captures without an object, of the direct return, the ambient light and the scene's background.
std::vector<Capture> empty_captures(const Scene& scene, int count, const HistogramCube& direct,
                                    const LinearValues& linear, std::uint64_t& seed) {
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  std::vector<Capture> captures(static_cast<std::size_t>(count));
  for (Capture& capture : captures) {
    capture.counts = draw_counts(scene, expected_counts(scene, nothing, direct, linear), 1, seed++);
    capture.source = "empty";
  }
  return captures;
}

// Photons vary by their number. 1152 bins leave a standard deviation of 4 % (root of 2 / 1152), of
// which four are tolerated.
TEST(Calibration, OneEmptyCaptureOfPhotonsVariesByTheirNumber) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const auto renderer = make_reference_renderer(scene, sensor_placement(scene));
  const LinearValues linear{1, scene.linear.fixed_ambient, scene.linear.fixed_direct, 1};
  CalibrationOptions options;
  options.variance_scale = false;
  std::uint64_t seed = 2;
  const auto captures = empty_captures(scene, 1, renderer->static_background(), linear, seed);
  EXPECT_NEAR(calibrate(scene, captures, options, true).scene.sensor.dispersion, 1, 0.17);
}

/// The mirrors' scene with bright light, and an instrument that differs from it.
struct Differing {
  Scene scene = bundled_scene("cheapspad_mirrors");
  Scene instrument = scene;
  Differing() {
    instrument.sensor.bin_width *= 1.01;
    for (std::size_t z = 0; z < instrument.sensor.zones.size(); ++z) {
      Zone& zone = instrument.sensor.zones[z];
      zone.time_zero += 0.3 * scene.sensor.bin_width;
      zone.gain *= 3 * (1 + 0.1 * static_cast<double>(z % 3));
    }
    auto& law = std::get<MeasuredLawMaterial>(instrument.hidden.material);
    law.cosine_exponent = 6;
    law.distance_exponent = 2.4;
    law.axis_across = -0.06;
    law.axis_up = 0.04;
  }
};

/// Light that comes late enough to wrap: after so many bins (0: never) in zones of the first and of
/// the second phase, where the scene says something else.
struct Wrapped : Differing {
  Wrapped(int later_bins, std::array<int, 2> truth, std::array<int, 2> stated) {
    for (Scene* s : {&scene, &instrument}) {
      open_time_axis(*s);
      for (Zone& zone : s->sensor.zones) zone.time_zero += later_bins * s->sensor.bin_width;
    }
    for (std::size_t z = 0; z < 8; ++z) {
      instrument.sensor.zones[z].wrap_bins = truth[z % 2];
      scene.sensor.zones[z].wrap_bins = stated[z % 2];
    }
  }
};

/// The first and the third spot of the mirrors' scene take each other's place.
void swap_spots(Scene& scene) {
  for (const std::size_t phase : {std::size_t{0}, std::size_t{1}}) {
    std::swap(scene.sensor.zones[phase].footprint, scene.sensor.zones[4 + phase].footprint);
  }
}

CalibrationOptions quick() {
  CalibrationOptions options;
  options.permutations = false;
  options.wraps = false;
  options.variance_scale = false;
  return options;
}

TEST(Calibration, FindsTheInstrumentWithinItsErrors) {
  const Differing d;
  const Calibration c = calibrate(d.scene, captures_of(d.instrument, 60, 100, 1), quick());
  EXPECT_EQ(c.used, 60);
  expect_found(c, "measured_law.cosine_exponent", 6);
  expect_found(c, "measured_law.distance_exponent", 2.4);
  expect_found(c, "measured_law.axis_across", -0.06);
  expect_found(c, "measured_law.axis_up", 0.04);
  expect_found(c, "bin_width_ps", d.instrument.sensor.bin_width * 1e12);
  const double time_zero = c.scene.sensor.zones[0].time_zero;
  EXPECT_NEAR(time_zero, d.instrument.sensor.zones[0].time_zero, 0.1 * d.scene.sensor.bin_width);
  for (std::size_t z = 0; z < 8; ++z) {
    EXPECT_NEAR(
        std::log(c.scene.sensor.zones[z].gain / d.instrument.sensor.zones[z].gain), 0,
        0.2);  // standard errors are 0.36: the law's axis takes part of what sets them apart
  }
  // Noise model, at the level of the ambient light.
  const auto& noise = std::get<GaussianNoise>(c.scene.sensor.noise);
  EXPECT_NEAR((noise.variance_floor + noise.variance_per_count * 100) / 810, 1, 0.08);
  EXPECT_NEAR(c.scene.linear.ambient_prior.at(0).mean, 100, 3);
  EXPECT_LT(c.deviance_after, c.deviance_before);
  EXPECT_NEAR(c.deviance_after / c.expected_deviance, 1, 0.1);
}

// Two phases of a sensor, one with three times the noise of the other.
TEST(Calibration, FindsTheNoiseOfEachZone) {
  Differing d;
  for (std::size_t z = 0; z < 8; ++z) {
    d.instrument.sensor.zones[z].variance_floor = z % 2 == 0 ? 300 : 900;
  }
  std::get<GaussianNoise>(d.instrument.sensor.noise).variance_per_count = 2;
  const Calibration c = calibrate(d.scene, captures_of(d.instrument, 60, 100, 1), quick());
  for (int z = 0; z < 8; ++z) {
    // At the level of the ambient light; of 600 residuals, 4 standard errors.
    const double found = count_variance(c.scene.sensor, z, 100);
    EXPECT_NEAR(found / count_variance(d.instrument.sensor, z, 100), 1, 0.23) << "zone " << z;
  }
}

// Ten captures of nonsense among seventy: left out, and the answer stays within its errors.
TEST(Calibration, DisturbedCapturesDoNotMoveIt) {
  const Differing d;
  std::vector<Capture> captures = captures_of(d.instrument, 60, 100, 1);
  for (Capture& capture : captures_of(d.instrument, 10, 100, 2)) {
    for (int z = 0; z < 8; ++z) {
      for (int b = 14; b < 18; ++b) capture.counts.zone(z)[b] += 4000;  // something in view
    }
    captures.push_back(capture);
  }
  const Calibration c = calibrate(d.scene, captures, quick());
  EXPECT_EQ(c.left_out.size(), 10u);
  for (const LeftOutCapture& out : c.left_out) {
    EXPECT_GE(out.index, 60);
    EXPECT_THAT(out.reason, testing::ContainsRegex("most in zone [0-7], bin 1[4-7]: "));
  }
  expect_found(c, "measured_law.cosine_exponent", 6);
  expect_found(c, "bin_width_ps", d.instrument.sensor.bin_width * 1e12);
}

// A zone that counts nothing, bins that are always full, and one capture that is full elsewhere.
TEST(Calibration, LeavesOutDeadZonesAndFullBins) {
  Differing d;
  d.scene.sensor.saturation = 1e5;
  std::vector<Capture> captures = captures_of(d.instrument, 60, 100, 1);
  for (Capture& capture : captures) {
    std::fill_n(capture.counts.zone(5), capture.counts.bins, 0.0);
    capture.counts.zone(2)[d.scene.sensor.zones[2].first_valid_bin] = 1e5;
  }
  captures[7].counts.zone(1)[18] = 1e5;
  const Calibration c = calibrate(d.scene, captures, quick());
  EXPECT_TRUE(c.scene.sensor.zones[5].dead);
  EXPECT_EQ(c.scene.sensor.zones[2].first_valid_bin, d.scene.sensor.zones[2].first_valid_bin + 1);
  EXPECT_THAT(c.notes, testing::Contains(testing::HasSubstr("dead zones")));
  EXPECT_THAT(c.notes, testing::Contains(testing::HasSubstr("left out 1 bins of 1 zones")));
  ASSERT_EQ(c.left_out.size(), 1u);
  EXPECT_EQ(c.left_out[0].index, 7);
  EXPECT_THAT(c.left_out[0].reason, testing::HasSubstr("saturates"));
  expect_found(c, "bin_width_ps", d.instrument.sensor.bin_width * 1e12);
}

TEST(Calibration, TellsWhichSpotIsWhich) {
  const Differing d;
  Scene swapped = d.scene;
  swap_spots(swapped);
  CalibrationOptions options = quick();
  options.permutations = true;
  const Calibration c = calibrate(swapped, captures_of(d.instrument, 30, 100, 3), options);
  ASSERT_EQ(c.assignments.size(), 24u);
  EXPECT_EQ(c.assignments.front().spot, (std::vector<int>{2, 1, 0, 3}));
  EXPECT_GT(c.assignments[1].deviance, c.assignments[0].deviance + 50);
}

// Two phases of a sensor: one wraps after 20 bins, which the scene does not know, the other does
// not, where the scene says so. Zones whose light stays clear of all wraps say nothing.
TEST(Calibration, FindsWhereTheTimeAxisWraps) {
  Wrapped d(6, {20, 0}, {0, 22});
  CalibrationOptions options = quick();
  options.wraps = true;
  options.background = false;  // which takes light in the wrong bins for unusable bins
  const std::vector<Capture> captures = captures_of(d.instrument, 40, 100, 4);
  const Calibration c = calibrate(d.scene, captures, options);
  EXPECT_GE(c.wraps.size(), 6u);  // two zones see little that late
  for (const ZoneWrap& wrap : c.wraps) {
    EXPECT_EQ(wrap.found, wrap.zone % 2 == 0 ? 20 : 0) << wrap.zone;
    EXPECT_EQ(wrap.stated, wrap.zone % 2 == 0 ? 0 : 22) << wrap.zone;
    EXPECT_EQ(c.scene.sensor.wrap(wrap.zone), wrap.found);
    EXPECT_GT(wrap.margin, 0) << wrap.zone;
  }
  options.wraps = false;
  const Calibration as_stated = calibrate(d.scene, captures, options);
  EXPECT_LT(c.deviance_after / c.expected_deviance, 1.2);
  EXPECT_GT(as_stated.deviance_after / as_stated.expected_deviance,
            c.deviance_after / c.expected_deviance + 0.1);
  options.wraps = true;
  options.background = true;
  const Calibration both = calibrate(d.scene, captures, options);
  ASSERT_EQ(both.wraps.size(), c.wraps.size());
  for (std::size_t i = 0; i < c.wraps.size(); ++i) EXPECT_EQ(both.wraps[i].found, c.wraps[i].found);
  EXPECT_LT(both.deviance_after / both.expected_deviance,
            c.deviance_after / c.expected_deviance + 0.01);

  // Early light in a short gate, which a wrap in the nearer half of the axis does not change.
  d.scene.sensor.zones[1].wrap_bins = 7;
  for (Zone& zone : d.scene.sensor.zones) {
    zone.first_valid_bin = 8;
    zone.last_valid_bin = 11;
  }
  EXPECT_TRUE(calibrate(d.scene, captures, options).wraps.empty());
}

// Wraps and assignment are both stated wrongly, and most light is where the scene has none. Neither
// can be found without the other. A zone that is listed has decided.
TEST(Calibration, FindsAssignmentAndWrapsTogether) {
  using Wraps = std::array<int, 2>;
  for (const auto& [later, truth, stated] : {std::tuple{6, Wraps{20, 0}, Wraps{0, 22}},
                                             {6, Wraps{18, 18}, Wraps{0, 0}},
                                             {9, Wraps{0, 0}, Wraps{17, 17}},
                                             {9, Wraps{17, 19}, Wraps{20, 15}}}) {
    Wrapped d(later, truth, stated);
    swap_spots(d.scene);
    CalibrationOptions options = quick();
    options.permutations = true;
    options.wraps = true;
    const Calibration c = calibrate(d.scene, captures_of(d.instrument, 40, 100, 4), options);
    SCOPED_TRACE(testing::Message() << "wraps after " << truth[0] << " and " << truth[1]);
    EXPECT_EQ(c.assignments.front().spot, (std::vector<int>{2, 1, 0, 3}));
    EXPECT_GT(c.assignments[1].deviance, c.assignments[0].deviance + 50);
    EXPECT_GE(c.wraps.size(), 6u);
    for (const ZoneWrap& wrap : c.wraps) {
      EXPECT_EQ(wrap.found, truth[static_cast<std::size_t>(wrap.zone) % 2]) << wrap.zone;
    }
    EXPECT_EQ(c.used, 40);
    EXPECT_LT(c.deviance_after / c.expected_deviance, 1.1);
  }
}

// A direct return that the scene does not model, with a strength that drifts, a weak reflection
// behind it, and a last bin without response; the scene takes all bins for valid.
TEST(Calibration, FindsStaticBackgroundAndUnusableBins) {
  Differing d;
  for (Scene* s : {&d.scene, &d.instrument}) open_time_axis(*s);
  const std::vector<double> direct{0, 0, 0, 0, 4000, 60000, 50000, 3000, 0, 40};
  std::vector<Capture> captures = captures_of(d.instrument, 60, 100, 8);
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  for (Capture& capture : captures) {
    for (int z = 0; z < 8; ++z) {
      const double strength = 1 + 0.03 * normal(random);
      for (int b = 0; b < 10; ++b) {
        const double light = direct[static_cast<std::size_t>(b)];
        capture.counts.zone(z)[b] += strength * light + std::sqrt(8 * light) * normal(random);
      }
      capture.counts.zone(z)[d.scene.sensor.bins - 1] = 3 + std::abs(normal(random));
    }
  }
  const Calibration c = calibrate(d.scene, captures, quick());
  EXPECT_EQ(c.used, 60);
  for (int z = 0; z < 8; ++z) {
    const Zone& zone = c.scene.sensor.zones[static_cast<std::size_t>(z)];
    EXPECT_GE(zone.first_valid_bin, 7) << z;  // the two bright bins drift far beyond their noise
    EXPECT_LE(zone.first_valid_bin, 8) << z;
    EXPECT_EQ(zone.last_valid_bin, d.scene.sensor.bins - 2) << z;
  }
  EXPECT_THAT(c.notes, testing::Contains(testing::HasSubstr("valid bins: ")));
  int reflections = 0;
  for (const BackgroundBin& found : c.background) {
    const double truth = direct[static_cast<std::size_t>(std::min(found.bin, 8))];
    const bool reflection = found.bin == 9;
    EXPECT_NEAR(found.counts, reflection ? 40 : truth, 5 * found.standard_error)
        << found.zone << " " << found.bin;
    reflections += reflection ? 1 : 0;
  }
  EXPECT_EQ(reflections, 8);
  expect_found(c, "measured_law.cosine_exponent", 6);
  expect_found(c, "measured_law.distance_exponent", 2.4);
  expect_found(c, "bin_width_ps", d.instrument.sensor.bin_width * 1e12);
  EXPECT_NEAR(c.deviance_after / c.expected_deviance, 1, 0.1);

  CalibrationOptions without = quick();
  without.background = false;
  EXPECT_GT(
      std::abs(std::log(
          parameter(calibrate(d.scene, captures, without), "measured_law.cosine_exponent").value /
          6)),
      0.1);
}

// Few photons, and few captures: chance leaves bins empty or fills them, and none is condemned.
TEST(Calibration, SparseCountsHaveNoBackground) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  scene.sensor.noise = PoissonNoise{};
  for (Zone& zone : scene.sensor.zones) zone.first_valid_bin = 0;
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  std::uint64_t seed = 100;
  int found = 0;
  for (const auto& [ambient, count] :
       {std::pair{0.03, 20}, {0.1, 20}, {0.2, 10}, {0.5, 20}, {1.0, 8}, {2.0, 8}, {2.0, 60}}) {
    for (int repeat = 0; repeat < 4; ++repeat) {
      const std::vector<Capture> captures =
          empty_captures(scene, count, nothing, {0, ambient, 0}, seed);
      const Calibration c = calibrate(scene, captures, quick(), /*no_object=*/true);
      found += static_cast<int>(c.background.size());
      EXPECT_THAT(c.notes, testing::Not(testing::Contains(testing::HasSubstr("valid bins"))))
          << ambient << " " << count;
    }
  }
  EXPECT_LE(found, 2);  // of 5,000 bins
}

// What is not seen often enough stays as stated: here in too few captures.
TEST(Calibration, KeepsAStatedBackgroundThatItCannotSee) {
  Differing d;
  for (Scene* s : {&d.scene, &d.instrument}) {
    s->sensor.zones[3].background.assign(static_cast<std::size_t>(s->sensor.bins), 0.0);
    s->sensor.zones[3].background[17] = 500;
  }
  std::vector<Capture> captures = captures_of(d.instrument, 5, 100, 11);
  for (Capture& capture : captures) capture.counts.zone(3)[17] += 500;
  const Calibration few = calibrate(d.scene, captures, quick());
  EXPECT_EQ(few.scene.sensor.zones[3].background, d.scene.sensor.zones[3].background);
  EXPECT_TRUE(few.background.empty());
  // In many it is what the captures hold, here nothing.
  const Calibration many = calibrate(d.scene, captures_of(d.instrument, 60, 100, 12), quick());
  EXPECT_TRUE(many.scene.sensor.zones[3].background.empty());
}

// A direct return twice as bright as stated, its scale free: the background is one for all scales.
TEST(Calibration, BackgroundIsNotScaledTwice) {
  Scene scene = bundled_scene("denali_like");
  ASSERT_EQ(scene.linear.direct, LinearMode::per_zone);
  Scene instrument = scene;
  for (Zone& zone : instrument.sensor.zones) {
    zone.background.assign(static_cast<std::size_t>(scene.sensor.bins), 0.0);
    zone.background[static_cast<std::size_t>(scene.sensor.bins) - 5] = 300;
  }
  const auto model = make_fast_model(scene, sensor_placement(scene));
  std::uint64_t seed = 40;
  const std::vector<Capture> captures =
      empty_captures(instrument, 10, model->static_background(), {0, 2, 2, 2}, seed);
  CalibrationOptions options = quick();
  options.bin_width_relative = options.pulse_log = 0;
  options.zone_gain_log = options.zone_time_zero_bins = 0;
  const Calibration c = calibrate(scene, captures, options, /*no_object=*/true);
  ASSERT_EQ(c.background.size(), scene.sensor.zones.size());
  for (const BackgroundBin& bin : c.background) {
    EXPECT_EQ(bin.bin, scene.sensor.bins - 5);
    EXPECT_NEAR(bin.counts, 300, 5 * bin.standard_error);
  }
}

// Without an object one capture will do where photons are counted: their noise is known.
TEST(Calibration, MeasuresTheBackgroundOfAnEmptyScene) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  scene.sensor.noise = PoissonNoise{};
  for (Zone& zone : scene.sensor.zones) zone.first_valid_bin = 0;
  Scene instrument = scene;
  for (Zone& zone : instrument.sensor.zones) {
    zone.background.assign(static_cast<std::size_t>(scene.sensor.bins), 0.0);
    zone.background[3] = 400;
    zone.background[4] = 90;
  }
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  for (const int count : {1, 12}) {
    std::uint64_t seed = 3;
    const std::vector<Capture> captures =
        empty_captures(instrument, count, nothing, {0, 2, 0}, seed);
    const Calibration c = calibrate(scene, captures, quick(), /*no_object=*/true);
    const auto zones = static_cast<std::size_t>(scene.sensor.zone_count());
    EXPECT_EQ(c.background.size(), 2 * zones) << count;
    for (const BackgroundBin& found : c.background) {
      EXPECT_NEAR(found.counts, found.bin == 3 ? 400 : 90, 5 * found.standard_error) << count;
      // Of one capture's counts; of twelve, from their scatter (a fifth of it uncertain).
      const double error = std::sqrt((found.bin == 3 ? 402.0 : 92.0) / count);
      EXPECT_NEAR(found.standard_error / error, 1, count == 1 ? 0.2 : 0.75);
    }
  }
}

// A Lambertian scene, rendered pair by pair and calibrated with the fast model.
TEST(Calibration, FindsTimeZeroAndGainOfALambertianScene) {
  Scene scene = bundled_scene("person_vl53l8ch");
  scene.sensor.noise = GaussianNoise{.variance_floor = 100, .variance_per_count = 1};
  scene.linear.ambient = LinearMode::per_zone;
  Scene instrument = scene;
  for (Zone& zone : instrument.sensor.zones) {
    zone.time_zero += 0.4 * scene.sensor.bin_width;
    zone.gain *= 1.7;
  }
  // The direct return is far brighter than anything else and has no noise to speak of here.
  for (Scene* s : {&scene, &instrument}) {
    s->linear.direct = LinearMode::fixed;
    s->linear.fixed_direct = 0;
  }
  CalibrationOptions options = quick();
  options.bin_width_relative = 0;
  options.pulse_log = 0;
  options.zone_gain_log = 0;
  options.zone_time_zero_bins = 0;
  const Calibration c = calibrate(scene, captures_of(instrument, 8, 50, 4), options);
  expect_found(c, "time_zero_ps", instrument.sensor.zones[0].time_zero * 1e12);
  EXPECT_NEAR(parameter(c, "gain_factor").value / 1.7, 1, 0.05);
}

// Without an object nothing is said about the law of its brightness.
TEST(Calibration, KeepsWhatTheDataDoNotDetermine) {
  Differing d;
  for (Zone& zone : d.instrument.sensor.zones) zone.gain *= 1e-9;
  const Calibration c =
      calibrate(d.scene, captures_of(d.instrument, 20, 100, 5), quick(), /*no_object=*/true);
  const CalibratedParameter& p = parameter(c, "measured_law.cosine_exponent");
  EXPECT_FALSE(p.determined);
  EXPECT_EQ(p.value, 7);
  EXPECT_NEAR(c.scene.linear.ambient_prior.at(3).mean, 100, 3);
}

TEST(Calibration, SaysWhatItNeeds) {
  const Differing d;
  EXPECT_THROW(calibrate(d.scene, {}, quick()), Error);
  std::vector<Capture> captures = captures_of(d.instrument, 2, 100, 6);
  captures[1].truth.erase("z_m");
  try {
    calibrate(d.scene, captures, quick());
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("truth.z_m"), std::string::npos) << error.what();
  }
  CalibrationOptions wrong;
  wrong.spot_m = -1;
  EXPECT_THROW(wrong.validate(), Error);
}

}  // namespace
}  // namespace blindcorner
