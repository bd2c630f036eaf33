// SPDX-License-Identifier: Apache-2.0
/// The instrument's parameters as unknowns of a least squares problem.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "inverse/likelihood/linear_unknowns.h"
#include "inverse/likelihood/observation.h"

namespace blindcorner {

/// One parameter. Its unknown u is 0 at the value in the scene file.
struct InstrumentParameter {
  std::string name;
  double prior = 0;          ///< value at u = 0
  double sigma = 0;          ///< of u
  bool logarithmic = false;  ///< value = prior * exp(u), else prior + unit * u
  double unit = 1;
  /// Step of u for differences: a thousandth of a bin or of a logarithm, or a millimetre. It is far
  /// above rounding, and below the accuracy to which any parameter is known.
  double step = 1e-3;
  std::function<void(Scene&, double)> apply;
  bool fixed = false;

  double value(double u) const;
};

/// Distinct relay spots of a scene, in order of appearance, and the spot of each zone. Empty if a
/// zone's footprint is not a spot.
struct RelaySpots {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::size_t> of_zone;
};
RelaySpots relay_spots(const Scene& scene);
/// Puts other points in the place of the scene's spots.
void move_spots(Scene& scene, const RelaySpots& spots, const std::vector<Eigen::Vector3d>& points);

std::vector<InstrumentParameter> instrument_parameters(const Scene& scene,
                                                       const CalibrationOptions& options);

/// Captures at known poses with everything but the instrument eliminated.
class CalibrationProblem {
 public:
  /// `poses` is [captures]; an empty optional: no object.
  CalibrationProblem(const Scene& scene, std::vector<Capture> captures,
                     std::vector<std::optional<PoseVector>> poses,
                     std::vector<InstrumentParameter> parameters);

  Scene scene_at(const Eigen::VectorXd& u) const;

  /// What one capture says at given parameters.
  struct Evaluation {
    std::vector<double> residuals;  ///< of the deviance and the ambient light's prior
    double deviance = 0;
    LinearSolution linear;
    std::vector<std::vector<double>> object;  ///< [observed zones][bins] expected light, counts
    std::vector<std::vector<double>> known;   ///< the same of the static light; empty: none
    std::vector<std::vector<double>> mean;    ///< [observed zones][bins] expected counts
    double log_amplitude = 0, log_amplitude_error = 0;  ///< if asked for
  };
  /// Evaluates all captures. `free_amplitude` estimates each capture's brightness, `flat_ambient`
  /// leaves the ambient light's prior out.
  std::vector<Evaluation> evaluate(const Scene& scene, bool free_amplitude = false,
                                   bool flat_ambient = false) const;

  /// Levenberg-Marquardt over the parameters that are not fixed; captures weighted by `weights`.
  void solve(Eigen::VectorXd& u, int iterations, const std::vector<double>& weights) const;

  /// Posterior covariance of u, zero rows for fixed parameters.
  Eigen::MatrixXd covariance(const Eigen::VectorXd& u, const std::vector<double>& weights) const;

  const Observation& observation(std::size_t capture) const { return observations_[capture]; }
  std::size_t captures() const { return captures_.size(); }
  const Capture& capture(std::size_t i) const { return captures_[i]; }
  const std::optional<PoseVector>& pose(std::size_t i) const { return poses_[i]; }
  /// Index of a parameter; -1: there is none of that name.
  Eigen::Index index_of(const std::string& name) const;
  std::vector<InstrumentParameter>& parameters() { return parameters_; }
  const std::vector<InstrumentParameter>& parameters() const { return parameters_; }
  /// Noise model and linear unknowns are taken from here.
  const Scene& base() const { return base_; }
  void set_base(const Scene& scene);

 private:
  friend class StackedCost;
  Eigen::VectorXd residuals(const Eigen::VectorXd& u, const std::vector<double>& weights) const;
  Eigen::MatrixXd jacobian(const Eigen::VectorXd& u, const Eigen::VectorXd& at,
                           const std::vector<double>& weights) const;
  void observe_all();

  Scene base_;
  std::vector<Capture> captures_;
  std::vector<std::optional<PoseVector>> poses_;
  std::vector<InstrumentParameter> parameters_;
  std::vector<Observation> observations_;  // [captures]
  /// Sampling of the fast model. It is the same at all parameters, because differences would see it
  /// change.
  std::optional<SamplingStep> sampling_step_;
};

/// [captures]
using Evaluations = std::vector<CalibrationProblem::Evaluation>;

}  // namespace blindcorner
