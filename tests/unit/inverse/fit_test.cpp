// SPDX-License-Identifier: Apache-2.0
/// The solver as a whole: captures of the reference renderer in, poses out.
#include "blindcorner/inverse/fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/io/starter_scene.h"
#include "bundled.h"
#include "inverse/search/exhaustive.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using testing_scenes::reference_capture;

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// A small, quick scene: the DENALI-like wall with two unknowns.
Scene quick_scene() { return bundled_scene("denali_like"); }

FitOptions quick_options() {
  FitOptions options;
  options.max_starts = 8;
  options.importance_samples = 128;
  options.empty_captures = 32;
  return options;
}

Capture blank(const Scene& scene) {
  Capture capture;
  capture.counts = HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  capture.source = "blank";
  return capture;
}

PoseVector middle(const Scene& scene) {
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    pose[static_cast<Eigen::Index>(i)] = scene.unknowns[i].lower + 0.4 * scene.unknowns[i].range();
  }
  return pose;
}

TEST(Fit, FindsABrightObjectWithinItsOwnErrorBars) {
  const Scene scene = quick_scene();
  const PoseVector truth = middle(scene);
  const FitResult result = fit(scene, reference_capture(scene, truth, 3000, 1), quick_options());
  const PoseMode& mode = result.posterior.modes.front();
  const PoseVector d = mode.pose - truth;
  // chi-square of two unknowns exceeds 18.4 once in ten thousand.
  EXPECT_LT(d.dot(mode.covariance.inverse() * d), 18.4);
  EXPECT_LT(d.norm(), 0.05);
  EXPECT_GT(result.posterior.presence_probability, 0.999);
  EXPECT_LT(result.false_alarm_probability.value(), 0.01);
  EXPECT_GT(mode.weight, 0.99);
}

TEST(Fit, ReachesTheExhaustiveOptimum) {
  const Scene scene = quick_scene();
  const Fitter fitter(scene, quick_options());
  const ExhaustiveSearch exhaustive(scene);
  for (const double photons : {15.0, 60.0, 400.0}) {
    const Capture capture = reference_capture(scene, middle(scene), photons, 7);
    const FitResult result = fitter.fit(capture);
    double best = -std::numeric_limits<double>::infinity();
    for (const PoseMode& mode : result.posterior.modes) {
      best = std::max(best, exhaustive.log_posterior(capture, mode.optimum));
    }
    EXPECT_GT(best, exhaustive.search(capture).log_posterior - 0.1) << photons << " photons";
  }
}

TEST(Fit, AnEmptySceneIsNotAnObject) {
  const Scene scene = quick_scene();
  const Fitter fitter(scene, quick_options());
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Capture capture = blank(scene);
    capture.counts = draw_counts(
        scene, expected_counts(scene, nothing, model->static_background(), {0.0, 5.0, 1.0}), 1.0,
        seed);
    if (fitter.fit(capture).false_alarm_probability.value() < 0.05) ++alarms;
  }
  // Binomial(40, 0.05): more than 8 with probability 1e-4.
  EXPECT_LE(alarms, 8);
}

TEST(Fit, FalseAlarmsAreUnknownWhenNotAskedFor) {
  const Scene scene = quick_scene();
  FitOptions options = quick_options();
  options.empty_captures = 0;
  EXPECT_FALSE(fit(scene, reference_capture(scene, middle(scene), 40, 3), options)
                   .false_alarm_probability.has_value());
}

// Without false alarms the probability of presence alone says whether there is an object.
TEST(Fit, PresenceDecidesWhenFalseAlarmsAreNotAskedFor) {
  const Scene scene = quick_scene();
  FitOptions options = quick_options();
  options.empty_captures = 0;
  const Fitter fitter(scene, options);
  const FitResult bright = fitter.fit(reference_capture(scene, middle(scene), 3000, 1));
  EXPECT_GT(bright.posterior.presence_probability, 0.999);
  EXPECT_THAT(bright.flags, Not(Contains("nothing_detected")));
  // A photon or two tell next to nothing: about half of such captures leave less than the prior.
  int absent = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const FitResult dim = fitter.fit(reference_capture(scene, middle(scene), 1, seed));
    const bool said = std::ranges::find(dim.flags, "nothing_detected") != dim.flags.end();
    EXPECT_EQ(said, dim.posterior.presence_probability < 0.5) << seed;
    EXPECT_LT(dim.posterior.presence_probability, 0.9) << seed;
    absent += said ? 1 : 0;
  }
  EXPECT_GE(absent, 2);  // of 12 with even chances fewer come once in 300
}

