// SPDX-License-Identifier: Apache-2.0
/// The parts of a fit that no capture changes: models for the sensor placements, the bins that
/// matter, and the scored poses with their expected histograms.
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "forward/transport/coarse_model.h"
#include "inverse/likelihood/observation.h"
#include "inverse/search/spline_grid.h"
#include "inverse/search/templates.h"

namespace blindcorner {

/// Models of all captures of a joint fit at one pulse width.
using ModelSet = std::vector<std::unique_ptr<ForwardModel>>;  // [captures]

class SceneKnowledge;

/// Tolerance of the models of the search, which are the first level of exactness. Whether further
/// levels are used follows from the capture. A search with 4 % found no better poses and took
/// longer.
inline constexpr double kFirstTolerance = 0.1;

/// Number of levels of exactness that a fit may go through. The light of the last level is at most
/// 0.2 to 0.3 % off (kMatt and kLobes in sharpen.cpp). This is of the order of the noise of a
/// million photons, 0.1 %.
inline constexpr int kModelLevels = 4;
/// Tolerances of the levels for matt objects.
inline constexpr std::array<double, kModelLevels> kLevelTolerance{kFirstTolerance, 0.03, 0.01,
                                                                  0.001};

/// The static background inside the gates, rows as in Observation::zones, counts of one exposure.
/// Both vectors are empty where there is no background.
struct GatedBackground {
  std::vector<double> light;
  std::vector<double> error;  ///< standard deviation of the model's own error in `light`
};

struct CompiledScene {
  Scene scene;
  /// Coarse to fine: cheap models with a widened pulse first (where the grid asks for it), the
  /// cheap model with the true pulse next to last, the model of the wanted tolerance last.
  std::vector<ModelSet> ladder;
  /// Closed-form models [captures] that score poses where there is no spline; none for measured
  /// laws.
  std::vector<CoarseModel> coarse;
  /// Extra pulse widths (s), the widest first. The scored poses have the first one. On the ladder,
  /// the others are those on the way from the scored poses to an optimum.
  std::vector<double> widths;
  std::vector<std::vector<TimeGate>> gates;  ///< [captures][zones]
  double pulse_path = 0.0;        ///< m, standard deviation of pulse and bin as optical path
  PoseVector step;                ///< [n] finite-difference steps
  PoseVector spacing;             ///< [n] of the axes
  std::vector<GridAxis> axes;     ///< [n] of the scored grid, bounds included
  std::vector<PoseVector> poses;  ///< scored poses, last unknown fastest
  std::vector<float> log_prior;   ///< [poses] log density of their prior
  /// gain * S inside the gates, one column per scored pose, rows as in Observation::zones.
  /// Closed-form ones are rendered when they are first asked for; tracked frames do not need them.
  /// Thread safe.
  const Templates& templates() const { return rendered().templates; }
  /// With several objects, the light of each one alone, in closed form. With one object, empty.
  struct ObjectGrid {
    std::vector<PoseVector> poses;  ///< of this object's unknowns, in the scene's order
    PoseVector spacing;
    Templates templates;  ///< as above
  };
  const std::vector<ObjectGrid>& objects() const { return rendered().objects; }
  /// Histograms between the scored poses. Null where poses are scored in closed form, the pulse had
  /// to be widened, or the grid is too large.
  std::unique_ptr<SplineGrid> spline;
  /// FitOptions::known_light.
  KnownLightSampling known_light = KnownLightSampling::usual;
  std::vector<HistogramCube> static_background;  ///< [captures]; none where there is none
  GatedBackground background;
  /// The background for bright captures (KnownLightSampling::fine), made when it is first asked
  /// for. Thread safe.
  const GatedBackground& fine_background() const;

  const ModelSet& models() const { return ladder.back(); }
  /// Models of a level of exactness, 0 (models()) to kModelLevels - 1, made when they are asked
  /// for. Thread safe.
  const ModelSet& models_at(int level) const;
  /// Whether the models sum over pairs of patches of a lobe. A render then takes milliseconds, and
  /// `coarse`, which takes microseconds, stands in for it wherever that is enough.
  bool pairs_lobes() const;
  /// models_at(level); null where one render of them would sum over more than `most_paths` (lit
  /// times seen times object points) of pairs of lobes. They are not made where it would by far.
  const ModelSet* models_within(int level, double most_paths) const;
  /// Cheap models with the true pulse. They exist only without closed-form models.
  const ModelSet& cheap_models() const { return ladder[ladder.size() - 2]; }
  /// Memory in use at present, bytes. Tables count by their size, models by an estimate. Thread
  /// safe.
  std::size_t bytes() const;

