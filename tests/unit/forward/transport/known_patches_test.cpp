// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/known_patches.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <set>
#include <vector>

#include "bundled.h"
#include "forward/relay/relay_setup.h"
#include "forward/sensor/pulse_table.h"
#include "forward/transport/static_background.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

constexpr double kSensorHeight = 2;

/// Adds n x n patches of a square of 4 m, as a light at `source` lights them.
void add_square(KnownPatches& patches, const Vector3d& middle, const Vector3d& u, const Vector3d& v,
                int n, int zone) {
  const Vector3d source(0, 0, kSensorHeight);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      SurfaceCell cell;
      cell.half_u = 2.0 / n * u;
      cell.half_v = 2.0 / n * v;
      cell.normal = u.cross(v);
      cell.center = middle + (2 * i + 1 - n) * cell.half_u + (2 * j + 1 - n) * cell.half_v;
      cell.area = 16.0 / (n * n);
      const Vector3d way = cell.center - source;
      patches.add(cell, way.normalized(), cell.area / way.squaredNorm(), way.norm(), zone);
    }
  }
}

/// A floor about 6 m before the sensor and a wall behind it, in two zones.
KnownPatches floor_and_wall() {
  KnownPatches patches;
  add_square(patches, {6, 0, 0}, Vector3d::UnitX(), Vector3d::UnitY(), 16, 0);
  add_square(patches, {8, 0, 2}, Vector3d::UnitY(), -Vector3d::UnitZ(), 16, 1);
  patches.pad();
  return patches;
}

double total(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

TEST(PatchTree, EveryCutHoldsAllLightAndItsMeanPath) {
  const KnownPatches patches = floor_and_wall();
  const PatchTree tree(patches, 0.3, 0.4);
  double path = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) path += patches.weight[i] * patches.leg[i];
  std::set<std::size_t> sizes;
  for (const double x : {2.0, 6.0, 7.5}) {
    for (const double z : {0.2, 1.0, 3.0}) {
      KnownPatches parts;
      tree.cut({{x, 0.3, z}, 0.1}, parts);
      sizes.insert(parts.size());
      EXPECT_NEAR(total(parts.weight), total(patches.weight), 1e-12);
      double cut_path = 0, area = 0;
      for (std::size_t i = 0; i < parts.size(); ++i) {
        cut_path += parts.weight[i] * parts.leg[i];
        area += parts.cells[i].area;
      }
      EXPECT_NEAR(cut_path, path, 1e-10);
      EXPECT_NEAR(area, 32, 1e-10);
    }
  }
  EXPECT_GT(sizes.size(), 3U);  // how fine a cut is depends on where it is seen from
}

TEST(PatchTree, PartsThatStandForManyHaveTheirMoments) {
  const KnownPatches patches = floor_and_wall();
  const PatchTree tree(patches, 0.5, 10);
  KnownPatches parts;
  tree.cut({{1000, 0, 500}, 0}, parts);  // behind the wall, which is left out
  ASSERT_EQ(parts.size(), 1U);
  Vector3d center = Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double weight = 0;
  const auto floor = [&](std::size_t i) { return patches.zone[i] == 0; };
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (!floor(i)) continue;
    weight += patches.weight[i];
    center += patches.weight[i] * patches.cells[i].center;
  }
  center /= weight;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (!floor(i)) continue;
    const SurfaceCell& cell = patches.cells[i];
    const Vector3d way = cell.center - center;
    second += patches.weight[i] / weight *
              (way * way.transpose() + cell.half_u * cell.half_u.transpose() / 3 +
               cell.half_v * cell.half_v.transpose() / 3);
  }
  const SurfaceCell& part = parts.cells.front();
  EXPECT_LT((part.center - center).norm(), 1e-12);
  EXPECT_LT((part.half_u * part.half_u.transpose() / 3 + part.half_v * part.half_v.transpose() / 3 -
             second)
                .norm(),
            1e-12);
}

TEST(PatchTree, NearByItIsThePatchesThemselves) {
  const KnownPatches patches = floor_and_wall();
  KnownPatches parts;
  PatchTree(patches, 0.2, 0.4).cut({{6, 0, 0.5}, 5}, parts);
  EXPECT_EQ(parts.size(), patches.size());
  PatchTree(patches, 0.2, 1e-3).cut({{6, 0, 500}, 0}, parts);  // the sensor is too near for more
  EXPECT_EQ(parts.size(), patches.size());
}

TEST(PatchTree, WhatLiesBehindTheCellsIsLeftOut) {
  const KnownPatches patches = floor_and_wall();
  const PatchTree tree(patches, 0.3, 0.4);
  std::vector<const SurfaceCell*> cells;
  double wall = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (patches.zone[i] == 0 && cells.size() < 16) cells.push_back(&patches.cells[i]);
    if (patches.zone[i] == 1) wall += patches.weight[i];
  }
  KnownPatches parts;
  tree.cut(ball_around(cells), parts);  // cells of the floor, which faces the wall and not itself
  EXPECT_NEAR(total(parts.weight), wall, 1e-12);
  for (const int zone : parts.zone) EXPECT_EQ(zone, 1);
}

TEST(PatchTree, BlocksHoldEachPatchOnceAndOneZone) {
  const KnownPatches patches = floor_and_wall();
  std::vector<int> times(patches.size(), 0);
  for (const auto& block : PatchTree(patches, 0.2, 0.4).blocks(16)) {
    ASSERT_FALSE(block.empty());
    EXPECT_LE(block.size(), 16U);
    for (const std::size_t i : block) {
      ++times[i];
      EXPECT_EQ(patches.zone[i], patches.zone[block.front()]);
    }
  }
  for (const int n : times) EXPECT_EQ(n, 1);
  EXPECT_TRUE(PatchTree(KnownPatches{}, 0.2, 0.4).blocks(16).empty());
}

TEST(KnownBounces, PartsOfTreesHaveTheLightOfTheirPatches) {
  for (const char* name : {"crossing_cyclist", "street_turn", "tmf8828_floor"}) {
    const Scene scene = bundled_scene(name);
    StaticLightSampling every;
    every.part_angle = 1e-9;
    const RelaySetup setup(scene, sensor_placement(scene));
    const PulseTable pulses(scene.sensor.response, scene.sensor.bin_width,
                            std::pow(scene.sensor.response.core_sigma(), 2), 1e-7);
    const auto light = [&](const StaticLightSampling& sampling) {
      HistogramCube cube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
      KnownBounces(scene, sampling).add(setup, pulses, cube);
      return cube;
    };
    const HistogramCube all = light(every), parts = light({}), finer = light(denser({}, 1.4));
    double by_parts = 0, by_sampling = 0, size = 0;
    for (std::size_t i = 0; i < all.values.size(); ++i) {
      by_parts += std::pow(parts.values[i] - all.values[i], 2);
      by_sampling += std::pow(finer.values[i] - all.values[i], 2);
      size += std::pow(all.values[i], 2);
    }
    EXPECT_LT(std::sqrt(by_parts), 0.4 * std::sqrt(by_sampling)) << name;
    EXPECT_LT(std::sqrt(by_parts / size), 0.01) << name;
  }
}

}  // namespace
}  // namespace blindcorner
