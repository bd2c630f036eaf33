// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/pose_spread.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <ctime>
#include <limits>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/footprint.h"

namespace blindcorner {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;

const GridGeometry kSpreadGrid{.columns = 60, .rows = 50, .cell_size = 0.1, .origin = {-1.0, 2.0}};

/// A box of 1 m by 0.4 m that may stand anywhere in a region of 4 m by 3 m.
Scene scene_of_spread(double yaw_range = 2 * M_PI) {
  Scene scene;
  scene.hidden.shape = BoxShape{{1.0, 0.4, 1.5}};
  scene.hidden.anchor = Anchor::base;
  scene.unknowns = {{Component::x, 0, 4, std::nullopt},
                    {Component::y, 3, 6, std::nullopt},
                    {Component::yaw, 0, yaw_range, std::nullopt}};
  return scene;
}

PoseMode mode_of(double x, double y, double yaw, const MatrixXd& covariance, double weight = 1) {
  PoseMode mode;
  mode.weight = weight;
  mode.pose = Eigen::Vector3d(x, y, yaw);
  mode.covariance = covariance;
  return mode;
}

MatrixXd diagonal(double x, double y, double yaw) {
  return Eigen::Vector3d(x * x, y * y, yaw * yaw).asDiagonal();
}

PoseMixture mixture_of(std::vector<PoseMode> modes, double presence = 1) {
  PoseMixture mixture;
  mixture.modes = std::move(modes);
  mixture.presence_probability = presence;
  return mixture;
}

/// Whether a cell's square touches the box of the scene at a pose: separating axes.
bool touches(const Vector2d& center, double cell, const Vector2d& position,
             const Eigen::Matrix2d& turn) {
  const Vector2d half(0.5, 0.2);
  const Vector2d off = center - position;
  const Vector2d in_box = turn.transpose() * off;
  const double c = std::abs(turn(0, 0));
  const double s = std::abs(turn(1, 0));
  const double reach = cell / 2 * (c + s);
  return std::abs(in_box.x()) <= half.x() + reach && std::abs(in_box.y()) <= half.y() + reach &&
         std::abs(off.x()) <= cell / 2 + half.x() * c + half.y() * s &&
         std::abs(off.y()) <= cell / 2 + half.x() * s + half.y() * c;
}

/// Shares of draws from the distribution that hit each cell; `inside` keeps the search region.
std::vector<double> sampled(const GridGeometry& grid, const PoseMode& mode, bool inside,
                            int draws = 20000) {
  const MatrixXd factor = Eigen::LLT<MatrixXd>(mode.covariance).matrixL();
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> cells(grid.cells());
  for (int kept = 0; kept < draws;) {
    Eigen::Vector3d u;
    for (double& value : u) value = normal(random);
    const Eigen::Vector3d pose = mode.pose + factor * u;
    if (inside && (pose.x() < 0 || pose.x() > 4 || pose.y() < 3 || pose.y() > 6)) continue;
    ++kept;
    const Eigen::Matrix2d turn = Eigen::Rotation2Dd(pose[2]).toRotationMatrix();
    const Cell middle = grid.cell_at(pose.head<2>());
    const int reach = static_cast<int>(0.7 / grid.cell_size) + 1;
    for (int row = middle.row - reach; row <= middle.row + reach; ++row) {
      for (int column = middle.column - reach; column <= middle.column + reach; ++column) {
        const Cell cell{column, row};
        if (grid.contains(cell) &&
            touches(grid.center(cell), grid.cell_size, pose.head<2>(), turn)) {
          cells[grid.index(cell)] += 1.0 / draws;
        }
      }
    }
  }
  return cells;
}

double worst(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference = std::max(difference, std::abs(a[i] - b[i]));
  }
  return difference;
}

struct Case {
  const char* name;
  PoseMode mode;
  bool truncated = true;
};

