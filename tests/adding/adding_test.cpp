// SPDX-License-Identifier: Apache-2.0
/// The examples of docs/adding.md do what the page says of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "adding/examples.h"
#include "adding/readout_noise.h"
#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/planner/vehicles/vehicle.h"
#include "bundled.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Gone when the test ends.
class Adding : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    directory_ =
        fs::path(::testing::TempDir()) / ("blindcorner_adding_" + std::string(info->name()));
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  void TearDown() override { fs::remove_all(directory_); }

  fs::path directory_;
};

// A closed surface: areas add up to the hexagon's, and area times normal to nothing.
TEST_F(Adding, AHexagonIsAClosedColumn) {
  const HexagonShape shape{.edge = 0.4, .height = 1.5};
  const auto hexagon = shape.geometry();
  const double area = 6 * 0.4 * 1.5 + 3 * std::sqrt(3.0) * 0.4 * 0.4;
  double sum = 0, points = 0;
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  for (const SurfaceCell& cell : hexagon->cells(0.1, 1)) {
    sum += cell.area;
    vector += cell.area * cell.normal;
    EXPECT_GT(cell.normal.dot(cell.center), 0);  // outward
  }
  for (const SurfacePoint& point : hexagon->points(0.1)) points += point.area;
  EXPECT_NEAR(sum, area, 1e-9);
  EXPECT_NEAR(points, area, 1e-9);
  EXPECT_LT(vector.norm(), 1e-9);
  EXPECT_EQ(hexagon->triangles(48).size(), 24U);
}

