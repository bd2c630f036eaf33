// SPDX-License-Identifier: Apache-2.0
// Scenes made in code: whatever takes one refuses what it cannot compute with, in the words of the
// scene file's reader.
#include "blindcorner/forward/scene/validate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/inverse/baseline/multilateration.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "blindcorner/simulation/synthetic.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using ::testing::HasSubstr;

Scene good() { return testing_scenes::one_narrow_zone(); }

std::string problem_of(const std::function<void(Scene&)>& change) {
  Scene scene = good();
  change(scene);
  return message_of([&] { validate(scene); });
}

TEST(ValidateScene, AcceptsAGoodScene) { EXPECT_NO_THROW(validate(good())); }

TEST(ValidateScene, RefusesAnEmptyScene) {
  const std::string message = message_of([] {
    const Scene empty;
    validate(empty);
  });
  EXPECT_THAT(message, HasSubstr("scene: sensor.zones: found an array of 0, accepted: an array of "
                                 "1 zones (rows * columns)"));
  EXPECT_THAT(message, HasSubstr("\nscene: surfaces: found [], accepted: an array of at least 1"));
}

TEST(ValidateScene, NamesFieldValueAndRangeInTheFilesUnits) {
  const std::string place = "one narrow zone: ";
  EXPECT_EQ(problem_of([](Scene& s) { s.sensor.bin_width = -1e-10; }),
            place + "sensor.bin_width_ps: found -100, accepted: a number > 0 and <= 1000000000");
  EXPECT_EQ(problem_of([](Scene& s) { s.sensor.bins = 0; }),
            place + "sensor.bins: found 0, accepted: a whole number from 1 to 131072");
  EXPECT_EQ(problem_of([](Scene& s) { s.sensor.field = AngularCone{}; }),
            place +
                "sensor.illumination.field.cone_half_angle_deg: found 0, accepted: a number > 0 "
                "and < 90");
  EXPECT_EQ(problem_of([](Scene& s) { std::swap(s.unknowns[0].lower, s.unknowns[0].upper); }),
            place + "unknowns.x_m: found [0.21,0.19], accepted: [lower, upper] with lower < upper");
  EXPECT_EQ(problem_of([](Scene& s) { s.surfaces[0].albedo = 5; }),
            place + "surfaces[0].albedo: found 5, accepted: a number > 0 and <= 1");
}

// Tables of paths to all of a plate of 10 km took 14 GB, of one of 100 km all memory.
TEST(ValidateScene, RefusesAnObjectFarBeyondTheTimeAxis) {
  const Scene scene = good();
  const double axis = kSpeedOfLight * scene.sensor.bins * scene.sensor.bin_width;
  const auto with_plate = [axis](double edge) {
    return [=](Scene& s) { s.hidden.shape = RectangleShape{edge * axis, edge * axis}; };
  };
  EXPECT_EQ(problem_of(with_plate(60)), "no error");
  EXPECT_THAT(problem_of(with_plate(90)), HasSubstr("hidden: found an object of "));
}

TEST(ValidateScene, DegreesThatWereGivenForRadiansAreOutOfRange) {
  EXPECT_THAT(problem_of([](Scene& s) {
                s.sensor.zones[0].footprint = AngularRectangle{-20, 20, -20, 20};
              }),
              HasSubstr("sensor.zones[0].angles_deg (left, right)[0]: found -1145.91559"));
  EXPECT_THAT(problem_of([](Scene& s) { s.hidden.material = RetroreflectiveMaterial{1.0}; }),
              HasSubstr("hidden.material.retroreflective.lobe_sigma_deg: found 57.2957"));
  EXPECT_THAT(problem_of([](Scene& s) {
                s.unknowns = {{Component::yaw, -90, 90, std::nullopt}};
              }),
              HasSubstr("unknowns.yaw_deg"));
}

TEST(ValidateScene, ListsEveryProblem) {
  const std::string message = problem_of([](Scene& s) {
    s.hidden.albedo = 0;
    s.presence_prior = 1;
    s.sensor.zones[0].gain = std::numeric_limits<double>::quiet_NaN();
  });
  EXPECT_EQ(std::ranges::count(message, '\n'), 2) << message;
}

TEST(ValidateScene, IsCalledByEverythingThatTakesAScene) {
  const Scene empty;
  const Capture capture;
  std::mt19937_64 random(1);
  const std::vector<std::pair<const char*, std::function<void()>>> entries = {
      {"fit", [&] { fit(empty, capture); }},
      {"Fitter", [&] { Fitter{empty}; }},
      {"calibrate",
       [&] {
         calibrate(empty, {&capture, 1});
       }},
      {"sensor_placement", [&] { sensor_placement(empty); }},
      {"check_relay_visible", [&] { check_relay_visible(empty); }},
      {"make_reference_renderer", [&] { make_reference_renderer(empty, {}); }},
      {"make_fast_model", [&] { make_fast_model(empty, {}); }},
      {"make_scene_transport", [&] { make_scene_transport(empty); }},
      {"BackProjection", [&] { BackProjection{empty}; }},
      {"Multilateration", [&] { Multilateration{empty}; }},
      {"SimulatedSensor", [&] { SimulatedSensor{empty}; }},
      {"draw_pose", [&] { draw_pose(empty, random); }},
  };
  for (const auto& [name, call] : entries) {
    EXPECT_THAT(message_of(call), HasSubstr("sensor.zones: found an array of 0")) << name;
  }
}

}  // namespace
}  // namespace blindcorner
