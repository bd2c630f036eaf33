// SPDX-License-Identifier: Apache-2.0
/// From a pose to the expected histogram: one interface with two models behind it.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/transport_plan.h"

namespace blindcorner {

/// Placement of the sensor, as far as a capture states it.
struct SensorPlacement {
  Transform T_world_sensor = Transform::Identity();
  std::vector<Eigen::Vector3d> relay_points;  ///< [zones] m, world; empty: from the footprints
};

/// Sensor placement of a capture: the capture's own where it has one, else the scene's.
SensorPlacement sensor_placement(const Scene& scene, const Capture* capture = nullptr);

/// Throws Error when the sensor lights or sees no relay surface, a stated relay point is far from
/// all relay surfaces, or a measured law has zones that are not points. Points that captures bring
/// are not checked.
void check_relay_visible(const Scene& scene);

/// Coarseness of the fast model's sampling, in units of the steps that closed-form estimates ask
/// for.
struct SamplingStep {
  double relay = 1.0;
  double object = 1.0;
  /// Sum light of narrow lobes over pairs of relay patches, where a single sum leaves out too much.
  bool lobe_pairs = false;
};

/// Size of a model's sums.
struct ModelSize {
  int lit_points = 0;     ///< on the relay, as the source sees it
  int seen_points = 0;    ///< on the relay, of all zones
  int object_points = 0;  ///< at the scene's own placement
};

/// Standard deviations of the model's own error in static_background(), W/m^2 per bin. Both are
/// empty if there is no error.
struct BackgroundError {
  HistogramCube direct;   ///< of the direct return
  HistogramCube bounces;  ///< of two and three bounces within the known scene
};

/// Standard deviation of both errors together: they are independent, so their squares add.
HistogramCube total(const BackgroundError& error);

/// Expected light of a scene. Thread safe: all methods are const, and parts computed on first use
/// are locked.
class ForwardModel {
 public:
  virtual ~ForwardModel() = default;

  /// Three-bounce light (source, relay, object, relay, detector), W/m^2 per bin, for a zone that
  /// weighs all its directions alike. It is the sum over lit points p, object points q and seen
  /// points r of
  ///   I dOmega_p (rho_p / pi) cos cos / |pq|^2 * f dA_q * cos cos / |qr|^2 (rho_r / pi) dOmega_r
  /// where p, q and r see each other. Each term is a pulse at the time of its whole path. I is the
  /// source's radiant intensity, f the object's BRDF, and dOmega_r the solid angle as the detector
  /// sees it. Gains and linear unknowns are not applied. `out` is resized to [rows, columns, bins].
  /// The pose holds the scene's unknowns in order, SI units.
  virtual void three_bounce(const PoseVector& pose, HistogramCube& out) const = 0;

  HistogramCube three_bounce(const PoseVector& pose) const {
    HistogramCube out;
    three_bounce(pose, out);
    return out;
  }

  /// Static background, the light of the known scene alone, in the same unit: the direct return
  /// (source, surface, detector) and, where it matters, the two- and three-bounce returns of known
  /// surfaces. Zero when path lengths count from the relay (the first bounce is then not part of a
  /// capture).
  virtual const HistogramCube& static_background() const = 0;

  virtual BackgroundError background_error() const { return {}; }

  /// The static background with the hidden objects blocking the later bounces. `coarsely`: good
  /// enough to decide whether the shadow matters.
  virtual HistogramCube shadowed_background(const PoseVector& /*pose*/, bool /*coarsely*/) const {
    return static_background();
  }
  HistogramCube shadowed_background(const PoseVector& pose) const {
    return shadowed_background(pose, false);
  }

  virtual const TransportPlan& plan() const = 0;

