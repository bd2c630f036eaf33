// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/fisher_information.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "inverse/likelihood/light_slope.h"

namespace blindcorner {
namespace {

/// Which linear unknowns a zone has for itself.
struct OwnUnknowns {
  bool amplitude, ambient, direct;

  OwnUnknowns(const LinearUnknowns& unknowns, const ZoneShapes& shapes)
      : amplitude(unknowns.amplitude == LinearMode::per_zone),
        ambient(unknowns.ambient == LinearMode::per_zone),
        direct(unknowns.direct == LinearMode::per_zone && shapes.direct != nullptr) {}

  bool any() const { return amplitude || ambient || direct; }
};

/// What the model expects of a zone's bins.
struct ExpectedBins {
  Eigen::VectorXd mean;    ///< [gate] counts that the noise model sees
  Eigen::VectorXd weight;  ///< [gate] information of a bin about its mean, 1 / variance
};

ExpectedBins bins_of(const LinearSolver& solver, std::size_t z, const ZoneShapes& shapes,
                     const LinearSolution& linear) {
  const ObservedZone& zone = solver.observation().zones[z];
  const BinLikelihood& noise_model = solver.observation().noise_model(zone);
  ExpectedBins bins{Eigen::VectorXd(zone.bins()), Eigen::VectorXd(zone.bins())};
  solver.expected(zone, shapes, linear.amplitude[z], linear.ambient[z], linear.direct[z],
                  bins.mean.data());
  for (int k = 0; k < zone.bins(); ++k) {
    bins.mean[k] = noise_model.lit(bins.mean[k]);
    bins.weight[k] = zone.weight_of(k) * noise_model.information(bins.mean[k]);
  }
  return bins;
}

/// Completes the information [3, 3] that the bins of the time gate hold about a zone's own linear
/// unknowns: adds the bins outside the gate and the priors, and sets a neutral entry for each
/// unknown that the zone does not have.
void complete(const ObservedZone& zone, const BinLikelihood& noise_model,
              const LinearUnknowns& unknowns, const OwnUnknowns& own, double ambient,
              Eigen::Matrix3d& information) {
  if (own.ambient && zone.outside_bins > 0) {
    information(1, 1) += zone.outside_bins * noise_model.information(ambient);
  }
  if (own.ambient && !unknowns.ambient_prior.empty()) {
    information(1, 1) +=
        std::pow(unknowns.ambient_prior[static_cast<std::size_t>(zone.zone)].sigma, -2);
  }
  if (own.amplitude) information(0, 0) += std::pow(unknowns.amplitude_prior.sigma_log, -2);
  // The share that keeps a singular matrix (light as even as the ambient one) invertible is far
  // above rounding and far below what any count can tell.
  for (int i = 0; i < 3; ++i) {
    double& term = information(i, i);
    term = term > 0 ? term * (1 + 1e-12) : 1.0;
  }
}

/// Derivatives of the light `here` at an optimum. A spline has no neighbour beyond a bound of the
/// search region, so that its slope across the bound misses up to 23 % of the information. The
/// model's own slope is taken there.
Eigen::MatrixXd slope_at(const PoseObjective& objective, const LightSource& source,
                         const ShapeBuffer& here, const Refined& optimum) {
  Eigen::MatrixXd slope;
  light_slope(objective, source, optimum.pose, here, Differences::one_sided, slope);
  if (source.spline == nullptr) return slope;
  ShapeBuffer model;
  for (Eigen::Index i = 0; i < slope.cols(); ++i) {
    if (bound_at(objective.compiled().scene, optimum.pose, i) == 0) continue;
    if (model.object.empty()) objective.shapes(objective.models(), optimum.pose, model);
    light_slope(objective, objective.models(), optimum.pose, model, Differences::one_sided, i,
                slope.col(i));
  }
  return slope;
}

}  // namespace

Eigen::MatrixXd fisher_information(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                                   const LinearSolution& linear, const Eigen::MatrixXd& slope,
                                   Eigen::VectorXd* gradient) {
  const Observation& observation = solver.observation();
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(slope.cols(), slope.cols());
  if (gradient != nullptr) gradient->setZero(slope.cols());
  Eigen::Index row = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& noise_model = observation.noise_model(zone);
    const OwnUnknowns own(solver.unknowns(), shapes[z]);
    const double a = linear.amplitude[z];
    const int bins = zone.bins();
    const Eigen::MatrixXd counts = a * slope.middleRows(row, bins);
    row += bins;
    if (counts.isZero(0)) continue;  // the zone's own unknowns do not matter to the others
    const auto [mean, weight] = bins_of(solver, z, shapes[z], linear);
    Eigen::MatrixXd local = Eigen::MatrixXd::Zero(bins, 3);
    for (int k = 0; k < bins; ++k) {
      if (own.amplitude) local(k, 0) = a * shapes[z].object[k];
      if (own.ambient) local(k, 1) = 1;
      if (own.direct) local(k, 2) = shapes[z].direct[k];
    }
    if (gradient != nullptr) {
      Eigen::VectorXd first(bins);
      for (int k = 0; k < bins; ++k) {
        first[k] = zone.weight_of(k) *
                   noise_model.terms(zone.counts[static_cast<std::size_t>(k)], mean[k]).first;
      }
      *gradient -= counts.transpose() * first;
    }
    const Eigen::MatrixXd weighted = weight.asDiagonal() * counts;
    total += counts.transpose() * weighted;
    if (!own.any()) continue;
    const Eigen::MatrixXd cross = weighted.transpose() * local;
    Eigen::Matrix3d within = local.transpose() * weight.asDiagonal() * local;
    complete(zone, noise_model, solver.unknowns(), own, linear.ambient[z], within);
    total -= cross * within.ldlt().solve(cross.transpose());
  }
  return total;
}

