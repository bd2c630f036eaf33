// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/cnn.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/orientation.h"
#include "blindcorner/inverse/baseline/cnn_training.h"
#include "inverse/baseline/cnn_description.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

/// Two zones of 24 bins; unknown are x, which moves a pulse along the bins, and the yaw of a box,
/// which shares light between the zones. No physics: a network learns it within seconds.
Scene toy_scene() {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.name = "toy";
  scene.sensor.columns = 2;
  scene.sensor.zones.resize(2, scene.sensor.zones.front());
  scene.sensor.bins = 24;
  scene.hidden.shape = BoxShape{{2, 1, 1}};
  scene.unknowns = {{Component::x, 1.0, 3.0, std::nullopt},
                    {Component::yaw, 0.0, kPi, std::nullopt}};
  return scene;
}

Capture toy_capture(const Scene& scene, double x, double yaw, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Capture capture;
  capture.counts = HistogramCube(1, 2, scene.sensor.bins);
  for (int k = 0; k < scene.sensor.bins; ++k) {
    const double pulse = 400 * std::exp(-0.5 * std::pow((k - 6 * x) / 1.5, 2));
    for (int z = 0; z < 2; ++z) {
      const double share = 1 + 0.8 * (z == 0 ? std::cos(2 * yaw) : std::sin(2 * yaw));
      std::poisson_distribution<int> photons(20 + share * pulse);
      capture.counts.zone(z)[k] = photons(random);
    }
  }
  capture.T_world_sensor = testing_scenes::at({0.1 * static_cast<double>(seed % 3), 0, 0});
  capture.truth = {{"x_m", x}, {"yaw_rad", yaw}};
  capture.source = "toy.exr";
  capture.index = static_cast<int>(seed);
  return capture;
}

std::vector<Capture> toy_captures(const Scene& scene, int count) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> x(1.0, 3.0), yaw(0.0, kPi);
  std::vector<Capture> captures;
  for (int i = 0; i < count; ++i) {
    const double at = x(random);
    captures.push_back(toy_capture(scene, at, yaw(random), static_cast<std::uint64_t>(i)));
  }
  return captures;
}

CnnTrainingOptions quick(int epochs) {
  CnnTrainingOptions options;
  options.epochs = epochs;
  options.learning_rate = 1e-2;
  return options;
}

/// What needs libtorch.
class Cnn : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!CnnBaseline::available()) GTEST_SKIP() << "this build has no libtorch";
  }
  Scene scene_ = toy_scene();
};

TEST(CnnDescription, PosesComeBackFromOutputs) {
  const Scene scene = toy_scene();
  const CnnDescription d = describe_cnn(scene, toy_captures(scene, 3), {});
  // The box looks the same after half a turn, which is all of the yaw's range: cosine and sine.
  EXPECT_EQ(d.outputs(), 3);
  for (const double yaw : {0.0, 0.01, 1.5, kPi - 0.01}) {
    const PoseVector pose = Eigen::Vector2d(1.7, yaw);
    const PoseVector back = decode_pose(d, encode_pose(d, pose));
    EXPECT_NEAR(back[0], 1.7, 1e-6);
    EXPECT_NEAR(pose_error(scene, back, pose)[1], 0, 1e-6) << yaw;
    EXPECT_GE(back[1], 0);
    EXPECT_LE(back[1], kPi);
  }
}

TEST(CnnDescription, IsReadAsItWasWritten) {
  const Scene scene = toy_scene();
  const CnnDescription d = describe_cnn(scene, toy_captures(scene, 6), {});
  const std::string text = description_text(d);
  EXPECT_EQ(description_text(parse_description(text, "w.pt")), text);
  EXPECT_NEAR(d.sensor_center.x(), 0.1, 1e-12);
}

TEST(CnnDescription, OtherVersionsAndFieldsAreNamed) {
  const Scene scene = toy_scene();
  std::string text = description_text(describe_cnn(scene, toy_captures(scene, 3), {}));
  text.replace(text.find("cnn/2"), 5, "cnn/1");
  EXPECT_THAT(message_of([&] { parse_description(text, "w.pt"); }),
              AllOf(HasSubstr("w.pt: metadata.format"), HasSubstr("cnn/1"), HasSubstr("cnn/2")));
  EXPECT_THAT(message_of([] { parse_description("no JSON", "w.pt"); }), HasSubstr("w.pt"));
  EXPECT_THAT(message_of([] { parse_description("[1]", "w.pt"); }), HasSubstr("metadata.format"));
  text.replace(text.find("cnn/1"), 5, "cnn/2");
  const std::size_t at = text.find("\"zones\":") + 8;
  for (const char* zones : {"1e300", "4294967304", "8.9", "true", "[[1]]", "5000"}) {
    std::string other = text;
    other.replace(at, other.find(',', at) - at, zones);
    EXPECT_THAT(message_of([&] { parse_description(other, "w.pt"); }),
                AllOf(HasSubstr("w.pt: metadata.zones: found"), HasSubstr("1 to 4096")))
        << zones;
  }
}

