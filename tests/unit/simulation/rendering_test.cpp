// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/rendering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;
using testing::HasSubstr;

std::vector<std::vector<Placement>> placements(const Scene& scene, std::size_t count) {
  return std::vector(count, stated_placements(scene));
}

TEST(Rendering, ACaptureDependsOnItsPlaceAndTheSeedAlone) {
  const Scene scene = one_narrow_zone();
  RenderOptions options;
  options.photons = 1000;
  const CaptureFile three =
      render_captures(scene, placements(scene, 3), {scene.T_world_sensor}, options);
  const CaptureFile one =
      render_captures(scene, placements(scene, 1), {scene.T_world_sensor}, options);
  EXPECT_EQ(three.captures[0].counts.values, one.captures[0].counts.values);
  EXPECT_NE(three.captures[0].counts.values, three.captures[1].counts.values);
  EXPECT_EQ(three.captures[2].index, 2);
  EXPECT_FALSE(three.captures[0].truth.empty());
}

TEST(Rendering, NoCaptureIsBegunOnceItIsToldToStop) {
  const Scene scene = one_narrow_zone();
  std::atomic<int> made{0};
  RenderHooks hooks;
  hooks.stop = [&] { return made > 0; };
  hooks.advance = [&] { ++made; };
  const CaptureFile file =
      render_captures(scene, placements(scene, 2000), {scene.T_world_sensor}, {}, hooks);
  const auto begun = std::ranges::count_if(
      file.captures, [](const Capture& capture) { return !capture.counts.values.empty(); });
  EXPECT_EQ(begun, made);
  EXPECT_GT(begun, 0);
  EXPECT_LT(begun, 2000);
}

TEST(Rendering, NumbersOfPosesHaveToSuitEachOther) {
  EXPECT_EQ(capture_count(1, 5), 5u);
  EXPECT_EQ(capture_count(5, 5), 5u);
  EXPECT_THAT(message_of([] { capture_count(2, 5); }),
              HasSubstr("found 2 poses of the object and 5 of the sensor"));
  EXPECT_THAT(message_of([] { capture_count(0, 0); }), HasSubstr("accepted: as many"));
}

TEST(Rendering, OptionsAreChecked) {
  RenderOptions options;
  options.model = "guess";
  EXPECT_THAT(message_of([&] { options.validate(); }), HasSubstr("RenderOptions.model"));
  options = {};
  options.sampling = 100;
  EXPECT_THAT(message_of([&] { options.validate(); }), HasSubstr("0.1 to 10"));
}

}  // namespace
}  // namespace blindcorner
