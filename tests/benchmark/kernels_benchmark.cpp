// SPDX-License-Identifier: Apache-2.0
/// Run times of the kernels that everything waits for.
#include <benchmark/benchmark.h>

#include <random>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "bundled.h"
#include "forward/relay/ray_scene.h"
#include "forward/relay/visibility.h"
#include "forward/sensor/pulse_table.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

/// Evaluates a model at 64 poses of the search region in turn.
void evaluate(benchmark::State& state, const Scene& scene, const ForwardModel& model) {
  std::mt19937_64 random(1);
  std::vector<PoseVector> poses;
  for (int i = 0; i < 64; ++i) poses.push_back(testing_scenes::random_pose(scene, random));
  HistogramCube out;
  std::size_t i = 0;
  for (auto _ : state) {
    model.three_bounce(poses[i++ % poses.size()], out);
    benchmark::DoNotOptimize(out.values.data());
  }
  state.SetItemsProcessed(state.iterations());
}

/// One histogram cube of the fast model; argument: tolerance in per mille.
void fast_model(benchmark::State& state, const std::string& name, bool occluders) {
  Scene scene = bundled_scene(name);
  for (Surface& surface : scene.surfaces) surface.occluder = surface.occluder && occluders;
  const double tolerance = 1e-3 * static_cast<double>(state.range(0));
  const auto model =
      make_fast_model(scene, sensor_placement(scene), testing_scenes::at_tolerance(tolerance));
  evaluate(state, scene, *model);
}
BENCHMARK_CAPTURE(fast_model, tmf8828_wall, "tmf8828_wall", true)
    ->Arg(100)
    ->Arg(40)
    ->Arg(10)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(fast_model, tmf8828_wall_open, "tmf8828_wall", false)
    ->Arg(10)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(fast_model, denali_like, "denali_like", true)
    ->Arg(10)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(fast_model, tmf8828_floor, "tmf8828_floor", true)
    ->Arg(10)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(fast_model, street_corner, "street_corner", true)
    ->Arg(100)
    ->Arg(40)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(fast_model, street_corner_open, "street_corner", false)
    ->Arg(100)
    ->Unit(benchmark::kMicrosecond);
/// Histogram cubes of both cores together.
BENCHMARK_CAPTURE(fast_model, street_corner_two_cores, "street_corner", true)
    ->Arg(100)
    ->Arg(40)
    ->Threads(2)
    ->UseRealTime()
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(fast_model, street_corner_open_two_cores, "street_corner", false)
    ->Arg(100)
    ->Threads(2)
    ->UseRealTime()
    ->Unit(benchmark::kMicrosecond);

/// One cube of the reference renderer, sampled as coarsely as tests ever do.
void reference_renderer(benchmark::State& state) {
  const Scene scene = bundled_scene("tmf8828_wall");
  ReferenceOptions options;
  options.zone_divisions = 4;
  options.field_divisions = 10;
  options.object_divisions = 4;
  const auto model = make_reference_renderer(scene, sensor_placement(scene), options);
  evaluate(state, scene, *model);
}
BENCHMARK(reference_renderer)->Unit(benchmark::kMillisecond);

/// One blurred pulse into a row of 128 bins.
void pulse_add(benchmark::State& state) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const double sigma = scene.sensor.response.core_sigma();
  const PulseTable pulses(scene.sensor.response, scene.sensor.bin_width, 4 * sigma * sigma);
  std::vector<double> row(128);
  double position = 40;
  for (auto _ : state) {
    pulses.add(row.data(), 128, position, 0.5 * sigma * sigma, 1.0);
    position = position < 60 ? position + 0.13 : 40;
    benchmark::DoNotOptimize(row.data());
  }
}
BENCHMARK(pulse_add);

/// Visible part of a patch behind a box, at a point whose shadow edge crosses it.
void shadow_clip(benchmark::State& state) {
  const auto faces = occluder_faces(bundled_scene("tmf8828_wall").surfaces);
  for (auto _ : state) {
    const ShadowView view(faces, {0.28, 0.5, 1.05});
    benchmark::DoNotOptimize(view.see({0.6, 0.05, 1}, {0, 0.05, 0}, {0, 0, 0.05}).fraction);
  }
}
BENCHMARK(shadow_clip);

/// One visibility ray.
void ray_blocked(benchmark::State& state) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const RayScene rays(scene.surfaces);
  double y = 0.4;
  for (auto _ : state) {
    benchmark::DoNotOptimize(rays.blocked({0.28, y, 1.05}, {0.59, 0.0, 1.0}));
    y = y < 0.7 ? y + 1e-3 : 0.4;
  }
}
BENCHMARK(ray_blocked);

}  // namespace
}  // namespace blindcorner

BENCHMARK_MAIN();
