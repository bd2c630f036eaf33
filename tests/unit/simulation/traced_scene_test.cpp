// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/traced_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numeric>

#include "blindcorner/forward/constants.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/solver_sweep.h"
#include "blindcorner/simulation/synthetic.h"
#include "bundled.h"
#include "io/npz.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kSpheres = SOURCE_DIR "/scenes/reference_tilted_spheres.json";

/// An archive with two poses of the spheres scene: light in bin 40 + 20 * pose of each zone, 2 and
/// 4 of it a zone, over an empty scene with 100 in bin 5.
std::string write_archive(const test::TemporaryFolder& folder, std::size_t bins = 96) {
  const std::size_t zones = 16;
  std::vector<double> mean(2 * zones * bins), error(mean.size(), 0.25), empty(zones * bins);
  for (std::size_t z = 0; z < zones; ++z) {
    empty[z * bins + 5] = 100;
    for (std::size_t p = 0; p < 2; ++p) {
      mean[(p * zones + z) * bins + 5] = 100;
      mean[(p * zones + z) * bins + 40 + 20 * p] = 2.0 * static_cast<double>(p + 1);
    }
  }
  const std::string path = folder.file("spheres.npz");
  test::write_text(path,
                   npz_of({{"poses", npy_of({2, 4}, {0.055, 0.79, 0.984, 0, 0.1, 0.8, 1.0, 0})},
                           {"mean", npy_of({2, 4, 4, bins}, mean)},
                           {"standard_error", npy_of({2, 4, 4, bins}, error)},
                           {"empty_mean", npy_of({4, 4, bins}, empty)},
                           {"empty_standard_error", npy_of({4, 4, bins}, empty)}}));
  return path;
}

TEST(TracedScene, ObjectsMoveAlongWithTheFirst) {
  const test::TemporaryFolder folder;
  const Scene scene = read_scene(kSpheres);
  const TracedScene traced = read_traced_scene(scene, write_archive(folder));
  ASSERT_EQ(traced.poses.size(), 2U);
  const Eigen::Matrix<double, 6, 1> moved =
      (Eigen::Matrix<double, 6, 1>() << 0.1, 0.8, 1.0, -0.05, 1.02, 1.05).finished();
  EXPECT_TRUE(traced.poses[1].isApprox(moved, 1e-12)) << traced.poses[1].transpose();
  EXPECT_EQ(traced.light[1].mean.zone(3)[60], 4);
  EXPECT_EQ(traced.light[0].standard_error.zone(0)[0], 0.25);
  EXPECT_EQ(object_light(traced, 0).zone(2)[5], 0);
  EXPECT_EQ(object_light(traced, 0).zone(2)[40], 2);
}

TEST(TracedScene, OfAnotherShapeIsRefused) {
  const test::TemporaryFolder folder;
  const std::string path = write_archive(folder, 64);
  const std::string message =
      test::error_of([&] { read_traced_scene(read_scene(kSpheres), path); });
  EXPECT_THAT(message, AllOf(HasSubstr(path + ": mean"), HasSubstr("(2, 4, 4, 64)"),
                             HasSubstr("(2, 4, 4, 96)")));
}

// Three units of object light a zone in the mean; its ambient is spread over the bins that hold 90
// % of it: 15 of 16 zones' one bin at either pose.
TEST(TracedCaptures, HaveThePhotonsAskedForInTheMeanOverThePoses) {
  const test::TemporaryFolder folder;
  const Scene scene = read_scene(kSpheres);
  const TracedCaptures captures(scene, read_traced_scene(scene, write_archive(folder)));
  EXPECT_NEAR(captures.exposures(480), 10, 1e-9);
  const double ambient = 0.9 * 48 / 15;
  EXPECT_NEAR(captures.expected(0).zone(0)[40], 2 + ambient, 1e-9);
  EXPECT_NEAR(captures.expected(0).zone(0)[5], 100 + ambient, 1e-9);
  const double photons = 48e4;
  const Capture capture = captures.capture(1, photons, 7);
  EXPECT_NEAR(capture.exposures, 1e4, 1e-6);
  EXPECT_NEAR(capture.truth.at("back.y_m"), 1.02, 1e-12);
  const double sum =
      std::accumulate(capture.counts.values.begin(), capture.counts.values.end(), 0.0);
  const double expected = 16 * (100 + 4) + 16 * 96 * ambient;
  EXPECT_NEAR(sum, expected, 5 * std::sqrt(expected / capture.exposures));
  EXPECT_EQ(captures.capture(1, photons, 7).counts.values, capture.counts.values);
  EXPECT_NE(captures.capture(1, photons, 8).counts.values, capture.counts.values);
}

TEST(TracedCaptures, TakeAnotherOwnLight) {
  const test::TemporaryFolder folder;
  const Scene scene = read_scene(kSpheres);
  const HistogramCube dark(4, 4, 96);
  const TracedCaptures captures(scene, read_traced_scene(scene, write_archive(folder)), &dark);
  EXPECT_NEAR(captures.expected(1).zone(9)[5], captures.expected(1).zone(9)[90], 1e-12);
}

// The shipped files belong to the shipped scenes: the poses lie within the search regions.
TEST(TracedScene, OfTheSharedDataSuitsItsScene) {
  for (const std::string name : {"wall_rectangle", "floor_corner_black", "floor_corner_light",
                                 "street_box", "tilted_spheres"}) {
    const std::string path = test::data_folder() + "/mitransient/" + name + ".npz";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no reference transients at " << path;
    const Scene scene = bundled_scene("reference_" + name);
    for (const PoseVector& pose : read_traced_scene(scene, path).poses) {
      for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
        const double value = pose[static_cast<Eigen::Index>(i)];
        EXPECT_GE(value, scene.unknowns[i].lower) << name;
        EXPECT_LE(value, scene.unknowns[i].upper) << name;
      }
    }
  }
}

TEST(TracedScene, ArchiveIsNamedAfterTheScene) {
  const test::TemporaryFolder folder;
  const std::string beside = folder.file("spheres.npz");
  EXPECT_EQ(traced_file(std::filesystem::path(beside).parent_path().string(),
                        "scenes/reference_spheres.json"),
            beside);
  std::filesystem::create_directory(folder.file("mitransient"));
  const std::string inside = folder.file("mitransient/spheres.npz");
  test::write_text(inside, "");
  EXPECT_EQ(traced_file(std::filesystem::path(beside).parent_path().string(), "spheres.json"),
            inside);
}

// Methods that are swept over traced light see the archive's poses in turn, and their light.
TEST(TracedScene, SweepTakesTracedPosesInTurn) {
  const test::TemporaryFolder folder;
  const Scene scene = read_scene(kSpheres);
  SweepOptions options;
  options.captures = 3;
  options.photons = {1e6};
  options.traced = write_archive(folder);
  std::vector<Capture> seen;
  const SweptMethod listener{"listener", "other methods", false, 1, [&]() -> SweepAnswerer {
                               return [&](const Capture& capture) {
                                 seen.push_back(capture);
                                 return SweepAnswer{middle_of_prior(scene), std::nullopt};
                               };
                             }};
  sweep_scene(scene, {listener}, options);
  ASSERT_EQ(seen.size(), 3U);
  const TracedScene traced = read_traced_scene(scene, options.traced);
  const std::string first = unknown_names(scene).front();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(seen[i].truth.at(first), traced.poses[i % 2][0]);
    EXPECT_GT(seen[i].counts.zone(0)[40 + 20 * (i % 2)], 10 * seen[i].counts.zone(0)[50]);
  }
}

}  // namespace
}  // namespace blindcorner
