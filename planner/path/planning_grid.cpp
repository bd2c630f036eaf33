// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/planning_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/path/distance_transform.h"

namespace blindcorner {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// Overlap that counts as touching, which is no collision, m: well above the rounding of
/// single-precision clearances up to 10 m.
constexpr double kTouch = 1e-6;
/// Parts of a line shorter than this share of a cell are roundings at a cell's corner.
constexpr double kCorner = 1e-9;

void check_field(bool fine, const char* field, double value, const char* accepted) {
  if (fine) return;
  throw Error(std::string("PlanningGridOptions.") + field + " = " + std::to_string(value) +
              "; accepted: " + accepted);
}

/// The point of a cell's square that is nearest to a point (cells).
Eigen::Vector2d nearest_of_square(const Eigen::Vector2d& point, int column, int row) {
  return {std::clamp(point.x(), static_cast<double>(column), column + 1.0),
          std::clamp(point.y(), static_cast<double>(row), row + 1.0)};
}

}  // namespace

void PlanningGridOptions::validate() const {
  check_field(occupied_threshold > 0 && occupied_threshold <= 1, "occupied_threshold",
              occupied_threshold, "a probability > 0");
  check_field(unknown_occupancy >= 0 && unknown_occupancy <= 1, "unknown_occupancy",
              unknown_occupancy, "a probability");
  check_field(lethal_radius >= 0 && std::isfinite(lethal_radius), "lethal_radius", lethal_radius,
              "a number of metres >= 0");
  check_field(risk_radius >= 0 && std::isfinite(risk_radius), "risk_radius", risk_radius,
              "a number of metres >= 0");
  check_field(risk_weight >= 0 && std::isfinite(risk_weight), "risk_weight", risk_weight,
              "a number >= 0");
}

PlanningGrid::PlanningGrid(const GridGeometry& geometry, std::span<const double> occupancy,
                           const PlanningGridOptions& options)
    : geometry_(geometry), options_(options) {
  geometry.validate();
  options.validate();
  if (occupancy.size() != geometry.cells()) {
    throw Error("occupancy", "found " + std::to_string(occupancy.size()) +
                                 " values, accepted: one per cell, " +
                                 std::to_string(geometry.cells()));
  }
  std::vector<double> known(occupancy.begin(), occupancy.end());
  obstacle_.resize(known.size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (std::isnan(known[i])) known[i] = options.unknown_occupancy;
    if (!(known[i] >= 0 && known[i] <= 1)) {
      throw Error("occupancy", "found " + std::to_string(known[i]) + " in cell " +
                                   std::to_string(i) + ", accepted: probabilities");
    }
    obstacle_[i] = known[i] >= options.occupied_threshold ? 1 : 0;
  }
  measure_clearance();
  set_cost_factors(known);
  find_steps();
}

PlanningGrid PlanningGrid::with_lethal_radius(double radius) const {
  PlanningGrid grid = *this;
  grid.options_.lethal_radius = radius;
  grid.options_.validate();
  grid.find_steps();
  return grid;
}

void PlanningGrid::measure_clearance() {
  const std::vector<double> squared = squared_distances(geometry_, obstacle_);
  clearance_.resize(squared.size());
  for (std::size_t i = 0; i < squared.size(); ++i) {
    double cells = std::sqrt(squared[i]);
    if (options_.closed_border) {
      const Cell cell = geometry_.cell(i);
      const int to_side = std::min({cell.column, cell.row, geometry_.columns - 1 - cell.column,
                                    geometry_.rows - 1 - cell.row});
      cells = std::min(cells, to_side + 0.5);
    }
    clearance_[i] = static_cast<float>(cells * geometry_.cell_size);
  }
}

void PlanningGrid::set_cost_factors(std::span<const double> occupancy) {
  cost_factor_.assign(occupancy.size(), 1.0F);
  if (options_.risk_weight == 0) return;
  const double radius = options_.risk_radius / geometry_.cell_size;  // cells
  std::vector<double> risk(occupancy.begin(), occupancy.end());
  if (radius > 0) {
    for (double& value : risk) value = value > 0 ? -value * radius * radius : kNever;
    risk = lowered_by_parabolas(geometry_, risk);
    for (double& value : risk) value = std::clamp(-value / (radius * radius), 0.0, 1.0);
  }
  for (std::size_t i = 0; i < risk.size(); ++i) {
    cost_factor_[i] = static_cast<float>(1 + options_.risk_weight * risk[i]);
  }
}