TEST(CnnDescription, CapturesAreOfUnitMeanWhateverTheirExposure) {
  const Scene scene = toy_scene();
  Capture capture = toy_capture(scene, 2, 1, 1);
  const CnnDescription d = describe_cnn(scene, std::span(&capture, 1), {});
  CnnData data;
  add_capture(d, capture, *capture.T_world_sensor, data);
  for (double& count : capture.counts.values) count *= 7;
  add_capture(d, capture, *capture.T_world_sensor, data);
  ASSERT_THAT(data.histograms, SizeIs(2 * 48));
  double sum = 0;
  for (std::size_t i = 0; i < 48; ++i) {
    sum += data.histograms[i];
    EXPECT_NEAR(data.histograms[i], data.histograms[48 + i], 1e-6);
  }
  EXPECT_NEAR(sum / 48, 1, 1e-6);
}

// A bin that never changed in training and a pose of the sensor far from those in it.
TEST(CnnDescription, InputsAreBounded) {
  const Scene scene = toy_scene();
  Capture capture = toy_capture(scene, 2, 1, 1);
  CnnDescription d = describe_cnn(scene, std::span(&capture, 1), {});
  const Capture* learnt = &capture;
  standardise_inputs(std::span(&learnt, 1), d);
  d.input_deviation.assign(48, 1e-4);
  capture.counts.zone(0)[3] += 500;
  const Transform elsewhere = testing_scenes::at({-100, 0, 0});
  CnnData data;
  add_capture(d, capture, elsewhere, data);
  EXPECT_EQ(data.histograms[3], 5);
  EXPECT_EQ(data.histograms[40], -5);
  EXPECT_EQ(data.sensors[0], -5);
  d.input_bound = 0;
  add_capture(d, capture, elsewhere, data);
  EXPECT_GT(data.histograms[48 + 3], 1000);
  EXPECT_LT(data.sensors[3], -50);
}

TEST(CnnDescription, AnswersStayInTheSearchRegion) {
  const Scene scene = toy_scene();
  const CnnDescription d = describe_cnn(scene, toy_captures(scene, 3), {});
  EXPECT_EQ(decode_pose(d, std::vector<float>{7, 1, 0})[0], 3);
  EXPECT_EQ(decode_pose(d, std::vector<float>{-7, 1, 0})[0], 1);
}

TEST(CnnDescription, NetworksAreKnownByName) {
  const Scene scene = toy_scene();
  CnnTrainingOptions options = CnnTrainingOptions::of(CnnArchitecture::wide);
  std::string text = description_text(describe_cnn(scene, toy_captures(scene, 3), options));
  const CnnDescription back = parse_description(text, "w.pt");
  EXPECT_EQ(back.network, CnnArchitecture::wide);
  EXPECT_TRUE(back.training.split_by_truth);
  text.replace(text.find("\"wide\""), 6, "\"tall\"");
  EXPECT_THAT(message_of([&] { parse_description(text, "w.pt"); }),
              AllOf(HasSubstr("w.pt: metadata.network"), HasSubstr("'tall'"), HasSubstr("'wide'")));
}

// Two members at +-0.5 of x with a variance of 0.04 each, and yaws of 0 with no spread but 0.01.
TEST(CnnDescription, AnEnsembleStatesTheMomentsOfItsMembers) {
  const Scene scene = toy_scene();
  const CnnTrainingOptions options = CnnTrainingOptions::of(CnnArchitecture::wide);
  const CnnDescription d = describe_cnn(scene, toy_captures(scene, 3), options);
  const auto log_of = [](double v) { return static_cast<float>(std::log(v)); };
  const std::vector<float> values{0.5F,  1, 0, log_of(0.04), log_of(0.01), log_of(0.01),
                                  -0.5F, 1, 0, log_of(0.04), log_of(0.01), log_of(0.01)};
  const CnnStatement statement = statement_of(d, values);
  EXPECT_NEAR(decode_pose(d, statement.mean)[0], 2, 1e-6);
  const Eigen::MatrixXd covariance = decode_covariance(d, statement);
  EXPECT_NEAR(covariance(0, 0), 0.25 + 0.04, 1e-6);  // x spans 2 m: half of it is 1 m
  EXPECT_NEAR(covariance(1, 1), 0.01 / 4, 1e-6);     // half a turn: the angle is twice the yaw
  EXPECT_NEAR(covariance(0, 1), 0, 1e-6);
}

