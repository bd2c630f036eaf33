// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/simulated_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <variant>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay_setup.h"
#include "forward/sensor/pulse_table.h"
#include "forward/support/parallel.h"
#include "forward/transport/scene_transport.h"
#include "forward/transport/static_background.h"

namespace blindcorner {
namespace {

/// Sampling of three-bounce light by way of a retroreflective object. The fit's sampling densities
/// are powers of the square root of two; these lie between them, so that no point is shared. The
/// narrow lobe takes one sum over the relay. Where the lobe spreads paths by more than kWideLobe of
/// the pulse, one sum has an error of its own, and pairs of patches replace it.
constexpr SamplingStep kNarrowLobeSampling{0.85, 0.85, false};
constexpr SamplingStep kWideLobeSampling{4.8, 4.8, true};
constexpr double kWideLobe = 0.5;
/// Coarser points of the object, because the object may be small beside a wide lobe. The first step
/// that errs by less than kObjectError (L2, against kWideLobeSampling's) is taken; it is tested
/// with relay patches of kCoarseRelay. On the crossing cyclist a render takes 0.03 s with 13.5
/// and 0.2 s with kWideLobeSampling's step. In both, the relay's patches err by 0.5 to 0.8 % (L2).
constexpr std::array kObjectSteps{13.5, 9.5, 6.7};
constexpr double kCoarseRelay = 8;
constexpr double kObjectError = 0.005;
constexpr std::size_t kObjectPoses = 4;  // by judgement
/// For other materials: the error at which a sampling is chosen, as a share of the light's peak,
/// and the factor by which its step is then made finer than the fit's.
constexpr double kTolerance = 0.01;
constexpr double kBetweenSteps = 0.85;
/// Cells of the direct return and of the further static bounces. The fit uses {4, 0.3, 5} and the
/// default sampling.
constexpr DirectSampling kDirectCells{5, 0.27, 6};
constexpr StaticLightSampling kBounceCells{.zone_divisions = 1,
                                           .outer_divisions = 2,
                                           .field_divisions = 9,
                                           .patch_angle = 0.36,
                                           .least_patch = 3.6,
                                           .outer_angle = 1.8,
                                           .part_angle = 0.13,
                                           .middle_angle = 0.4,
                                           .middle_edge = 0.11,
                                           .least_middle = 0.0075};
/// Share of the pulse's energy that may be cut off at either end.
constexpr double kPulseTail = 1e-7;

bool holds_static_background(const Scene& scene) {
  return scene.linear.direct != LinearMode::fixed || scene.linear.fixed_direct > 0;
}

HistogramCube dark(const Sensor& sensor) { return {sensor.rows, sensor.columns, sensor.bins}; }

/// Whether the sensor lights and sees a part of the relay.
bool sees_relay(const Scene& scene, const Transform& T_world_sensor) {
  Scene moved = scene;
  moved.T_world_sensor = T_world_sensor;
  try {
    check_relay_visible(moved);
  } catch (const Error&) {
    return false;
  }
  return true;
}

/// Whether the lobe's footprint on the relay is wide relative to the pulse. The object is taken to
/// be at its placement in the scene (by default the middle of its search region), and the relay
/// where the scene's own sensor looks.
bool wide_lobe(const Scene& scene, const RetroreflectiveMaterial& retro) {
  const auto hit =
      RayScene(scene.surfaces)
          .first_hit(scene.T_world_sensor.translation(), scene.T_world_sensor.linear().col(0));
  if (!hit) return true;
  const double distance = (hit->point - scene.hidden.placement.position).norm();
  const double pulse = kSpeedOfLight * scene.sensor.response.core_sigma();
  return retro.lobe_sigma * distance > kWideLobe * pulse;
}

/// Relative error (L2) of the light of several poses against `better`; 1 where `better` is dark.
double relative_error(const std::vector<HistogramCube>& light,
                      const std::vector<HistogramCube>& better) {
  double error = 0, size = 0;
  for (std::size_t i = 0; i < light.size(); ++i) {
    for (std::size_t k = 0; k < light[i].values.size(); ++k) {
      error += std::pow(light[i].values[k] - better[i].values[k], 2);
      size += std::pow(better[i].values[k], 2);
    }
  }
  return size > 0 ? std::sqrt(error / size) : 1;
}

/// The coarsest object step that is fine enough beside a wide lobe.
double object_step(const std::shared_ptr<const SceneTransport>& transport) {
  const auto& all = transport->probe_poses;
  const std::vector<PoseVector> poses(
      all.begin(), all.begin() + static_cast<std::ptrdiff_t>(std::min(all.size(), kObjectPoses)));
  const auto lights = [&](double object) {
    FastModelOptions fast;
    fast.sampling_step = SamplingStep{kCoarseRelay, object, true};
    const auto model = make_fast_model(transport, sensor_placement(transport->scene), fast);
    std::vector<HistogramCube> light;
    for (const PoseVector& pose : poses) light.push_back(model->three_bounce(pose));
    return light;
  };
  const std::vector<HistogramCube> finest = lights(kWideLobeSampling.object);
  for (const double step : kObjectSteps) {
    if (relative_error(lights(step), finest) < kObjectError) return step;
  }
  return kWideLobeSampling.object;
}

}  // namespace

struct SimulatedSensor::Impl {
  explicit Impl(const Scene& all)
      : scene((validate(all), all)),
        rays(std::make_shared<const SurfaceRays>(scene.surfaces)),
        transport(make_scene_transport(scene)),
        bounces(scene, kBounceCells),
        pulses(scene.sensor.response, scene.sensor.bin_width,
               std::pow(scene.sensor.response.core_sigma(), 2), kPulseTail) {
    fast.tolerance = kTolerance;
    if (const auto* retro = std::get_if<RetroreflectiveMaterial>(&scene.hidden.material)) {
      fast.sampling_step = kNarrowLobeSampling;
      if (wide_lobe(scene, *retro)) {
        fast.sampling_step = kWideLobeSampling;
        if (sees_relay(scene, scene.T_world_sensor)) {
          fast.sampling_step->object = object_step(transport);
        }
      }
      return;
    }
    fast.sampling_step = choose_sampling(transport, sensor_placement(scene), fast);
    if (!fast.sampling_step) return;
    fast.sampling_step->relay *= kBetweenSteps;
    fast.sampling_step->object *= kBetweenSteps;
  }

