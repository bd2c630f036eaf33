// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/refine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "bundled.h"
#include "inverse/likelihood/pose_objective.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/search/compiled_scene.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

/// One scene with a spline through its scored poses, and without, on the same captures of the
/// reference renderer.
class PolishOnSpline : public testing::TestWithParam<std::string> {
 protected:
  static constexpr int kCaptures = 4;

  void SetUp() override {
    scene_ = bundled_scene(GetParam());
    const SensorPlacement sensor = sensor_placement(scene_);
    GridOptions without;
    without.spline = false;
    with_ = compile(scene_, {sensor}, {}, {});
    without_ = compile(scene_, {sensor}, {}, without);
    ASSERT_NE(with_->spline, nullptr);
    ASSERT_EQ(without_->spline, nullptr);
    std::mt19937_64 random(7);
    for (int i = 0; i < kCaptures; ++i) {
      truths_.push_back(testing_scenes::random_pose(scene_, random));
      const double photons = 60.0 * (1 << (2 * i));  // 60 to 3840
      captures_.push_back(testing_scenes::reference_capture(scene_, truths_.back(), photons,
                                                            static_cast<std::uint64_t>(i + 1)));
    }
  }

  Scene scene_;
  std::unique_ptr<CompiledScene> with_, without_;
  std::vector<PoseVector> truths_;
  std::vector<Capture> captures_;
};

// The spline's derivatives lead to the model's optimum, and say how sharp it is.
TEST_P(PolishOnSpline, FindsTheModelsOptimumAndItsWidth) {
  for (std::size_t i = 0; i < captures_.size(); ++i) {
    const Observation observed = observe(scene_, {&captures_[i], 1}, with_->gates);
    const Observation plainly = observe(scene_, {&captures_[i], 1}, without_->gates);
    const PoseObjective on_spline(*with_, observed);
    const PoseObjective on_model(*without_, plainly);
    const Refined b = polish(on_model, truths_[i]);
    PoseVector start = b.pose - 0.3 * with_->spacing;
    for (Eigen::Index k = 0; k < start.size(); ++k) {
      const Unknown& unknown = scene_.unknowns[static_cast<std::size_t>(k)];
      start[k] = std::clamp(start[k], unknown.lower, unknown.upper);
    }
    const Refined a = polish(on_spline, start);
    EXPECT_FALSE(a.correction.empty());
    EXPECT_TRUE(b.correction.empty());
    LinearSolution linear = b.linear;
    const double found = on_model.evaluate(without_->models(), a.pose, linear, true).log_posterior;
    EXPECT_GT(found, b.value.log_posterior - 0.02) << GetParam() << " " << i;
    if ((a.pose - b.pose).norm() > 0.01) continue;  // another, better optimum
    const Eigen::MatrixXd spline = pose_information(on_spline, a).pose;
    const Eigen::MatrixXd model = pose_information(on_model, b).pose;
    EXPECT_LT((spline - model).norm(), 0.1 * model.norm()) << GetParam() << " " << i;
  }
}

// At the pose where it was corrected, the spline gives the model's own light.
TEST_P(PolishOnSpline, CorrectionIsExactAtItsPose) {
  const Observation observed = observe(scene_, {captures_.data(), 1}, with_->gates);
  const PoseObjective objective(*with_, observed);
  const Refined optimum = polish(objective, truths_[0]);
  ShapeBuffer corrected;
  ShapeBuffer model;
  objective.shapes(light_near(objective, optimum), optimum.pose, corrected);
  objective.shapes(with_->models(), optimum.pose, model);
  const double peak = *std::max_element(model.object.begin(), model.object.end());
  for (std::size_t r = 0; r < model.object.size(); ++r) {
    EXPECT_NEAR(corrected.object[r], model.object[r], 1e-12 * peak);
  }
}