TEST(PoseSpread, AgreesWithMonteCarlo) {
  MatrixXd ridge(3, 3);  // correlation of x and y 0.95, of x and yaw 0.8
  ridge << 0.25, 0.19, 0.16, 0.19, 0.16, 0.12, 0.16, 0.12, 0.16;
  const std::vector<Case> cases{
      {"sharp", mode_of(2.013, 4.427, 0.4, diagonal(0.03, 0.03, 0.02))},
      {"a cell wide", mode_of(2.013, 4.427, 0.4, diagonal(0.1, 0.1, 0.2))},
      {"thin", mode_of(2.013, 4.427, 0.4, diagonal(0.6, 0.04, 0.2))},
      {"correlated", mode_of(2.0, 4.4, 2.5, ridge)},
      {"any yaw", mode_of(2.0, 4.4, 0.4, diagonal(0.2, 0.2, 4.0))},
      {"wide", mode_of(2.0, 4.4, 0.4, diagonal(0.5, 0.5, 0.5))},
      {"at the region's border", mode_of(3.9, 3.1, 0.4, diagonal(0.4, 0.4, 0.1))},
      {"has left the region", mode_of(4.2, 6.2, 0.4, diagonal(0.2, 0.2, 0.1)), false},
  };
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  for (const Case& c : cases) {
    const std::vector<double> got = spread.occupied(mixture_of({c.mode}));
    // 20000 draws: 5 standard errors are 0.018; the washed-out border is what remains.
    const double off = worst(got, sampled(kSpreadGrid, c.mode, c.truncated));
    RecordProperty(c.name, std::to_string(off));
    EXPECT_LT(off, 0.03) << c.name;
  }
}

TEST(PoseSpread, ACertainPoseFillsItsFootprint) {
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  const std::vector<double> cells =
      spread.occupied(mixture_of({mode_of(2.05, 4.05, 0, MatrixXd::Zero(3, 3))}));
  // Nothing finer than a quarter of a cell is resolved: half a cell off the edge is two of them.
  const auto at = [&](double x, double y) {
    return cells[kSpreadGrid.index(kSpreadGrid.cell_at({x, y}))];
  };
  EXPECT_NEAR(at(2.05, 4.05), 1, 1e-3);
  EXPECT_NEAR(at(2.45, 4.15), 1, 1e-3);
  EXPECT_NEAR(at(2.75, 4.05), 0, 1e-3);
  EXPECT_NEAR(at(2.05, 4.45), 0, 1e-3);
}

TEST(PoseSpread, PresenceAndWeightsScaleIt) {
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  const PoseMode left = mode_of(1, 4, 0, diagonal(0.1, 0.1, 0.1), 0.7);
  const PoseMode right = mode_of(3, 5, 1, diagonal(0.2, 0.1, 0.3), 0.3);
  PoseMode only_left = left, only_right = right;
  only_left.weight = only_right.weight = 1;
  const auto both = spread.occupied(mixture_of({left, right}, 0.5));
  const auto first = spread.occupied(mixture_of({only_left}));
  const auto second = spread.occupied(mixture_of({only_right}));
  for (std::size_t i = 0; i < both.size(); ++i) {
    ASSERT_NEAR(both[i], 0.5 * (0.7 * first[i] + 0.3 * second[i]), 1e-9);
  }
  const auto none = spread.occupied(mixture_of({only_left}, 0));
  EXPECT_EQ(*std::ranges::max_element(none), 0);
}

TEST(PoseSpread, MissingWeightIsThePriorOverTheSearchRegion) {
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  const std::vector<double> prior = spread.occupied(mixture_of({}, 0.5));
  // Well inside the region each cell is covered by the mean area of box and cell together:
  // A + a + perimeter * side / pi * ... (Santalo): A1 + A2 + L1 L2 / (2 pi).
  const double area = 1.0 * 0.4 + 0.1 * 0.1 + 2.8 * 0.4 / (2 * M_PI);
  EXPECT_NEAR(prior[kSpreadGrid.index(kSpreadGrid.cell_at({2, 4.5}))], 0.5 * area / 12,
              0.03 * 0.5 * area / 12);
  EXPECT_EQ(prior[kSpreadGrid.index(kSpreadGrid.cell_at({-0.9, 2.05}))], 0);

  PoseMode open = mode_of(2, 4.5, M_PI, diagonal(4 / std::sqrt(12), 3 / std::sqrt(12), 1.81));
  open.undetermined = {0, 1, 2};
  EXPECT_LT(worst(spread.occupied(mixture_of({open}, 0.5)), prior), 1e-3);
}

