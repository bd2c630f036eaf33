// SPDX-License-Identifier: Apache-2.0
#include "inverse/bound/look_alike.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace blindcorner {
namespace {

/// Least expected counts, far below one in all bins; roots need them above zero.
constexpr double kDark = 1e-12;
/// Features of a zone beside its bins: ambient light outside its time gate, priors of ambient light
/// and of an amplitude of its own.
constexpr Eigen::Index kMoreFeatures = 3;
/// Factor by which the quadratic estimate of a squared distance may be too large, by judgement. A
/// larger factor only costs time. A smaller one may leave out a pose that counts, which lowers the
/// bound.
constexpr double kEstimate = 3;

}  // namespace

LookAlike::LookAlike(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                     const LinearSolution& linear)
    : solver_(solver) {
  const Observation& observation = solver.observation();
  const LinearUnknowns& unknowns = solver.unknowns();
  int row = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& noise_model = observation.noise_model(zone);
    OfZone own;
    own.row = row;
    own.bins = zone.bins();
    row += own.bins;
    own.amplitude = linear.amplitude[z];
    own.ambient = linear.ambient[z];
    own.direct = linear.direct[z];
    own.truth.resize(own.bins);
    solver.expected(zone, shapes[z], own.amplitude, own.ambient, own.direct, own.truth.data());
    own.weight.resize(own.bins);
    own.basis = Eigen::MatrixXd::Zero(own.bins, 2);
    for (int k = 0; k < own.bins; ++k) {
      own.weight[k] =
          zone.weight_of(k) / std::max(noise_model.variance(std::max(own.truth[k], kDark)), kDark);
      if (unknowns.ambient == LinearMode::per_zone) own.basis(k, 0) = 1;
      if (unknowns.direct == LinearMode::per_zone && shapes[z].direct != nullptr) {
        own.basis(k, 1) = shapes[z].direct[k];
      }
    }
    own.light = own.amplitude * Eigen::Map<const Eigen::VectorXd>(shapes[z].object, own.bins);
    Eigen::Matrix2d information = own.basis.transpose() * own.weight.asDiagonal() * own.basis;
    if (unknowns.ambient == LinearMode::per_zone) {
      information(0, 0) +=
          zone.outside_bins / std::max(noise_model.variance(std::max(own.ambient, kDark)), kDark);
      if (!unknowns.ambient_prior.empty()) {
        information(0, 0) +=
            std::pow(unknowns.ambient_prior[static_cast<std::size_t>(zone.zone)].sigma, -2);
      }
    }
    for (int i = 0; i < 2; ++i) {
      double& term = information(i, i);
      term = term > 0 ? term * (1 + 1e-12) : 1.0;
    }
    own.inverse = information.inverse();
    own.explained = own.basis.transpose() * own.weight.cwiseProduct(own.light);
    features_ += own.bins + kMoreFeatures;
    zones_.push_back(std::move(own));
  }
  ++features_;  // the prior of a shared amplitude
}

LookAlike::Fit LookAlike::compare(const TestLight& test) const {
  const bool own = solver_.unknowns().amplitude == LinearMode::per_zone;
  const Eigen::Index count = test.light.cols();
  const auto zones = static_cast<Eigen::Index>(zones_.size());
  Fit fit;
  fit.norm = Eigen::MatrixXd::Zero(own ? zones : 1, count);
  fit.projection = fit.norm;
  for (Eigen::Index z = 0; z < zones; ++z) {
    const OfZone& zone = zones_[static_cast<std::size_t>(z)];
    const auto light = test.light.middleRows(zone.row, zone.bins);
    const Eigen::MatrixXd explained =
        (zone.weight.asDiagonal() * zone.basis).transpose() * light;  // [2, K]
    const Eigen::MatrixXd solved = zone.inverse * explained;
    const Eigen::Index at = own ? z : 0;
    fit.norm.row(at) += zone.weight.transpose() * test.square.middleRows(zone.row, zone.bins) -
                        explained.cwiseProduct(solved).colwise().sum();
    fit.projection.row(at) += zone.weight.cwiseProduct(zone.light).transpose() * light -
                              zone.explained.transpose() * solved;
    fit.constant += zone.light.dot(zone.weight.cwiseProduct(zone.light)) -
                    zone.explained.dot(zone.inverse * zone.explained);
    fit.explained.push_back(explained);
  }
  return fit;
}

// min over u of norm e^2u - 2 projection e^u + (u - ln truth)^2 / sigma^2, by Newton's method.
double LookAlike::amplitude_for(double norm, double projection, double truth) const {
  const LinearUnknowns& unknowns = solver_.unknowns();
  if (unknowns.amplitude == LinearMode::fixed || truth <= 0) return truth;
  // Steps are at most one each and starts at most 20 away from the truth. The last steps are
  // Newton's.
  constexpr int kSteps = 20;
  const double precision = std::pow(unknowns.amplitude_prior.sigma_log, -2);
  const auto value = [&](double u) {
    const double a = truth * std::exp(u);
    return a * (norm * a - 2 * projection) + precision * u * u;
  };
  double best = 0;
  const double peak = projection > 0 && norm > 0 ? std::log(projection / norm / truth) : 0.0;
  for (double u : {0.0, std::clamp(peak, -20.0, 20.0)}) {
    for (int i = 0; i < kSteps; ++i) {
      const double a = truth * std::exp(u);
      const double slope = 2 * a * (norm * a - projection) + 2 * precision * u;
      const double curvature = std::max(2 * a * (2 * norm * a - projection), 0.0) + 2 * precision;
      u += std::clamp(-slope / curvature, -1.0, 1.0);
    }
    if (value(u) < value(best)) best = u;
  }
  return truth * std::exp(best);
}

