// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/random_scene.h"

#include <gmock/gmock.h>

#include <cmath>
#include <set>
#include <string>

#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/io/sensor_presets.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

constexpr std::uint64_t kSeeds = 200;

Scene written(const RandomScene& random) {
  const test::TemporaryFolder folder;
  test::write_text(folder.file(random.name + ".json"), random.text);
  if (!random.mesh.empty()) test::write_text(folder.file(random.name + ".obj"), random.mesh);
  return read_scene(folder.file(random.name + ".json"));
}

// Each can be read, and a fit takes it: its sensor sees a relay.
TEST(RandomScene, EveryOneCanBeFitted) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    EXPECT_NO_THROW(Fitter(written(random_scene(seed)))) << seed;
  }
}

TEST(RandomScene, TheSameSeedGivesTheSameScene) {
  EXPECT_EQ(random_scene(7).text, random_scene(7).text);
  EXPECT_NE(random_scene(7).text, random_scene(8).text);
}

// All sensors, shapes, materials and unknowns occur, and light of every level.
TEST(RandomScene, AllKindsOccur) {
  std::set<std::string> sensors, kinds, unknowns;
  std::set<int> decades;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const RandomScene random = random_scene(seed);
    const Scene scene = written(random);
    sensors.insert(scene.sensor.name);
    kinds.insert(shape_name(scene.hidden.shape) + std::to_string(scene.hidden.material.index()));
    for (const std::string& name : unknown_names(scene)) unknowns.insert(name);
    ASSERT_GE(random.photons, 10);
    ASSERT_LE(random.photons, 1e7);
    decades.insert(static_cast<int>(std::log10(random.photons)));
  }
  EXPECT_EQ(sensors.size(), sensor_preset_names().size());
  EXPECT_EQ(kinds.size(), 10);  // five shapes, matt and retroreflective
  EXPECT_EQ(unknowns.size(), 5);
  EXPECT_EQ(decades.size(), 6);
}

}  // namespace
}  // namespace blindcorner
