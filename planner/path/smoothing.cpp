// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/smoothing.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "planner/path/least_curved.h"
#include "planner/path/spline.h"

namespace blindcorner {
namespace {

/// Weight of points that stay where they are, against second differences' weight of 1.
constexpr double kFixed = 1e8;
/// Weight at which the curve follows its targets to a few per cent of their spacing.
constexpr double kStiff = 100;
/// A corner of angle a between long straight lines, flattened with weights (h / s)^4 (h: distance
/// of control points, s: the curve's scale), has the curvature a / (2 sqrt(2) s): Green's function
/// of s^4 p'''' + p. This is s over the turning radius for a right angle.
constexpr double kScaleOfRadius = 0.5554;
/// And at the corner the curvature changes by a / (2 s^2) along the curve: of this over the root of
/// the rate that the steering can follow, for a right angle.
constexpr double kScaleOfRate = 0.8862;
/// Without a turning radius corners are rounded over so many cells.
constexpr double kScaleOfCell = 2;
/// Factors by which weights change in a round, and what a push is multiplied with (the curve gives
/// way by less than its targets). Larger ones overshoot, smaller ones take more rounds.
constexpr double kLoosen = 0.6, kTighten = 1.5, kPush = 2;
/// After so many rounds targets are spaced evenly along the curve, which is shorter than the lines
/// that they come from: else they crowd in its bends.
constexpr int kSpacingRounds = 10;
/// Collisions and curvature are looked at so often per cell. Between two such places a disc of the
/// radius of a cell reaches 1/500 of a cell into a corner at most.
constexpr double kSamplesPerCell = 8;
/// Rounds after which a curve that is fine but riskier than it must be is taken.
constexpr int kRiskRounds = 8;
/// Of the rounds in which the waypoints are followed again where nothing else helps.
constexpr int kStiffRounds = 10;
/// Parts of a curve that are looked at side by side; what is found does not depend on it.
constexpr std::size_t kParts = 4;
/// Distances are known up to so many cells beyond what the footprint needs.
constexpr double kClearanceCells = 4;
/// As many control points as in the rounds, and then twice as many.
constexpr int kLevels = 2;
/// Cells kept from obstacles: more where distances between cells' centres were taken too far.
constexpr std::array kMargins{0.25, 0.75};
/// A curve may be that much riskier than the waypoints beside it.
constexpr double kMoreRisk = 0.1;
/// Curvature above the limit by this share is rounding.
constexpr double kCurvatureRounding = 1e-3;
/// The rate of it may be above by this share: who follows a path steers a little earlier or later.
constexpr double kRateMargin = 0.05;

/// Of a whole curve, at its sampled poses.
struct CurveCheck {
  int collisions = 0;             ///< poses that touch an obstacle
  double greatest_curvature = 0;  ///< 1/m
  double excess = 0;              ///< greatest curvature, or rate of it, over what the vehicle can

  void add(const CurveCheck& next) {
    collisions += next.collisions;
    greatest_curvature = std::max(greatest_curvature, next.greatest_curvature);
    excess = std::max(excess, next.excess);
  }
};

/// What is wrong at one of them.
struct PlaceFaults {
  bool tight = false, collides = false;
};

/// What is wrong near each control point.
struct Review : CurveCheck {
  std::vector<Eigen::Vector2d> push;         ///< m, away from obstacles
  std::vector<bool> collides, tight, risky;  ///< [control point]
  bool any_risky = false;

  explicit Review(std::size_t points)
      : push(points, Eigen::Vector2d::Zero()),
        collides(points, false),
        tight(points, false),
        risky(points, false) {}