TEST(CnnTraining, CapturesOfOneTruthAreHeldBackTogether) {
  const Scene scene = toy_scene();
  std::vector<Capture> captures = toy_captures(scene, 40);
  for (std::size_t i = 1; i < captures.size(); i += 2) captures[i].truth = captures[i - 1].truth;
  const auto held_back = validation_captures(captures, {40, 0.2, 1, 1, 0, true});
  ASSERT_THAT(held_back, SizeIs(8));
  for (std::size_t i = 0; i < held_back.size(); i += 2) {
    EXPECT_EQ(held_back[i] % 2, 0U);
    EXPECT_EQ(held_back[i + 1], held_back[i] + 1);
  }
  EXPECT_EQ(validation_captures(captures, {40, 0.2, 3, 1, 0, false}),
            validation_captures(40, 0.2, 3));
}

TEST(CnnTraining, HoldsBackTheShareThatIsAskedFor) {
  const auto held_back = validation_captures(100, 0.2, 3);
  EXPECT_THAT(held_back, SizeIs(20));
  EXPECT_TRUE(std::ranges::is_sorted(held_back));
  EXPECT_EQ(held_back, validation_captures(100, 0.2, 3));
  EXPECT_NE(held_back, validation_captures(100, 0.2, 4));
}

TEST(CnnTraining, OptionsOutOfRangeAreNamed) {
  const auto refuses = [](auto change, const char* field) {
    CnnTrainingOptions options;
    change(options);
    EXPECT_THAT(message_of([&] { options.validate(); }), HasSubstr(field));
  };
  refuses([](auto& o) { o.epochs = 0; }, "epochs");
  refuses([](auto& o) { o.batch = 1; }, "batch");
  refuses([](auto& o) { o.learning_rate = std::nan(""); }, "learning_rate");
  refuses([](auto& o) { o.validation_share = 1; }, "validation_share");
  refuses([](auto& o) { o.early_stopping = -1; }, "early_stopping");
  refuses([](auto& o) { o.input_bound = -1; }, "input_bound");
}

// Captures whose answer is plain: the error falls far below that of guessing the middle, which is
// 0.5 m in x and a quarter of half a turn in yaw.
TEST_F(Cnn, LearnsAnEasyCase) {
  const auto captures = toy_captures(scene_, 400);
  const CnnTrainingResult result = train_cnn(scene_, captures, quick(60));
  ASSERT_THAT(result.history, SizeIs(60));
  EXPECT_LT(result.history.back().training, 0.5 * result.history.front().training);
  EXPECT_LT(result.history.back().validation, 0.2 * result.history.front().validation);
  const CnnBaseline cnn = CnnBaseline::parse(result.weights, "w.pt");
  double error_x = 0, error_yaw = 0;
  const auto held_back = validation_captures(captures.size(), 0.2, 1);
  for (const std::size_t i : held_back) {
    const PoseVector truth =
        Eigen::Vector2d(captures[i].truth.at("x_m"), captures[i].truth.at("yaw_rad"));
    const PoseVector error =
        pose_error(scene_, cnn.predict(captures[i], *captures[i].T_world_sensor), truth);
    error_x += std::abs(error[0]) / static_cast<double>(held_back.size());
    error_yaw += std::abs(error[1]) / static_cast<double>(held_back.size());
  }
  EXPECT_LT(error_x, 0.15);
  EXPECT_LT(error_yaw, 0.25);
}