  /// Null where no relay surface is in view; there is then no light by way of the object.
  std::unique_ptr<ForwardModel> model(const Transform& T_world_sensor) const {
    if (!sees_relay(scene, T_world_sensor)) return nullptr;
    return make_fast_model(transport, SensorPlacement{T_world_sensor, {}}, fast);
  }

  HistogramCube three_bounce(const Transform& T_world_sensor, const PoseVector& pose) const {
    const auto light = model(T_world_sensor);
    return light ? light->three_bounce(pose) : dark(scene.sensor);
  }

  HistogramCube static_background(const Transform& T_world_sensor) const {
    if (!holds_static_background(scene)) return dark(scene.sensor);
    const RelaySetup setup(scene, SensorPlacement{T_world_sensor, {}}, rays);
    HistogramCube light = setup.direct_return(pulses, kDirectCells);
    if (bounces.any()) bounces.add(setup, pulses, light);
    mix_zones(scene.sensor, light);
    return light;
  }

  /// The sensor's capture of the light: photon counts, together with the truth.
  Capture capture_of(const SensedLight& expected, const Transform& T_world_sensor,
                     const std::optional<PoseVector>& pose, std::uint64_t seed,
                     int exposures) const;

  const Scene scene;
  std::shared_ptr<const SurfaceRays> rays;
  std::shared_ptr<const SceneTransport> transport;
  KnownBounces bounces;
  PulseTable pulses;
  FastModelOptions fast;
};

SimulatedSensor::SimulatedSensor(const Scene& scene) : impl_(std::make_unique<Impl>(scene)) {}
SimulatedSensor::~SimulatedSensor() = default;
SimulatedSensor::SimulatedSensor(SimulatedSensor&&) noexcept = default;
SimulatedSensor& SimulatedSensor::operator=(SimulatedSensor&&) noexcept = default;

const Scene& SimulatedSensor::scene() const { return impl_->scene; }

SensedLight SimulatedSensor::light(const Transform& T_world_sensor,
                                   const std::optional<PoseVector>& pose) const {
  SensedLight light;
  parallel_invoke(
      [&] {
        light.three_bounce =
            pose ? impl_->three_bounce(T_world_sensor, *pose) : dark(scene().sensor);
      },
      [&] { light.static_background = impl_->static_background(T_world_sensor); });
  return light;
}

SensedLight SimulatedSensor::reference_light(const Transform& T_world_sensor,
                                             const std::optional<PoseVector>& pose) const {
  SensedLight light{dark(scene().sensor), dark(scene().sensor)};
  const SensorPlacement placement{T_world_sensor, {}};
  const auto reference = make_reference_renderer(scene(), placement);
  if (pose && sees_relay(scene(), T_world_sensor))
    light.three_bounce = reference->three_bounce(*pose);
  if (holds_static_background(scene())) {
    light.static_background =
        pose ? reference->shadowed_background(*pose) : reference->static_background();
  }
  return light;
}

Capture SimulatedSensor::Impl::capture_of(const SensedLight& expected,
                                          const Transform& T_world_sensor,
                                          const std::optional<PoseVector>& pose, std::uint64_t seed,
                                          int exposures) const {
  const LinearValues linear{scene.linear.fixed_amplitude, scene.linear.fixed_ambient,
                            scene.linear.fixed_direct};
  Capture capture;
  capture.counts = draw_counts(
      scene, expected_counts(scene, expected.three_bounce, expected.static_background, linear),
      exposures, seed);
  capture.exposures = exposures;
  capture.T_world_sensor = T_world_sensor;
  if (!pose) return capture;
  const std::vector<std::string> names = unknown_names(scene);
  for (std::size_t i = 0; i < names.size(); ++i) {
    capture.truth[names[i]] = (*pose)[static_cast<Eigen::Index>(i)];
  }
  return capture;
}

SensedFrame SimulatedSensor::sense(const Transform& T_world_sensor,
                                   const std::optional<PoseVector>& pose, std::uint64_t seed,
                                   int exposures) const {
  const SensedLight expected = light(T_world_sensor, pose);
  return {impl_->capture_of(expected, T_world_sensor, pose, seed, exposures),
          expected_counts(scene(), expected.three_bounce, dark(scene().sensor),
                          {scene().linear.fixed_amplitude, 0, 0, 0})};
}

std::vector<Capture> SimulatedSensor::sense_each(const Transform& T_world_sensor,
                                                 const std::vector<PoseVector>& poses,
                                                 std::uint64_t seed) const {
  std::vector<Capture> captures;
  if (poses.empty()) return captures;
  const auto model = impl_->model(T_world_sensor);
  SensedLight expected{dark(scene().sensor), impl_->static_background(T_world_sensor)};
  for (const PoseVector& pose : poses) {
    if (model) expected.three_bounce = model->three_bounce(pose);
    captures.push_back(
        impl_->capture_of(expected, T_world_sensor, pose, seed + captures.size(), 1));
  }
  return captures;
}

Scene with_light(const Scene& scene, double factor, double ambient) {
  Scene lit = scene;
  lit.sensor.radiant_intensity *= factor;
  lit.linear.fixed_ambient *= ambient;
  if (lit.sensor.link) lit.sensor.link->pulse_energy *= factor;
  return lit;
}

}  // namespace blindcorner
