// SPDX-License-Identifier: Apache-2.0
/// Log posterior of a pose for one observation, linear unknowns eliminated.
#pragma once

#include <utility>
#include <vector>

#include "inverse/likelihood/linear_unknowns.h"
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

/// Where expected histograms come from: models, or the spline through the scored poses, which may
/// be corrected by what it lacks at a pose nearby.
struct LightSource {
  const ModelSet* models = nullptr;
  const SplineGrid* spline = nullptr;
  const std::vector<double>* correction = nullptr;  ///< [rows] added to the spline's light

  LightSource(const ModelSet& set) : models(&set) {}      // NOLINT(google-explicit-constructor)
  LightSource(const SplineGrid& grid) : spline(&grid) {}  // NOLINT(google-explicit-constructor)
  LightSource(const SplineGrid& grid, const std::vector<double>& added)
      : spline(&grid), correction(&added) {}
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

  /// No object at all.
  PoseValue evaluate_empty(LinearSolution& solution) const;

  /// Fills shapes for a pose.
  void shapes(const LightSource& light, const PoseVector& pose, ShapeBuffer& buffer) const;
  void empty_shapes(ShapeBuffer& buffer) const;

  const LinearSolver& solver() const { return solver_; }
  const CompiledScene& compiled() const { return compiled_; }
  int rows() const { return rows_; }

 private:
  void point(ShapeBuffer& buffer, bool object) const;

  const CompiledScene& compiled_;
  LinearSolver solver_;
  std::vector<std::pair<int, int>> direct_range_;  // [observed zones] lit bins, [first, end)
  int rows_ = 0;
};

}  // namespace blindcorner