  void take_push(std::size_t point, const Eigen::Vector2d& other) {
    if (other.norm() > push[point].norm()) push[point] = other;
  }
  /// What is found in the part of the curve after this one.
  void add(const Review& next) {
    CurveCheck::add(next);
    for (std::size_t i = 0; i < push.size(); ++i) {
      take_push(i, next.push[i]);
      collides[i] = collides[i] || next.collides[i];
      tight[i] = tight[i] || next.tight[i];
      risky[i] = risky[i] || next.risky[i];
    }
    any_risky = any_risky || next.any_risky;
  }
};

/// Parts that a piece is cut into, so that none is longer than `spacing`.
std::size_t samples_of(const CubicBezier& piece, double spacing) {
  return std::max<std::size_t>(
      1, static_cast<std::size_t>(std::ceil(polyline_length(piece.control) / spacing)));
}

/// The shorter way round from one heading to another, rad.
double turn_between(double from, double to) {
  const double turn = to - from;
  return std::abs(turn) < kPi ? turn : std::remainder(turn, 2 * kPi);
}

/// A place of a piece of a curve.
struct PlaceOnCurve {
  Eigen::Vector2d position;  ///< m
  double heading = 0;        ///< rad
  double curvature = 0;      ///< 1/m, left is positive
};

PlaceOnCurve place_on_curve(const CubicBezier& piece, double t) {
  return {piece.point(t), piece.heading(t), piece.curvature(t)};
}

/// Calls `visit(found, piece, t, place, place before it)` at places of each piece at most `spacing`
/// apart, the first of which is its own place before, and returns what is found along all of them.
/// Parts of the curve begin with `nothing` and are added up in their order.
template <typename Found, typename Visit>
Found look_along(std::span<const CubicBezier> pieces, double spacing, const Found& nothing,
                 const Visit& visit) {
  std::vector<Found> found(kParts, nothing);
  // Isolated: another path, begun by whoever waits here, would delay this one.
  tbb::this_task_arena::isolate([&] {
    tbb::parallel_for(std::size_t{0}, kParts, [&](std::size_t part) {
      const std::size_t end = (part + 1) * pieces.size() / kParts;
      for (std::size_t k = part * pieces.size() / kParts; k < end; ++k) {
        const auto samples = static_cast<double>(samples_of(pieces[k], spacing));
        PlaceOnCurve before = place_on_curve(pieces[k], 0);
        visit(found[part], k, 0.0, before, before);
        for (double i = 1; i <= samples; ++i) {
          const PlaceOnCurve here = place_on_curve(pieces[k], i / samples);
          visit(found[part], k, i / samples, here, before);
          before = here;
        }
      }
    });
  });
  for (std::size_t part = 1; part < kParts; ++part) found[0].add(found[part]);
  return std::move(found[0]);
}

/// Curvature at a place, 1/m. A curve that turns back on itself has none between two places, but
/// opposite headings at them.
double curvature_at(const PlaceOnCurve& here, const PlaceOnCurve& before) {
  const double curvature = std::abs(here.curvature);
  const double turn = std::abs(turn_between(before.heading, here.heading));
  if (turn < 0.5 * kPi) return curvature;
  const double chord = (here.position - before.position).norm();
  return chord > 0 ? std::max(curvature, turn / chord) : std::numeric_limits<double>::infinity();
}

/// A curvature, or the rate at which it changes from one place to the next, over what the vehicle
/// can; 0 where it can turn on the spot.
double excess_at(const PlaceOnCurve& here, const PlaceOnCurve& before, double curvature,
                 const SmoothingOptions& options) {
  const double tight = options.min_turning_radius * curvature;
  const double length = (here.position - before.position).norm();
  if (options.max_curvature_rate == 0 || length == 0) return tight;
  const double rate = std::abs(here.curvature - before.curvature) / length;
  return std::max(tight, rate / ((1 + kRateMargin) * options.max_curvature_rate));
}

bool exceeds(double excess) { return excess > 1 + kCurvatureRounding; }

class Smoother {
 public:
  Smoother(const PlanningGrid& grid, std::span<const Eigen::Vector2d> waypoints,
           const PathEnds& ends, const SmoothingOptions& options);

