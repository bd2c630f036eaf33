// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/scoring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include "bundled.h"
#include "inverse/likelihood/pose_objective.h"
#include "inverse/search/compiled_scene.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

/// A scene's scored poses, and captures of the reference renderer at random ones.
class Scoring : public testing::Test {
 protected:
  /// The best log posterior of all poses less that of those which `score` takes the trouble to
  /// evaluate, largest of several captures.
  double missed(double photons) {
    double most = 0;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      const Capture capture = testing_scenes::reference_capture(
          scene_, testing_scenes::random_pose(scene_, random_), photons, seed);
      const Observation observed = observe(scene_, {&capture, 1}, compiled_->gates);
      const PoseObjective objective(*compiled_, observed);
      LinearSolution empty;
      objective.evaluate_empty(empty);
      double best = -std::numeric_limits<double>::infinity();
      for (int pose = 0; pose < static_cast<int>(compiled_->poses.size()); ++pose) {
        LinearSolution linear;
        best = std::max(best, objective.evaluate_template(pose, linear, false).log_posterior);
      }
      const Scored scored = score(objective, empty, 2, 10);
      EXPECT_LE(scored.exact.size(), compiled_->poses.size() / 8);
      most = std::max(most, best - scored.exact.front().log_posterior);
    }
    return most;
  }

  Scene scene_ = bundled_scene("denali_like");
  std::unique_ptr<CompiledScene> compiled_ = compile(scene_, {sensor_placement(scene_)}, {}, {});
  std::mt19937_64 random_{3};
};

// The matched filter's order decides which poses are evaluated: the best one must be among them,
// from a handful of photons (where the filter that suits bright objects misses it by up to 1.6) to
// a thousand.
TEST_F(Scoring, FindsTheBestOfAllPosesAmongAFew) {
  for (const double photons : {10.0, 20.0, 1000.0}) {
    EXPECT_LT(missed(photons), 0.05) << photons << " photons";
  }
}

// Where brightness and ambient light are known, a pose is as likely as its light is neither too
// bright nor too faint, and the ambient light must not be taken for a faint object's. A filter that
// leaves both free misses the best pose by 5.
TEST_F(Scoring, FindsTheBestOfAllPosesWhereBrightnessAndAmbientLightAreKnown) {
  const Capture capture = testing_scenes::reference_capture(
      scene_, testing_scenes::random_pose(scene_, random_), 10, 1);
  const double level =
      testing_scenes::sum(capture.counts) / static_cast<double>(capture.counts.values.size());
  scene_.linear.amplitude_prior = {.median = 1, .sigma_log = 0.08};
  scene_.linear.ambient_prior.assign(
      static_cast<std::size_t>(scene_.sensor.zone_count()),
      {.mean = level / capture.exposures, .sigma = 0.05 * level / capture.exposures});
  compiled_ = compile(scene_, {sensor_placement(scene_)}, {}, {});
  EXPECT_LT(missed(10), 0.05);
}

// The mode of a log-normal amplitude, from three Newton steps, against one found by trying.
TEST(GainUnderPrior, IsTheLargestOverAllAmplitudes) {
  for (const double sigma : {0.03, 0.1, 0.5, 1.5, 3.0}) {
    const AmplitudePrior prior{.median = 2, .sigma_log = sigma};
    for (const double norm : {1e-6, 1e-2, 1.0, 30.0, 1e4}) {
      for (const double projection : {-100.0, -1.0, 0.0, 0.01, 1.0, 10.0, 300.0, 1e4}) {
        double best = -std::numeric_limits<double>::infinity();
        for (double u = -30; u < 30; u += 0.002) {
          const double a = std::exp(u);
          const double away = (u - std::log(prior.median)) / sigma;
          best = std::max(best, a * projection - 0.5 * a * a * norm - 0.5 * away * away);
        }
        GainOfAmplitude gains;
        gains.projection = Eigen::VectorXf::Constant(1, static_cast<float>(projection));
        gains.norm = Eigen::VectorXf::Constant(1, static_cast<float>(norm));
        const auto got = static_cast<double>(gain_under_prior(gains, prior)[0]);
        EXPECT_NEAR(got, best, 0.02 * std::abs(best) + 0.05)
            << "sigma " << sigma << ", norm " << norm << ", projection " << projection;
      }
    }
  }
}

TEST_F(Scoring, StartsAreApartAndBestFirst) {
  const Capture capture = testing_scenes::reference_capture(
      scene_, testing_scenes::random_pose(scene_, random_), 15, 1);
  const Observation observed = observe(scene_, {&capture, 1}, compiled_->gates);
  const PoseObjective objective(*compiled_, observed);
  LinearSolution empty;
  objective.evaluate_empty(empty);
  const Scored scored = score(objective, empty, 5, 10);
  ASSERT_GE(scored.starts.size(), 2U);
  ASSERT_LE(scored.starts.size(), 5U);
  EXPECT_EQ(scored.starts.front().index, scored.exact.front().index);
  for (std::size_t i = 0; i < scored.starts.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const PoseVector d = pose_difference(
          scene_, compiled_->poses[static_cast<std::size_t>(scored.starts[i].index)],
          compiled_->poses[static_cast<std::size_t>(scored.starts[j].index)]);
      EXPECT_TRUE((d.array().abs() > 1.05 * compiled_->spacing.array()).any());
    }
  }
  const auto descending = [](const Candidate& a, const Candidate& b) {
    return a.log_posterior > b.log_posterior;
  };
  EXPECT_TRUE(std::is_sorted(scored.exact.begin(), scored.exact.end(), descending));
}

}  // namespace
}  // namespace blindcorner
