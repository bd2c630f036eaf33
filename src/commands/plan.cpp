// SPDX-License-Identifier: Apache-2.0
/// `blindcorner plan MAP --start x,y --goal x,y -o DIR`: a path on a map.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/map_file.h"
#include "blindcorner/planner/path/path_planner.h"
#include "blindcorner/report/path_page.h"
#include "commands/commands.h"
#include "commands/output_directory.h"
#include "commands/printout.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

struct PlanArguments {
  std::string map, output;
  std::vector<double> start, goal;                    ///< x, y, m
  std::optional<double> start_heading, goal_heading;  ///< degrees
  std::optional<double> length, width, radius;        ///< of the vehicle, m
  PathPlannerOptions planner;
  Printout out;
};

VehicleFootprint footprint_of(const PlanArguments& arguments) {
  if (arguments.length.has_value() != arguments.width.has_value()) {
    throw Error("--vehicle-length and --vehicle-width", "found one of them, accepted: both");
  }
  if (arguments.length) return VehicleFootprint::rectangle(*arguments.length, *arguments.width);
  return VehicleFootprint::disc(arguments.radius.value_or(0));
}

std::optional<double> radians(const std::optional<double>& degrees) {
  return degrees ? std::optional(*degrees * kDegree) : std::nullopt;
}

void print_path(const Printout& out, const PlannedPath& planned, const std::string& output) {
  const Path& path = planned.path;
  if (path.found()) {
    out.text("%.2f m, %zu expansions, %.1f ms\n", path.length, path.expansions, 1e3 * path.time);
  }
  out.file((fs::path(output) / "path.json").string());
  out.text("%s and %s\n", (fs::path(output) / "path.json").c_str(),
           (fs::path(output) / "path.html").c_str());
}

/// Centre of the nearest cell to a point that a path may lead through. Empty: there is no such
/// cell.
std::optional<Eigen::Vector2d> nearest_free(const PlanningGrid& grid,
                                            const Eigen::Vector2d& point) {
  const GridGeometry& geometry = grid.geometry();
  std::optional<Eigen::Vector2d> nearest;
  for (std::size_t i = 0; i < geometry.cells(); ++i) {
    const Cell cell = geometry.cell(i);
    if (!grid.traversable(cell)) continue;
    const Eigen::Vector2d centre = geometry.center(cell);
    if (!nearest || (centre - point).norm() < (*nearest - point).norm()) nearest = centre;
  }
  return nearest;
}

/// Why there is no path, and what to do.
std::string advice(const PlannedPath& planned) {
  const PlanningGrid& grid = planned.grid;
  const GridGeometry& geometry = grid.geometry();
  const PathStatus status = planned.path.status;
  const bool start = status == PathStatus::start_blocked || status == PathStatus::start_outside;
  const std::string end = start ? "start" : "goal";
  char text[400] = "";
  switch (status) {
    case PathStatus::start_outside:
    case PathStatus::goal_outside: {
      const Eigen::Vector2d far =
          geometry.origin + geometry.cell_size * Eigen::Vector2d(geometry.columns, geometry.rows);
      std::snprintf(text, sizeof text,
                    ": the %s lies outside of the map, which spans x %g to %g m and y %g to %g m",
                    end.c_str(), geometry.origin.x(), far.x(), geometry.origin.y(), far.y());
      break;
    }
    case PathStatus::start_blocked:
    case PathStatus::goal_blocked: {
      const auto free =
          nearest_free(grid, start ? planned.request.start : planned.request.goal.point);
      std::snprintf(text, sizeof text, ": the %s lies in an obstacle or nearer than %.3g m to one",
                    end.c_str(), grid.options().lethal_radius + geometry.cell_size / 2);
      if (free) {
        char place[200];
        std::snprintf(place, sizeof place, "; the nearest free place is --%s %g,%g", end.c_str(),
                      free->x(), free->y());
        return text + std::string(place) +
               (grid.options().lethal_radius > 0 ? ", or plan for a smaller vehicle" : "");
      }
      return text + std::string("; no cell of the map is free for this vehicle");
    }
    case PathStatus::no_path:
      return ": start and goal are free, but nothing connects them for this vehicle";
    default:
      break;
  }
  return text;
}

