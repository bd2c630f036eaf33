// SPDX-License-Identifier: Apache-2.0
/// StatedPresence probabilities of presence, over captures with and without an object.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "bundled.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

/// A calibrated scene as `calibrate` makes it: the ambient light of each zone and the object's
/// brightness have narrow priors.
Scene calibrated_mirrors() {
  Scene scene = bundled_scene("cheapspad_mirrors");
  const auto zones = static_cast<std::size_t>(scene.sensor.zone_count());
  scene.linear.ambient_prior.assign(zones, NormalPrior{100, 3});
  scene.linear.amplitude_prior = {1, 0.1};
  scene.sensor.noise.state_line({1, 10});
  scene.outlier_probability = 0;
  return scene;
}

struct StatedPresence {
  double presence = 0;
  bool there = false;

  /// The probability that was stated of what is the case.
  double right() const { return there ? presence : 1 - presence; }
};

/// Captures drawn from the scene's own priors, every second one of nothing. `noise` multiplies the
/// variance that the scene states.
std::vector<StatedPresence> stated_presence(const Scene& scene, int count, double noise) {
  const auto model = make_fast_model(scene, sensor_placement(scene));
  FitOptions options;
  options.empty_captures = 0;
  const Fitter fitter(scene, options);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::vector<StatedPresence> list;
  for (int i = 0; i < count; ++i) {
    const bool there = i % 2 == 0;
    const double amplitude =
        there ? std::exp(scene.linear.amplitude_prior.sigma_log * normal(random)) : 0.0;
    Capture capture;
    capture.exposures = 50;
    capture.counts = model->three_bounce(testing_scenes::random_pose(scene, random));
    for (int z = 0; z < capture.counts.zones(); ++z) {
      const NormalPrior& prior = scene.linear.ambient_prior[static_cast<std::size_t>(z)];
      const double ambient = prior.mean + prior.sigma * normal(random);
      const double gain = scene.sensor.zones[static_cast<std::size_t>(z)].gain;
      for (int k = 0; k < capture.counts.bins; ++k) {
        double& n = capture.counts.zone(z)[k];
        const double mean = ambient + amplitude * gain * n;
        const double variance = noise * count_variance(scene.sensor, z, mean) / capture.exposures;
        n = mean + std::sqrt(variance) * normal(random);
      }
    }
    list.push_back({fitter.fit(capture).posterior.presence_probability, there});
  }
  return list;
}

// Over captures drawn from the priors, what is stated with probability p is the case in a share p.
// Both sums below have mean zero then, and are within four of their standard deviations but once in
// 16,000. An evidence that forgets the prior of the ambient light on one side is off by a factor of
// 1e9 here.
TEST(Presence, IsRightAsOftenAsItIsStated) {
  double surprise = 0, surprise_variance = 0, excess = 0, excess_variance = 0;
  for (const StatedPresence& s : stated_presence(calibrated_mirrors(), 300, 1)) {
    const double p = std::min(std::max(s.presence, 1e-12), 1 - 1e-12);
    const double logit = std::log(p / (1 - p));
    excess += (s.there ? 1 : 0) - p;
    excess_variance += p * (1 - p);
    surprise += -std::log(s.there ? p : 1 - p) + p * std::log(p) + (1 - p) * std::log1p(-p);
    surprise_variance += p * (1 - p) * logit * logit;
  }
  EXPECT_LT(std::abs(excess), 4 * std::sqrt(excess_variance));
  EXPECT_LT(std::abs(surprise), 4 * std::sqrt(surprise_variance));
}

// Noise of twice the stated variance: the fit notices and takes both hypotheses' likelihoods for
// less. A claim of a thousand to one is then wrong in no more than one of a hundred captures.
TEST(Presence, IsNotCertainOfWhatIsWrongWhereTheNoiseIsWider) {
  int wrong = 0;
  const std::vector<StatedPresence> list = stated_presence(calibrated_mirrors(), 300, 2);
  for (const StatedPresence& s : list) wrong += s.right() < 1e-3 ? 1 : 0;
  EXPECT_LE(wrong, 3);
}

}  // namespace
}  // namespace blindcorner