TEST(PoseSpread, WhatWasSeenEmptyIsTakenOut) {
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  const PoseMixture mixture = mixture_of({mode_of(1, 4, 0, diagonal(0.05, 0.05, 0.05), 0.5),
                                          mode_of(3, 5, 0, diagonal(0.05, 0.05, 0.05), 0.5)},
                                         0.8);
  std::vector<double> not_seen(kSpreadGrid.cells(), 1.0);
  for (std::size_t i = 0; i < not_seen.size(); ++i) {
    if (kSpreadGrid.center(kSpreadGrid.cell(i)).x() < 2) not_seen[i] = 0;
  }
  const std::vector<double> cells = spread.occupied(mixture, not_seen);
  // Bayes: 0.8 * 0.5 of being on the right, unseen, against 0.2 of being nowhere.
  EXPECT_NEAR(cells[kSpreadGrid.index(kSpreadGrid.cell_at({3, 5}))], 0.4 / 0.6, 0.01);
  EXPECT_EQ(cells[kSpreadGrid.index(kSpreadGrid.cell_at({1, 4}))], 0);
}

TEST(PoseSpread, IsContinuousInThePose) {
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  const auto at = [&](double x) {
    return spread.occupied(mixture_of({mode_of(x, 4.4, 0.4, diagonal(0.05, 0.05, 0.1))}));
  };
  std::vector<double> before = at(2.0);
  for (int i = 1; i <= 20; ++i) {  // over two cells
    const std::vector<double> now = at(2.0 + 0.01 * i);
    // The steepest edge: a step of 0.01 over a normal density of 0.05, 0.4 * 0.01 / 0.05.
    EXPECT_LT(worst(before, now), 0.09) << i;
    before = now;
  }
}

TEST(PoseSpread, SeveralObjectsAndModesWithoutOne) {
  Scene scene = scene_of_spread();
  scene.further_hidden = {scene.hidden};
  for (const Component component : {Component::x, Component::y, Component::yaw}) {
    Unknown unknown = scene.unknowns[static_cast<std::size_t>(component == Component::x   ? 0
                                                              : component == Component::y ? 1
                                                                                          : 2)];
    unknown.object = 1;
    scene.unknowns.push_back(unknown);
  }
  PoseMode mode;
  mode.weight = 1;
  mode.pose.resize(6);
  mode.pose << 1, 4, 0, 1.3, 4.1, 0;
  mode.covariance = 0.04 * MatrixXd::Identity(6, 6);
  const PoseSpread both(scene, kSpreadGrid);
  const PoseSpread one(scene_of_spread(), kSpreadGrid);
  const MatrixXd c = 0.04 * MatrixXd::Identity(3, 3);
  const auto first = one.occupied(mixture_of({mode_of(1, 4, 0, c)}));
  const auto second = one.occupied(mixture_of({mode_of(1.3, 4.1, 0, c)}));
  const auto joint = both.occupied(mixture_of({mode}));
  for (std::size_t i = 0; i < joint.size(); ++i) {
    ASSERT_NEAR(joint[i], 1 - (1 - first[i]) * (1 - second[i]), 1e-6);
  }
  const double none = std::numeric_limits<double>::quiet_NaN();
  mode.pose.tail(3).setConstant(none);
  mode.covariance.bottomRows(3).setConstant(none);
  mode.covariance.rightCols(3).setConstant(none);
  EXPECT_LT(worst(both.occupied(mixture_of({mode})), first), 1e-9);
}