INSTANTIATE_TEST_SUITE_P(Refine, PolishOnSpline, testing::Values("denali_like", "person_vl53l8ch"),
                         [](const auto& tested) { return std::string(tested.param); });

/// The wall scene for a new sensor pose, closed-form light steering, and captures of the reference
/// renderer.
class SettleOnModel : public testing::Test {
 protected:
  void prepare(const PoseVector& truth) {
    GridOptions grid;
    grid.closed_form = true;
    grid.max_poses = 600;
    compiled_ = compile(scene_, {sensor_placement(scene_)}, {}, grid);
    ASSERT_FALSE(compiled_->coarse.empty());
    capture_ = testing_scenes::reference_capture(scene_, truth, 2000, 3);
    observed_ = observe(scene_, {&capture_, 1}, compiled_->gates);
    objective_ = std::make_unique<PoseObjective>(*compiled_, observed_);
  }
  double value(const PoseVector& pose, LinearSolution linear) const {
    return objective_->evaluate(compiled_->models(), pose, linear, true).log_posterior;
  }
  PoseVector middle() const {
    PoseVector pose(static_cast<Eigen::Index>(scene_.unknowns.size()));
    for (Eigen::Index k = 0; k < pose.size(); ++k) {
      const Unknown& unknown = scene_.unknowns[static_cast<std::size_t>(k)];
      pose[k] = 0.5 * (unknown.lower + unknown.upper);
    }
    return pose;
  }

  Scene scene_ = bundled_scene("tmf8828_wall");
  std::unique_ptr<CompiledScene> compiled_;
  Capture capture_;
  Observation observed_;
  std::unique_ptr<PoseObjective> objective_;
};

// With the truth a standard deviation or more beyond a bound, that unknown stops at the bound and
// the others are as good as they can be there.
TEST_F(SettleOnModel, AtABoundTheOthersAreAtTheirBest) {
  const PoseVector truth = middle();
  Unknown& beyond = scene_.unknowns[0];
  beyond.upper = truth[0] - 0.05;
  beyond.lower = std::min(beyond.lower, beyond.upper - 0.1);
  prepare(truth);
  PoseVector start = truth;
  start[0] = beyond.upper - 0.02;
  const Refined best = find_optima(*objective_, {start}, 20).front();
  ASSERT_NEAR(best.pose[0], beyond.upper, 1e-6);
  EXPECT_LT(best.pose[0], beyond.upper + 1e-12);
  const Eigen::MatrixXd information = pose_information(*objective_, best).pose;
  for (Eigen::Index k = 1; k < best.pose.size(); ++k) {
    for (const double sign : {-1.0, 1.0}) {
      PoseVector pose = best.pose;
      pose[k] += sign * 0.3 / std::sqrt(information(k, k));
      const Unknown& unknown = scene_.unknowns[static_cast<std::size_t>(k)];
      if (pose[k] < unknown.lower || pose[k] > unknown.upper) continue;
      EXPECT_LT(value(pose, best.linear), best.value.log_posterior + 0.05) << k << " " << sign;
    }
  }
}

// Starts all over one peak are one optimum, however far their descents have come.
TEST_F(SettleOnModel, StartsOnOnePeakAreOneOptimum) {
  const PoseVector truth = middle();
  prepare(truth);
  const Refined best = find_optima(*objective_, {truth}, 20).front();
  const Eigen::MatrixXd information = pose_information(*objective_, best).pose;
  std::vector<PoseVector> starts{best.pose};
  for (Eigen::Index k = 0; k < best.pose.size(); ++k) {
    starts.push_back(best.pose);
    starts.back()[k] += 0.5 / std::sqrt(information(k, k));
  }
  const std::vector<Refined> optima = find_optima(*objective_, starts, 20);
  ASSERT_EQ(optima.size(), 1U);
  EXPECT_GT(optima.front().value.log_posterior, best.value.log_posterior - 0.1);
}

}  // namespace
}  // namespace blindcorner