  /// Pieces of the curve; sets the flags that say what is wrong with it.
  std::vector<CubicBezier> run(PathFlags& flags);
  double greatest_curvature() const { return greatest_curvature_; }  ///< of the curve, 1/m

 private:
  bool solve_in_rounds();
  void solve_at_once();
  void keep_if_better(const std::vector<CubicBezier>& pieces, const CurveCheck& found);
  CurveCheck check(std::span<const CubicBezier> pieces) const;
  PlaceFaults add_place(const PlaceOnCurve& here, const PlaceOnCurve& before,
                        CurveCheck& curve) const;
  void follow_waypoints_where_wrong();
  void solve();
  Review review() const;
  void review_place(std::size_t index, double t, const PlaceOnCurve& here,
                    const PlaceOnCurve& before, Review& review) const;
  void space_targets(std::span<const Eigen::Vector2d> along);
  void adapt(const Review& review);
  bool fixed(std::size_t i) const { return weights_[i] >= kFixed; }
  double cost_factor(const Eigen::Vector2d& point) const;

  const PlanningGrid& grid_;
  const SmoothingOptions& options_;
  std::vector<Eigen::Vector2d> waypoints_;  ///< evenly spaced
  double spacing_ = 0;                      ///< of control points, m
  double first_weight_ = 0;
  Eigen::Vector2d bend_ = {0, 0};  ///< m, start_bend of spline_pieces
  std::vector<Eigen::Vector2d> targets_, control_;
  std::vector<double> weights_;
  std::vector<double> most_risk_;  ///< cost factor allowed at each control point
  std::vector<CubicBezier> pieces_;
  double greatest_curvature_ = 0;
  std::vector<CubicBezier> best_;  ///< of the least excess that touches nothing; none: empty
  double least_excess_ = std::numeric_limits<double>::infinity();  ///< of best_
};

Smoother::Smoother(const PlanningGrid& grid, std::span<const Eigen::Vector2d> waypoints,
                   const PathEnds& ends, const SmoothingOptions& options)
    : grid_(grid), options_(options) {
  const double rate = options.max_curvature_rate;
  const double scale = std::max({kScaleOfRadius * options.min_turning_radius,
                                 rate > 0 ? kScaleOfRate / std::sqrt(rate) : 0.0,
                                 kScaleOfCell * grid.geometry().cell_size});
  const double length = polyline_length(waypoints);
  const auto count = static_cast<std::size_t>(std::max(4.0, std::ceil(2 * length / scale) + 1));
  waypoints_ = evenly_spaced(waypoints, count);
  spacing_ = length / static_cast<double>(count - 1);
  first_weight_ = std::pow(spacing_ / scale, 4);
  weights_.assign(count, first_weight_);
  targets_ = waypoints_;
  const auto fix = [&](std::size_t i, const Eigen::Vector2d& place) {
    targets_[i] = place;
    weights_[i] = kFixed;
  };
  const auto ahead = [&](double heading) -> Eigen::Vector2d {
    return spacing_ * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  };
  fix(0, waypoints.front());
  fix(count - 1, waypoints.back());
  if (ends.start_heading) {
    const double left = *ends.start_heading + 0.5 * kPi;
    bend_ = spacing_ * ends.start_curvature * ahead(left);
    fix(0, targets_[0] - bend_ / 6);
    fix(1, targets_[0] + ahead(*ends.start_heading) + bend_ / 2);
  }
  if (ends.goal_heading) fix(count - 2, waypoints.back() - ahead(*ends.goal_heading));
  for (std::size_t i = 0; i < count; ++i) {
    double most = 1;
    for (std::size_t k = i == 0 ? 0 : i - 1; k < std::min(i + 2, count); ++k) {
      most = std::max(most, cost_factor(waypoints_[k]));
    }
    most_risk_.push_back(most + kMoreRisk * grid.options().risk_weight);
  }
}

double Smoother::cost_factor(const Eigen::Vector2d& point) const {
  const Cell cell = grid_.geometry().cell_at(point);
  return grid_.geometry().contains(cell) ? grid_.cost_factor(grid_.geometry().index(cell)) : 1;
}

std::vector<CubicBezier> Smoother::run(PathFlags& flags) {
  if (!solve_in_rounds()) {
    solve_at_once();
    if (best_.empty()) {
      follow_waypoints_where_wrong();
      flags.partly_unsmoothed = true;
    } else {
      pieces_ = best_;
    }
  }
  const CurveCheck result = check(pieces_);
  greatest_curvature_ = result.greatest_curvature;
  flags.curvature_exceeded = exceeds(result.excess);
  flags.footprint_collides = result.collisions > 0;
  return pieces_;
}

/// Whether the curve is fine.
bool Smoother::solve_in_rounds() {
  for (int round = 0; round < options_.max_rounds; ++round) {
    solve();
    const Review found = review();
    if (found.collisions == 0 && !exceeds(found.excess) &&
        (!found.any_risky || round >= kRiskRounds)) {
      return true;
    }
    keep_if_better(pieces_, found);
    adapt(found);
    if ((round + 1) % kSpacingRounds == 0) space_targets(control_);
  }
  return false;
}

void Smoother::keep_if_better(const std::vector<CubicBezier>& pieces, const CurveCheck& found) {
  if (found.collisions > 0 || found.excess >= least_excess_) return;
  least_excess_ = found.excess;
  best_ = pieces;
}

/// Rounds move the curve by what is wrong here and there, and fail where a turn has to begin well
/// before the place that makes it tight. All that is asked of a curve is then asked at once: first
/// of as many control points, since a curve is moved as a whole by few of them, and then, if that
/// is not enough, of twice as many.
void Smoother::solve_at_once() {
  if (options_.min_turning_radius == 0) return;  // corners may be turned on the spot
  const double cell = grid_.geometry().cell_size;
  const std::vector<double> clearance =
      signed_clearance(grid_, options_.footprint.circumscribed_radius() + kClearanceCells * cell);
  std::vector<Eigen::Vector2d> control = waypoints_;
  for (std::size_t i = 0; i < control.size(); ++i) {
    if (fixed(i)) control[i] = targets_[i];
  }
  CurveLimits limits;
  limits.footprint = options_.footprint;
  limits.turning_radius = options_.min_turning_radius;
  limits.curvature_rate = options_.max_curvature_rate;
  limits.start_bend = bend_;
  limits.fixed_first = fixed(1) ? 2 : 1;
  limits.fixed_last = fixed(control.size() - 2) ? 2 : 1;
  for (int level = 0; level < kLevels; ++level) {
    if (level > 0) {
      control = subdivided(control, limits.start_bend);
      limits.start_bend /= 4;
    }
    for (const double margin : kMargins) {
      limits.margin = margin * cell;
      control = least_curved(grid_, clearance, control, limits);
      const std::vector<CubicBezier> pieces = spline_pieces(control, limits.start_bend);
      const CurveCheck found = check(pieces);
      keep_if_better(pieces, found);
      if (found.collisions == 0) break;
    }
    if (!exceeds(least_excess_)) return;
  }
}

void Smoother::follow_waypoints_where_wrong() {
  space_targets(waypoints_);
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    if (!fixed(i)) weights_[i] = first_weight_;
  }
  solve();
  for (int round = 0; round < kStiffRounds; ++round) {
    const Review found = review();
    if (found.collisions == 0) break;
    for (std::size_t i = 0; i < control_.size(); ++i) {
      if (!found.collides[i] || fixed(i)) continue;
      weights_[i] = kStiff;
    }
    solve();
  }
}

void Smoother::space_targets(std::span<const Eigen::Vector2d> along) {
  const std::vector<Eigen::Vector2d> spaced = evenly_spaced(along, targets_.size());
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    if (!fixed(i)) targets_[i] = spaced[i];
  }
}

