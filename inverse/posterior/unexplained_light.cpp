// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/unexplained_light.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <cstdio>
#include <vector>

#include "inverse/likelihood/light_slope.h"
#include "inverse/posterior/fisher_information.h"

namespace blindcorner {
namespace {

/// Number of places whose light is looked for. Sixteen tell as much as 144: a pulse in a few zones
/// has some six degrees of freedom.
constexpr std::size_t kLookedFor = 24;
/// Fractional part of the golden ratio. Its multiples, modulo one, choose places that are spread
/// evenly.
constexpr double kGolden = 0.61803398874989485;
/// A direction is not tested if the fitted unknowns explain all but this share of its light, a
/// hundredth in amplitude: errors of differences are of that order.
constexpr double kMinUnexplained = 1e-4;
/// Relative step of an object's size, up and down. By judgement: only the direction of the change
/// in light matters, and it is the same for all sizes that are about as far off.
constexpr double kSizeStep = 0.1;
/// Most bins and zones over which errors of the static background go together, as
/// StaticBackgroundModel measures it: 15 (robot_corridor), 36 (tmf8828_wall), 40 (street_corner).
constexpr double kMaxTogether = 40;

/// [rows, places] Light of scored poses all over the search region. If there are several objects,
/// each pose has one of them alone.
Eigen::MatrixXd light_of_places(const CompiledScene& compiled, int rows) {
  std::vector<const Templates*> sets;
  for (const CompiledScene::ObjectGrid& object : compiled.objects()) {
    sets.push_back(&object.templates);
  }
  if (sets.empty()) sets.push_back(&compiled.templates());
  const std::size_t each = std::max<std::size_t>(1, kLookedFor / sets.size());
  std::vector<Eigen::VectorXf> columns;
  for (const Templates* set : sets) {
    const std::size_t count = std::min(each, set->poses());
    for (std::size_t k = 0; k < count; ++k) {
      const double share = std::fmod(kGolden * static_cast<double>(k + 1), 1.0);
      const auto pose = static_cast<std::size_t>(share * static_cast<double>(set->poses()));
      columns.emplace_back(Eigen::VectorXf::Zero(rows));
      set->add(pose, 1, columns.back());
    }
  }
  Eigen::MatrixXd light(rows, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    light.col(static_cast<Eigen::Index>(k)) = columns[k].cast<double>();
  }
  return light;
}

/// [rows, objects] What closed-form light gains if an object of known size grows. No columns
/// without such light.
Eigen::MatrixXd light_of_size(const PoseObjective& objective, const PoseVector& pose) {
  const CompiledScene& compiled = objective.compiled();
  const Scene& scene = compiled.scene;
  Eigen::MatrixXd gain(objective.rows(), 0);
  if (compiled.coarse.empty()) return gain;
  const std::vector<Placement> stated = placements_at(scene, pose);
  SparseLight light;
  for (std::size_t object = 0; object < stated.size(); ++object) {
    const bool fitted = std::ranges::any_of(scene.unknowns, [&](const Unknown& u) {
      return u.component == Component::size && u.object == static_cast<int>(object);
    });
    if (fitted) continue;
    gain.conservativeResize(Eigen::NoChange, gain.cols() + 1);
    auto column = gain.rightCols(1);
    column.setZero();
    for (const double sign : {-1.0, 1.0}) {
      std::vector<Placement> changed = stated;
      changed[object].size *= 1 + sign * kSizeStep;
      std::size_t rendered = compiled.coarse.size();
      Eigen::Index row = 0;
      for (const ObservedZone& zone : objective.solver().observation().zones) {
        const auto capture = static_cast<std::size_t>(zone.capture);
        if (rendered != capture) compiled.coarse[capture].three_bounce(changed, 0, light);
        rendered = capture;
        const double* counts = light.cube.zone(zone.zone) + zone.first;
        for (int k = 0; k < zone.bins(); ++k) column(row++, 0) += sign * zone.gain * counts[k];
      }
    }
  }
  return gain;
}

/// [directions] Factor on the variance of each score for the static background's own error. The
/// error goes together from bin to bin, but the likelihood's weights treat the bins' errors as
/// independent.
Eigen::VectorXd spread_of(const PoseObjective& objective, const ShapeBuffer& at,
                          const LinearSolution& linear, const Eigen::MatrixXd& light) {
  const LinearSolver& solver = objective.solver();
  Eigen::VectorXd photons = Eigen::VectorXd::Constant(light.cols(), 1e-300), all = photons;
  Eigen::Index row = 0;
  for (std::size_t z = 0; z < solver.observation().zones.size(); ++z) {
    const ObservedZone& zone = solver.observation().zones[z];
    const BinLikelihood& noise_model = solver.observation().noise_model(zone);
    std::vector<double> mean(zone.counts.size());
    solver.expected(zone, at.shapes[z], linear.amplitude[z], linear.ambient[z], linear.direct[z],
                    mean.data());
    for (int k = 0; k < zone.bins(); ++k, ++row) {
      const double weight = zone.weight_of(k);
      const double m = mean[static_cast<std::size_t>(k)];
      const double one = weight * noise_model.information(m);
      const double together = weight + (1 - weight) * kMaxTogether;
      for (Eigen::Index q = 0; q < light.cols(); ++q) {
        const double square = one * light(row, q) * light(row, q);
        photons[q] += square;
        all[q] += square * together;
      }
    }
  }
  return all.cwiseQuotient(photons).cwiseMax(1.0);
}

}  // namespace

ScoreTest score_test(const Eigen::VectorXd& score, const Eigen::MatrixXd& information,
                     const Eigen::VectorXd& spread) {
  ScoreTest test;
  if (score.size() == 0) return test;
  const Eigen::VectorXd variance = information.diagonal().cwiseProduct(spread);
  const double sum = score.cwiseAbs2().cwiseQuotient(variance).sum();
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() * information * scale.asDiagonal();
  const auto mean = static_cast<double>(score.size());
  const double squares = correlation.squaredNorm();
  if (!std::isfinite(sum) || !(squares > 0)) return test;
  // factor * chi-square of `freedom`: mean factor * freedom, variance 2 factor^2 freedom.
  test.freedom = mean * mean / squares;
  const double factor = mean / test.freedom;
  test.probability = boost::math::cdf(
      boost::math::complement(boost::math::chi_squared(test.freedom), sum / factor));
  return test;
}

double UnexplainedLight::probability() const {
  return std::min(1.0, 2 * std::min(elsewhere.probability, size.probability));
}

UnexplainedLight unexplained_light(const PoseObjective& objective, const Refined& optimum) {
  const LightSource source = light_near(objective, optimum);
  ShapeBuffer at;
  objective.shapes(source, optimum.pose, at);
  const Eigen::MatrixXd places = light_of_places(objective.compiled(), objective.rows());
  const Eigen::MatrixXd size = light_of_size(objective, optimum.pose);
  const Eigen::MatrixXd slope =
      optimum.slope.size() > 0 ? optimum.slope : light_slope(objective, source, optimum.pose);
  // Columns: the directions, the pose and, where all zones share it, the brightness.
  const bool shared = objective.solver().unknowns().amplitude == LinearMode::shared;
  const Eigen::Index k = places.cols() + size.cols(), n = slope.cols() + (shared ? 1 : 0);
  Eigen::MatrixXd columns(objective.rows(), k + n);
  columns.leftCols(places.cols()) = places;
  columns.middleCols(places.cols(), size.cols()) = size;
  columns.middleCols(k, slope.cols()) = slope;
  if (shared) columns.rightCols(1) = light_of(at);
  Eigen::VectorXd gradient;
  Eigen::MatrixXd total =
      fisher_information(objective.solver(), at.shapes, optimum.linear, columns, &gradient);
  const Eigen::VectorXd own = total.diagonal().head(k);
  Eigen::MatrixXd fitted = total.bottomRightCorner(n, n);
  fitted.diagonal() *= 1 + 1e-9;
  fitted.diagonal().array() += 1e-300;
  const Eigen::MatrixXd taken = fitted.ldlt().solve(total.bottomLeftCorner(n, k));
  const Eigen::VectorXd score = gradient.head(k) - taken.transpose() * gradient.tail(n);
  const Eigen::MatrixXd left = total.topLeftCorner(k, k) - total.topRightCorner(k, n) * taken;
  const Eigen::VectorXd spread = spread_of(objective, at, optimum.linear, columns.leftCols(k));
  const auto test = [&](Eigen::Index begin, Eigen::Index end) {
    std::vector<Eigen::Index> seen;
    for (Eigen::Index q = begin; q < end; ++q) {
      if (own[q] > 0 && left(q, q) > kMinUnexplained * own[q]) seen.push_back(q);
    }
    return score_test(score(seen), left(seen, seen), spread(seen));
  };
  return {test(0, places.cols()), test(places.cols(), k)};
}

std::string unexplained_hint(double probability) {
  char text[16];
  std::snprintf(text, sizeof text, "%.2g", probability);
  return std::string("Some light is where this fit does not expect it (probability ") + text +
         " if the scene were right): the object's size may not be as stated, more than one object "
         "may be there, or the known surfaces are a little off. The pose may then be farther off "
         "than its uncertainty says.";
}

}  // namespace blindcorner
