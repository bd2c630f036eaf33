// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "bundled.h"
#include "forward/relay/relay_setup.h"

namespace blindcorner {
namespace {

struct DirectCase {
  std::string scene;
  double moved;  ///< m along x from where the scene has its sensor
  std::string name() const {
    return scene + "_" + std::to_string(static_cast<int>(std::lround(100 * moved)));
  }
};

// The cells that a fit takes against finer ones. On the reference floor the field of the light ends
// within the zones, beside the detector; in the others a zone sees several surfaces. On its way to
// the crossing, a sensor sees the corner's edge at the rim of a cell, and its face at a grazing
// angle.
class DirectReturn : public testing::TestWithParam<DirectCase> {};

TEST_P(DirectReturn, CoarseCellsAgreeWithFineOnes) {
  const Scene scene = bundled_scene(GetParam().scene);
  SensorPlacement placement = sensor_placement(scene);
  placement.T_world_sensor.translation().x() += GetParam().moved;
  const RelaySetup setup(scene, placement);
  const PulseTable pulses(scene.sensor.response, scene.sensor.bin_width,
                          std::pow(scene.sensor.response.core_sigma(), 2), 1e-7);
  const HistogramCube coarse = setup.direct_return(pulses, {4, 0.3, 5});
  const HistogramCube fine = setup.direct_return(pulses, {12, 0.2, 7});
  double square = 0, difference = 0;
  for (std::size_t i = 0; i < fine.values.size(); ++i) {
    square += fine.values[i] * fine.values[i];
    difference += std::pow(coarse.values[i] - fine.values[i], 2);
  }
  ASSERT_GT(square, 0);
  EXPECT_LT(std::sqrt(difference / square), 2e-4);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, DirectReturn,
    testing::Values(DirectCase{"reference_floor_corner_black", 0}, DirectCase{"tmf8828_wall", 0},
                    DirectCase{"robot_corridor", 0}, DirectCase{"street_corner", 0},
                    DirectCase{"crossing_cyclist", 0}, DirectCase{"crossing_cyclist", 7.24},
                    DirectCase{"crossing_cyclist", 8.51}, DirectCase{"crossing_cyclist", 9.78},
                    DirectCase{"crossing_cyclist", 10.48}),
    [](const auto& param) { return param.param.name(); });

}  // namespace
}  // namespace blindcorner
