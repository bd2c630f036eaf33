// SPDX-License-Identifier: Apache-2.0
/// The tracker against closed forms: with linear frames and normal noise it has to be the Kalman
/// filter, its smoother the joint normal distribution of all frames.
#include "blindcorner/inverse/tracking/tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "bundled.h"

namespace blindcorner {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// An object on a floor of 8 m x 8 m whose light has a known brightness.
Scene floor_scene() {
  Scene scene;
  scene.unknowns = {{Component::x, -4, 4, std::nullopt}, {Component::y, -4, 4, std::nullopt}};
  scene.linear.amplitude = LinearMode::fixed;
  return scene;
}

Motion walking() {
  Motion motion;
  motion.acceleration_density = 0.7;
  motion.initial_speed = 1.3;
  return motion;
}

VectorXd vector(std::initializer_list<double> values) {
  VectorXd v(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), v.data());
  return v;
}

double log_normal(const VectorXd& d, const MatrixXd& covariance) {
  const Eigen::LLT<MatrixXd> root(covariance);
  const MatrixXd L = root.matrixL();
  return -0.5 * d.dot(root.solve(d)) - L.diagonal().array().log().sum() -
         0.5 * static_cast<double>(d.size()) * std::log(2 * kPi);
}

/// A frame that measures the unknowns themselves, at one of several places: the likelihood is a sum
/// of normal densities. A descent ends at the peak nearest to its start.
class LinearFrame final : public FrameLikelihood {
 public:
  LinearFrame(const TrackLayout& layout, std::vector<VectorXd> peaks, MatrixXd noise)
      : layout_(layout), peaks_(std::move(peaks)), noise_(std::move(noise)) {}

  Update update(const Gaussian& prior, const VectorXd& start, double inflation) const override {
    const VectorXd& peak =
        *std::min_element(peaks_.begin(), peaks_.end(), [&](const auto& a, const auto& b) {
          return layout_.difference(start, a).norm() < layout_.difference(start, b).norm();
        });
    const MatrixXd S = prior.covariance + inflation * noise_;
    const MatrixXd gain = prior.covariance * S.inverse();
    const VectorXd d = layout_.difference(prior.mean, peak);
    ++updates_;
    Update result;
    result.posterior = {prior.mean + gain * d, prior.covariance - gain * prior.covariance};
    result.log_evidence = log_normal(d, S);
    return result;
  }
  std::vector<VectorXd> starts() const override {
    return {peaks_.begin(),
            peaks_.begin() + static_cast<std::ptrdiff_t>(std::min(shown_, peaks_.size()))};
  }
  double log_evidence_empty(double) const override { return -60; }
  void describe(const VectorXd&, FitResult&) const override {}

  /// How many of the peaks a search finds.
  std::size_t shown_ = 100;
  mutable std::atomic<int> updates_{0};  ///< so far

 private:
  const TrackLayout& layout_;
  std::vector<VectorXd> peaks_;
  MatrixXd noise_;
};

std::shared_ptr<const FrameLikelihood> linear(const TrackLayout& layout,
                                              std::vector<VectorXd> peaks, MatrixXd noise) {
  return std::make_shared<LinearFrame>(layout, std::move(peaks), std::move(noise));
}

/// A frame that shows no object: any pose explains it worse than an empty scene does.
class EmptyFrame final : public FrameLikelihood {
 public:
  Update update(const Gaussian& prior, const VectorXd&, double) const override {
    return {prior, -50, -50};
  }
  std::vector<VectorXd> starts() const override { return {}; }
  double log_evidence_empty(double) const override { return 0; }
  void describe(const VectorXd&, FitResult&) const override {}
};

/// A frame of which the look at all places says so much; a search would find `place`.
class LookedAtFrame final : public FrameLikelihood {
 public:
  LookedAtFrame(double log_anywhere, VectorXd place, double information = 1)
      : look_{log_anywhere, information}, place_(std::move(place)) {}

  Update update(const Gaussian&, const VectorXd&, double) const override {
    return {{place_, 0.01 * MatrixXd::Identity(2, 2)}, 20, 20};
  }
  std::vector<VectorXd> starts() const override { return {place_}; }
  double log_evidence_empty(double) const override { return 0; }
  Look look(double) const override { return look_; }
  void describe(const VectorXd&, FitResult&) const override {}

 private:
  Look look_;
  VectorXd place_;
};

/// A frame whose rough updates weigh its places otherwise than its full updates do.
class RoughlyJudgedFrame final : public FrameLikelihood {
 public:
  struct Place {
    VectorXd at;
    double roughly, fully;  ///< log evidence
  };
  explicit RoughlyJudgedFrame(std::vector<Place> places) : places_(std::move(places)) {}