int run_plan(const PlanArguments& arguments) {
  PathPlannerOptions options = arguments.planner;
  options.footprint = footprint_of(arguments);
  PathPlanner planner(options);
  const OccupancyMap map = read_map(arguments.map);
  const PathRequest request{
      {arguments.start[0], arguments.start[1]},
      radians(arguments.start_heading),
      {{arguments.goal[0], arguments.goal[1]}, radians(arguments.goal_heading), std::nullopt}};
  const PlanningGrid grid = planner.grid(map.geometry, map.occupancy);
  const Path path = planner.plan(grid, request);
  const PlannedPath planned{arguments.map, request, grid, path};
  make_directory(arguments.output);
  write_atomically((fs::path(arguments.output) / "path.json").string(), path_json(planned));
  write_atomically((fs::path(arguments.output) / "path.html").string(),
                   path_page(planned, map.occupancy));
  print_path(arguments.out, planned, arguments.output);
  if (path.found()) return kAllWell;
  std::fprintf(stderr, "blindcorner: %s: %s%s\n", arguments.map.c_str(),
               std::string(path_status_word(path.status)).c_str(), advice(planned).c_str());
  return kSomeFailed;
}

void add_vehicle_options(CLI::App& command, PlanArguments& arguments) {
  CLI::Option* length =
      command.add_option("--vehicle-length", arguments.length, "of a rectangular vehicle, m");
  CLI::Option* width =
      command.add_option("--vehicle-width", arguments.width, "of a rectangular vehicle, m");
  command.add_option("--radius", arguments.radius, "of a round vehicle, m; default: a point")
      ->excludes(length)
      ->excludes(width);
  command
      .add_option("--min-turning-radius", arguments.planner.curves.turning_radius,
                  "the path turns no tighter, m")
      ->capture_default_str();
}

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand("plan",
                                          "a path on a map; writes path.json and path.html. Exit "
                                          "code 1: there is none");
  const auto arguments = std::make_shared<PlanArguments>();
  command
      .add_option("MAP", arguments->map,
                  "ROS map (.yaml), or MovingAI map (.map; cells of 1 m, y up)")
      ->required();
  command.add_option("--start", arguments->start, "x,y in m")
      ->delimiter(',')
      ->expected(2)
      ->required();
  command.add_option("--goal", arguments->goal, "x,y in m")
      ->delimiter(',')
      ->expected(2)
      ->required();
  command.add_option("-o,--output", arguments->output, "directory to write to")->required();
  command.add_option("--start-heading-deg", arguments->start_heading, "default: any");
  command.add_option("--goal-heading-deg", arguments->goal_heading, "default: any");
  add_vehicle_options(command, *arguments);
  PlanningGridOptions& grid = arguments->planner.grid;
  command
      .add_option("--risk-weight", grid.risk_weight, "price of risk: a metre costs 1 + it * risk")
      ->capture_default_str();
  command
      .add_option("--risk-radius", grid.risk_radius,
                  "how far the risk of an obstacle reaches, m; 0: twice the vehicle's radius")
      ->capture_default_str();
  command.add_option("--unknown", grid.unknown_occupancy, "occupancy where nothing is known")
      ->capture_default_str();
  command
      .add_option("--heuristic-weight", arguments->planner.search.heuristic_weight,
                  "above 1: faster, and at most that much costlier than the cheapest path")
      ->capture_default_str();
  arguments->out.add_option(command, "path.json");
  command.callback([arguments, &exit_code] { exit_code = run_plan(*arguments); });
}

}  // namespace blindcorner