// Normalised by the covariance that it states, the squared error of two unknowns is 2 on average
// where claims are honest.
TEST_F(Cnn, TheEnsembleKnowsItsErrors) {
  CnnTrainingOptions options = CnnTrainingOptions::of(CnnArchitecture::wide);
  options.epochs = 25;
  options.batch = 16;
  const auto captures = toy_captures(scene_, 400);
  const CnnBaseline cnn = CnnBaseline::parse(train_cnn(scene_, captures, options).weights, "w.pt");
  double error_x = 0, squares = 0;
  const auto held_back = validation_captures(captures, cnn.description().training);
  ASSERT_THAT(held_back, SizeIs(80));
  for (const std::size_t i : held_back) {
    const PoseVector truth =
        Eigen::Vector2d(captures[i].truth.at("x_m"), captures[i].truth.at("yaw_rad"));
    const PoseMixture said = cnn.posterior(captures[i], *captures[i].T_world_sensor);
    EXPECT_EQ(said.mean, cnn.predict(captures[i], *captures[i].T_world_sensor));
    const PoseVector error = pose_error(scene_, said.mean, truth);
    error_x += std::abs(error[0]) / 80;
    squares += error.dot(said.covariance.inverse() * error) / 80;
  }
  EXPECT_LT(error_x, 0.15);
  EXPECT_GT(squares, 0.5);
  EXPECT_LT(squares, 6);
}

TEST_F(Cnn, TheEnsembleGoesOnFromACheckpointToTheSameBytes) {
  CnnTrainingOptions options = CnnTrainingOptions::of(CnnArchitecture::wide);
  options.epochs = 4;
  const auto captures = toy_captures(scene_, 60);
  std::string checkpoint;
  CnnTrainingCallbacks callbacks;
  callbacks.epoch = [&](int number, const CnnEpoch&, const auto& make) {
    if (number == 2) checkpoint = make();
  };
  const std::string whole = train_cnn(scene_, captures, options, callbacks).weights;
  EXPECT_TRUE(whole == train_cnn(scene_, captures, options, {}, checkpoint).weights);
  // A checkpoint of the one network is none of the other.
  EXPECT_THAT(message_of([&] { train_cnn(scene_, captures, quick(4), {}, checkpoint); }),
              HasSubstr("checkpoint: network"));
  // Weights of the one under the name of the other.
  EXPECT_EQ(CnnBaseline::parse(whole, "w.pt")
                .posterior(captures[0], Transform::Identity())
                .covariance.rows(),
            2);
  const std::string published = train_cnn(scene_, captures, quick(1)).weights;
  const PoseMixture pose =
      CnnBaseline::parse(published, "w.pt").posterior(captures[0], Transform::Identity());
  EXPECT_EQ(pose.covariance.size(), 0) << "the published network claims none";
}

TEST_F(Cnn, SameSeedSameBytes) {
  const auto captures = toy_captures(scene_, 60);
  const std::string weights = train_cnn(scene_, captures, quick(3)).weights;
  EXPECT_TRUE(weights == train_cnn(scene_, captures, quick(3)).weights);
  CnnTrainingOptions other = quick(3);
  other.seed = 2;
  EXPECT_FALSE(weights == train_cnn(scene_, captures, other).weights);
  EXPECT_TRUE(CnnBaseline::parse(weights, "w.pt").bytes() == weights);
}

TEST_F(Cnn, GoesOnFromACheckpointToTheSameBytes) {
  const auto captures = toy_captures(scene_, 60);
  for (const int early_stopping : {0, 4}) {
    CnnTrainingOptions options = quick(8);
    options.early_stopping = early_stopping;
    std::string checkpoint;
    CnnTrainingCallbacks callbacks;
    callbacks.epoch = [&](int number, const CnnEpoch&, const auto& make_checkpoint) {
      if (number == 3) checkpoint = make_checkpoint();
    };
    const CnnTrainingResult whole = train_cnn(scene_, captures, options, callbacks);
    const CnnTrainingResult resumed = train_cnn(scene_, captures, options, {}, checkpoint);
    EXPECT_TRUE(whole.weights == resumed.weights) << early_stopping;
    EXPECT_EQ(whole.history.size(), resumed.history.size());
    EXPECT_EQ(whole.epoch, resumed.epoch);
  }
}

TEST_F(Cnn, CheckpointsOfOtherTrainingsAreRefused) {
  const auto captures = toy_captures(scene_, 40);
  std::string checkpoint;
  CnnTrainingCallbacks callbacks;
  callbacks.epoch = [&](int, const CnnEpoch&, const auto& make) { checkpoint = make(); };
  const std::string weights = train_cnn(scene_, captures, quick(1), callbacks).weights;
  const auto resume = [&](const std::vector<Capture>& from, const CnnTrainingOptions& options,
                          const std::string& bytes) {
    return message_of([&] { train_cnn(scene_, from, options, {}, bytes); });
  };
  CnnTrainingOptions other = quick(2);
  other.seed = 7;
  EXPECT_THAT(resume(captures, other, checkpoint), HasSubstr("checkpoint: seed: found 1"));
  EXPECT_THAT(resume(toy_captures(scene_, 41), quick(2), checkpoint),
              HasSubstr("checkpoint: captures"));
  EXPECT_THAT(resume(captures, quick(2), weights), HasSubstr("metadata.format"));
  EXPECT_THAT(resume(captures, quick(2), checkpoint.substr(0, 900)), HasSubstr("truncated"));
}