// Mean and variance of 200,000 draws, whose standard errors are 0.2 and 0.3 % of the deviation.
TEST_F(Adding, ReadoutNoiseDrawsWithItsOwnVariance) {
  const ReadoutNoise noise{.readout = 3};
  std::vector<double> counts(200'000, 16.0);
  std::mt19937_64 random(7);
  noise.draw(counts.data(), static_cast<int>(counts.size()), 4, 1, random);
  double mean = 0, square = 0;
  for (const double n : counts) mean += n / static_cast<double>(counts.size());
  for (const double n : counts)
    square += std::pow(n - mean, 2) / static_cast<double>(counts.size());
  EXPECT_NEAR(mean, 16, 5 * std::sqrt(25.0 / 4 / 200'000));
  EXPECT_NEAR(square, noise.variance(16, 1) / 4, 0.02 * 25 / 4);
}

// Its variance is a line, so that the Gaussian likelihood serves it.
TEST_F(Adding, ReadoutNoiseStatesItsVarianceAsALine) {
  ReadoutNoise noise;
  noise.state_line({.floor = 16, .per_count = 1});
  EXPECT_EQ(noise.readout, 4);
  EXPECT_EQ(noise.stated_line()->floor, 16);
}

TEST_F(Adding, TheReaderTakesItsOwnLinesOnly) {
  const fs::path log = directory_ / "hex.log";
  std::ofstream(log) << "H0:0001000a\nping\nH1:00ff0000\nH2:00000000\nH3:00010002\n";
  const ImportSource source(log.string());
  const CaptureReader reader = hex_reader();
  ASSERT_TRUE(reader.recognise(source));
  ImportNotes notes;
  const CaptureFile file = reader.read(source, {}, notes);
  ASSERT_EQ(file.captures.size(), 1U);
  EXPECT_EQ(file.captures[0].counts.zones(), 4);
  EXPECT_EQ(file.captures[0].counts.zone(0)[1], 10);
  EXPECT_EQ(file.captures[0].counts.zone(1)[0], 255);
  EXPECT_EQ(file.bin_width, 250e-12);
}

TEST_F(Adding, TheReaderNamesADamagedLine) {
  const fs::path log = directory_ / "hex.log";
  std::ofstream(log) << "H0:0001\nH1:00x1\n";
  ImportNotes notes;
  try {
    hex_reader().read(ImportSource(log.string()), {}, notes);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::HasSubstr("line 2"),
                                               ::testing::HasSubstr("four hexadecimal digits")));
  }
}

// A sensor without a preset, and a material, in a scene file.
TEST_F(Adding, SensorAndMaterialStandInASceneFile) {
  using nlohmann::json;
  const json scene{{"sensor", json::parse(text_of(SOURCE_DIR "/tests/adding/sensor.json"))},
                   {"sensor_pose", {{"position_m", {0, 0, 1}}}},
                   {"surfaces",
                    {{{"shape", "rectangle"},
                      {"center_m", {1, 0, 1}},
                      {"normal", {-1, 0, 0}},
                      {"width_m", 2},
                      {"height_m", 2},
                      {"relay", true}}}},
                   {"hidden", json::parse(text_of(SOURCE_DIR "/tests/adding/material.json"))},
                   {"unknowns", {{"x_m", {0, 0.5}}, {"y_m", {0.4, 1.0}}}}};
  const Scene read = parse_scene(scene, "example.json");
  EXPECT_EQ(read.sensor.zones.size(), 4U);
  EXPECT_EQ(read.sensor.bins, 64);
  const auto* retro = std::get_if<RetroreflectiveMaterial>(&read.hidden.material);
  ASSERT_NE(retro, nullptr);
  EXPECT_NEAR(retro->lobe_sigma, 3 * kDegree, 1e-12);
}

// Light may take its way backwards. The fast model and the reference renderer agree over the search
// region, and differ from matt.
TEST_F(Adding, BothModelsKnowTheGlossyMaterial) {
  const auto fields = nlohmann::ordered_json::parse(R"({"share": 0.6, "exponent": 20})");
  Scene scene = bundled_scene("tmf8828_wall");
  scene.hidden.material = read_glossy(JsonReader(fields, "glossy.json"));
  EXPECT_EQ(material_name(scene.hidden.material), "glossy");
  const Brdf& brdf = *std::get<BrdfMaterial>(scene.hidden.material).brdf;
  const Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d in = Eigen::Vector3d(1, 0.5, 0.2).normalized();
  const Eigen::Vector3d out = Eigen::Vector3d(1, -0.3, 0.4).normalized();
  EXPECT_DOUBLE_EQ(brdf.value(normal, in, out), brdf.value(normal, out, in));

  const auto fast = make_fast_model(scene, sensor_placement(scene));
  const auto reference = make_reference_renderer(scene, sensor_placement(scene));
  scene.hidden.material = LambertianMaterial{};
  const auto matt = make_fast_model(scene, sensor_placement(scene));
  std::mt19937_64 random(3);
  for (int i = 0; i < 4; ++i) {
    const PoseVector pose = testing_scenes::random_pose(scene, random);
    const HistogramCube light = reference->three_bounce(pose);
    EXPECT_LT(testing_scenes::difference(fast->three_bounce(pose), light), 0.01)
        << pose.transpose();
    EXPECT_GT(testing_scenes::difference(matt->three_bounce(pose), light), 0.1) << pose.transpose();
  }
}

// The whole fit takes the material, too. Where the scene says that the plate is matt, it errs.
TEST_F(Adding, AFitPlacesAGlossyPlate) {
  const auto fields = nlohmann::ordered_json::parse(R"({"share": 0.6, "exponent": 20})");
  Scene scene = bundled_scene("tmf8828_wall");
  scene.hidden.material = read_glossy(JsonReader(fields, "glossy.json"));
  const PoseVector truth = testing_scenes::stated_pose(scene);
  const Capture capture = testing_scenes::reference_capture(scene, truth, 3e5, 1);
  const auto chi_squared = [&] {
    const PoseMixture posterior = fit(scene, capture).posterior;
    const PoseMode& best = posterior.modes.front();
    const PoseVector error = pose_error(scene, best.pose, truth);
    return error.dot(best.covariance.ldlt().solve(error));
  };
  EXPECT_LT(chi_squared(), 18.5);  // 0.1 % of chi squared with four degrees of freedom
  scene.hidden.material = LambertianMaterial{};
  EXPECT_GT(chi_squared(), 18.5);
}

// Between two reports it says what the last one said.
TEST_F(Adding, TheReportedPerceptionIsASecondOld) {
  const Scene scene = bundled_scene("tmf8828_floor");
  const auto truth = [](double time) {
    return std::optional<PoseVector>({PoseVector{{time, 2.0}}});
  };
  const auto perception = reported_perception({scene, {}, nullptr, truth});
  for (const auto& [time, x] : {std::pair(0.0, 0.0), {0.6, 0.0}, {1.2, 1.2}, {1.8, 1.2}}) {
    const PerceptionAnswer answer = perception->perceive({}, Transform::Identity(), time);
    ASSERT_TRUE(answer.mixture);
    EXPECT_EQ(answer.mixture->modes.front().pose[0], x) << time;
  }
}

// At a curvature of 1/2 it goes round a circle of 2 m: back at its start after 4 pi metres.
TEST_F(Adding, TheCartDrivesACircle) {
  Vehicle vehicle(cart());
  vehicle.place({.speed = 1, .yaw_rate = 0.5});
  const double dt = 4 * kPi / 1000;
  double farthest = 0;
  for (int i = 0; i < 1000; ++i) {
    vehicle.step(DriveRequest{.acceleration = 0, .curvature = 0.5}, dt);
    farthest = std::max(farthest, vehicle.state().position.norm());
  }
  EXPECT_NEAR(farthest, 4, 1e-3);
  EXPECT_LT(vehicle.state().position.norm(), 1e-3);
}

// Ten times the exposures make the error smaller by sqrt(10), but for the prior of the brightness,
// which counts as a measurement: less than one in a hundred. The files are there.
TEST_F(Adding, TheStudyWritesATableAndAPage) {
  CLI::App app;
  int exit_code = -1;
  example_study(app, exit_code);
  app.parse("bound '" SOURCE_DIR "/scenes/tmf8828_floor.json' -o '" + directory_.string() + "'");
  EXPECT_EQ(exit_code, 0);
  std::ifstream table(directory_ / "bound.csv");
  std::string line;
  std::getline(table, line);
  EXPECT_EQ(line, "exposures,position_m");
  std::vector<double> errors;
  while (std::getline(table, line)) errors.push_back(std::stod(line.substr(line.find(',') + 1)));
  ASSERT_EQ(errors.size(), 3U);
  EXPECT_NEAR(errors[0] / errors[1], std::sqrt(10.0), 0.03);
  EXPECT_THAT(text_of(directory_ / "bound.html"), ::testing::HasSubstr("<svg"));
}

}  // namespace
}  // namespace blindcorner
