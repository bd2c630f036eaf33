// SPDX-License-Identifier: Apache-2.0
/// Elimination of the linear unknowns (variable projection): for a given pose, the amplitude,
/// ambient light and direct return that explain the counts best.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <utility>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "inverse/likelihood/observation.h"

namespace blindcorner {

/// Expected shapes of one observed zone, counts at unit amplitude, aligned with its gate.
struct ZoneShapes {
  const double* object = nullptr;  ///< gain * S, [gate]; null: no object
  const double* direct = nullptr;  ///< static_background(), [gate]; null: none
  int object_first = 0;            ///< bins of the gate that the object lights: [first, end)
  int object_end = 0;
  int direct_first = 0;  ///< bins that the direct return lights: [first, end)
  int direct_end = 0;
};

/// Values that minimise the negative log posterior for given shapes.
struct LinearSolution {
  std::vector<double> amplitude;  ///< [observed zones] (equal ones when shared)
  std::vector<double> ambient;    ///< [observed zones] counts per bin
  std::vector<double> direct;     ///< [observed zones] scale of the static light; 1 if not free
  double log_likelihood = 0;      ///< relative to the best attainable one: minus half the deviance
  double log_prior = 0;           ///< of the amplitude, normalised density in log a
  /// log of the integral over the linear unknowns around the maximum, by Laplace's method, minus
  /// the maximum itself: -log det(H)/2 + (dimension/2) log(2 pi).
  double log_volume = 0;
  bool converged = false;
};

/// Solver for one observation. It uses Newton's method, damped by the Newton decrement, and keeps
/// no state between calls. With `warm`, it starts from the given solution, which may be that of a
/// nearby pose.
class LinearSolver {
 public:
  /// The observation must outlive the solver.
  LinearSolver(const Observation& observation, const LinearUnknowns& unknowns);

  /// `shapes` is [observed zones]. Without an object (all `object` null) the amplitude is left out.
  /// `accuracy` is the tolerated error of the log posterior; zero goes to machine precision.
  void solve(std::span<const ZoneShapes> shapes, LinearSolution& solution, bool warm,
             double accuracy = 0) const;

  /// The same without `log_likelihood`, for callers that want residuals.
  void eliminate(std::span<const ZoneShapes> shapes, LinearSolution& solution, bool warm,
                 double accuracy = 0) const;

  /// Expected counts of one zone for a solution, [gate].
  void expected(const ObservedZone& zone, const ZoneShapes& shapes, double amplitude,
                double ambient, double direct, double* out) const;

  /// Signed deviance residuals of all gates, of the ambient light outside them, and of the
  /// amplitude's prior, [residual_count()]. Half their squared sum is minus (log_likelihood +
  /// log_prior) up to a constant.
  void residuals(std::span<const ZoneShapes> shapes, const LinearSolution& solution,
                 double* out) const;
  int residual_count() const { return residual_count_; }

  /// Derivatives of these residuals in the unknowns of the object's light, [residual_count(), n]
  /// row by row. The linear unknowns follow to first order (Kaufman 1975). `slope` holds the
  /// light's derivatives, [rows of all gates, n], and `residuals` the residuals of `solution`. This
  /// must be the eliminated solution: the gradient is then exact.
  void jacobian(std::span<const ZoneShapes> shapes, const LinearSolution& solution,
                const Eigen::MatrixXd& slope, const double* residuals, double* out) const;

  const Observation& observation() const { return observation_; }
  const LinearUnknowns& unknowns() const { return unknowns_; }

 private:
  /// Sums over the bins before a bin. Each bin counts with its weight.
  struct Prefix {
    double bins = 0;               ///< sum of the weights
    double count = 0, square = 0;  ///< n and n^2
    double saturated = 0;          ///< negative saturated log likelihood
    double fixed = 0;              ///< half deviance at the fixed ambient light
  };
  /// Bins that the object or the direct return lights, in at most two ranges, and the sums over the
  /// rest, where ambient light alone is expected.
  struct Lit {
    std::array<std::pair<int, int>, 2> ranges;
    std::size_t count = 0;
    Prefix rest;
  };
  /// Prior of the ambient light of an observed zone; null: none.
  const NormalPrior* ambient_prior(std::size_t zone) const {
    if (unknowns_.ambient_prior.empty()) return nullptr;
    return &unknowns_.ambient_prior[static_cast<std::size_t>(observation_.zones[zone].zone)];
  }
  Lit lit(std::size_t zone, const ZoneShapes& shapes) const;
  /// Number of a zone's residuals: its bins, one for all bins outside of its gate, and its priors.
  int residual_count(std::size_t zone) const;
  /// A zone's part of a Jacobian, [residual_count(zone), n + 1]. The last column is that of the
  /// logarithm of the zone's amplitude. The zone's own unknowns adapt to first order.
  void zone_jacobian(std::size_t zone, const ZoneShapes& shapes, const LinearSolution& solution,
                     const Eigen::Ref<const Eigen::MatrixXd>& slope, const double* residuals,
                     Eigen::MatrixXd& out) const;
  /// Whether bins with ambient light alone can be taken together.
  bool summable(const ObservedZone& zone) const;
  LinearTerms local(std::size_t z, const ZoneShapes& shapes, double amplitude, double ambient,
                    double direct) const;
  void start(std::span<const ZoneShapes> shapes, LinearSolution& solution) const;
  void solve_shared(std::span<const ZoneShapes> shapes, std::size_t begin, std::size_t end,
                    LinearSolution& solution, double accuracy) const;

  const Observation& observation_;
  LinearUnknowns unknowns_;
  std::vector<double> ambient_floor_;        // [observed zones]
  std::vector<double> lower_half_;           // [observed zones] mean of the lower half of the bins
  std::vector<std::vector<Prefix>> prefix_;  // [observed zones][bins + 1]
  int residual_count_ = 0;
  bool has_direct_ = false;
};

}  // namespace blindcorner
