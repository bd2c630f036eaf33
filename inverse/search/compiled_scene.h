// SPDX-License-Identifier: Apache-2.0
/// What a fit needs and no capture changes: models for the sensor placements, the bins that
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

/// Tolerance of the models that search, which is that of the first level of exactness; further
/// levels follow from the capture. A search with 4 % found no better poses and took longer.
inline constexpr double kFirstTolerance = 0.1;

/// Levels of exactness that a fit may go through: light of the last is 0.2 to 0.3 % off at most
/// (kMatt and kLobes in sharpen.cpp), of the order of the noise of a million photons, 0.1 %.
inline constexpr int kModelLevels = 4;
/// Their tolerances, of matt objects.
inline constexpr std::array<double, kModelLevels> kLevelTolerance{kFirstTolerance, 0.03, 0.01,
                                                                  0.001};

/// The static background inside the gates, rows as in Observation::zones, counts of one exposure;
/// all empty where there is none.
struct GatedBackground {
  std::vector<double> light;
  std::vector<double> error;  ///< standard deviation of the model's own error in that
};

struct CompiledScene {
  Scene scene;
  /// Coarse to fine: cheap models with a widened pulse first (where the grid asks for it), the
  /// cheap model with the true pulse next to last, the model of the wanted tolerance last.
  std::vector<ModelSet> ladder;
  /// Closed-form models [captures] that score poses where there is no spline; none for measured
  /// laws.
  std::vector<CoarseModel> coarse;
  /// Extra pulse widths (s), wide first: the scored poses' and, on the ladder, those on the way
  /// from them to an optimum.
  std::vector<double> widths;
  std::vector<std::vector<TimeGate>> gates;  ///< [captures][zones]
  double pulse_path = 0.0;        ///< m, standard deviation of pulse and bin as optical path
  PoseVector step;                ///< [n] finite-difference steps
  PoseVector spacing;             ///< [n] of the axes
  std::vector<GridAxis> axes;     ///< [n] of the scored grid, bounds included
  std::vector<PoseVector> poses;  ///< scored poses, last unknown fastest
  std::vector<float> log_prior;   ///< [poses] log density of their prior
  /// gain * S inside the gates, one column per scored pose, rows as in Observation::zones.
  /// Closed-form ones are rendered when somebody asks: a frame that is tracked does not. Thread
  /// safe.
  const Templates& templates() const { return rendered().templates; }
  /// Of several objects, each one's light by itself, closed form; empty: one object.
  struct ObjectGrid {
    std::vector<PoseVector> poses;  ///< of this object's unknowns, in the scene's order
    PoseVector spacing;
    Templates templates;  ///< as above
  };
  const std::vector<ObjectGrid>& objects() const { return rendered().objects; }
  /// Between the scored poses; null where the pulse had to be widened, or the grid is too large.
  std::unique_ptr<SplineGrid> spline;
  std::vector<HistogramCube> static_background;  ///< [captures]; none where there is none
  GatedBackground background;
  /// The same for bright captures, made when it is asked for. Thread safe.
  const GatedBackground& fine_background() const;

  const ModelSet& models() const { return ladder.back(); }
  /// Models of a level of exactness, 0 (models()) to kModelLevels - 1, made when they are asked
  /// for. Thread safe.
  const ModelSet& models_at(int level) const;
  /// Coarser models of pairs of lobes. Their light tells roughly how the models' changes about a
  /// pose at which these correct it. Null where the models are cheap themselves. Thread safe.
  const ModelSet* rough_models() const;
  /// models_at(level); null where one render of them would sum over more than `most_paths` (lit
  /// times seen times object points) of pairs of lobes.
  const ModelSet* models_within(int level, double most_paths) const;
  /// Without closed-form models only.
  const ModelSet& cheap_models() const { return ladder[ladder.size() - 2]; }
  /// Memory that it keeps at present, bytes: tables by their size, models by an estimate. Thread
  /// safe.
  std::size_t bytes() const;

  /// Templates in closed form, `extra_sigma` (s) wider, of several objects at most `most_poses`
  /// each; or these.
  void render_later(double extra_sigma, int most_poses);
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
  /// Where the grid is too large for a spline, histograms come from closed-form models too, at so
  /// many poses at most; 0: from the fast model, with a wider pulse.
  int closed_form_poses = 0;
};

/// What no sensor placement changes, found once for a scene. Thread safe.
class SceneKnowledge {
 public:
  explicit SceneKnowledge(const Scene& scene);

  /// Null where closed-form light does not apply: measured laws.
  const std::shared_ptr<const CoarseScene>& coarse() const { return coarse_; }
  /// What the fast models share.
  const std::shared_ptr<const SceneTransport>& transport() const { return transport_; }
  /// The fast model's sampling for a tolerance, found at the scene's own sensor placement; nothing
  /// where the scene does not have one (relay points come with captures).
  std::optional<SamplingStep> sampling_step(double tolerance) const;

 private:
  const Scene scene_;
  std::shared_ptr<const SceneTransport> transport_;
  std::shared_ptr<const CoarseScene> coarse_;
  mutable std::mutex mutex_;
  mutable std::map<double, SamplingStep> sampling_steps_;
};

/// Compiles the scene for the captures' sensor placements. Tables of exact histograms take seconds
/// for large search regions. Without `knowledge` it is found for this call.
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

/// Spacings within which a pose's neighbours on the grid are: any number between one and two says
/// the same of points of the grid; a tenth is far above rounding.
inline constexpr double kNextOnGrid = 1.1;

/// Finite-difference step of an unknown from a pose, backwards where forwards leads out of the
/// search region: a spline ends there.
double step_within(const CompiledScene& compiled, const PoseVector& pose, Eigen::Index unknown);

/// Brings circular unknowns back into [lower, lower + period).
void wrap_pose(const Scene& scene, PoseVector& pose);

/// Log density of the pose prior (uniform times the normal priors, not renormalised by them);
/// -infinity outside.
double log_pose_prior(const Scene& scene, const PoseVector& pose);

}  // namespace blindcorner