  Update update(const Gaussian&, const VectorXd& start, double) const override {
    ++full_updates_;
    return at(start, nearest(start).fully);
  }
  Update rough_update(const Gaussian&, const VectorXd& start, double) const override {
    return at(start, nearest(start).roughly);
  }
  std::vector<VectorXd> starts() const override {
    std::vector<VectorXd> all;
    for (const Place& place : places_) all.push_back(place.at);
    return all;
  }
  double log_evidence_empty(double) const override { return -60; }
  void describe(const VectorXd&, FitResult&) const override {}

  mutable std::atomic<int> full_updates_{0};  ///< so far

 private:
  const Place& nearest(const VectorXd& start) const {
    return *std::ranges::min_element(places_, {},
                                     [&](const Place& place) { return (place.at - start).norm(); });
  }
  Update at(const VectorXd& start, double log_evidence) const {
    return {{nearest(start).at, 0.01 * MatrixXd::Identity(2, 2)}, log_evidence, 0};
  }
  std::vector<Place> places_;
};

/// Never surprised and never in doubt: the Kalman filter's own assumptions.
TrackerOptions certain() {
  TrackerOptions options;
  options.missed_probability = 1e-12;
  options.gate_probability = 1e-300;
  options.search_interval = 1e9;
  options.max_inflation = 1;
  return options;
}

/// Kalman filter of one frame after the other, written out for two positions and velocities.
struct Kalman {
  VectorXd x = VectorXd::Zero(4);
  MatrixXd P = MatrixXd::Zero(4, 4);

  void predict(double dt, double q) {
    MatrixXd F = MatrixXd::Identity(4, 4);
    F(0, 2) = F(1, 3) = dt;
    MatrixXd Q = MatrixXd::Zero(4, 4);
    Q(0, 0) = Q(1, 1) = q * dt * dt * dt / 3;
    Q(0, 2) = Q(2, 0) = Q(1, 3) = Q(3, 1) = q * dt * dt / 2;
    Q(2, 2) = Q(3, 3) = q * dt;
    x = F * x;
    P = F * P * F.transpose() + Q;
  }
  void update(const VectorXd& z, const MatrixXd& R) {
    MatrixXd H = MatrixXd::Zero(2, 4);
    H(0, 0) = H(1, 1) = 1;
    const MatrixXd S = H * P * H.transpose() + R;
    const MatrixXd K = P * H.transpose() * S.inverse();
    x += K * (z - H * x);
    P -= K * H * P;
  }
};

struct Walk {
  std::vector<double> dt;
  std::vector<VectorXd> seen;
  MatrixXd noise;
};

Walk random_walk(int frames) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Walk walk;
  walk.noise = (MatrixXd(2, 2) << 0.04, 0.015, 0.015, 0.02).finished();
  const MatrixXd root = walk.noise.llt().matrixL();
  VectorXd at = vector({-1.0, 0.5});
  const VectorXd speed = vector({0.6, -0.2});
  for (int i = 0; i < frames; ++i) {
    walk.dt.push_back(i == 0 ? 0.0 : 0.05 + 0.1 * (i % 3));
    at += walk.dt.back() * speed;
    walk.seen.push_back(at + root * vector({normal(random), normal(random)}));
  }
  return walk;
}

Kalman kalman_before_first() {
  Kalman kalman;
  // Normal with the variance that the uniform density on 8 m has.
  kalman.P.diagonal() << 64.0 / 12, 64.0 / 12, std::pow(walking().initial_speed, 2),
      std::pow(walking().initial_speed, 2);
  return kalman;
}

TEST(Tracker, IsTheKalmanFilterForLinearFrames) {
  const Scene scene = floor_scene();
  const Walk walk = random_walk(25);
  Tracker tracker(scene, walking(), certain());
  Kalman kalman = kalman_before_first();
  for (std::size_t i = 0; i < walk.seen.size(); ++i) {
    const auto frame = linear(tracker.layout(), {walk.seen[i]}, walk.noise);
    const TrackPoint point = tracker.advance(walk.dt[i], frame);
    if (i > 0) kalman.predict(walk.dt[i], walking().acceleration_density);
    kalman.update(walk.seen[i], walk.noise);
    ASSERT_EQ(point.modes.size(), 1U);
    EXPECT_LT((point.modes[0].state.mean - kalman.x).cwiseAbs().maxCoeff(), 1e-10);
    EXPECT_LT((point.modes[0].state.covariance - kalman.P).cwiseAbs().maxCoeff(), 1e-10);
    EXPECT_GT(point.presence_probability, 0.999);
  }
}

