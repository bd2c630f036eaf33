// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "blindcorner/inverse/baseline/cnn_training.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/simulation/drive_dataset.h"
#include "blindcorner/simulation/perception.h"
#include "bundled.h"
#include "simulation/drive_setup.h"
#include "unit/error_message.h"

namespace blindcorner {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Drive& robot() { return bundled_drive("robot"); }

/// Captures that hold nothing to learn, with poses from all of the search region.
std::vector<Capture> noise(const Scene& scene) {
  std::mt19937_64 random(1);
  std::poisson_distribution<int> photons(20);
  std::vector<Capture> captures;
  for (int i = 0; i < 12; ++i) {
    Capture capture;
    capture.counts = HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
    for (double& count : capture.counts.values) count = photons(random);
    const std::vector<std::string> names = unknown_names(scene);
    for (std::size_t k = 0; k < names.size(); ++k) {
      const Unknown& unknown = scene.unknowns[k];
      capture.truth[names[k]] =
          std::uniform_real_distribution<double>(unknown.lower, unknown.upper)(random);
    }
    capture.source = "noise";
    capture.index = i;
    captures.push_back(capture);
  }
  return captures;
}

class NetworkPerception : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!CnnBaseline::available()) GTEST_SKIP() << "this build has no libtorch";
    directory_ = std::filesystem::path(::testing::TempDir()) /
                 ("network_perception_" + std::to_string(::getpid()));
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  /// A file of weights for the robot's scene.
  std::string weights(const std::string& network) const {
    CnnTrainingOptions options = CnnTrainingOptions::of(parse_cnn_architecture(network, "network"));
    options.epochs = 1;
    options.early_stopping = 0;
    const std::string path = (directory_ / (network + ".pt")).string();
    std::ofstream(path, std::ios::binary)
        << train_cnn(robot().scene, noise(robot().scene), options).weights;
    return path;
  }

  std::filesystem::path directory_;
};

TEST_F(NetworkPerception, TheFileSaysWhichPerceptionItIsOf) {
  const std::string published = weights("published"), wide = weights("wide");
  const auto files = weight_files(robot(), {wide, published}, {"los", "cnn", "cnn_wide"});
  EXPECT_EQ(files.at("cnn"), published);
  EXPECT_EQ(files.at("cnn_wide"), wide);
  EXPECT_THAT(message_of([&] {
                weight_files(robot(), {published, published}, {"cnn"});
              }),
              HasSubstr("both of cnn"));
  EXPECT_THAT(message_of([&] { weight_files(robot(), {wide}, {"cnn"}); }),
              HasSubstr("cnn has no weights"));
  Drive drive = robot();
  drive.weights = {{"cnn", wide}};
  EXPECT_THAT(message_of([&] { load_networks(drive, weight_files(drive, {}, {"cnn"})); }),
              AllOf(HasSubstr("wide.pt"), HasSubstr("cnn_wide"), HasSubstr("accepted")));
}

TEST_F(NetworkPerception, ThePublishedAnswerIsADiscAndTheEnsemblesHasACovariance) {
  const PerceptionNetworks networks =
      load_networks(robot(), {{"cnn", weights("published")}, {"cnn_wide", weights("wide")}});
  PerceptionSetup setup{robot().scene, robot().motion, {}, {}};
  setup.networks = networks;
  const auto cnn = make_perception("cnn", setup), wide = make_perception("cnn_wide", setup);
  EXPECT_EQ(cnn->disc_radius(), kPublishedDisc);
  EXPECT_FALSE(wide->disc_radius());
  const Capture frame = noise(robot().scene).front();
  const auto said = cnn->perceive(frame, robot().scene.T_world_sensor, 0);
  const auto claimed = wide->perceive(frame, robot().scene.T_world_sensor, 0);
  ASSERT_TRUE(said.mixture && claimed.mixture) << said.error << claimed.error;
  EXPECT_EQ(said.mixture->presence_probability, 1);
  EXPECT_EQ(claimed.mixture->presence_probability, 1);
  for (std::size_t i = 0; i < robot().scene.unknowns.size(); ++i) {
    const Unknown& unknown = robot().scene.unknowns[i];
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_GE(claimed.mixture->mean[k], unknown.lower);
    EXPECT_LE(claimed.mixture->mean[k], unknown.upper);
    EXPECT_GT(claimed.mixture->covariance(k, k), 0);
  }
  // A frame that it cannot read ends no drive.
  EXPECT_FALSE(cnn->perceive({}, Transform::Identity(), 0).error.empty());
}

TEST_F(NetworkPerception, WeightsOfAnotherSceneAreRefused) {
  const std::string file = weights("published");
  Drive other = robot();
  other.scene.unknowns.front().upper += 1;
  EXPECT_THAT(message_of([&] {
                load_networks(other, {{"cnn", file}});
              }),
              AllOf(HasSubstr(file), HasSubstr("trained for " + robot().scene.name)));
  const Drive street = bundled_drive("street_trials");
  EXPECT_THAT(message_of([&] {
                load_networks(street, {{"cnn", file}});
              }),
              HasSubstr("accepted: the scene's 64 zones"));
}

