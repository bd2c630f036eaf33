// SPDX-License-Identifier: Apache-2.0
/// The reference renderer against an independent path tracer: five shipped scenes, six poses each,
/// in absolute units, nothing fitted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/io/scene_file.h"
#include "bundled.h"
#include "io/npz.h"

namespace blindcorner {
namespace {

struct ReferenceCase {
  std::string name;
  double scale_tolerance;  ///< floors are noisier: few object photons in most bins
};

std::string data_file(const std::string& name) {
  const char* stated = std::getenv("BLINDCORNER_DATA");
  const std::string folder = stated != nullptr ? stated : DATA_DIR;
  return folder + "/mitransient/" + name + ".npz";
}

/// The scene with its first object at a pose of the file (x, y, z, yaw in degrees) and others moved
/// along with it; one component is nominally unknown.
Scene posed(const Scene& scene, const double* at) {
  Scene known = scene;
  const Eigen::Vector3d moved =
      Eigen::Vector3d(at[0], at[1], at[2]) - scene.hidden.placement.position;
  known.hidden.placement.position += moved;
  known.hidden.placement.yaw = at[3] * kDegree;
  for (HiddenObject& object : known.further_hidden) object.placement.position += moved;
  known.unknowns = {{Component::x, at[0] - 0.01, at[0] + 0.01, std::nullopt}};
  return known;
}

struct Agreement {
  double mean_square = 0;  ///< of normalised differences
  double scale = 0;        ///< of the tracer's light over the model's, weighted fit
};

/// What the object changes in the histograms, over the bins where its own light stands above 2 % of
/// its peak. The tracer's first bounce is subtracted with its empty scene: it is the same in both,
/// and bright enough for the tracer's own time discretisation to show beside its standard error.
Agreement compare(const HistogramCube& light, const std::vector<double>& change, const double* mean,
                  const double* error, const double* empty, const double* empty_error) {
  const double peak = *std::max_element(light.values.begin(), light.values.end());
  double xx = 0, xy = 0, chi = 0;
  int count = 0;
  for (std::size_t i = 0; i < light.values.size(); ++i) {
    const double variance = error[i] * error[i] + empty_error[i] * empty_error[i];
    if (light.values[i] < 0.02 * peak || !(variance > 0)) continue;
    const double traced = mean[i] - empty[i];
    ++count;
    xx += change[i] * change[i] / variance;
    xy += change[i] * traced / variance;
    chi += (traced - change[i]) * (traced - change[i]) / variance;
  }
  return {chi / count, xy / xx};
}

class ReferenceTransients : public testing::TestWithParam<ReferenceCase> {};

TEST_P(ReferenceTransients, AgreeWithinTheTracersNoise) {
  const std::string path = data_file(GetParam().name);
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no reference transients at " << path;
  const Scene scene = bundled_scene("reference_" + GetParam().name);
  const NpzFile file(path);
  const NpyArray mean = file.read("mean"), error = file.read("standard_error");
  const NpyArray empty = file.read("empty_mean"), empty_error = file.read("empty_standard_error");
  const NpyArray poses = file.read("poses");
  const std::size_t values = empty.values.size();
  const std::size_t count = mean.shape[0];
  ReferenceOptions sampling;  // coarser than what a user gets, for a test of a minute
  sampling.zone_divisions = 3;
  sampling.field_divisions = 9;
  sampling.object_divisions = 4;
  double chi = 0;
  double scale = 0;
  for (std::size_t p = 0; p < count; ++p) {
    const Scene known = posed(scene, poses.values.data() + 4 * p);
    const auto model = make_reference_renderer(known, sensor_placement(known), sampling);
    const PoseVector pose = pose_of(known.hidden.placement, known.unknowns);
    const HistogramCube light = model->three_bounce(pose);
    const HistogramCube with = model->shadowed_background(pose);
    std::vector<double> change = light.values;
    for (std::size_t i = 0; i < values; ++i) {
      change[i] += with.values[i] - model->static_background().values[i];
    }
    const Agreement agreement =
        compare(light, change, mean.values.data() + p * values, error.values.data() + p * values,
                empty.values.data(), empty_error.values.data());
    chi += agreement.mean_square / static_cast<double>(count);
    scale += agreement.scale / static_cast<double>(count);
  }
  RecordProperty("mean_square_per_mille", static_cast<int>(std::lround(1000 * chi)));
  RecordProperty("scale_ppm", static_cast<int>(std::lround(1e6 * scale)));
  std::printf("%s: mean square %.3f, scale %.4f\n", GetParam().name.c_str(), chi, scale);
  EXPECT_GT(chi, 0.8);
  EXPECT_LT(chi, 1.2);
  EXPECT_NEAR(scale, 1.0, GetParam().scale_tolerance);
}

/// The known scene's own light, [zone][bin], with all albedos `share` of what they are.
std::vector<double> own_light(Scene scene, double share) {
  for (Surface& surface : scene.surfaces) surface.albedo *= share;
  return make_reference_renderer(scene, sensor_placement(scene))->static_background().values;
}

// What the corner adds to the empty scene beside its own first bounce. Of the two empty scenes the
// tracer's first bounces, whose errors of up to 1 % a bin stand far above their standard errors,
// cancel. Light of n bounces goes with the n-th power of the albedos, so three albedos tell n = 1,
// 2 and 3 apart.
TEST(StaticReturns, OfTheLightCornerAgreeWithTheTracer) {
  const std::string light_path = data_file("floor_corner_light");
  const std::string black_path = data_file("floor_corner_black");
  if (!std::filesystem::exists(light_path)) GTEST_SKIP() << "no reference transients";
  const std::string scenes = std::string(SOURCE_DIR) + "/scenes/reference_floor_corner_";
  const Scene light = read_scene(scenes + "light.json");
  const std::vector<double> whole = own_light(light, 1);
  const std::vector<double> half = own_light(light, 0.5);
  const std::vector<double> quarter = own_light(light, 0.25);
  const std::vector<double> floor = own_light(read_scene(scenes + "black.json"), 1);
  std::vector<double> corner(whole.size());  // first bounce
  std::vector<double> later(whole.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const double first = (whole[i] - 12 * half[i] + 32 * quarter[i]) / 3;
    corner[i] = first - floor[i];
    later[i] = whole[i] - first;
  }
  const NpzFile light_file(light_path), black_file(black_path);
  const NpyArray mean = light_file.read("empty_mean");
  const NpyArray error = light_file.read("empty_standard_error");
  const NpyArray without = black_file.read("empty_mean");
  const NpyArray without_error = black_file.read("empty_standard_error");
  const double peak = *std::max_element(later.begin(), later.end());
  double xx = 0, xy = 0, square = 0, own = 0;
  int count = 0;
  for (std::size_t i = 0; i < later.size(); ++i) {
    const double variance = std::pow(error.values[i], 2) + std::pow(without_error.values[i], 2);
    if (later[i] < 0.02 * peak || std::abs(corner[i]) > 1e-3 * later[i] || !(variance > 0)) {
      continue;
    }
    const double traced = mean.values[i] - without.values[i];
    ++count;
    xx += later[i] * later[i] / variance;
    xy += later[i] * traced / variance;
    square += std::pow(traced - later[i], 2);
    own += later[i] * later[i];
  }
  const double scale = xy / xx;
  const double relative = std::sqrt(square / own);
  std::printf("later bounces: %d bins, scale %.4f, relative L2 %.4f\n", count, scale, relative);
  EXPECT_GT(count, 200);
  EXPECT_NEAR(scale, 1.0, 0.005);
  EXPECT_LT(relative, 0.007);
}

INSTANTIATE_TEST_SUITE_P(Mitransient, ReferenceTransients,
                         testing::Values(ReferenceCase{"wall_rectangle", 0.003},
                                         ReferenceCase{"floor_corner_black", 0.01},
                                         ReferenceCase{"floor_corner_light", 0.01},
                                         ReferenceCase{"street_box", 0.003},
                                         ReferenceCase{"tilted_spheres", 0.003}),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace blindcorner