/// All states as one normal vector: precision from the prior, the steps and the frames.
TEST(Tracker, SmootherIsTheJointPosteriorOfAllFrames) {
  const Scene scene = floor_scene();
  const Walk walk = random_walk(12);
  const auto frames = static_cast<Eigen::Index>(walk.seen.size());
  Tracker tracker(scene, walking(), certain());
  MatrixXd precision = MatrixXd::Zero(4 * frames, 4 * frames);
  VectorXd right = VectorXd::Zero(4 * frames);
  precision.topLeftCorner(4, 4) = kalman_before_first().P.inverse();
  for (Eigen::Index i = 0; i < frames; ++i) {
    const auto k = static_cast<std::size_t>(i);
    tracker.advance(walk.dt[k], linear(tracker.layout(), {walk.seen[k]}, walk.noise));
    precision.block(4 * i, 4 * i, 2, 2) += walk.noise.inverse();
    right.segment(4 * i, 2) += walk.noise.inverse() * walk.seen[k];
    if (i == 0) continue;
    Kalman step;
    step.predict(walk.dt[k], walking().acceleration_density);
    MatrixXd difference = MatrixXd::Zero(4, 8);  // x_i - F x_{i-1}
    difference.leftCols(4) = -MatrixXd::Identity(4, 4);
    difference(0, 2) = difference(1, 3) = -walk.dt[k];
    difference.rightCols(4) = MatrixXd::Identity(4, 4);
    precision.block(4 * (i - 1), 4 * (i - 1), 8, 8) +=
        difference.transpose() * step.P.inverse() * difference;
  }
  const MatrixXd covariance = precision.inverse();
  const VectorXd mean = covariance * right;
  const auto smoothed = tracker.smoothed();
  ASSERT_EQ(smoothed.size(), walk.seen.size());
  for (Eigen::Index i = 0; i < frames; ++i) {
    const auto& state = smoothed[static_cast<std::size_t>(i)];
    ASSERT_TRUE(state.has_value());
    EXPECT_LT((state->mean - mean.segment(4 * i, 4)).cwiseAbs().maxCoeff(), 1e-8) << i;
    EXPECT_LT((state->covariance - covariance.block(4 * i, 4 * i, 4, 4)).cwiseAbs().maxCoeff(),
              1e-8)
        << i;
  }
}

// Of the frames that it keeps, a tracker with a fixed lag knows what one that keeps all knows.
TEST(Tracker, FixedLagForgetsFramesButNothingOfTheOthers) {
  constexpr int kLag = 4;
  const Walk walk = random_walk(12);
  TrackerOptions lagged = certain();
  lagged.lag = kLag;
  Tracker all(floor_scene(), walking(), certain());
  Tracker few(floor_scene(), walking(), lagged);
  for (std::size_t k = 0; k < walk.seen.size(); ++k) {
    const auto frame = linear(all.layout(), {walk.seen[k]}, walk.noise);
    all.advance(walk.dt[k], frame);
    few.advance(walk.dt[k], frame);
  }
  const auto of_all = all.smoothed();
  const auto of_few = few.smoothed();
  ASSERT_EQ(of_few.size(), static_cast<std::size_t>(kLag + 1));
  EXPECT_EQ(few.first_kept_frame(), static_cast<int>(of_all.size()) - kLag - 1);
  for (std::size_t k = 0; k < of_few.size(); ++k) {
    const auto& full = of_all[static_cast<std::size_t>(few.first_kept_frame()) + k];
    EXPECT_EQ(of_few[k]->mean, full->mean);
    EXPECT_EQ(of_few[k]->covariance, full->covariance);
  }
}

TEST(Tracker, InnovationIsThatOfTheMeasurement) {
  const Scene scene = floor_scene();
  const TrackLayout layout(scene, walking());
  const MatrixXd P = (MatrixXd(2, 2) << 0.3, 0.1, 0.1, 0.2).finished();
  const MatrixXd R = (MatrixXd(2, 2) << 0.05, -0.01, -0.01, 0.02).finished();
  const Gaussian prior{vector({0.2, -0.4}), P};
  const VectorXd z = vector({0.9, -0.1});
  const auto update = LinearFrame(layout, {z}, R).update(prior, prior.mean, 1);
  const Innovation got = innovation(layout, prior, update.posterior);
  const VectorXd d = z - prior.mean;
  EXPECT_NEAR(got.squared, d.dot((P + R).inverse() * d), 1e-9);
  EXPECT_EQ(got.freedom, 2);
}