void Smoother::solve() {
  control_ = flattened(targets_, weights_);
  for (std::size_t i = 0; i < control_.size(); ++i) {
    if (fixed(i)) control_[i] = targets_[i];
  }
  pieces_ = spline_pieces(control_, bend_);
}

CurveCheck Smoother::check(std::span<const CubicBezier> pieces) const {
  return look_along(
      pieces, grid_.geometry().cell_size / kSamplesPerCell, CurveCheck(),
      [&](CurveCheck& found, std::size_t /*piece*/, double /*t*/, const PlaceOnCurve& here,
          const PlaceOnCurve& before) { add_place(here, before, found); });
}

/// Takes a place into what is known of its curve.
PlaceFaults Smoother::add_place(const PlaceOnCurve& here, const PlaceOnCurve& before,
                                CurveCheck& curve) const {
  const double curvature = curvature_at(here, before);
  const double excess = excess_at(here, before, curvature, options_);
  const bool free = grid_.is_free(options_.footprint, {here.position, here.heading});
  curve.greatest_curvature = std::max(curve.greatest_curvature, curvature);
  curve.excess = std::max(curve.excess, excess);
  curve.collisions += free ? 0 : 1;
  return {exceeds(excess), !free};
}

Review Smoother::review() const {
  return look_along(pieces_, grid_.geometry().cell_size / kSamplesPerCell, Review(control_.size()),
                    [&](Review& found, std::size_t k, double t, const PlaceOnCurve& here,
                        const PlaceOnCurve& before) { review_place(k, t, here, before, found); });
}

