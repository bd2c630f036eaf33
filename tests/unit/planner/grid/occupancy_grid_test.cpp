// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/occupancy_grid.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/reliability_diagram.h"

namespace blindcorner {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;

const GridGeometry kOccupancyGrid{.columns = 40, .rows = 40, .cell_size = 0.1, .origin = {0, 0}};

/// A disc of 0.6 m that stands anywhere in the middle 2 m by 2 m.
Scene scene_of_grid() {
  Scene scene;
  scene.hidden.shape = CylinderShape{0.3, 1.5};
  scene.hidden.anchor = Anchor::base;
  scene.unknowns = {{Component::x, 1, 3, std::nullopt}, {Component::y, 1, 3, std::nullopt}};
  return scene;
}

PoseMixture pose_around(double x, double y, double sigma, double presence) {
  PoseMode mode;
  mode.weight = 1;
  mode.pose = Vector2d(x, y);
  mode.covariance = sigma * sigma * MatrixXd::Identity(2, 2);
  PoseMixture mixture;
  mixture.modes = {mode};
  mixture.presence_probability = presence;
  return mixture;
}

Cell cell_at(double x, double y) { return kOccupancyGrid.cell_at({x, y}); }
std::size_t index_at(double x, double y) { return kOccupancyGrid.index(cell_at(x, y)); }

/// Whether the disc at a place covers the centre of a cell whose centre has a lower x than `line`.
bool covers_seen_center(const Vector2d& place, double line) {
  const Cell middle = kOccupancyGrid.cell_at(place);
  for (int row = middle.row - 3; row <= middle.row + 3; ++row) {
    for (int column = middle.column - 3; column <= middle.column + 3; ++column) {
      const Vector2d center = kOccupancyGrid.center({column, row});
      if (center.x() < line && (center - place).norm() < 0.3) return true;
    }
  }
  return false;
}

OccupancyGrid new_grid(const OccupancyOptions& options = {}) {
  return {kOccupancyGrid, scene_of_grid(), Motion{}, options};
}

TEST(OccupancyGrid, NothingIsKnownAtFirst) {
  const OccupancyGrid grid(kOccupancyGrid);
  EXPECT_FALSE(grid.known({0, 0}));
  EXPECT_NEAR(grid.probability({0, 0}), 0.5, 0.002);
  EXPECT_FALSE(grid.known({-1, 0}));
  EXPECT_EQ(grid.probability({-1, 0}), 0.5);
  EXPECT_EQ(grid.log_odds({-1, 0}), 0);
}

TEST(OccupancyGrid, LineOfSightAddsUpAsBayesSays) {
  OccupancyOptions options;
  options.moving_prior = 0;
  OccupancyGrid grid(kOccupancyGrid, options);
  LineOfSightScan scan;
  scan.free = {0};
  scan.surface_hits = {1};
  grid.update(0.1, &scan, nullptr);
  // Odds 1 times (1 - 0.9) / (1 - 0.001), and times 0.9 / 0.001.
  EXPECT_NEAR(grid.probability({0, 0}), 1 / (1 + 9.99), 1e-12);
  EXPECT_NEAR(grid.probability({1, 0}), 900.0 / 901, 1e-12);
  EXPECT_NEAR(grid.log_odds({1, 0}), std::log(900), 1e-9);
  EXPECT_TRUE(grid.known({0, 0}) && grid.seen({1, 0}));
  EXPECT_FALSE(grid.known({2, 0}));
  for (int i = 0; i < 1000; ++i) grid.update(0.1, &scan, nullptr);
  EXPECT_NEAR(grid.log_odds({0, 0}), -options.max_log_odds, 1e-9);
  EXPECT_NEAR(grid.log_odds({1, 0}), options.max_log_odds, 1e-9);
}

TEST(OccupancyGrid, OneHitAndOnePassWithEqualWeightsAreKnownAndUndecided) {
  OccupancyOptions options;
  options.hit_if_occupied = 0.7;
  options.hit_if_free = 0.3;
  options.moving_prior = 0;
  OccupancyGrid grid(kOccupancyGrid, options);
  LineOfSightScan hit, pass;
  hit.surface_hits = {5};
  pass.free = {5};
  grid.update(0, &hit, nullptr);
  grid.update(0, &pass, nullptr);
  EXPECT_NEAR(grid.probability({5, 0}), 0.5, 1e-12);
  EXPECT_TRUE(grid.known({5, 0}));
}

TEST(OccupancyGrid, AnAnswerReplacesItsPredecessor) {
  OccupancyGrid once = new_grid();
  OccupancyGrid often = new_grid();
  const HiddenAnswer answer{pose_around(2, 2, 0.1, 0.7), 0, {}};
  once.update(0, nullptr, &answer);
  for (int i = 0; i < 10; ++i) often.update(0.1, nullptr, &answer);
  EXPECT_EQ(once.probabilities(), often.probabilities());
  EXPECT_NEAR(once.probability(cell_at(2, 2)), 0.7, 0.05);
  EXPECT_TRUE(once.known(cell_at(2, 2)));
  EXPECT_FALSE(once.seen(cell_at(2, 2)));
  EXPECT_FALSE(once.known(cell_at(0.1, 0.1)));  // no answer speaks of it
}

TEST(OccupancyGrid, AnEmptyRegionBecomesLikelyFree) {
  OccupancyGrid grid = new_grid();
  const double before = grid.probability(cell_at(2, 2));
  const HiddenAnswer nothing{pose_around(2, 2, 0.5, 0.01), 0, {}};
  grid.update(0.1, nullptr, &nothing);
  EXPECT_GT(before, 0.5);
  EXPECT_LT(grid.probability(cell_at(2, 2)), 0.025);
  EXPECT_GE(grid.probability(cell_at(2, 2)), grid.options().unmodelled_probability);
}

TEST(OccupancyGrid, SeeingThePlaceBeatsTheAnswer) {
  OccupancyGrid grid = new_grid();
  const HiddenAnswer answer{pose_around(2, 2, 0.1, 0.9), 0, {}};
  LineOfSightScan scan;
  for (std::size_t i = 0; i < kOccupancyGrid.cells(); ++i) scan.free.push_back(i);
  for (int i = 0; i < 3; ++i) grid.update(0.1, &scan, &answer);
  // Odds of 9 times the likelihood of three passes, of which two have faded for 0.1 s and 0.2 s:
  // (0.1 / 0.999)^2.72 = 0.0019.
  EXPECT_LT(grid.probability(cell_at(2, 2)), 0.02);
  // Seen elsewhere, where all was free: believed from the second scan on.
  LineOfSightScan elsewhere;
  elsewhere.object_hits = {index_at(3.5, 3.5)};
  for (int i = 0; i < 2; ++i) grid.update(0.1, &elsewhere, nullptr);
  EXPECT_GT(grid.probability(cell_at(3.5, 3.5)), 0.8);
}

// A post of 1 cm stands in the middle of a cell or nowhere. One ray that passes is one factor of
// the likelihood of passing, 0.1 / 0.999, however the grid divides it among its parts.
TEST(OccupancyGrid, OnePassCountsOnce) {
  Scene post = scene_of_grid();
  post.hidden.shape = CylinderShape{0.1, 1.5};
  OccupancyOptions options;
  options.unmodelled_probability = options.moving_prior = 0;
  OccupancyGrid grid(kOccupancyGrid, post, Motion{}, options);
  const HiddenAnswer answer{pose_around(2.05, 2.05, 0, 0.5), 0, {}};
  LineOfSightScan scan;
  scan.free = {index_at(2.05, 2.05)};
  grid.update(0, &scan, &answer);
  const double passed = 0.1 / 0.999;
  EXPECT_NEAR(grid.probability(cell_at(2.05, 2.05)), passed / (passed + 1), 0.01);
  grid.update(0, &scan, &answer);
  EXPECT_NEAR(grid.probability(cell_at(2.05, 2.05)), passed * passed / (passed * passed + 1),
              0.002);
}

// The disc's left edge alone was seen empty.
TEST(OccupancyGrid, AnObjectIsNotWhereItsEdgeWasSeenEmpty) {
  OccupancyGrid grid = new_grid();
  const HiddenAnswer answer{pose_around(2.05, 2.05, 0.01, 0.5), 0, {}};
  LineOfSightScan scan;
  scan.free = {index_at(1.85, 2.05)};
  grid.update(0, &scan, &answer);
  EXPECT_NEAR(grid.hidden()[index_at(2.05, 2.05)], 0.1 / 1.1, 0.01);
  EXPECT_NEAR(grid.hidden()[index_at(2.25, 2.05)], 0.1 / 1.1, 0.01);
}

TEST(OccupancyGrid, ObjectHitsRaiseACellAtOnce) {
  OccupancyGrid grid = new_grid();
  const HiddenAnswer answer{pose_around(2, 2, 0.1, 0.05), 0, {}};
  LineOfSightScan scan;
  scan.object_hits = {index_at(2, 2)};
  grid.update(0, &scan, &answer);
  EXPECT_GT(grid.probability(cell_at(2, 2)), 0.95);  // odds 0.05 times 900
}

TEST(OccupancyGrid, ACertainAnswerStaysANumber) {
  OccupancyOptions options;
  options.unmodelled_probability = 0;
  OccupancyGrid grid = new_grid(options);
  const HiddenAnswer answer{pose_around(2.05, 2.05, 0, 1), 0, {}};
  LineOfSightScan scan;
  for (std::size_t i = 0; i < kOccupancyGrid.cells(); ++i) scan.free.push_back(i);
  for (int i = 0; i < 3; ++i) {
    grid.update(0, i > 0 ? &scan : nullptr, &answer);
    for (const double p : grid.probabilities()) ASSERT_TRUE(p >= 0 && p <= 1) << p;
    EXPECT_TRUE(std::isfinite(grid.log_odds(cell_at(2.05, 2.05))));
    EXPECT_GT(grid.probability(cell_at(2.05, 2.05)), 0.999);
  }
}

TEST(OccupancyGrid, MovingThingsAreForgottenWallsAreNot) {
  OccupancyGrid grid(kOccupancyGrid);
  LineOfSightScan scan;
  scan.surface_hits = {0};
  scan.free = {1, 2};
  for (int i = 0; i < 5; ++i) grid.update(0.1, &scan, nullptr);
  LineOfSightScan object;
  object.object_hits = {2};
  for (int i = 0; i < 5; ++i) grid.update(0.1, &object, nullptr);
  EXPECT_GT(grid.probability({2, 0}), 0.8);
  grid.update(60, nullptr, nullptr);
  EXPECT_LT(grid.probability({2, 0}), 0.01);
  EXPECT_GT(grid.probability({0, 0}), 0.99);
}

TEST(OccupancyGrid, WithoutAnswersTheObjectSpreadsAndReturnsToThePrior) {
  OccupancyGrid grid = new_grid();
  const std::vector<double> prior = grid.hidden();
  const HiddenAnswer answer{pose_around(2, 2, 0.05, 0.95), 0, {}};
  grid.update(0, nullptr, &answer);
  const double middle = grid.hidden()[index_at(2, 2)];
  const double side = grid.hidden()[index_at(2.6, 2)];
  grid.update(0.3, nullptr, nullptr);
  EXPECT_LT(grid.hidden()[index_at(2, 2)], middle);
  EXPECT_GT(grid.hidden()[index_at(2.6, 2)], side);
  grid.update(1e4, nullptr, nullptr);
  for (std::size_t i = 0; i < prior.size(); ++i) ASSERT_NEAR(grid.hidden()[i], prior[i], 1e-6);
}

TEST(HiddenMotion, PredictsAsTheTrackerDoes) {
  Motion motion;
  motion.acceleration_density = 3;
  motion.initial_speed = 2;
  const HiddenMotion hidden(scene_of_grid(), motion, 1e12);
  const PoseMixture later = hidden.predicted(pose_around(2, 2, 0.1, 0.5), 0.5);
  EXPECT_NEAR(later.modes[0].covariance(0, 0), 0.01 + 4 * 0.25 + 3 * 0.125 / 3, 1e-12);
  EXPECT_EQ(later.modes[0].covariance(0, 1), 0);
  PoseVelocity velocity = hidden.any_velocity();
  velocity.mean = Vector2d(1, -2);
  velocity.covariance << 0.04, 0.01, 0.01, 0.09;
  velocity.with_pose << 0.01, 0.002, 0.003, 0.015;
  const PoseMixture known = hidden.predicted(pose_around(2, 2, 0.1, 0.5), 0.5, {velocity});
  EXPECT_NEAR((known.modes[0].pose - Vector2d(2.5, 1)).norm(), 0, 1e-12);
  // P + t (W + W') + t^2 V + q t^3 / 3
  EXPECT_NEAR(known.modes[0].covariance(0, 0), 0.01 + 0.01 + 0.25 * 0.04 + 0.125, 1e-12);
  EXPECT_NEAR(known.modes[0].covariance(1, 1), 0.01 + 0.015 + 0.25 * 0.09 + 0.125, 1e-12);
  EXPECT_NEAR(known.modes[0].covariance(0, 1), 0.5 * 0.005 + 0.25 * 0.01, 1e-12);

  const HiddenMotion leaving(scene_of_grid(), motion, 2.0);
  const PoseMixture half = leaving.predicted(pose_around(2, 2, 0.1, 0.9), 2 * std::log(2));
  EXPECT_NEAR(half.presence_probability, 0.5 * 0.9 + 0.5 * 0.5, 1e-12);
  EXPECT_NEAR(half.modes[0].weight, 0.45 / 0.7, 1e-12);
  EXPECT_THROW(hidden.predicted(pose_around(2, 2, 0.1, 0.5), -1), Error);
  EXPECT_THROW(hidden.predicted(pose_around(2, 2, 0.1, 0.5), 1, {velocity, velocity}), Error);
  velocity.with_pose.resize(0, 0);
  EXPECT_THROW(hidden.predicted(pose_around(2, 2, 0.1, 0.5), 1, {velocity}), Error);
  PoseMixture empty;
  empty.modes = {PoseMode{}};
  EXPECT_THROW(hidden.predicted(empty, 1), Error);
}

TEST(OccupancyGrid, RefusesNonsenseAndStaysAsItWas) {
  OccupancyGrid grid = new_grid();
  const HiddenAnswer good{pose_around(2, 2, 0.2, 0.7), 0, {}};
  grid.update(0.1, nullptr, &good);
  const std::vector<double> before = grid.probabilities();
  HiddenAnswer bad = good;
  bad.mixture.modes[0].covariance(0, 0) = std::nan("");
  EXPECT_THROW(grid.update(0.1, nullptr, &bad), Error);
  bad.mixture.modes = {PoseMode{}};  // without values
  bad.mixture.modes[0].weight = 1;
  EXPECT_THROW(grid.update(0.1, nullptr, &bad), Error);
  bad = good;
  bad.mixture.modes[0].pose.conservativeResize(1);
  EXPECT_THROW(grid.update(0.1, nullptr, &bad), Error);
  bad = good;
  bad.mixture.modes[0].covariance = MatrixXd::Identity(1, 2);
  EXPECT_THROW(grid.update(0.1, nullptr, &bad), Error);
  bad = good;
  bad.velocities.resize(1);  // without values
  EXPECT_THROW(grid.update(0.1, nullptr, &bad), Error);
  bad.velocities[0] = HiddenMotion(scene_of_grid(), Motion{}, 60).any_velocity();
  bad.velocities[0].mean[0] = std::nan("");
  EXPECT_THROW(grid.update(0.1, nullptr, &bad), Error);
  EXPECT_THROW(grid.update(-1, nullptr, &good), Error);
  EXPECT_THROW(grid.update(std::nan(""), nullptr, &good), Error);
  EXPECT_EQ(grid.probabilities(), before);
  EXPECT_THROW(OccupancyGrid(kOccupancyGrid).update(0.1, nullptr, &good), Error);
  OccupancyOptions options;
  options.hit_if_occupied = 0.0005;
  EXPECT_THROW(OccupancyGrid(kOccupancyGrid, options), Error);
  options = {};
  options.unseen_prior = 1;
  EXPECT_THROW(OccupancyGrid(kOccupancyGrid, options), Error);
  options = {};
  options.dwell_time = 0;
  EXPECT_THROW(OccupancyGrid(kOccupancyGrid, options), Error);
}

// The truth is drawn from the mixture that the grid is told and from what line of sight has shown:
// of cells at p, a share p is occupied. One cell of each trial is counted, so that the statements
// are independent.
TEST(OccupancyGrid, CellsAreOccupiedAsOftenAsTheySay) {
  OccupancyOptions options;
  options.unmodelled_probability = options.moving_prior = 0;  // as in these trials
  options.hit_if_occupied = 0.6;                              // two passes leave something to say
  const OccupancyGrid fresh = new_grid(options);
  const double passes = (1 - options.hit_if_occupied) / (1 - options.hit_if_free);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> normal;
  // Scans pass through all cells on one side of a line.
  for (const int scans : {0, 1, 2}) {
    ReliabilityDiagram diagram(10);
    for (int trial = 0; trial < 4000; ++trial) {
      HiddenAnswer answer;
      answer.mixture.presence_probability = 0.3 + 0.7 * uniform(random);
      const double share = uniform(random);
      for (const double weight : {share, 1 - share}) {
        // Well inside the region, whose border would cut the normal distribution.
        const double sigma = 0.02 + 0.15 * uniform(random);
        answer.mixture.modes.push_back(
            pose_around(1.7 + 0.6 * uniform(random), 1.7 + 0.6 * uniform(random), sigma, 1)
                .modes[0]);
        answer.mixture.modes.back().weight = weight;
      }
      const double line = 1.4 + 1.2 * uniform(random);
      LineOfSightScan scan;
      for (std::size_t i = 0; i < kOccupancyGrid.cells(); ++i) {
        if (kOccupancyGrid.center(kOccupancyGrid.cell(i)).x() < line) scan.free.push_back(i);
      }
      OccupancyGrid grid = fresh;
      grid.update(0, nullptr, &answer);
      for (int i = 0; i < scans; ++i) grid.update(0, &scan, nullptr);

      bool present = false;
      Vector2d truth;
      for (bool drawn = false; !drawn;) {  // until all scans have passed it
        present = uniform(random) < answer.mixture.presence_probability;
        const PoseMode& mode = answer.mixture.modes[uniform(random) < share ? 0 : 1];
        const double sigma = std::sqrt(mode.covariance(0, 0));
        truth = mode.pose + sigma * Vector2d(normal(random), normal(random));
        const bool in_view = present && covers_seen_center(truth, line);
        drawn = !in_view || uniform(random) < std::pow(passes, scans);
      }
      // A cell near the first mode, most of which lie on the object's edge.
      const Vector2d place = answer.mixture.modes[0].pose +
                             0.5 * Vector2d(2 * uniform(random) - 1, 2 * uniform(random) - 1);
      const Vector2d off =
          (kOccupancyGrid.center(kOccupancyGrid.cell_at(place)) - truth).cwiseAbs();
      const Vector2d beyond = (off.array() - kOccupancyGrid.cell_size / 2).cwiseMax(0.0);
      diagram.add(grid.probability(kOccupancyGrid.cell_at(place)), present && beyond.norm() < 0.3);
    }
    for (const ReliabilityBin& bin : diagram.bins()) {
      if (bin.statements < 50) continue;
      // Four standard deviations of a binomial share; with ten bins 99.9 % of runs stay within.
      const double p = bin.mean_predicted;
      const double margin = 4 * std::sqrt(p * (1 - p) / bin.statements) + 0.01;
      EXPECT_NEAR(bin.observed, p, margin) << bin.lower << " after " << scans << " scans";
      RecordProperty("scans_" + std::to_string(scans) + "_bin_" + std::to_string(bin.lower),
                     std::to_string(p) + " " + std::to_string(bin.observed) + " of " +
                         std::to_string(bin.statements));
    }
  }
}

}  // namespace
}  // namespace blindcorner
