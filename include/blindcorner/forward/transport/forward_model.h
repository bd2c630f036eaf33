// SPDX-License-Identifier: Apache-2.0
/// Pose in, expected histogram out: one interface, two models behind it.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/transport_plan.h"

namespace blindcorner {

/// Where the sensor stood, as far as a capture says so.
struct SensorPlacement {
  Transform T_world_sensor = Transform::Identity();
  std::vector<Eigen::Vector3d> relay_points;  ///< [zones] m, world; empty: from the footprints
};

/// Sensor placement of a capture: its own where it carries one, else the scene's.
SensorPlacement sensor_placement(const Scene& scene, const Capture* capture = nullptr);

/// Throws Error when the sensor lights or sees no relay surface, a stated relay point is far from
/// all, or a measured law has zones that are no points. Points that captures bring are not checked.
void check_relay_visible(const Scene& scene);

/// How coarsely the fast model samples, in units of what closed-form estimates ask for.
struct SamplingStep {
  double relay = 1.0;
  double object = 1.0;
  /// Light of narrow lobes from pairs of relay patches, where one sum leaves out too much.
  bool lobe_pairs = false;
};

/// Size of a model's sums.
struct ModelSize {
  int lit_points = 0;     ///< of the relay, as the source sees it
  int seen_points = 0;    ///< of all zones
  int object_points = 0;  ///< at the scene's own placement
};

/// Standard deviations of static_background() from the model's own error, W/m^2 per bin; both
/// empty: none.
struct BackgroundError {
  HistogramCube direct;   ///< of the direct return
  HistogramCube bounces;  ///< of two and three bounces within the known scene
};

/// Both together, as errors of their own add up.
HistogramCube total(const BackgroundError& error);

/// Expected light of a scene. Thread safe: all methods are const and keep no state.
class ForwardModel {
 public:
  virtual ~ForwardModel() = default;

  /// Light that went source, relay, object, relay, detector, W/m^2 per bin for a zone that weighs
  /// all its directions alike: the sum over lit points p, object points q and seen points r of
  ///   I dOmega_p (rho_p / pi) cos cos / |pq|^2 * f dA_q * cos cos / |qr|^2 (rho_r / pi) dOmega_r
  /// where p, q and r see each other, each a pulse at its whole path's time; I the source's radiant
  /// intensity, f the object's BRDF, dOmega_r as the detector sees it. Gains and linear unknowns
  /// are not applied. `out` is resized to [rows, columns, bins]. The pose holds the scene's
  /// unknowns in order, SI units.
  virtual void three_bounce(const PoseVector& pose, HistogramCube& out) const = 0;

  HistogramCube three_bounce(const PoseVector& pose) const {
    HistogramCube out;
    three_bounce(pose, out);
    return out;
  }

  /// Light of the known scene alone: source, surface, detector, and where it matters the two- and
  /// three-bounce returns of known surfaces; same unit. Zero when path lengths count from the relay
  /// (the first bounce is then no part of a capture).
  virtual const HistogramCube& static_background() const = 0;

  virtual BackgroundError background_error() const { return {}; }

  /// The same with the hidden objects in the way of the later bounces; `coarsely`: good enough to
  /// see whether that matters.
  virtual HistogramCube shadowed_background(const PoseVector& /*pose*/, bool /*coarsely*/) const {
    return static_background();
  }
  HistogramCube shadowed_background(const PoseVector& pose) const {
    return shadowed_background(pose, false);
  }

  virtual const TransportPlan& plan() const = 0;