TEST(PerceptionNetworksOfADrive, AreNamedWhereTheyAreMissing) {
  EXPECT_THAT(message_of([] {
                weight_files(robot(), {}, {"los", "cnn"});
              }),
              AllOf(HasSubstr("cnn has no weights"), HasSubstr("--weights")));
  Drive drive = robot();
  drive.weights = {{"los", "w.pt"}};
  EXPECT_THAT(message_of([&] { weight_files(drive, {}, {"los"}); }),
              AllOf(HasSubstr("perception.weights"), HasSubstr("\"los\"")));
}

TEST(PerceptionDelay, OfTheDriveFileComesFirst) {
  Drive drive = robot();
  EXPECT_GT(declared_delay(drive, "cnn_wide"), declared_delay(drive, "cnn"));
  EXPECT_EQ(declared_delay(drive, "los"), 0);
  drive.delay["cnn"] = 0.3;
  EXPECT_EQ(declared_delay(drive, "cnn"), 0.3);
}

// As published: each frame of drives that know the truth, at a place of its own for each drive.
TEST(DriveDataset, HoldsFramesWithTruthAndSensorPose) {
  Drive drive = robot();
  drive.time_limit = 1;
  const SimulatedSensor sensor(drive.scene);
  const std::vector<Trial> drives = plan_drive_dataset(drive, {2, 1});
  ASSERT_EQ(drives.size(), 2U);
  EXPECT_GT(drives.front().seed, 1'000'000'000U) << "a trial may drive in the same world";
  const std::vector<Capture> captures = record_drives(drive, sensor, drives);
  ASSERT_GE(captures.size(), 4U);
  for (const Capture& capture : captures) {
    EXPECT_EQ(capture.truth.size(), drive.scene.unknowns.size());
    EXPECT_TRUE(capture.T_world_sensor);
    check_cnn_capture(drive.scene, capture);
  }
  EXPECT_NE(captures.front().truth, captures.back().truth);
  EXPECT_EQ(captures[0].truth, captures[1].truth);
  EXPECT_GT((captures[1].T_world_sensor->translation() - captures[0].T_world_sensor->translation())
                .norm(),
            0.01);
  EXPECT_THAT(message_of([&] { plan_drive_dataset(drive, {0, 1}); }), HasSubstr("environments"));
  EXPECT_THAT(message_of([&] { plan_drive_dataset(drive, {1, 1, 0}); }), HasSubstr("places"));
}

// More places of the hidden object in each frame, none of them in sight; what is there comes first
// and is as it would be without them.
TEST(DriveDataset, HoldsFurtherPlacesOfEachFrame) {
  Drive drive = robot();
  drive.time_limit = 1;
  const SimulatedSensor sensor(drive.scene);
  const std::vector<Trial> drives = plan_drive_dataset(drive, {1, 1, 3});
  const std::vector<Capture> plain = record_drives(drive, sensor, drives);
  const std::vector<Capture> captures = record_drives(drive, sensor, drives, 3);
  ASSERT_EQ(captures.size(), 3 * plain.size());
  std::set<std::map<std::string, double>> places;
  const LineOfSight sight(drive.scene, drive.map, sight_options(drive));
  const auto pose_of = [&](const Capture& capture) {
    PoseVector pose(static_cast<Eigen::Index>(capture.truth.size()));
    Eigen::Index k = 0;
    for (const std::string& name : unknown_names(drive.scene)) pose[k++] = capture.truth.at(name);
    return pose;
  };
  for (std::size_t i = 0; i < captures.size(); ++i) {
    const Capture& capture = captures[i];
    EXPECT_EQ(capture.index, static_cast<int>(i));
    check_cnn_capture(drive.scene, capture);
    EXPECT_TRUE(capture.T_world_sensor->isApprox(*plain[i / 3].T_world_sensor));
    if (i % 3 == 0) {
      EXPECT_EQ(capture.counts.values, plain[i / 3].counts.values);
    } else {
      EXPECT_TRUE(places.insert(capture.truth).second) << "the same place twice";
      const PoseVector pose = pose_of(capture);
      EXPECT_THAT(sight.scan(*capture.T_world_sensor, placements_at(drive.scene, pose)).object_hits,
                  IsEmpty());
    }
  }
  // One sensor pose's light is computed once, and is what it would be for each place by itself.
  const Transform& at = *plain.front().T_world_sensor;
  const PoseVector pose = pose_of(captures[1]);
  EXPECT_EQ(sensor.sense_each(at, {pose}, 7).front().counts.values,
            sensor.sense(at, pose, 7).capture.counts.values);
}

}  // namespace
}  // namespace blindcorner