TEST_F(Cnn, StopsEarlyAndKeepsTheBestWeights) {
  CnnTrainingOptions options = quick(400);
  options.early_stopping = 5;
  const CnnTrainingResult result = train_cnn(scene_, toy_captures(scene_, 50), options);
  ASSERT_LT(result.history.size(), 400U);
  EXPECT_EQ(result.history.size(), static_cast<std::size_t>(result.epoch) + 5);
  const auto best = std::ranges::min_element(result.history, {}, &CnnEpoch::validation);
  EXPECT_EQ(best - result.history.begin() + 1, result.epoch);
  EXPECT_EQ(CnnBaseline::parse(result.weights, "w.pt").description().training.epoch, result.epoch);
}

TEST_F(Cnn, DamagedWeightsAreRefused) {
  const std::string weights = train_cnn(scene_, toy_captures(scene_, 40), quick(1)).weights;
  for (const std::size_t size : {std::size_t{10}, weights.size() / 2, weights.size() - 30}) {
    EXPECT_THAT(message_of([&] { CnnBaseline::parse(weights.substr(0, size), "w.pt"); }),
                AllOf(HasSubstr("w.pt: is damaged, truncated"), HasSubstr("accepted")))
        << size;
  }
  EXPECT_THAT(message_of([] { CnnBaseline::load("/nowhere/w.pt"); }), HasSubstr("/nowhere/w.pt"));
}

TEST_F(Cnn, WeightsOfAnotherSceneAreRefused) {
  const CnnBaseline cnn =
      CnnBaseline::parse(train_cnn(scene_, toy_captures(scene_, 40), quick(1)).weights, "w.pt");
  EXPECT_NO_THROW(cnn.check_scene(scene_));
  Scene other = scene_;
  other.sensor.bins = 32;
  EXPECT_THAT(message_of([&] { cnn.check_scene(other); }),
              AllOf(HasSubstr("w.pt"), HasSubstr("2 zones of 24 bins"), HasSubstr("of 32 bins")));
  other = scene_;
  other.unknowns.pop_back();
  EXPECT_THAT(message_of([&] { cnn.check_scene(other); }),
              HasSubstr("found x_m, yaw_rad, accepted: the scene's x_m"));
  other = scene_;
  other.sensor.bin_width *= 2;
  EXPECT_THAT(message_of([&] { cnn.check_scene(other); }), HasSubstr("bin_width_ps"));
  Capture capture = toy_capture(scene_, 2, 1, 1);
  capture.counts = HistogramCube(1, 2, 32);
  EXPECT_THAT(message_of([&] { cnn.predict(capture, Transform::Identity()); }),
              AllOf(HasSubstr("toy.exr capture 1"), HasSubstr("2 zones of 32 bins")));
}

TEST_F(Cnn, CapturesThatCannotBeLearntAreRefused) {
  const auto captures = toy_captures(scene_, 40);
  const auto message = [&](auto change) {
    std::vector<Capture> changed = captures;
    change(changed[17]);
    return message_of([&] { train_cnn(scene_, changed, quick(1)); });
  };
  for (const double value : {std::nan(""), std::numeric_limits<double>::infinity(), -1.0}) {
    EXPECT_THAT(message([&](Capture& c) { c.counts.zone(1)[3] = value; }),
                AllOf(HasSubstr("toy.exr capture 17"), HasSubstr("counts[zone 1][bin 3]"),
                      HasSubstr("accepted")));
  }
  EXPECT_THAT(message([](Capture& c) { c.truth.erase("yaw_rad"); }),
              AllOf(HasSubstr("toy.exr capture 17"), HasSubstr("truth.yaw_rad")));
  EXPECT_THAT(message([](Capture& c) { c.counts = HistogramCube(3, 3, 24); }),
              AllOf(HasSubstr("3 x 3 zones"), HasSubstr("1 x 2 zones")));
  EXPECT_THAT(message([](Capture& c) { std::ranges::fill(c.counts.values, 0.0); }),
              HasSubstr("sum"));
}

}  // namespace
}  // namespace blindcorner