TEST(Tracker, RivalModesAreKeptUntilFramesDecide) {
  const Scene scene = floor_scene();
  Tracker tracker(scene, walking());
  const MatrixXd noise = 0.01 * MatrixXd::Identity(2, 2);
  const VectorXd left = vector({-1, 0.5});
  const VectorXd right = vector({1, 0.5});
  TrackPoint point;
  for (int i = 0; i < 6; ++i) {
    point = tracker.advance(0.1, linear(tracker.layout(), {left, right}, noise));
    ASSERT_EQ(point.modes.size(), 2U) << i;
    EXPECT_NEAR(point.modes[0].weight, 0.5, 0.02) << i;
  }
  for (int i = 0; i < 3; ++i) {
    point = tracker.advance(0.1, linear(tracker.layout(), {right}, noise));
  }
  EXPECT_GT(point.modes[0].weight, 0.99);
  EXPECT_NEAR(point.modes[0].state.mean[0], 1, 0.1);
}

TEST(Tracker, PlaceThatTheFirstSearchMissedWeighsByAllFrames) {
  // Both places explain every frame alike; the search of the first frame finds one of them only.
  const Scene scene = floor_scene();
  const MatrixXd noise = 0.01 * MatrixXd::Identity(2, 2);
  const std::vector<VectorXd> places{vector({-1, 0.5}), vector({1, 0.5})};
  for (const int young : {0, 16}) {
    TrackerOptions options;
    options.young_frames = young;
    Tracker tracker(scene, walking(), options);
    TrackPoint point;
    for (int i = 0; i < 4; ++i) {
      auto frame = std::make_shared<LinearFrame>(tracker.layout(), places, noise);
      if (i == 0) frame->shown_ = 1;
      point = tracker.advance(0.1, frame);
    }
    if (young == 0) {
      // As the object may be lost in any frame: one in ten thousand.
      EXPECT_GT(point.modes[0].weight, 0.99);
      continue;
    }
    ASSERT_EQ(point.modes.size(), 2U);
    EXPECT_NEAR(point.modes[0].weight, 0.5, 0.02);
    EXPECT_NEAR(point.modes[0].state.mean[0] + point.modes[1].state.mean[0], 0, 0.02);
  }
}

TEST(Tracker, JudgedByAllFramesIsWhatTheFilterSaysOfLinearOnes) {
  const Scene scene = floor_scene();
  const Walk walk = random_walk(12);
  TrackerOptions options = certain();
  options.young_frames = 0;
  Tracker filter(scene, walking(), options);
  options.young_frames = 16;
  options.search_interval = 1e-9;  // at each frame
  Tracker judged(scene, walking(), options);
  const VectorXd far = vector({60, 0});  // another place, which the prior all but excludes
  for (std::size_t i = 0; i < walk.seen.size(); ++i) {
    const TrackPoint of_filter =
        filter.advance(walk.dt[i], linear(filter.layout(), {walk.seen[i]}, walk.noise));
    const TrackPoint of_all = judged.advance(
        walk.dt[i], linear(judged.layout(), {walk.seen[i], walk.seen[i] + far}, walk.noise));
    ASSERT_EQ(of_all.modes.size(), 1U) << i;
    const Gaussian& a = of_filter.modes[0].state;
    const Gaussian& b = of_all.modes[0].state;
    EXPECT_LT((a.mean - b.mean).cwiseAbs().maxCoeff(), 1e-9) << i;
    EXPECT_LT((a.covariance - b.covariance).cwiseAbs().maxCoeff(), 1e-9) << i;
  }
}

TEST(Tracker, WhereASearchFindsNoOtherPlaceNoEarlierFrameIsAskedAgain) {
  const Scene scene = floor_scene();
  TrackerOptions options = certain();
  options.search_interval = 1e-9;  // at each frame
  for (const bool elsewhere : {false, true}) {
    Tracker tracker(scene, walking(), options);
    std::vector<VectorXd> places{vector({1, 1})};
    if (elsewhere) places.push_back(vector({61, 1}));  // which the prior all but excludes
    std::vector<std::shared_ptr<LinearFrame>> frames;
    for (int i = 0; i < 6; ++i) {
      frames.push_back(std::make_shared<LinearFrame>(tracker.layout(), places,
                                                     MatrixXd(1e-4 * MatrixXd::Identity(2, 2))));
      const int before = frames.front()->updates_;
      EXPECT_TRUE(tracker.advance(0.1, frames.back()).searched);
      if (i == 0) continue;
      EXPECT_EQ(frames.front()->updates_ > before, elsewhere) << i;
    }
  }
}