  /// Sampling that the fast model chose; nothing for the reference renderer.
  virtual std::optional<SamplingStep> sampling_step() const { return std::nullopt; }
  /// Size of the sums; nothing for the reference renderer, nor for several objects.
  virtual std::optional<ModelSize> size() const { return std::nullopt; }
};

/// Sampling of the reference renderer, denser than the fast model's and different from it: uniform
/// cells, divided further where paths or a lobe ask for it. Flat cells of the relay, of rectangles
/// and of boxes have 2 x 2 Gauss-Legendre nodes each. Cells of curved objects and of meshes, and
/// lit cells that resolve a retroreflector's lobe, have one node.
struct ReferenceOptions {
  /// Relay cells along each side of a zone. Where the field has more than eight zones along a side:
  /// cells along an eighth of the field, and at least two per zone.
  int zone_divisions = 4;
  int field_divisions = 12;  ///< relay cells along each side of the field (rings of a cone)
  int object_divisions = 5;  ///< least number of cells along each edge of the object
  double object_edge = 0.4;  ///< m, largest cell edge; longer where pulse and distance allow
  /// Density of the sampling of the empty scene's own light along each axis, over that of the relay
  /// cells. That light is summed once. The light that an object takes away from it is sampled with
  /// the relay cells' density.
  double known_density = 1;

  void validate() const;
};

/// The reference renderer's sampling, `scale` times as dense along each axis as the default.
ReferenceOptions reference_sampling(double scale);

/// The reference renderer: the sum of `three_bounce`, pair by pair, for any material, with
/// point-to-point visibility rays and without moments.
std::unique_ptr<ForwardModel> make_reference_renderer(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      const ReferenceOptions& options = {});

/// How finely the known scene's own light is sampled. `fine` is for captures so bright that the
/// error of the usual sampling matters beside the photon noise. It has a tenth of the direct
/// return's error, unless that error is small beside the bounces' error in any case. It also lowers
/// the bounces' error where that takes some 20 ms at most. Where it can do neither, it is the usual
/// sampling. `timely` is for a moving sensor, whose every frame needs the light anew: where the
/// usual sampling of the bounces takes more than some 20 ms, one of about half the time and twice
/// the error takes its place. Elsewhere, it is the usual sampling.
enum class KnownLightSampling { timely, usual, fine };

struct FastModelOptions {
  /// Sums of float weights are accurate to about 1e-6. No number of cells would meet a tolerance
  /// below this.
  static constexpr double kLeastTolerance = 1e-5;

  /// Error of a bin relative to the pose's peak. The model takes the coarsest sampling whose
  /// estimated error is below this. The estimate compares the sampling with at least twice as many
  /// cells at eight poses of the search region; it is no bound for every pose. Except for single
  /// sums of a lobe, the error is twice the relative error of all bins (L2), root mean square
  /// over the poses.
  double tolerance = 0.01;
  /// Standard deviation of an extra Gaussian pulse, s. It widens the basins of attraction.
  double extra_pulse_sigma = 0.0;
  /// Sampling found for a similar placement of the same scene, to save the search for it.
  std::optional<SamplingStep> sampling_step;
  KnownLightSampling known_light = KnownLightSampling::usual;
  /// Terms switched on or off against the plan, to measure what the plan's decisions are worth.
  PlanOverrides overrides;

  void validate() const;
};

/// Data that the fast models of one scene share at any sensor placement: tables, acceleration
/// structures, the search region. Thread safe.
class SceneTransport;
std::shared_ptr<const SceneTransport> make_scene_transport(const Scene& scene);

/// The fast model: sums over incoming and outgoing light instead of pairs. For a Lambertian object
/// these sums are convolved on a grid of paths. For a narrow lobe, one sum over the relay is used
/// where it meets the tolerance, else pairs within the lobe's reach. For any other BRDF, all pairs
/// of a way in and a way out are summed. Smooth in the pose. With
/// `options.sampling_step` given, the model costs little more than sampling the relay as the sensor
/// sees it.
std::unique_ptr<ForwardModel> make_fast_model(std::shared_ptr<const SceneTransport> transport,
                                              const SensorPlacement& placement,
                                              const FastModelOptions& options = {});
/// The same for a scene that is used with this sensor pose only.
std::unique_ptr<ForwardModel> make_fast_model(const Scene& scene, const SensorPlacement& placement,
                                              const FastModelOptions& options = {});

/// The cheapest sampling that meets `options.tolerance` at one sensor placement, for models of
/// other placements too. `options.sampling_step` is ignored. For several objects, the sampling
/// suits all of them. Nothing for a measured law, which is not sampled.
std::optional<SamplingStep> choose_sampling(const std::shared_ptr<const SceneTransport>& transport,
                                            const SensorPlacement& placement,
                                            const FastModelOptions& options = {});

}  // namespace blindcorner