  /// Asks for closed-form templates, rendered later, with pulses wider by `extra_sigma` (s). With
  /// several objects, each object's own grid has at most `most_poses`.
  void render_later(double extra_sigma, int most_poses);
  /// Gives templates that are rendered already.
  void set_templates(Templates templates);

  int unknown_count() const { return static_cast<int>(scene.unknowns.size()); }

  std::shared_ptr<const SceneKnowledge> knowledge;
  std::vector<SensorPlacement> placements;  ///< [captures]

 private:
  struct Rendered {
    Templates templates;
    std::vector<ObjectGrid> objects;
    std::size_t bytes() const;
  };
  struct Wanted {
    double extra_sigma = 0;
    int most_poses = 0;
  };
  const Rendered& rendered() const;

  std::optional<Wanted> wanted_;
  mutable std::once_flag rendered_once_;
  mutable Rendered rendered_;
  mutable std::atomic<std::size_t> rendered_bytes_{0};
  mutable std::mutex mutex_;
  mutable std::map<int, ModelSet> finer_;  ///< by level
  mutable std::once_flag fine_background_once_;
  mutable GatedBackground fine_background_;
};

/// The grid of scored poses.
struct GridOptions {
  double density = 1.0;  ///< grid points per 1.2 path standard deviations of the pulse
  int max_poses = 20'000;
  bool widen = true;   ///< widen the pulse when the grid must be coarser than that
  bool spline = true;  ///< lay a spline through the histograms
  bool sharp = false;  ///< histograms from the model of the wanted tolerance, not the cheap one
  bool closed_form =
      false;  ///< histograms from closed-form models: for few captures of a placement
  /// Where the grid is too large for a spline, histograms come from closed-form models too, at this
  /// many poses at most. 0: they come from the fast model, with a wider pulse.
  int closed_form_poses = 0;
};

/// Parts that no sensor placement changes, computed once for a scene. Thread safe.
class SceneKnowledge {
 public:
  explicit SceneKnowledge(const Scene& scene);

  /// Null where closed-form light does not apply: measured laws.
  const std::shared_ptr<const CoarseScene>& coarse() const { return coarse_; }
  /// Data that the fast models share.
  const std::shared_ptr<const SceneTransport>& transport() const { return transport_; }
  /// The fast model's sampling for a tolerance, found at the scene's own sensor placement. Nothing
  /// for measured laws, or where the scene has no placement of its own (relay points come with
  /// captures).
  std::optional<SamplingStep> sampling_step(double tolerance) const;

 private:
  const Scene scene_;
  std::shared_ptr<const SceneTransport> transport_;
  std::shared_ptr<const CoarseScene> coarse_;
  mutable std::mutex mutex_;
  mutable std::map<double, SamplingStep> sampling_steps_;
};

/// Compiles the scene for the captures' sensor placements. Tables of exact histograms take seconds
/// for large search regions. Without `knowledge`, it is computed for this call.
std::unique_ptr<CompiledScene> compile(const Scene& scene,
                                       const std::vector<SensorPlacement>& placements,
                                       const FitOptions& options, const GridOptions& grid,
                                       std::shared_ptr<const SceneKnowledge> knowledge = nullptr);

/// Period of an unknown if it is a yaw whose range covers a full turn of the shape, else 0.
double period_of(const Scene& scene, std::size_t unknown);

/// Smallest difference b - a, circular where the unknown is.
PoseVector pose_difference(const Scene& scene, const PoseVector& a, const PoseVector& b);

/// Whether two poses differ by less than so many grid spacings along every unknown.
bool within_spacings(const CompiledScene& compiled, const PoseVector& a, const PoseVector& b,
                     double spacings);

/// Poses of a grid that differ by fewer spacings than this along every unknown are neighbours. Any
/// number between one and two gives the same neighbours; a tenth more than one is far above
/// rounding.
inline constexpr double kNextOnGrid = 1.1;

/// Finite-difference step of an unknown from a pose. It goes backwards where a forward step leads
/// out of the search region, because a spline ends there.
double step_within(const CompiledScene& compiled, const PoseVector& pose, Eigen::Index unknown);

/// Brings circular unknowns back into [lower, lower + period).
void wrap_pose(const Scene& scene, PoseVector& pose);

/// Log density of the pose prior (uniform times the normal priors, not renormalised by them);
/// -infinity outside.
double log_pose_prior(const Scene& scene, const PoseVector& pose);

}  // namespace blindcorner