TEST(Tracker, MissedDetectionOnlyPredicts) {
  const Scene scene = floor_scene();
  const Walk walk = random_walk(10);
  Tracker tracker(scene, walking());
  TrackPoint before;
  for (std::size_t i = 0; i < walk.seen.size(); ++i) {
    before = tracker.advance(walk.dt[i], linear(tracker.layout(), {walk.seen[i]}, walk.noise));
  }
  Gaussian expected = before.modes[0].state;
  predict(tracker.layout(), walking(), 0.1, expected);
  const TrackPoint after = tracker.advance(0.1, std::make_shared<EmptyFrame>());
  ASSERT_FALSE(after.modes.empty());
  EXPECT_EQ(after.modes[0].coasted, 1);
  EXPECT_LT((after.modes[0].state.mean - expected.mean).norm(), 1e-12);
  EXPECT_LT((after.modes[0].state.covariance - expected.covariance).norm(), 1e-12);
  // Bayes: the object is there and the frame missed it (1 %), or it has left since.
  const double leave = 1 - std::exp(-0.1 / TrackerOptions{}.dwell_time);
  const double there = (1 - leave) * TrackerOptions{}.missed_probability;
  EXPECT_NEAR(after.presence_probability, there / (there + leave), 1e-3);
}

TEST(Tracker, EndsWhenTheObjectHasLeftAndStartsAgain) {
  const Scene scene = floor_scene();
  const MatrixXd noise = 0.01 * MatrixXd::Identity(2, 2);
  Tracker tracker(scene, walking());
  const VectorXd place = vector({1, 1});
  EXPECT_TRUE(tracker.advance(0.1, std::make_shared<EmptyFrame>()).modes.empty());
  for (int i = 0; i < 5; ++i) {
    tracker.advance(0.1, linear(tracker.layout(), {place}, noise));
  }
  TrackPoint point;
  for (int i = 0; i < 6; ++i) point = tracker.advance(0.1, std::make_shared<EmptyFrame>());
  EXPECT_TRUE(point.modes.empty());
  EXPECT_LT(point.presence_probability, 0.1);
  point = tracker.advance(0.1, linear(tracker.layout(), {place}, noise));
  ASSERT_EQ(point.modes.size(), 1U);
  EXPECT_EQ(point.modes[0].age, 0);
  const auto smoothed = tracker.smoothed();
  EXPECT_FALSE(smoothed.front().has_value());
  EXPECT_TRUE(smoothed[3].has_value());
  EXPECT_TRUE(smoothed.back().has_value());
}

TEST(Tracker, SearchesWhereTheLookAtAllPlacesLeavesADoubt) {
  const Scene scene = floor_scene();  // presence has a prior of one half
  const VectorXd place = vector({1, 1});
  const double odds = TrackerOptions{}.worth_a_search / (1 - TrackerOptions{}.worth_a_search);
  // Just too little: no search, and presence is what the look says.
  Tracker dark(scene, walking());
  TrackPoint point = dark.advance(0, std::make_shared<LookedAtFrame>(std::log(0.9 * odds), place));
  EXPECT_FALSE(point.searched);
  EXPECT_TRUE(point.modes.empty());
  EXPECT_NEAR(point.presence_probability, 0.9 * odds / (1 + 0.9 * odds), 1e-12);
  // Just enough: searched, and the search decides.
  Tracker bright(scene, walking());
  point = bright.advance(0, std::make_shared<LookedAtFrame>(std::log(1.1 * odds), place));
  EXPECT_TRUE(point.searched);
  ASSERT_EQ(point.modes.size(), 1U);
  EXPECT_GT(point.presence_probability, 0.99);
  // What frame after frame says in favour adds up until it is worth a search.
  point = dark.advance(0.1, std::make_shared<LookedAtFrame>(1, place));
  EXPECT_TRUE(point.searched);
  // Where all places are as good, there is nothing to follow: presence stays as it was.
  Tracker blind(scene, walking());
  point = blind.advance(0, std::make_shared<LookedAtFrame>(0, place, 0.01));
  EXPECT_FALSE(point.searched);
  EXPECT_NEAR(point.presence_probability, 0.5, 1e-12);
  // Asked to, it searches in any case.
  TrackerOptions always;
  always.worth_a_search = 0;
  Tracker thorough(scene, walking(), always);
  EXPECT_TRUE(thorough.advance(0, std::make_shared<LookedAtFrame>(-50, place)).searched);
}

// A search of a crossing asked for ten times as many renders of pairs as its best places needed.
TEST(Tracker, ASearchJudgesFullyOnlyWhatMattersRoughly) {
  const auto frame = std::make_shared<RoughlyJudgedFrame>(std::vector<RoughlyJudgedFrame::Place>{
      {vector({2, 2}), -15, -13}, {vector({-2, 1}), -18, -10}, {vector({0, -3}), -40, 0}});
  Tracker tracker(floor_scene(), walking());
  const TrackPoint point = tracker.advance(0, frame);
  EXPECT_EQ(frame->full_updates_, 2);  // not where the rough light leaves exp(-25) of the weight
  ASSERT_EQ(point.modes.size(), 2U);
  EXPECT_LT((point.modes.front().state.mean.head(2) - vector({-2, 1})).norm(), 1e-9);
  EXPECT_NEAR(std::log(point.modes[1].weight / point.modes[0].weight), -3, 1e-6);
}