TEST(Fit, SameSeedSameAnswer) {
  const Scene scene = quick_scene();
  const Capture capture = reference_capture(scene, middle(scene), 40, 3);
  const FitResult a = fit(scene, capture, quick_options());
  const FitResult b = fit(scene, capture, quick_options());
  ASSERT_EQ(a.posterior.modes.size(), b.posterior.modes.size());
  for (std::size_t i = 0; i < a.posterior.modes.size(); ++i) {
    EXPECT_EQ(a.posterior.modes[i].weight, b.posterior.modes[i].weight);
    EXPECT_EQ(a.posterior.modes[i].pose, b.posterior.modes[i].pose);
  }
  EXPECT_EQ(a.false_alarm_probability, b.false_alarm_probability);
}

TEST(Fit, CovarianceShrinksWithLight) {
  const Scene scene = quick_scene();
  const Fitter fitter(scene, quick_options());
  const FitResult dim = fitter.fit(reference_capture(scene, middle(scene), 200, 5));
  const FitResult bright = fitter.fit(reference_capture(scene, middle(scene), 5000, 5));
  // 25 times the light: variances 25 times smaller, within the scatter of one realisation.
  const double ratio = dim.posterior.covariance.trace() / bright.posterior.covariance.trace();
  EXPECT_GT(ratio, 8);
}

// A disturbed capture says nothing: its share of the answer is the prior, the normal one if given.
// Beside the partition the usual models' light jumps as its shadow's edge goes from cell to cell of
// the plate: their slopes claimed a standard deviation of 2.7 mm in y, where finer models have 4.9
// to 5.5, and the truth was 21 mm away.
TEST(Fit, StatesNoMoreThanFinerModelsKnowBesideAShadowsEdge) {
  Scene scene = bundled_scene("tmf8828_wall");
  for (Zone& zone : scene.sensor.zones) zone.gain *= 8;
  const double ambient = 36'800;
  const auto renderer =
      make_reference_renderer(scene, sensor_placement(scene), reference_sampling(1.5));
  const PoseVector truth = Eigen::Vector4d(0.226944, 0.368633, 0.994452, -0.534076);
  Capture capture;
  capture.source = "expected";
  capture.counts = expected_counts(scene, renderer->three_bounce(truth),
                                   renderer->shadowed_background(truth), {1.0, ambient, 1.0});
  FitOptions options;
  options.empty_captures = 0;
  const FitResult result = fit(scene, capture, options);
  const Eigen::MatrixXd& covariance = result.posterior.modes.front().covariance;
  EXPECT_GT(std::sqrt(covariance(1, 1)), 0.004);
  EXPECT_LT(std::sqrt(covariance(1, 1)), 0.012);
}

// A box on a desk takes light away that goes from the wall to the desk and back: 8 % of its own.
TEST(Fit, ABoxCastsItsShadowOnTheDesk) {
  Scene scene = parse_scene_text(starter_scene("vl53l8ch_4x4"), "desk.json");
  for (Zone& zone : scene.sensor.zones) zone.gain *= 100;
  const auto renderer =
      make_reference_renderer(scene, sensor_placement(scene), reference_sampling(1));
  const PoseVector truth = Eigen::Vector3d(0.2, 0.6, 0.3);
  Capture capture;
  capture.source = "expected";
  capture.counts = expected_counts(scene, renderer->three_bounce(truth),
                                   renderer->shadowed_background(truth), {1.0, 10.0, 1.0});
  FitOptions options;
  options.empty_captures = 0;
  const FitResult shaded = fit(scene, capture, options);
  options.left_out = {FitRule::shadow};
  const FitResult open = fit(scene, capture, options);
  EXPECT_LT(shaded.goodness_of_fit.deviance, 0.3 * open.goodness_of_fit.deviance);
  const PoseVector d = pose_error(scene, shaded.posterior.mean, truth);
  EXPECT_LT(d.dot(shaded.posterior.covariance.ldlt().solve(d)), 3);
  EXPECT_LT(d.head(2).norm(), 0.02);
}

TEST(Fit, OutliersHaveThePriorsMeanAndSpread) {
  Scene scene = quick_scene();
  const double share = 0.2;
  Unknown& x = scene.unknowns[0];
  const NormalPrior prior{x.lower + 0.55 * x.range(), 0.04 * x.range()};
  x.prior = prior;
  const Capture capture = reference_capture(scene, middle(scene), 3000, 1);
  const PoseMixture clean = fit(scene, capture, quick_options()).posterior;
  scene.outlier_probability = share;
  const PoseMixture mixed = fit(scene, capture, quick_options()).posterior;
  const Unknown& y = scene.unknowns[1];
  const double even = y.range() * y.range() / 12;
  const Eigen::Vector2d center(prior.mean, 0.5 * (y.lower + y.upper));
  const Eigen::Vector2d variance(prior.sigma * prior.sigma, even);
  for (Eigen::Index i = 0; i < 2; ++i) {
    const double d = center[i] - clean.mean[i];
    EXPECT_NEAR(mixed.mean[i], clean.mean[i] + share * d, 1e-5);
    const double want =
        (1 - share) * clean.covariance(i, i) + share * variance[i] + share * (1 - share) * d * d;
    EXPECT_NEAR(mixed.covariance(i, i), want, 1e-3 * want);
  }
}