Eigen::VectorXd row_information(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                                const LinearSolution& linear) {
  Eigen::Index count = 0;
  for (const ObservedZone& zone : solver.observation().zones) count += zone.bins();
  Eigen::VectorXd rows(count);
  Eigen::Index row = 0;
  for (std::size_t z = 0; z < shapes.size(); ++z) {
    const double a = linear.amplitude[z];
    const Eigen::VectorXd weight = bins_of(solver, z, shapes[z], linear).weight;
    rows.segment(row, weight.size()) = a * a * weight;
    row += weight.size();
  }
  return rows;
}

Eigen::MatrixXd sensor_slope(const PoseObjective& objective, const MovedModels& moved,
                             const PoseVector& pose) {
  Eigen::MatrixXd slope(objective.rows(), 6);
  ShapeBuffer plus;
  ShapeBuffer minus;
  for (std::size_t k = 0; k < 6; ++k) {
    objective.shapes(moved.plus[k], pose, plus);
    objective.shapes(moved.minus[k], pose, minus);
    slope.col(static_cast<Eigen::Index>(k)) =
        (light_of(plus) - light_of(minus)) / (2 * moved.step[k]);
  }
  return slope;
}

PoseInformation pose_information(const PoseObjective& objective, const ShapeBuffer& at,
                                 const LinearSolution& linear, const Eigen::MatrixXd& slope,
                                 const Eigen::MatrixXd& disturbance) {
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  const Eigen::Index n = slope.cols();
  const Eigen::Index k = disturbance.cols();

  // Columns: the pose, what disturbs the light, the logarithm of the amplitude.
  Eigen::MatrixXd columns(objective.rows(), n + k + 1);
  columns.leftCols(n) = slope;
  if (k > 0) columns.middleCols(n, k) = disturbance;
  columns.rightCols(1) = light_of(at);
  Eigen::MatrixXd total = fisher_information(objective.solver(), at.shapes, linear, columns);
  const Eigen::Index last = total.cols() - 1;
  PoseInformation info;
  info.signal = total(last, last);
  if (unknowns.amplitude == LinearMode::shared) {
    const double own = total(last, last) + std::pow(unknowns.amplitude_prior.sigma_log, -2);
    const Eigen::VectorXd cross = total.col(last);
    total -= cross * cross.transpose() / own;
  }
  info.pose = total.topLeftCorner(n, n);
  info.disturbance = total.block(0, n, n, k);
  return info;
}

PoseInformation pose_information(const PoseObjective& objective, const Refined& optimum,
                                 const Eigen::MatrixXd& disturbance) {
  const LightSource source = light_near(objective, optimum);
  ShapeBuffer at;
  objective.shapes(source, optimum.pose, at);
  return pose_information(
      objective, at, optimum.linear,
      optimum.slope.size() > 0 ? optimum.slope : slope_at(objective, source, at, optimum),
      disturbance);
}

}  // namespace blindcorner