TEST(Tracker, OneFrameElsewhereDoesNotMoveTheTrackButSeveralDo) {
  const Scene scene = floor_scene();
  const MatrixXd noise = 1e-4 * MatrixXd::Identity(2, 2);
  const VectorXd here = vector({1, 1});
  const VectorXd there = vector({-1.5, 0});
  Tracker tracker(scene, walking());
  TrackPoint point;
  const auto see = [&](const VectorXd& place) {
    point = tracker.advance(0.1, linear(tracker.layout(), {place}, noise));
  };
  for (int i = 0; i < 8; ++i) see(here);
  see(there);
  EXPECT_TRUE(point.searched);
  EXPECT_LT((point.modes[0].state.mean.head(2) - here).norm(), 0.05);
  see(here);
  EXPECT_EQ(point.modes[0].coasted, 0);
  EXPECT_LT((point.modes[0].state.mean.head(2) - here).norm(), 0.05);
  for (int i = 0; i < 3; ++i) see(there);
  EXPECT_LT((point.modes[0].state.mean.head(2) - there).norm(), 0.05);
}

TEST(Tracker, AYoungTrackIsSearchedAgainEachTimeItsAgeHasDoubled) {
  const Scene scene = floor_scene();
  const MatrixXd noise = 1e-4 * MatrixXd::Identity(2, 2);
  Tracker tracker(scene, walking());
  std::vector<int> searched;
  for (int frame = 0; frame < 20; ++frame) {
    const auto seen = linear(tracker.layout(), {vector({1, 1})}, noise);
    if (tracker.advance(0.125, seen).searched) searched.push_back(frame);
  }
  EXPECT_EQ(searched, (std::vector<int>{0, 1, 2, 4, 8, 16}));
}

TEST(Tracker, YawGoesAroundTheCircle) {
  Scene scene;
  scene.hidden.shape = RectangleShape{1, 1};
  scene.unknowns = {{Component::yaw, -kPi, kPi, std::nullopt}};
  scene.linear.amplitude = LinearMode::fixed;
  Motion turning;
  turning.yaw_drift = 1.5;
  Tracker tracker(scene, turning);
  const MatrixXd noise = 1e-3 * MatrixXd::Identity(1, 1);
  for (int i = 0; i < 40; ++i) {
    const double yaw = std::remainder(2.6 + 0.1 * i, 2 * kPi);  // passes pi after six frames
    const TrackPoint point = tracker.advance(0.1, linear(tracker.layout(), {vector({yaw})}, noise));
    ASSERT_EQ(point.modes.size(), 1U) << i;
    EXPECT_EQ(point.modes[0].coasted, 0);
    EXPECT_LT(std::abs(std::remainder(point.modes[0].state.mean[0] - yaw, 2 * kPi)), 0.05) << i;
    EXPECT_LT(point.modes[0].state.covariance(0, 0), 1.01e-3) << i;
  }
}

TEST(Tracker, InflationFollowsNoiseThatIsLargerThanSaid) {
  const Scene scene = floor_scene();
  TrackerOptions options;
  options.inflation_time = 2;
  Tracker tracker(scene, walking(), options);
  const MatrixXd said = 0.01 * MatrixXd::Identity(2, 2);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 0.2);  // four times the variance
  double sum = 0;
  for (int i = 0; i < 600; ++i) {
    const VectorXd z = vector({normal(random), normal(random)});
    const TrackPoint point = tracker.advance(0.1, linear(tracker.layout(), {z}, said));
    if (i >= 200) sum += point.inflation / 400;
  }
  EXPECT_NEAR(sum, 4, 1.0);
}

TEST(Tracker, OptionsAreChecked) {
  TrackerOptions options;
  options.gate_probability = 0;
  EXPECT_THROW(Tracker(floor_scene(), walking(), options), Error);
}

// ---- The scene's field
// ---------------------------------------------------------------------------

class MotionField : public testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / "blindcorner_motion_XXXXXX").string();
    const int file = mkstemp(path_.data());
    ASSERT_GE(file, 0);
    close(file);
  }
  void TearDown() override { std::filesystem::remove(path_); }

  Motion read(const std::string& json) {
    std::ofstream(path_) << json;
    return read_motion(path_);
  }

  std::string path_;
};

TEST_F(MotionField, IsReadWithItsUnits) {
  const Motion motion =
      read(R"({"motion": {"frame_interval_s": 0.04, "yaw_drift_deg_per_sqrt_s": 90}})");
  EXPECT_EQ(motion.frame_interval, 0.04);
  EXPECT_NEAR(motion.yaw_drift, kPi / 2, 1e-12);
  EXPECT_EQ(motion.acceleration_density, Motion{}.acceleration_density);
  EXPECT_EQ(read("{}").frame_interval, Motion{}.frame_interval);
}