TEST(Fit, JointFitIsSharperThanEachCapture) {
  const Scene scene = quick_scene();
  const Fitter fitter(scene, quick_options());
  const std::vector<Capture> captures = {reference_capture(scene, middle(scene), 300, 11),
                                         reference_capture(scene, middle(scene), 300, 12)};
  const FitResult joint = fitter.fit_joint(captures);
  const FitResult one = fitter.fit(captures.front());
  EXPECT_EQ(joint.histograms.size(), 2U);
  EXPECT_LT(joint.posterior.covariance.trace(), 0.8 * one.posterior.covariance.trace());
}

/// Captures of one object, larger than the scene says, from as many places of the sensor.
std::vector<Capture> from_many_places(const Scene& scene, int count, double photons) {
  std::vector<Capture> captures;
  for (int i = 0; i < count; ++i) {
    Scene there = scene;
    there.hidden.placement.size = 1.4;
    there.T_world_sensor.translation() += Eigen::Vector3d(0.03 * (i % 4), 0.02 * (i / 4), 0);
    captures.push_back(
        reference_capture(there, middle(scene), photons, static_cast<std::uint64_t>(i) + 1));
    captures.back().T_world_sensor = there.T_world_sensor;
  }
  return captures;
}

// A model of every capture at every step of every descent is what a joint fit cannot afford: 36
// captures of scenes/ams_u.json took minutes. A few captures search, and all of them settle.
TEST(Fit, JointFitOfManyCapturesSearchesWithAFewOfThem) {
  const Scene scene = quick_scene();
  FitOptions options = quick_options();
  options.empty_captures = 0;
  const std::vector<Capture> captures = from_many_places(scene, 12, 300000);
  const FitResult joint = Fitter(scene, options).fit_joint(captures);
  const PoseMode& mode = joint.posterior.modes.front();
  const PoseVector d = mode.pose - middle(scene);
  // What a wrong size moves, by which the other captures of the scene are off alike.
  EXPECT_LT(d.norm(), 0.03);
  // Evaluations of all captures, sampling included: some 280. Descents by all of them from every
  // start would alone take as many again.
  EXPECT_LT(joint.renders, 350 * 12);
}

TEST(BadCapture, NoPhotonsIsNothingDetectedNotAnError) {
  const Scene scene = quick_scene();
  const FitResult result = fit(scene, blank(scene), quick_options());
  EXPECT_TRUE(result.error.empty());
  EXPECT_THAT(result.flags, Contains("nothing_detected"));
  EXPECT_LE(result.posterior.presence_probability, scene.presence_prior);
  ASSERT_EQ(result.posterior.modes.size(), 1U);
  EXPECT_TRUE(result.posterior.modes.front().covariance.allFinite());
  EXPECT_EQ(result.posterior.modes.front().undetermined.size(), scene.unknowns.size());
}

TEST(BadCapture, WrongValuesAreNamed) {
  const Scene scene = quick_scene();
  const Fitter fitter(scene, quick_options());
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -1.0}) {
    Capture capture = blank(scene);
    capture.counts.zone(3)[17] = value;
    const std::string message = message_of([&] { fitter.fit(capture); });
    EXPECT_THAT(message, HasSubstr("blank"));
    EXPECT_THAT(message, HasSubstr("counts[zone 3][bin 17]"));
    EXPECT_THAT(message, HasSubstr("accepted"));
  }
}

TEST(BadCapture, NegativeCountsAreDataUnderAGaussianLaw) {
  Scene scene = quick_scene();
  scene.sensor.noise = GaussianNoise{25.0, 1.0, false};
  scene.linear.direct = LinearMode::fixed;
  scene.linear.fixed_direct = 0;
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  const PoseVector truth = middle(scene);
  Capture capture = blank(scene);
  const HistogramCube light = model->three_bounce(truth);
  const double peak = *std::max_element(light.values.begin(), light.values.end());
  for (Zone& zone : scene.sensor.zones) zone.gain = 200 / peak;
  capture.counts = draw_counts(
      scene, expected_counts(scene, light, model->static_background(), {1.0, 0.0, 0.0}), 1.0, 2);
  ASSERT_LT(*std::min_element(capture.counts.values.begin(), capture.counts.values.end()), 0.0);
  const FitResult result = fit(scene, capture, quick_options());
  EXPECT_LT((result.posterior.modes.front().pose - truth).norm(), 0.05);
}