// Integral of dm / (2 sqrt(V)), where the variance V = V0 + V1 m is linear in the expected counts
// m. For photons the Bhattacharyya coefficient is then exact. For normal counts, the changing
// variance is taken as known.
double LookAlike::root(std::size_t z, double counts) const {
  const Observation& observation = solver_.observation();
  const BinLikelihood& noise_model = observation.noise_model(observation.zones[z]);
  const double m = std::max(counts, 0.0);
  const double none = noise_model.counts_photons() ? 0.0 : noise_model.variance(0);
  const double per_count = noise_model.variance(1) - none;
  if (per_count > 0) return std::sqrt(none + per_count * m) / per_count;
  return m / (2 * std::sqrt(none));
}

Eigen::VectorXd LookAlike::roots_of(const TestLight& test, const Fit& fit, Eigen::Index column,
                                    const Eigen::VectorXd& amplitude) const {
  const Observation& observation = solver_.observation();
  const LinearUnknowns& unknowns = solver_.unknowns();
  const bool own_amplitude = unknowns.amplitude == LinearMode::per_zone;
  const auto prior_distance = [&](double a, double truth) {
    if (unknowns.amplitude == LinearMode::fixed || a <= 0 || truth <= 0) return 0.0;
    return std::log(a / truth) / (2 * unknowns.amplitude_prior.sigma_log);
  };
  Eigen::VectorXd roots = Eigen::VectorXd::Zero(features_);
  Eigen::Index feature = 0;
  for (std::size_t z = 0; z < zones_.size(); ++z) {
    const OfZone& zone = zones_[z];
    const ObservedZone& observed = observation.zones[z];
    const double a = amplitude[own_amplitude ? static_cast<Eigen::Index>(z) : 0];
    const Eigen::Vector2d moved =
        zone.inverse * (zone.explained - a * fit.explained[z].col(column));
    const double least = observation.noise_model(observed).counts_photons() ? kDark : -1e300;
    const double ambient = std::max(zone.ambient + moved[0], least) - zone.ambient;
    const double direct = std::max(zone.direct + moved[1], 0.0) - zone.direct;
    const auto light = test.light.col(column).segment(zone.row, zone.bins);
    for (int k = 0; k < zone.bins; ++k) {
      const double counts = zone.truth[k] + a * light[k] - zone.light[k] +
                            ambient * zone.basis(k, 0) + direct * zone.basis(k, 1);
      roots[feature + k] =
          std::sqrt(observed.weight_of(k)) * (root(z, counts) - root(z, zone.truth[k]));
    }
    feature += zone.bins;
    roots[feature] = std::sqrt(observed.outside_bins) *
                     (root(z, zone.ambient + ambient) - root(z, zone.ambient));
    if (!unknowns.ambient_prior.empty()) {
      const NormalPrior& prior = unknowns.ambient_prior[static_cast<std::size_t>(observed.zone)];
      roots[feature + 1] = ambient / (2 * prior.sigma);
    }
    if (own_amplitude) roots[feature + 2] = prior_distance(a, zone.amplitude);
    feature += kMoreFeatures;
  }
  if (!own_amplitude) roots[feature] = prior_distance(amplitude[0], zones_.front().amplitude);
  return roots;
}

LookAlike::Confused LookAlike::confused(const TestLight& test, double negligible) const {
  const Fit fit = compare(test);
  const double limit = -std::log(negligible);
  const double precision = solver_.unknowns().amplitude == LinearMode::fixed
                               ? 0.0
                               : std::pow(solver_.unknowns().amplitude_prior.sigma_log, -2);
  Confused result;
  std::vector<Eigen::VectorXd> columns;
  for (Eigen::Index k = 0; k < test.light.cols(); ++k) {
    Eigen::VectorXd amplitude(fit.norm.rows());
    double square = fit.constant;
    for (Eigen::Index i = 0; i < amplitude.size(); ++i) {
      const double norm = fit.norm(i, k), projection = fit.projection(i, k);
      const double truth = zones_[static_cast<std::size_t>(i)].amplitude;
      const double a = amplitude_for(norm, projection, truth);
      amplitude[i] = a;
      square += a * (norm * a - 2 * projection);
      if (a > 0 && truth > 0) square += precision * std::pow(std::log(a / truth), 2);
    }
    // The squared distance of the roots is about a quarter of `square`.
    if (0.25 * square > kEstimate * limit) continue;
    const Eigen::VectorXd roots = roots_of(test, fit, k, amplitude);
    if (roots.squaredNorm() > limit) continue;
    result.index.push_back(k);
    columns.push_back(roots);
  }
  result.roots = Eigen::MatrixXd::Zero(features_, static_cast<Eigen::Index>(columns.size()) + 1);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    result.roots.col(static_cast<Eigen::Index>(i) + 1) = columns[i];
  }
  return result;
}

}  // namespace blindcorner