void Smoother::review_place(std::size_t index, double t, const PlaceOnCurve& here,
                            const PlaceOnCurve& before, Review& review) const {
  const std::size_t nearest = index + (t < 0.5 ? 0 : 1);
  const PlaceFaults faults = add_place(here, before, review);
  if (faults.tight) review.tight[nearest] = true;
  if (cost_factor(here.position) > most_risk_[nearest])
    review.risky[nearest] = review.any_risky = true;

  if (!faults.collides) return;
  review.collides[index] = review.collides[index + 1] = true;
  const Eigen::Vector2d ahead(std::cos(here.heading), std::sin(here.heading));
  const double radius = options_.footprint.disc_radius();
  for (const double offset : options_.footprint.disc_offsets()) {
    const Eigen::Vector2d center = here.position + offset * ahead;
    if (grid_.disc_is_free(center, radius)) continue;
    // The control point that moves this disc most is the one beside it, not beside the vehicle.
    const double place = std::round(static_cast<double>(index) + t + offset / spacing_);
    const auto moved =
        static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(control_.size() - 1)));
    Eigen::Vector2d push = waypoints_[moved] - center;
    if (const auto obstacle = grid_.nearest_obstacle(center, radius)) {
      const Eigen::Vector2d away = center - *obstacle;
      const double margin = 0.25 * grid_.geometry().cell_size;
      if (away.norm() > 0) push = away.normalized() * (radius + margin - away.norm());
    }
    review.take_push(moved, push);
  }
}

void Smoother::adapt(const Review& review) {
  std::vector<bool> loosened(control_.size(), false);
  for (std::size_t i = 0; i < control_.size(); ++i) {
    if (!review.tight[i]) continue;
    for (std::size_t k = i < 2 ? 0 : i - 2; k < std::min(i + 3, control_.size()); ++k) {
      loosened[k] = true;
    }
  }
  for (std::size_t i = 0; i < control_.size(); ++i) {
    if (fixed(i)) continue;
    targets_[i] += kPush * review.push[i];
    if (loosened[i]) {
      weights_[i] *= kLoosen;
    } else if (review.risky[i]) {
      weights_[i] = std::min(kStiff, weights_[i] * kTighten);
    }
  }
}