void PlanningGrid::find_steps() {
  const auto lethal = static_cast<float>(options_.lethal_radius - kTouch);
  traversable_.resize(geometry_.cells());
  float least = std::numeric_limits<float>::infinity(), greatest = 1;
  for (std::size_t i = 0; i < traversable_.size(); ++i) {
    traversable_[i] = obstacle_[i] == 0 && clearance_[i] >= lethal ? 1 : 0;
    if (traversable_[i] == 0) continue;
    least = std::min(least, cost_factor_[i]);
    greatest = std::max(greatest, cost_factor_[i]);
  }
  least_cost_factor_ = std::isfinite(least) ? least : 1;
  greatest_cost_factor_ = greatest;
  steps_.assign(geometry_.cells(), 0);
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    if (traversable_[i] == 0) continue;
    const Cell cell = geometry_.cell(i);
    unsigned free = 0;  // bit k: the neighbour that step k leads to is traversable
    for (std::size_t k = 0; k < kSteps; ++k) {
      const bool open = is_traversable(cell.column + kStepColumns[k], cell.row + kStepRows[k]);
      free |= open ? 1U << k : 0U;
    }
    // A diagonal step k also needs both k - 1 and k + 1, around the circle.
    constexpr unsigned kStraight = 0b01010101;
    const unsigned before = free << 1U | free >> 7U, after = free >> 1U | free << 7U;
    steps_[i] = static_cast<std::uint8_t>(free & (kStraight | (before & after)));
  }
}

bool PlanningGrid::is_traversable(int column, int row) const { return traversable({column, row}); }

bool PlanningGrid::traversable(const Cell& cell) const {
  return geometry_.contains(cell) && traversable_[geometry_.index(cell)] != 0;
}

std::optional<Eigen::Vector2d> PlanningGrid::nearest_obstacle(const Eigen::Vector2d& point,
                                                              double farthest) const {
  const Eigen::Vector2d at = (point - geometry_.origin) / geometry_.cell_size;  // cells
  double least = std::pow(farthest / geometry_.cell_size, 2);
  std::optional<Eigen::Vector2d> nearest;
  const auto consider = [&](const Eigen::Vector2d& candidate) {
    const double distance = (candidate - at).squaredNorm();
    if (distance > least) return;
    least = distance;
    nearest = candidate;  // cells
  };
  const Eigen::Vector2d reach = Eigen::Vector2d::Constant(farthest);
  const Cell first = geometry_.cell_at(point - reach), last = geometry_.cell_at(point + reach);
  const int first_column = std::max(first.column, 0);
  const int last_column = std::min(last.column, geometry_.columns - 1);
  for (int row = std::max(first.row, 0); row <= std::min(last.row, geometry_.rows - 1); ++row) {
    const double beside = at.y() - std::clamp(at.y(), static_cast<double>(row), row + 1.0);
    if (beside * beside > least) continue;
    const std::uint8_t* obstacles = &obstacle_[geometry_.index({0, row})];
    for (int column = first_column; column <= last_column; ++column) {
      if (obstacles[column] != 0) consider(nearest_of_square(at, column, row));
    }
  }
  if (options_.closed_border) {
    consider({at.x() < 0.5 * geometry_.columns ? std::min(at.x(), 0.0)
                                               : std::max<double>(at.x(), geometry_.columns),
              at.y()});
    consider({at.x(), at.y() < 0.5 * geometry_.rows ? std::min(at.y(), 0.0)
                                                    : std::max<double>(at.y(), geometry_.rows)});
  }
  if (nearest) nearest = geometry_.origin + geometry_.cell_size * *nearest;
  return nearest;
}

bool PlanningGrid::disc_is_free(const Eigen::Vector2d& center, double radius) const {
  const Cell cell = geometry_.cell_at(center);
  if (geometry_.contains(cell)) {
    const std::size_t index = geometry_.index(cell);
    if (obstacle_[index] != 0) return false;
    if (radius == 0) return true;
    // The clearance changes by at most the distance from the cell's centre.
    const double offset = (center - geometry_.center(cell)).norm();
    if (clearance_[index] - offset >= radius - kTouch) return true;
    if (clearance_[index] + offset < radius - 2 * kTouch) return false;
  } else if (options_.closed_border) {
    return false;
  }
  return radius < kTouch || !reaches_obstacle(center, radius - kTouch);
}

