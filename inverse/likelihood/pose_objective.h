// SPDX-License-Identifier: Apache-2.0
/// Log posterior of a pose for one observation, with the linear unknowns eliminated.
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "inverse/likelihood/linear_unknowns.h"
#include "inverse/likelihood/local_model.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {

/// Shapes of all observed zones, with their storage.
struct ShapeBuffer {
  std::vector<double> object;  ///< rows as in CompiledScene::templates
  std::vector<ZoneShapes> shapes;
};

struct PoseValue {
  double log_posterior = 0;  ///< likelihood, amplitude prior and pose prior
  double log_likelihood = 0;
  double log_integrand = 0;  ///< log_posterior plus the linear unknowns' log volume
};

/// What a cheap light lacks at a pose to be the model's: it is scaled zone by zone, then the rest
/// is added. Near that pose the corrected light has the model's values and the cheap light's
/// slopes.
struct Correction {
  std::vector<double> scale;  ///< [observed zones]
  std::vector<double> added;  ///< [rows] counts at unit amplitude

  bool empty() const { return added.empty(); }
};

/// The model's light and its slopes at a pose, [rows] and [rows, unknowns].
struct Linearisation {
  PoseVector pose;
  std::vector<double> light;
  Eigen::MatrixXd slope;
};

/// Where expected histograms come from: models; a cheap light (the spline through the scored poses,
/// or closed-form models), which may be corrected by what it lacks at a pose nearby; the model's
/// own linearisation, or a polynomial of the pose.
struct LightSource {
  const ModelSet* models = nullptr;
  const SplineGrid* spline = nullptr;
  const std::vector<CoarseModel>* coarse = nullptr;
  double extra_pulse_sigma = 0;  ///< s, of the closed-form models
  const Linearisation* linear = nullptr;
  const LocalModel* local = nullptr;
  const Correction* correction = nullptr;
  bool once = false;  ///< nobody asks for the light at these poses again: it is not kept

  LightSource(const ModelSet& set) : models(&set) {}      // NOLINT(google-explicit-constructor)
  LightSource(const SplineGrid& grid) : spline(&grid) {}  // NOLINT(google-explicit-constructor)
  LightSource(const Linearisation& at) : linear(&at) {}   // NOLINT(google-explicit-constructor)
  LightSource(const LocalModel& at) : local(&at) {}       // NOLINT(google-explicit-constructor)
  explicit LightSource(const std::vector<CoarseModel>& set, double extra_sigma = 0)
      : coarse(&set), extra_pulse_sigma(extra_sigma) {}

  LightSource corrected(const Correction& by) const {
    LightSource light = *this;
    light.correction = by.empty() ? nullptr : &by;
    return light;
  }
  LightSource asked_once() const {
    LightSource light = *this;
    light.once = true;
    return light;
  }
};

/// The models' light at the poses that were asked for last. The light at the end of a descent is
/// asked for again by its slopes, its corrections, the Fisher information, the goodness of fit and
/// the fitted histograms. Thread safe.
class RecentLight {
 public:
  /// Copies the light [rows] at exactly that pose, if it is still known.
  bool find(const ModelSet& models, const PoseVector& pose, std::vector<double>& light) const;
  void keep(const ModelSet& models, const PoseVector& pose, const std::vector<double>& light);

 private:
  /// Number of poses in use at the same time: two descents, each with a place, its slopes and a
  /// step.
  static constexpr std::size_t kPoses = 16;
  struct Entry {
    const ModelSet* models = nullptr;
    PoseVector pose;
    std::vector<double> light;
  };
  mutable std::mutex mutex_;
  std::array<Entry, kPoses> entries_;
  std::size_t oldest_ = 0;
};

class PoseObjective {
 public:
  PoseObjective(const CompiledScene& compiled, const Observation& observation);

  /// Evaluates at a pose with the given light; `solution` is the warm start and the result,
  /// `accuracy` the tolerated error of the log posterior from eliminating the linear unknowns.
  PoseValue evaluate(const LightSource& light, const PoseVector& pose, LinearSolution& solution,
                     bool warm, double accuracy = 0) const;

  /// The same from shapes that were filled before.
  PoseValue evaluate(const ShapeBuffer& buffer, const PoseVector& pose, LinearSolution& solution,
                     bool warm, double accuracy = 0) const;

  /// The same from the precomputed histograms of a scored pose.
  PoseValue evaluate_template(int index, LinearSolution& solution, bool warm,
                              double accuracy = 0) const;

  /// Log posterior of an object's light at unit amplitude [rows], without a pose's prior.
  double evaluate_light(const Eigen::VectorXf& light, LinearSolution& solution,
                        double accuracy = 0) const;

  /// The scene without any object.
  PoseValue evaluate_empty(LinearSolution& solution) const;

  /// Fills shapes for a pose.
  void shapes(const LightSource& light, const PoseVector& pose, ShapeBuffer& buffer) const;
  void empty_shapes(ShapeBuffer& buffer) const;
  /// The same from light that is known, [rows].
  void shapes_of(std::span<const double> light, ShapeBuffer& buffer) const;

  /// What `cheap` lacks of `light`, both at one pose.
  Correction correction(const ShapeBuffer& light, const ShapeBuffer& cheap) const;

  /// The models that decide: the compiled scene's, unless others were chosen. They must outlive
  /// this.
  const ModelSet& models() const { return *models_; }
  void use(const ModelSet& models) { models_ = &models; }
  /// Shadow of the hidden objects at a pose: what they take off the static background by blocking
  /// its later bounces, [rows] counts at a scale of one; empty: nothing. `coarsely` is as in
  /// ForwardModel::shadowed_background().
  std::vector<double> shadow_at(const PoseVector& pose, bool coarsely) const;
  /// Takes `shadow` off the background in all later calls with an object. Empty: no shadow.
  void cast(std::vector<double> shadow);
  const std::vector<double>& shadow() const { return shadow_; }
  /// Models that, corrected at the posterior's optima, are accurate enough beside the photon noise
  /// to give the posterior's shape: the compiled scene's, unless others were chosen.
  const ModelSet& rough_models() const { return *rough_; }
  void use_roughly(const ModelSet& models) { rough_ = &models; }

  const LinearSolver& solver() const { return solver_; }
  const CompiledScene& compiled() const { return compiled_; }
  int rows() const { return rows_; }

  /// Number of histograms, of one capture each, that models were asked for. Histograms that were
  /// still known count too, so that the number is the same at any number of threads.
  long renders() const { return renders_; }

 private:
  void point(ShapeBuffer& buffer, bool object) const;
  /// Light of models or of closed-form models, including the zones' gains.
  void render(const LightSource& light, const PoseVector& pose, std::vector<double>& object) const;
  void correct(const Correction& correction, ShapeBuffer& buffer) const;

  const CompiledScene& compiled_;
  const GatedBackground& background_;
  const ModelSet* models_;
  const ModelSet* rough_;
  std::vector<double> shadow_, shaded_;  // [rows] and the background without it; empty: none
  LinearSolver solver_;
  std::vector<std::pair<int, int>> direct_range_;  // [observed zones] lit bins, [first, end)
  int rows_ = 0;
  mutable RecentLight recent_;
  mutable std::atomic<long> renders_ = 0;
};

}  // namespace blindcorner