std::vector<CubicBezier> straight_pieces(std::span<const Eigen::Vector2d> corners) {
  std::vector<CubicBezier> pieces;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    const Eigen::Vector2d &a = corners[i - 1], &b = corners[i];
    if (a == b) continue;
    pieces.push_back({{a, (2 * a + b) / 3, (a + 2 * b) / 3, b}});
  }
  return pieces;
}

bool touches_obstacle(const PlanningGrid& grid, const VehicleFootprint& footprint,
                      std::span<const PathPoint> points) {
  return std::ranges::any_of(points, [&](const PathPoint& point) {
    return !grid.is_free(footprint, {point.position, point.heading});
  });
}

/// Poses of a turn on the spot from one pose to the heading of the next, both left out. No part of
/// the vehicle moves by more than `spacing` between two of them.
void add_turn(const PathPoint& from, double heading, double reach, double spacing,
              std::vector<PathPoint>& poses) {
  const PathPoint start = from;  // which may be one of `poses`, and these move as they grow
  const double turn = turn_between(start.heading, heading);
  const auto steps = static_cast<int>(std::ceil(std::abs(turn) * reach / spacing));
  for (int i = 1; i < steps; ++i) {
    PathPoint pose = start;
    pose.heading += turn * i / steps;
    poses.push_back(pose);
  }
}

/// Greatest turn of straight lines that are to be driven one after the other, from and to the
/// headings that are given, rad.
double greatest_turn(std::span<const CubicBezier> lines, const PathEnds& ends) {
  double most = 0;
  std::optional<double> before = ends.start_heading;
  const auto turn_to = [&](double heading) {
    if (before) most = std::max(most, std::abs(turn_between(*before, heading)));
    before = heading;
  };
  for (const CubicBezier& line : lines) turn_to(line.heading(0));
  if (ends.goal_heading) turn_to(*ends.goal_heading);
  return most;
}

/// Points at most `spacing` apart. A corner between two pieces is turned within `spacing`, and
/// nothing is tighter than a turn back within it: no curvature is infinite, and the turn's integral
/// over the two neighbouring points is its angle.
std::vector<PathPoint> points_of(std::span<const CubicBezier> pieces, double spacing) {
  const double tightest = kPi / spacing;
  const auto point = [&](const CubicBezier& piece, double t, double arc_length) {
    return PathPoint{piece.point(t), piece.heading(t),
                     std::clamp(piece.curvature(t), -tightest, tightest), arc_length};
  };
  std::vector<PathPoint> points{point(pieces.front(), 0, 0)};
  double heading = pieces.front().heading(0);
  for (const CubicBezier& piece : pieces) {
    const double turn = turn_between(heading, piece.heading(0)) / spacing;
    if (std::abs(turn) > std::abs(points.back().curvature)) points.back().curvature = turn;
    const std::size_t samples = samples_of(piece, spacing);
    for (std::size_t i = 1; i <= samples; ++i) {
      const double before = static_cast<double>(i - 1) / static_cast<double>(samples);
      const double t = static_cast<double>(i) / static_cast<double>(samples);
      const double length = piece.length(before, t);
      if (length > 0) points.push_back(point(piece, t, points.back().arc_length + length));
    }
    heading = piece.heading(1);
  }
  return points;
}

double cost_of(const PlanningGrid& grid, std::span<const PathPoint> points) {
  double cost = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Eigen::Vector2d middle = 0.5 * (points[i - 1].position + points[i].position);
    const Cell cell = grid.geometry().cell_at(middle);
    const double factor =
        grid.geometry().contains(cell) ? grid.cost_factor(grid.geometry().index(cell)) : 1;
    cost += factor * (points[i].arc_length - points[i - 1].arc_length);
  }
  return cost;
}

}  // namespace

