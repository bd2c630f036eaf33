// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/position_splits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "blindcorner/forward/error.h"
#include "unit/error_message.h"

namespace blindcorner {
namespace {

using ::testing::HasSubstr;

Scene plane() {
  Scene scene;
  scene.unknowns = {{Component::x, -1, 1, {}}, {Component::y, -1, 1, {}}};
  return scene;
}

Capture capture_at(double x, double y) {
  Capture capture;
  capture.source = "some.exr";
  capture.truth = {{"x_m", x}, {"y_m", y}};
  return capture;
}

/// Two captures at each of sixty places.
std::vector<Capture> sixty_places() {
  std::vector<Capture> captures;
  for (int i = 0; i < 120; ++i) captures.push_back(capture_at(0.01 * (i % 60), 0.02 * (i % 7)));
  return captures;
}

TEST(PositionSplits, NeverEvaluateAPlaceThatIsLearnt) {
  const auto positions = positions_of(plane(), sixty_places());
  for (const SplitScheme& scheme : split_schemes(positions, {"x_m", "y_m"}, {})) {
    for (const PositionSplit& split : scheme.splits) {
      std::set<std::string> learnt;
      for (const std::size_t c : split.learn) learnt.insert(positions[c].key);
      for (const std::size_t c : split.evaluated(positions)) {
        EXPECT_FALSE(learnt.contains(positions[c].key)) << scheme.name;
      }
    }
  }
}

TEST(PositionSplits, FoldsEvaluateEachCaptureOnceAndHalvesBothWays) {
  const auto positions = positions_of(plane(), sixty_places());
  const auto schemes = split_schemes(positions, {"x_m", "y_m"}, {});
  ASSERT_EQ(schemes.size(), 6u);
  EXPECT_EQ(schemes[0].name, "5 folds");
  std::multiset<std::size_t> evaluated;
  for (const PositionSplit& split : schemes[0].splits) {
    for (const std::size_t c : split.evaluated(positions)) evaluated.insert(c);
  }
  ASSERT_EQ(evaluated.size(), positions.size());
  for (std::size_t c = 0; c < positions.size(); ++c) EXPECT_EQ(evaluated.count(c), 1u);
  EXPECT_EQ(schemes[2].name, "lower half of x_m calibrated");
  for (const std::size_t c : schemes[2].splits.front().learn) EXPECT_LT(positions[c].pose[0], 0.3);
  for (const std::size_t c : schemes[3].splits.front().learn) EXPECT_GE(positions[c].pose[0], 0.3);
}

TEST(PositionSplits, FewLearnsAsManyAsAskedFor) {
  const auto positions = positions_of(plane(), sixty_places());
  SplitOptions options;
  options.schemes = {"few"};
  options.few = 4;
  const auto schemes = split_schemes(positions, {"x_m", "y_m"}, options);
  ASSERT_EQ(schemes.size(), 1u);
  EXPECT_EQ(schemes[0].name, "calibrated on 4");
  for (const PositionSplit& split : schemes[0].splits) EXPECT_EQ(split.learn.size(), 4u);
}

TEST(PositionSplits, AreTheSameWhateverElseIsInTheFile) {
  const auto all = positions_of(plane(), sixty_places());
  std::vector<Capture> captures = sixty_places();
  captures.erase(captures.begin(), captures.begin() + 30);
  const auto some = positions_of(plane(), captures);
  EXPECT_EQ(some.front().hash, all[30].hash);
}

TEST(PositionSplits, RefuseCapturesWithoutTruth) {
  Capture capture = capture_at(0, 0);
  capture.index = 3;
  capture.truth.erase("y_m");
  EXPECT_THAT(message_of([&] { position_of(plane(), capture); }),
              HasSubstr("some.exr capture 3: truth"));
  SplitOptions options;
  options.folds = 1;
  EXPECT_THAT(message_of([&] { options.validate(); }), HasSubstr("folds: found 1"));
}

}  // namespace
}  // namespace blindcorner
