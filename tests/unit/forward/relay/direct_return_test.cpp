// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "blindcorner/io/scene_file.h"
#include "forward/relay/relay_setup.h"

namespace blindcorner {
namespace {

// The cells that a fit takes against finer ones. On the reference floor the field of the light ends
// within the zones, beside the detector; in the others a zone sees several surfaces.
class DirectReturn : public testing::TestWithParam<std::string> {};

TEST_P(DirectReturn, CoarseCellsAgreeWithFineOnes) {
  const Scene scene = read_scene(std::string(SOURCE_DIR) + "/scenes/" + GetParam() + ".json");
  const RelaySetup setup(scene, sensor_placement(scene));
  const PulseTable pulses(scene.sensor.response, scene.sensor.bin_width,
                          std::pow(scene.sensor.response.core_sigma(), 2), 1e-7);
  const HistogramCube coarse = setup.direct_return(pulses, {4, 0.3, 2});
  const HistogramCube fine = setup.direct_return(pulses, {12, 0.2, 4});
  double square = 0, difference = 0;
  for (std::size_t i = 0; i < fine.values.size(); ++i) {
    square += fine.values[i] * fine.values[i];
    difference += std::pow(coarse.values[i] - fine.values[i], 2);
  }
  ASSERT_GT(square, 0);
  EXPECT_LT(std::sqrt(difference / square), 2e-4);
}

INSTANTIATE_TEST_SUITE_P(Scenes, DirectReturn,
                         testing::Values("reference_floor_corner_black", "tmf8828_wall",
                                         "robot_corridor", "street_corner"),
                         [](const auto& param) { return param.param; });

}  // namespace
}  // namespace blindcorner