void SmoothingOptions::validate() const {
  if (!(min_turning_radius >= 0) || !std::isfinite(min_turning_radius)) {
    throw Error("SmoothingOptions.min_turning_radius = " + std::to_string(min_turning_radius) +
                "; accepted: a number of metres >= 0");
  }
  if (!(point_spacing >= 0) || !std::isfinite(point_spacing)) {
    throw Error("SmoothingOptions.point_spacing = " + std::to_string(point_spacing) +
                "; accepted: a number of metres >= 0");
  }
  if (!(max_curvature_rate >= 0) || !std::isfinite(max_curvature_rate)) {
    throw Error("SmoothingOptions.max_curvature_rate = " + std::to_string(max_curvature_rate) +
                "; accepted: a number of 1/m^2 >= 0");
  }
  if (max_rounds < 1) {
    throw Error("SmoothingOptions.max_rounds = " + std::to_string(max_rounds) +
                "; accepted: 1 or more");
  }
}

std::vector<PathPoint> checked_poses(const PlanningGrid& grid, const Path& path,
                                     const PathEnds& ends, const VehicleFootprint& footprint) {
  const double spacing = grid.geometry().cell_size / kSamplesPerCell;
  const double reach = footprint.circumscribed_radius();
  std::vector<PathPoint> poses;
  if (path.pieces.empty()) poses = path.points;
  if (ends.start_heading && !path.pieces.empty()) {
    poses.push_back({path.pieces.front().point(0), *ends.start_heading, 0, 0});
  }
  for (const CubicBezier& piece : path.pieces) {
    double arc_length = poses.empty() ? 0 : poses.back().arc_length;
    const std::size_t samples = samples_of(piece, spacing);
    for (std::size_t i = 0; i <= samples; ++i) {
      const double t = static_cast<double>(i) / static_cast<double>(samples);
      if (i > 0) arc_length += piece.length(t - 1 / static_cast<double>(samples), t);
      const PathPoint pose{piece.point(t), piece.heading(t), piece.curvature(t), arc_length};
      if (i == 0 && !poses.empty()) add_turn(poses.back(), pose.heading, reach, spacing, poses);
      poses.push_back(pose);
    }
  }
  if (ends.goal_heading && !poses.empty()) {
    const PathPoint last = poses.back();
    add_turn(last, *ends.goal_heading, reach, spacing, poses);
    poses.push_back({last.position, *ends.goal_heading, 0, last.arc_length});
  }
  return poses;
}

Path smooth(const PlanningGrid& grid, std::span<const Eigen::Vector2d> waypoints,
            const PathEnds& ends, const SmoothingOptions& options) {
  options.validate();
  if (waypoints.empty()) throw Error("waypoints", "found none, accepted: one or more");
  Path path;
  path.status = PathStatus::found;
  path.waypoints.assign(waypoints.begin(), waypoints.end());
  const double spacing =
      options.point_spacing > 0 ? options.point_spacing : 0.5 * grid.geometry().cell_size;
  if (polyline_length(waypoints) == 0) {
    path.points = {{waypoints.front(), ends.start_heading.value_or(0), 0, 0}};
    path.flags.footprint_collides = touches_obstacle(grid, options.footprint, path.points);
    return path;
  }
  Smoother smoother(grid, waypoints, ends, options);
  path.pieces = smoother.run(path.flags);
  path.greatest_curvature = smoother.greatest_curvature();
  if (path.flags.footprint_collides) {
    // The waypoints themselves may be free: the vehicle then turns at their corners.
    path.pieces = straight_pieces(waypoints);
    path.greatest_curvature =
        greatest_turn(path.pieces, ends) / std::min(spacing, 0.5 * grid.geometry().cell_size);
    path.flags = {
        .curvature_exceeded = exceeds(path.greatest_curvature * options.min_turning_radius),
        .partly_unsmoothed = true,
        .footprint_collides = touches_obstacle(grid, options.footprint,
                                               checked_poses(grid, path, ends, options.footprint))};
  }
  path.points = points_of(path.pieces, spacing);
  path.points.front().position = waypoints.front();  // without rounding
  path.points.back().position = waypoints.back();
  path.length = path.points.back().arc_length;
  path.cost = cost_of(grid, path.points);
  return path;
}

}  // namespace blindcorner
