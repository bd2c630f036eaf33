// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/light_slope.h"

#include <algorithm>

#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// From this number of rows on, the light for one unknown takes tenths of a millisecond and is
/// worth a task of its own. A model's light always is.
constexpr int kManyRows = 4000;

}  // namespace

void light_slope(const PoseObjective& objective, const LightSource& source, const PoseVector& pose,
                 const ShapeBuffer& here, Differences differences, Eigen::Index unknown,
                 Eigen::Ref<Eigen::VectorXd> column) {
  thread_local ShapeBuffer light;
  const Unknown& of = objective.compiled().scene.unknowns[static_cast<std::size_t>(unknown)];
  const double step = step_within(objective.compiled(), pose, unknown);
  PoseVector moved = pose;
  moved[unknown] += step;
  const double up = moved[unknown];
  objective.shapes(source, moved, light);
  column = light_of(light);
  if (differences == Differences::one_sided) {
    column = (column - light_of(here)) / step;
    return;
  }
  double down = pose[unknown] - step;
  // Sizes must stay positive.
  if (of.component == Component::size) down = std::max(down, 0.5 * of.lower);
  moved[unknown] = down;
  objective.shapes(source, moved, light);
  column = (column - light_of(light)) / (up - down);
}

void light_slope(const PoseObjective& objective, const LightSource& source, const PoseVector& pose,
                 const ShapeBuffer& here, Differences differences, Eigen::MatrixXd& slope) {
  slope.resize(objective.rows(), pose.size());
  const auto column = [&](Eigen::Index i) {
    light_slope(objective, source, pose, here, differences, i, slope.col(i));
  };
  if (objective.rows() < kManyRows && source.models == nullptr) {
    for (Eigen::Index i = 0; i < pose.size(); ++i) column(i);
    return;
  }
  parallel_for(Eigen::Index{0}, pose.size(), column);
}

Eigen::MatrixXd light_slope(const PoseObjective& objective, const LightSource& source,
                            const PoseVector& pose) {
  ShapeBuffer here;
  objective.shapes(source, pose, here);
  Eigen::MatrixXd slope;
  light_slope(objective, source, pose, here, Differences::one_sided, slope);
  return slope;
}

}  // namespace blindcorner
