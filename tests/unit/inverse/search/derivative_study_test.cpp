// SPDX-License-Identifier: Apache-2.0
/// Default steps of the numeric derivatives sit on the plateau of the error curve.
#include "inverse/search/derivative_study.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "bundled.h"
#include "inverse/search/difference_steps.h"

namespace blindcorner {
namespace {

/// m = sin(k x) in two bins: central differences err by (k h)^2 / 6.
class Sine final : public ForwardModel {
 public:
  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    out = HistogramCube(1, 1, 2);
    out.values = {std::sin(3 * pose[0]), 2 * std::sin(3 * pose[0])};
  }
  const HistogramCube& static_background() const override { return direct_; }
  const TransportPlan& plan() const override { return plan_; }

 private:
  HistogramCube direct_{1, 1, 2};
  TransportPlan plan_;
};

TEST(DerivativeStudy, TruncationHasItsClosedForm) {
  const PoseVector pose = PoseVector::Constant(1, 0.3);
  const DerivativeErrors errors = derivative_errors(Sine(), pose, 0, {0.1, 0.01, 0.001}, 0.02);
  // 1 - sin(k h) / (k h)
  for (std::size_t i = 0; i < 3; ++i) {
    const double x = 3 * errors.steps[i];
    EXPECT_NEAR(errors.errors[i], 1 - std::sin(x) / x, 1e-9);
  }
  EXPECT_NEAR(errors.at_default, 1 - std::sin(0.06) / 0.06, 1e-9);
  EXPECT_LT(errors.resolution, 1e-8);
}

class ShippedDerivatives : public testing::TestWithParam<const char*> {};

// The plateau reaches from where rounding ends to where curvature or a kink begins. Below a
// millimetre the curve is flat in every scene: its level there is what the scene's shadow edges
// and the extrapolation itself leave open. The default step may stand at most three times above it
// (or at 2 % by a shadow's edge, 0.5 % elsewhere), and the whole error is at most 5 %, 1 % without
// occluders.
TEST_P(ShippedDerivatives, DefaultStepsSitOnThePlateau) {
  const Scene scene = bundled_scene(GetParam());
  FastModelOptions options;
  options.tolerance = 0.04;
  const auto model = make_fast_model(scene, sensor_placement(scene), options);
  const PoseVector steps = difference_steps(scene, sensor_placement(scene));
  const bool edges = model->plan().decision(Term::occlusion).used;
  std::mt19937_64 random(2);
  for (int p = 0; p < 3; ++p) {
    PoseVector pose(steps.size());
    for (Eigen::Index i = 0; i < steps.size(); ++i) {
      const Unknown& unknown = scene.unknowns[static_cast<std::size_t>(i)];
      const double margin = 0.05 * unknown.range();
      pose[i] = std::uniform_real_distribution<double>(unknown.lower + margin,
                                                       unknown.upper - margin)(random);
    }
    for (Eigen::Index i = 0; i < steps.size(); ++i) {
      std::vector<double> small;
      for (const double share : {0.01, 0.03, 0.1, 0.3}) small.push_back(share * steps[i]);
      const DerivativeErrors e = derivative_errors(*model, pose, i, small, steps[i]);
      const double level = *std::ranges::max_element(e.errors);
      EXPECT_LE(e.at_default, std::max(3 * level, edges ? 0.02 : 0.005))
          << "unknown " << i << ", pose " << p;
      EXPECT_LE(e.at_default, edges ? 0.05 : 0.01) << "unknown " << i << ", pose " << p;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(DerivativeStudy, ShippedDerivatives,
                         testing::Values("tmf8828_wall", "tmf8828_floor", "robot_corridor",
                                         "denali_like", "person_vl53l8ch", "street_corner"),
                         [](const auto& tested) { return std::string(tested.param); });

}  // namespace
}  // namespace blindcorner