// Crosstalk as bright as the object, near where its light is: known, it does no harm; and a fit
// that knows of none is the same as ever after one that does.
TEST(Fit, MeasuredBackgroundIsNoObject) {
  const Scene plain = quick_scene();
  Scene scene = plain;
  const PoseVector truth = middle(scene);
  const auto model = make_reference_renderer(scene, sensor_placement(scene));
  const HistogramCube light = model->three_bounce(truth);
  for (int z = 0; z < light.zones(); ++z) {
    Zone& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    const double* row = light.zone(z);
    zone.background.assign(row, row + light.bins);
    for (double& counts : zone.background) counts *= zone.gain;
    std::rotate(zone.background.begin(), zone.background.end() - 6, zone.background.end());
  }
  const Capture capture = reference_capture(scene, truth, 3000, 4);
  const Capture without = reference_capture(plain, truth, 3000, 4);
  const PoseVector alone = fit(plain, without, quick_options()).posterior.mean;
  const FitResult known = fit(scene, capture, quick_options());
  EXPECT_LT((known.posterior.mean - truth).norm(), 0.05);
  EXPECT_LT(known.goodness_of_fit.inflation, 1.1);
  EXPECT_EQ(fit(plain, without, quick_options()).posterior.mean, alone);
  const FitResult unknown = fit(plain, capture, quick_options());
  EXPECT_GT((unknown.posterior.mean - truth).norm(), 2 * (known.posterior.mean - truth).norm());
}

TEST(BadCapture, WrongShapeIsNamed) {
  const Scene scene = quick_scene();
  const Fitter fitter(scene, quick_options());
  Capture zones = blank(scene);
  zones.counts = HistogramCube(4, 4, scene.sensor.bins);
  EXPECT_THAT(message_of([&] { fitter.fit(zones); }), HasSubstr("4 x 4 zones"));
  Capture bins = blank(scene);
  bins.counts = HistogramCube(scene.sensor.rows, scene.sensor.columns, 64);
  EXPECT_THAT(message_of([&] { fitter.fit(bins); }), HasSubstr("64 bins"));
}

TEST(BadScene, InvisibleRelayIsNamed) {
  Scene scene = quick_scene();
  scene.T_world_sensor.linear() =
      Eigen::AngleAxisd(3.14159, Eigen::Vector3d::UnitZ()) * scene.T_world_sensor.linear();
  EXPECT_THAT(message_of([&] { Fitter fitter(scene, quick_options()); }), HasSubstr("relay"));
}

TEST(BadOptions, FieldIsNamed) {
  FitOptions options;
  options.max_starts = 0;
  EXPECT_THAT(message_of([&] { Fitter fitter(quick_scene(), options); }),
              HasSubstr("FitOptions.max_starts"));
}

TEST(Fit, SensorPoseUncertaintyWidensTheAnswer) {
  Scene scene = quick_scene();
  const Capture capture = reference_capture(scene, middle(scene), 2000, 4);
  const FitResult exact = fit(scene, capture, quick_options());
  scene.sensor_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  scene.sensor_covariance->topLeftCorner(3, 3).diagonal().setConstant(0.02 * 0.02);
  const FitResult vague = fit(scene, capture, quick_options());
  EXPECT_GT(vague.posterior.covariance.trace(), 1.5 * exact.posterior.covariance.trace());
}

// Where the sensor stood before, and how much of that is remembered, does not change an answer.
TEST(Fit, AnswersDoNotDependOnWhatTheCacheHolds) {
  const Scene scene = quick_scene();
  const PoseVector truth = middle(scene);
  std::vector<Capture> captures;
  for (int i = 0; i < 3; ++i) {
    captures.push_back(reference_capture(scene, truth, 500, static_cast<std::uint64_t>(i)));
    Transform there = scene.T_world_sensor;
    there.translation().y() += 0.02 * i;
    captures.back().T_world_sensor = there;
  }
  FitOptions forgetful = quick_options();
  forgetful.cache_bytes = 1;
  const Fitter all(scene, quick_options());
  const Fitter none(scene, forgetful);
  for (const std::size_t i : {0U, 1U, 2U, 0U, 2U}) {
    const FitResult a = all.fit(captures[i]);
    const FitResult b = none.fit(captures[i]);
    EXPECT_EQ(a.posterior.modes.front().pose, b.posterior.modes.front().pose);
    EXPECT_EQ(a.false_alarm_probability, b.false_alarm_probability);
  }
}

}  // namespace
}  // namespace blindcorner