/// Whether a disc touches an obstacle's square, or a closed border.
bool PlanningGrid::reaches_obstacle(const Eigen::Vector2d& center, double radius) const {
  const Eigen::Vector2d at = (center - geometry_.origin) / geometry_.cell_size;  // cells
  const double reach = radius / geometry_.cell_size;
  if (options_.closed_border &&
      std::min({at.x(), at.y(), geometry_.columns - at.x(), geometry_.rows - at.y()}) <= reach) {
    return true;
  }
  const auto cell_of = [](double place, int cells) {
    if (place >= cells) return cells;
    return place > -1 ? static_cast<int>(std::floor(place)) : -1;  // not a number: no cell
  };
  const int first_row = std::max(0, cell_of(at.y() - reach, geometry_.rows));
  const int last_row = std::min(geometry_.rows - 1, cell_of(at.y() + reach, geometry_.rows));
  for (int row = first_row; row <= last_row; ++row) {
    const double beside = at.y() - std::clamp(at.y(), static_cast<double>(row), row + 1.0);
    const double half = std::sqrt(std::max(0.0, reach * reach - beside * beside));
    const int first = std::max(0, cell_of(at.x() - half, geometry_.columns));
    const int last = std::min(geometry_.columns - 1, cell_of(at.x() + half, geometry_.columns));
    const std::uint8_t* obstacles = &obstacle_[geometry_.index({0, row})];
    if (std::any_of(obstacles + first, obstacles + last + 1,
                    [](std::uint8_t obstacle) { return obstacle != 0; })) {
      return true;
    }
  }
  return false;
}

bool PlanningGrid::is_free(const VehicleFootprint& footprint, const PlanarPose& pose) const {
  const Cell cell = geometry_.cell_at(pose.position);
  if (!geometry_.contains(cell)) return false;
  const double offset = (pose.position - geometry_.center(cell)).norm();
  if (clearance_[geometry_.index(cell)] - offset >= footprint.circumscribed_radius() &&
      footprint.disc_radius() > 0) {
    return true;
  }
  const Eigen::Vector2d ahead(std::cos(pose.heading), std::sin(pose.heading));
  return std::ranges::all_of(footprint.disc_offsets(), [&](double distance) {
    return disc_is_free(pose.position + distance * ahead, footprint.disc_radius());
  });
}

std::vector<double> PlanningGrid::overlaps(const VehicleFootprint& footprint,
                                           const PlanarPose& pose) const {
  const double radius = footprint.disc_radius();
  const Eigen::Vector2d ahead(std::cos(pose.heading), std::sin(pose.heading));
  std::vector<double> depths;
  for (const double offset : footprint.disc_offsets()) {
    const Eigen::Vector2d center = pose.position + offset * ahead;
    const auto nearest = nearest_obstacle(center, radius);
    depths.push_back(nearest ? radius - (*nearest - center).norm() : 0.0);
  }
  return depths;
}

double PlanningGrid::line_cost(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
  // Traversal of the cells in the order of the line (Amanatides & Woo 1987); t from 0 to 1.
  const Eigen::Vector2d begin = (from - geometry_.origin) / geometry_.cell_size;
  const Eigen::Vector2d line = (to - from) / geometry_.cell_size;
  Cell cell = geometry_.cell_at(from);
  const Cell end = geometry_.cell_at(to);
  const auto next_side = [](double place, double speed, int index, double t) {
    if (speed == 0) return kNever;
    return std::max(t, (index + (speed > 0 ? 1 : 0) - place) / speed);
  };
  const int right = line.x() > 0 ? 1 : -1, up = line.y() > 0 ? 1 : -1;
  const double length = line.norm();
  double t = 0, sum = 0;
  const int crossings = std::abs(end.column - cell.column) + std::abs(end.row - cell.row);
  for (int crossed = 0;; ++crossed) {
    if (!traversable(cell)) return kNever;
    const double factor = cost_factor_[geometry_.index(cell)];
    if (crossed >= crossings) return geometry_.cell_size * (sum + (1 - t) * length * factor);
    const double t_x =
        cell.column == end.column ? kNever : next_side(begin.x(), line.x(), cell.column, t);
    const double t_y = cell.row == end.row ? kNever : next_side(begin.y(), line.y(), cell.row, t);
    const double t_next = std::min({t_x, t_y, 1.0});
    sum += (t_next - t) * length * factor;
    t = t_next;
    if (std::abs(t_x - t_y) * length <= kCorner) {  // through a corner
      if (!is_traversable(cell.column + right, cell.row) ||
          !is_traversable(cell.column, cell.row + up)) {
        return kNever;
      }
      cell = {cell.column + right, cell.row + up};
      ++crossed;
    } else if (t_x < t_y) {
      cell.column += right;
    } else {
      cell.row += up;
    }
  }
}

}  // namespace blindcorner