  /// Sampling that the fast model chose; nothing for the reference renderer.
  virtual std::optional<SamplingStep> sampling_step() const { return std::nullopt; }
  /// Nothing for the reference renderer, nor for several objects.
  virtual std::optional<ModelSize> size() const { return std::nullopt; }
};

/// Sampling of the reference renderer: uniform, denser than and different from the fast model's.
/// Flat cells, of relay and object, have 2 x 2 Gauss-Legendre nodes each; cells of curved objects
/// and lit cells that resolve a lobe have one.
struct ReferenceOptions {
  /// Relay cells along each side of a zone; of an eighth of the field where there are more than
  /// eight zones along it, and two of a zone at least.
  int zone_divisions = 4;
  int field_divisions = 12;  ///< relay cells along each side of the field (rings of a cone)
  int object_divisions = 5;  ///< least cells along each edge of the object
  double object_edge = 0.4;  ///< m, largest cell edge on the object
  /// Density of the empty scene's own light along each axis over that of the relay cells. That
  /// light is summed once. What an object takes away from it has the relay cells' density.
  double known_density = 1;

  void validate() const;
};

/// The reference renderer's sampling, `scale` times as dense along each axis as by default.
ReferenceOptions reference_sampling(double scale);

/// The sum of `three_bounce`, pair by pair: any material, point-to-point visibility rays, no
/// moments.
std::unique_ptr<ForwardModel> make_reference_renderer(const Scene& scene,
                                                      const SensorPlacement& placement,
                                                      const ReferenceOptions& options = {});

/// How finely the known scene's own light is sampled. Fine: for captures so bright that the usual
/// sampling's error matters beside the photon noise. It has a tenth of the direct return's error,
/// unless that error is small beside the bounces' in any case, and less of the bounces' error where
/// that takes some 20 ms at most. Where it can have neither, it is the usual one.
enum class KnownLightSampling { usual, fine };

struct FastModelOptions {
  /// Sums of float weights end near 1e-6: below this, no number of cells would do.
  static constexpr double kLeastTolerance = 1e-5;

  /// Error of a bin relative to the pose's peak. The model takes the coarsest sampling whose error,
  /// estimated by going on to at least twice as many cells at eight poses of the search region, is
  /// below this: an estimate, not a bound for every pose. Of matt objects and of pairs of patches
  /// it is twice the relative error of all bins (L2), root mean square over the poses.
  double tolerance = 0.01;
  /// Standard deviation of an extra Gaussian pulse, s: widens the basins of attraction.
  double extra_pulse_sigma = 0.0;
  /// Sampling found for a like placement of the same scene, to save the search for it.
  std::optional<SamplingStep> sampling_step;
  KnownLightSampling known_light = KnownLightSampling::usual;
  /// Terms evaluated, or not, against the plan: for measuring what the plan's decisions are worth.
  PlanOverrides overrides;

  void validate() const;
};

/// What the fast models of one scene share wherever the sensor stands: tables, acceleration
/// structures, the search region. Thread safe.
class SceneTransport;
std::shared_ptr<const SceneTransport> make_scene_transport(const Scene& scene);

/// Sums over light arriving and light leaving instead of pairs: of a Lambertian object, convolved
/// on a grid of paths; of a narrow lobe, one sum over the relay where that meets the tolerance,
/// else pairs within the lobe's reach. Smooth in the pose. With `options.sampling_step` given it
/// costs little more than sampling the relay as the sensor sees it.
std::unique_ptr<ForwardModel> make_fast_model(std::shared_ptr<const SceneTransport> transport,
                                              const SensorPlacement& placement,
                                              const FastModelOptions& options = {});
/// The same for a scene of which no other sensor pose is asked about.
std::unique_ptr<ForwardModel> make_fast_model(const Scene& scene, const SensorPlacement& placement,
                                              const FastModelOptions& options = {});

/// The cheapest sampling that meets `options.tolerance` at a sensor placement, for models of other
/// placements too (`options.sampling_step` is not looked at). Of several objects, what suits all;
/// nothing for a measured law, which is not sampled.
std::optional<SamplingStep> choose_sampling(const std::shared_ptr<const SceneTransport>& transport,
                                            const SensorPlacement& placement,
                                            const FastModelOptions& options = {});

}  // namespace blindcorner