TEST_F(MotionField, MistakesAreNamed) {
  const auto message = [&](const std::string& json) -> std::string {
    try {
      read(json);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message(R"({"motion": {"frame_interval_s": 0}})"),
              testing::HasSubstr("motion.frame_interval_s: found 0"));
  EXPECT_THAT(message(R"({"motion": {"speed": 1}})"), testing::HasSubstr("motion.speed"));
}

// ---- The likelihood of a capture ----------------------------------------------------------------

Capture noiseless(const Scene& scene, const PoseVector& pose, double amplitude) {
  const auto model = make_fast_model(scene, sensor_placement(scene));
  Capture capture;
  const LinearValues linear{amplitude, 50.0, scene.linear.fixed_direct};
  capture.counts =
      expected_counts(scene, model->three_bounce(pose), model->static_background(), linear);
  capture.source = "noiseless";
  return capture;
}

/// Each unknown of a scene at this share of its range.
PoseVector pose_at(const Scene& scene, double share) {
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  for (Eigen::Index i = 0; i < pose.size(); ++i) {
    const Unknown& unknown = scene.unknowns[static_cast<std::size_t>(i)];
    pose[i] = unknown.lower + share * unknown.range();
  }
  return pose;
}

/// Frames of a scene of two unknowns and a shared amplitude.
class CaptureLikelihood : public testing::Test {
 protected:
  static FitOptions no_empty_captures() {
    FitOptions options;
    options.empty_captures = 0;
    return options;
  }

  PoseVector pose_at(double share) const { return blindcorner::pose_at(scene, share); }

  const Scene scene = bundled_scene("denali_like");
  const Fitter fitter{scene, no_empty_captures()};
};

TEST_F(CaptureLikelihood, FindsPoseAndBrightnessFromAPredictionNearby) {
  const TrackLayout layout(scene, walking());
  ASSERT_EQ(layout.measured, layout.poses + 1);
  const PoseVector pose = pose_at(0.5);
  const double amplitude = 1.7;
  const auto frame = fitter.frame(noiseless(scene, pose, amplitude));
  Gaussian wide{VectorXd::Zero(layout.measured), MatrixXd::Identity(3, 3)};
  wide.mean.head(2) = pose + PoseVector::Constant(2, 0.02);
  const auto update = frame->update(wide, wide.mean, 1);
  EXPECT_LT((update.posterior.mean.head(2) - pose).norm(), 2e-3);
  EXPECT_NEAR(update.posterior.mean[2], std::log(amplitude), 0.01);
  EXPECT_GT(update.log_evidence, frame->log_evidence_empty(1));

  // Linear-normal theory: a prior as sure as the frame, displaced by one of its standard
  // deviations, leaves the estimate half way, with half the variance.
  Gaussian equal = update.posterior;
  const VectorXd shift = MatrixXd(equal.covariance.llt().matrixL()).col(0);
  equal.mean += shift;
  const auto both = frame->update(equal, equal.mean, 1);
  EXPECT_LT((both.posterior.mean - update.posterior.mean - 0.5 * shift).norm(), 0.1 * shift.norm());
  EXPECT_LT((both.posterior.covariance - 0.5 * update.posterior.covariance).norm(),
            0.1 * update.posterior.covariance.norm());
}

TEST_F(CaptureLikelihood, ASplineThatIsCorrectedLeadsToWhereTheModelsHaveTheObject) {
  FitOptions for_many = no_empty_captures();
  for_many.captures_per_placement = 1'000'000;
  const Fitter on_spline(scene, for_many);
  for (const double amplitude : {0.1, 1.0, 30.0, 1000.0}) {
    for (const double share : {0.31, 0.44, 0.57}) {
      const auto frame = on_spline.frame(noiseless(scene, pose_at(share), amplitude));
      Gaussian prior{VectorXd::Zero(3), 0.04 * MatrixXd::Identity(3, 3)};
      prior.mean.head(2) = pose_at(share + 0.05);
      prior.mean[2] = std::log(amplitude) + 0.1;
      const Gaussian found = frame->update(prior, prior.mean, 1).posterior;
      VectorXd d = found.mean;
      d.head(2) -= pose_at(share);
      d[2] -= std::log(amplitude);
      // However bright: what the models themselves are off by is in the covariance.
      EXPECT_LT(std::sqrt(d.dot(found.covariance.ldlt().solve(d))), 0.7) << amplitude << share;
      EXPECT_LT(d.head(2).norm(), amplitude < 1 ? 0.03 : 2e-3) << amplitude << share;
    }
  }
}

TEST(CaptureLikelihoodOfPairs, RoughPairsThatAreCorrectedLeadToWhereTheModelsHaveTheObject) {
  // Pairs of a wide lobe, and no spline: coarser pairs lead.
  const Scene scene = bundled_scene("tmf8828_floor");
  FitOptions options;
  options.empty_captures = 0;
  const Fitter fitter(scene, options);
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  const AmplitudePrior& brightness = scene.linear.amplitude_prior;
  const bool shared = scene.linear.amplitude == LinearMode::shared;
  const Eigen::Index size = n + (shared ? 1 : 0);
  for (const double brighter : {1.0, 30.0}) {
    const double amplitude = brighter * (shared ? brightness.median : scene.linear.fixed_amplitude);
    for (const double share : {0.35, 0.5, 0.65}) {
      const auto frame = fitter.frame(noiseless(scene, pose_at(scene, share), amplitude));
      Gaussian prior{VectorXd::Zero(size), 0.04 * MatrixXd::Identity(size, size)};
      prior.mean.head(n) = pose_at(scene, share + 0.04);
      if (shared) prior.mean[n] = std::log(amplitude) + 0.1;
      const Gaussian found = frame->update(prior, prior.mean, 1).posterior;
      VectorXd d = found.mean;
      d.head(n) -= pose_at(scene, share);
      if (shared) d[n] -= std::log(amplitude);
      EXPECT_LT(std::sqrt(d.dot(found.covariance.ldlt().solve(d))), 1) << brighter << " " << share;
    }
  }
}

TEST_F(CaptureLikelihood, BrightLightClaimsNoMoreThanTheModelIsWorth) {
  // A model that is wrong by some share of the light is worth as much as that many photons, however
  // many there are: it is wrong alike in the next frame.
  const PoseVector pose = pose_at(0.5);
  const auto claim = [&](double amplitude) {
    const auto frame = fitter.frame(noiseless(scene, pose, amplitude));
    Gaussian prior{VectorXd::Zero(3), MatrixXd::Identity(3, 3)};
    prior.mean.head(2) = pose;
    prior.mean[2] = std::log(amplitude);
    return std::sqrt(frame->update(prior, prior.mean, 1).posterior.covariance(0, 0));
  };
  const double bright = claim(1e4), brighter = claim(1e6);
  EXPECT_NEAR(brighter / bright, 1, 0.2);
  EXPECT_GT(claim(1) / bright, 1.5);
}

TEST_F(CaptureLikelihood, StartsLeadToTheTruth) {
  const PoseVector pose = pose_at(0.3);
  const auto frame = fitter.frame(noiseless(scene, pose, 1.0));
  const auto starts = frame->starts();
  ASSERT_FALSE(starts.empty());
  EXPECT_LT((starts.front().head(2) - pose).norm(), 0.1);  // a place of the search grid
  Gaussian wide{starts.front(), MatrixXd::Identity(3, 3)};
  const VectorXd there = frame->update(wide, starts.front(), 1).posterior.mean;
  EXPECT_LT((there.head(2) - pose).norm(), 0.01);
}

TEST_F(CaptureLikelihood, TheLookAtAllPlacesPromisesNoLessThanASearchFinds) {
  // What it may lack is what TrackerOptions::worth_a_search leaves it.
  const double lacks = std::log(0.5 / TrackerOptions{}.worth_a_search);
  Gaussian unknown{VectorXd::Zero(3), MatrixXd::Identity(3, 3)};
  for (Eigen::Index i = 0; i < 2; ++i) {
    const Unknown& range = scene.unknowns[static_cast<std::size_t>(i)];
    unknown.mean[i] = range.lower + 0.5 * range.range();
    unknown.covariance(i, i) = range.range() * range.range() / 12;
  }
  const AmplitudePrior& brightness = scene.linear.amplitude_prior;
  unknown.mean[2] = std::log(brightness.median);
  unknown.covariance(2, 2) = brightness.sigma_log * brightness.sigma_log;
  int doubtful = 0;
  for (const double amplitude : {1e-6, 0.003, 0.01, 0.03, 0.1}) {
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      Capture capture = noiseless(scene, pose_at(0.2 + 0.1 * static_cast<double>(seed)), amplitude);
      capture.counts = draw_counts(scene, capture.counts, 1, seed);
      const auto frame = fitter.frame(capture);
      const double empty = frame->log_evidence_empty(1);
      const double promised = frame->look(1).log_evidence - empty;
      double found = 0;
      for (const VectorXd& start : frame->starts()) {
        found += std::exp(frame->update(unknown, start, 1).log_evidence - empty);
      }
      EXPECT_LT(std::log(found), promised + lacks) << amplitude << ", seed " << seed;
      doubtful += promised < 0 ? 1 : 0;
    }
  }
  EXPECT_GT(doubtful, 3);  // or it would promise something everywhere
}

}  // namespace
}  // namespace blindcorner