TEST(PoseSpread, Extremes) {
  const PoseSpread spread(scene_of_spread(), kSpreadGrid);
  const auto largest = [&](const PoseMode& mode) {
    const auto cells = spread.occupied(mixture_of({mode}));
    for (const double p : cells) {
      EXPECT_TRUE(p >= 0 && p <= 1) << p;
    }
    return *std::ranges::max_element(cells);
  };
  EXPECT_EQ(largest(mode_of(1e300, 4, 0, diagonal(0.1, 0.1, 0.1))), 0);
  EXPECT_EQ(largest(mode_of(-900, 4, 0, diagonal(0.1, 0.1, 0.1))), 0);
  EXPECT_GT(largest(mode_of(2, 4, 1e6, diagonal(0.1, 0.1, 0.1))), 0.9);
  // Cut to the search region, a huge covariance is the prior over it.
  EXPECT_NEAR(largest(mode_of(2, 4, 0, diagonal(1e6, 1e6, 1e6))), 0.6 / 12, 0.01);
  EXPECT_LT(largest(mode_of(9, 9, 0, diagonal(1e6, 1e6, 1e6))), 0.01);

  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(spread.occupied(mixture_of({mode_of(2, 4, none, diagonal(1, 1, 1))})), Error);
  EXPECT_THROW(spread.occupied(mixture_of({mode_of(2, 4, 0, diagonal(1, none, 1))})), Error);
  EXPECT_THROW(spread.occupied(mixture_of({mode_of(2, 4, 0, -diagonal(1, 1, 1))})), Error);
  EXPECT_THROW(spread.occupied(mixture_of({mode_of(2, 4, 0, MatrixXd::Zero(2, 2))})), Error);
  EXPECT_THROW(spread.occupied(mixture_of({}, 1.5)), Error);
  EXPECT_THROW(spread.occupied(mixture_of({mode_of(2, 4, 0, diagonal(1, 1, 1), 0.6),
                                           mode_of(2, 4, 0, diagonal(1, 1, 1), 0.6)})),
               Error);
  EXPECT_THROW(spread.occupied(mixture_of({}), std::vector<double>(3)), Error);
}

TEST(PoseSpread, ATouchedThinRectangleOccupiesCells) {
  Scene scene = scene_of_spread();
  scene.hidden.shape = RectangleShape{0.8, 0.8};
  const PoseSpread spread(scene, kSpreadGrid);
  const auto cells =
      spread.occupied(mixture_of({mode_of(2.05, 4.05, 0, diagonal(0.01, 0.01, 0.01))}));
  EXPECT_GT(cells[kSpreadGrid.index(kSpreadGrid.cell_at({2.05, 4.35}))], 0.9);
  EXPECT_LT(cells[kSpreadGrid.index(kSpreadGrid.cell_at({2.25, 4.05}))], 0.01);
}

// Processor time: that of other programs is not counted.
TEST(PoseSpread, TakesMillisecondsOnALargeGrid) {
  const GridGeometry large{.columns = 500, .rows = 500, .cell_size = 0.1, .origin = {-25, -20}};
  const PoseSpread spread(scene_of_spread(), large);
  std::vector<double> not_seen(large.cells(), 0.5);
  for (const double sigma : {0.03, 0.1, 0.3, 1.0, 3.0}) {
    const PoseMixture mixture =
        mixture_of({mode_of(2, 4.5, 0.3, diagonal(sigma, sigma / 2, sigma))});
    double best = 1e9;
    for (int i = 0; i < 5; ++i) {
      const std::clock_t start = std::clock();
      spread.occupied(mixture, not_seen);
      best = std::min(best, 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    RecordProperty("ms_at_sigma_" + std::to_string(sigma), std::to_string(best));
    EXPECT_LT(best, 50);
  }
}

}  // namespace
}  // namespace blindcorner
