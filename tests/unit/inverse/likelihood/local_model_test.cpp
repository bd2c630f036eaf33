// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/local_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "bundled.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {
namespace {

constexpr double kAnyError = 1e300;

/// Two unknowns without a period.
Scene flat_scene() {
  Scene scene;
  scene.unknowns = {{Component::x, -10, 10, std::nullopt}, {Component::y, -10, 10, std::nullopt}};
  return scene;
}

LocalRegion region() {
  LocalRegion region;
  region.center = Eigen::Vector2d(0.5, -0.3);
  region.root = Eigen::MatrixXd::Zero(2, 2);
  region.root << 0.2, 0, 0.1, 0.05;
  return region;
}

/// Nodes whose light is `light(z)`, three rows, within two standard deviations along each axis.
template <typename Light>
std::vector<LightNode> nodes_of(int count, Light light) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-2, 2);
  std::vector<LightNode> nodes;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d z(uniform(random), uniform(random));
    nodes.push_back({region().center + region().root * z, light(z)});
  }
  return nodes;
}

Eigen::VectorXd cubic(const Eigen::Vector2d& z) {
  return Eigen::Vector3d(5 + z[0], 7 - 0.2 * z[0] * z[1] * z[1], 9 + 0.1 * std::pow(z[1], 3));
}

double value(const LocalModel& model, const Eigen::Vector2d& z, int row) {
  Eigen::VectorXd light(3);
  model.light(flat_scene(), region().center + region().root * z, light.data());
  return light[row];
}

// Light that is a cubic is reproduced by the third degree; the fourth would do no better.
TEST(LocalModel, ReproducesAPolynomial) {
  const auto model = LocalModel::fit(flat_scene(), region(), nodes_of(40, cubic),
                                     Eigen::Vector3d::Ones(), kAnyError);
  ASSERT_TRUE(model);
  EXPECT_GE(model->degree(), 3);
  EXPECT_NEAR(model->error(), 0, 1e-12);
  const Eigen::Vector2d z(0.7, -1.3);
  for (int row = 0; row < 3; ++row) EXPECT_NEAR(value(*model, z, row), cubic(z)[row], 1e-9);
}

// Twelve nodes suffice for six terms of the second degree (1.6 * 6 + 2), not for ten of the third:
// the model then says by how much it is off, and is none where that is not tolerated.
TEST(LocalModel, IsNoneWhereItIsNotExactEnough) {
  const std::vector<LightNode> nodes = nodes_of(12, cubic);
  const Eigen::Vector3d information = Eigen::Vector3d::Ones();
  const auto model = LocalModel::fit(flat_scene(), region(), nodes, information, kAnyError);
  ASSERT_TRUE(model);
  EXPECT_EQ(model->degree(), 2);
  EXPECT_GT(model->error(), 0.01);
  EXPECT_FALSE(LocalModel::fit(flat_scene(), region(), nodes, information, 0.5 * model->error()));
}

// Nodes outside of the region do not count, and eleven inside are too few.
TEST(LocalModel, AsksForEnoughNodesInItsRegion) {
  std::vector<LightNode> nodes = nodes_of(11, cubic);
  for (LightNode& far : nodes_of(30, cubic)) {
    far.pose += Eigen::Vector2d(5, 5);
    nodes.push_back(far);
  }
  EXPECT_FALSE(LocalModel::fit(flat_scene(), region(), nodes, Eigen::Vector3d::Ones(), kAnyError));
}

// It covers its ellipsoid to the reach, and no light is negative.
TEST(LocalModel, CoversItsRegionAndIsNeverNegative) {
  const auto falling = [](const Eigen::Vector2d& z) {
    return Eigen::VectorXd(Eigen::Vector3d(1 - z[0], 1, 1));
  };
  const auto model = LocalModel::fit(flat_scene(), region(), nodes_of(40, falling),
                                     Eigen::Vector3d::Ones(), kAnyError);
  ASSERT_TRUE(model);
  const Eigen::Vector2d direction(0.6, 0.8);
  const auto at = [](const Eigen::Vector2d& z) {
    return PoseVector(region().center + region().root * z);
  };
  EXPECT_TRUE(model->covers(flat_scene(), at(0.99 * local_reach(2) * direction)));
  EXPECT_FALSE(model->covers(flat_scene(), at(1.01 * local_reach(2) * direction)));
  EXPECT_EQ(value(*model, {2, 0}, 0), 0);
}

// The error is that of fits that leave a node out, each done here.
TEST(LeaveOneOut, IsThatOfFitsWithoutEachNode) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kNodes = 9, kTerms = 4, kRows = 5;
  const auto fill = [&](Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd(
        Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); }));
  };
  const Eigen::MatrixXd design = fill(kNodes, kTerms);
  const Eigen::MatrixXd light = fill(kNodes, kRows);
  const Eigen::VectorXd weight = fill(kNodes, 1).cwiseAbs() + Eigen::VectorXd::Constant(kNodes, 1);
  double sum = 0;
  for (int left = 0; left < kNodes; ++left) {
    Eigen::VectorXd others = weight;
    others[left] = 0;
    const Eigen::MatrixXd by = others.asDiagonal() * design;
    const Eigen::MatrixXd to = others.asDiagonal() * light;
    const Eigen::MatrixXd solved = by.colPivHouseholderQr().solve(to);
    const double missed = (light.row(left) - design.row(left) * solved).squaredNorm();
    sum += weight[left] * weight[left] * 0.5 * missed;
  }
  const double expected = sum / weight.squaredNorm();
  EXPECT_NEAR(leave_one_out_error(design, weight, light * light.transpose()), expected,
              1e-9 * expected);
}

// An oblique floor whose shadows bend: what the model says of its own error is what other poses of
// the same region find, in log likelihood, within the spread of forty of them.
TEST(LocalModel, KnowsItsErrorOnAnObliqueFloor) {
  const Scene scene = bundled_scene("reference_floor_corner_black");
  FastModelOptions options;
  options.tolerance = 0.02;
  const auto light = make_fast_model(scene, sensor_placement(scene), options);
  LocalRegion region;
  region.center = Eigen::Vector3d(0.624, 0.991, -93.8 * kDegree);
  region.root = Eigen::Vector3d(0.03, 0.03, 0.08).asDiagonal();
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto draw = [&] {
    const Eigen::Vector3d z(normal(random), normal(random), normal(random));
    LightNode node;
    node.pose = region.center + region.root * z;
    const HistogramCube cube = light->three_bounce(node.pose);
    node.light = Eigen::Map<const Eigen::VectorXd>(cube.values.data(),
                                                   static_cast<Eigen::Index>(cube.values.size()));
    return node;
  };
  std::vector<LightNode> nodes;
  for (int i = 0; i < 40; ++i) nodes.push_back(draw());
  // 1000 photons over an equal background.
  const double photons = 1000 / nodes.front().light.sum();
  for (LightNode& node : nodes) node.light *= photons;
  const double background = 1000.0 / static_cast<double>(nodes.front().light.size());
  const Eigen::VectorXd information = (nodes.front().light.array() + background).inverse().matrix();
  const auto model = LocalModel::fit(scene, region, nodes, information, kAnyError);
  ASSERT_TRUE(model);
  double found = 0;
  constexpr int kJudges = 40;
  for (int i = 0; i < kJudges; ++i) {
    const LightNode judge = draw();
    Eigen::VectorXd said(judge.light.size());
    model->light(scene, judge.pose, said.data());
    found += 0.5 * (said - photons * judge.light).cwiseAbs2().dot(information) / kJudges;
  }
  EXPECT_LT(model->error(), 0.3);
  EXPECT_GT(model->error(), found / 4);
  EXPECT_LT(model->error(), found * 4);
}

TEST(Monomials, MixObjectsUpToTheSecondDegree) {
  EXPECT_EQ(monomials_up_to(4, {0, 0, 0}).size(), 35U);
  // 1 + 2 (3 + 6 + 10) of each object alone, 9 products of two.
  EXPECT_EQ(monomials_up_to(3, {0, 0, 0, 1, 1, 1}).size(), 48U);
  EXPECT_EQ(monomials_up_to(0, {0, 0}).size(), 1U);
}

}  // namespace
}  // namespace blindcorner
