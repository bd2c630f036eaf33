// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/path_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "blindcorner/report/result_file.h"
#include "report/colours.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

Json pair(const Eigen::Vector2d& point) { return {point.x(), point.y()}; }

/// How a cell is drawn; the first kind is the page's background.
enum class Ground { free, unknown, margin, obstacle };

struct GroundStyle {
  Ground ground;
  const char* colour;
};
constexpr std::array<GroundStyle, 3> kStyles{{{Ground::unknown, "var(--faint,#d9dee3)"},
                                              {Ground::margin, "#b9a98c"},
                                              {Ground::obstacle, "var(--occluder,#79838c)"}}};

Ground ground_of(const PlanningGrid& grid, std::span<const double> occupancy, std::size_t index) {
  if (grid.obstacle(index)) return Ground::obstacle;
  if (!grid.traversable(grid.geometry().cell(index))) return Ground::margin;
  return std::isnan(occupancy[index]) ? Ground::unknown : Ground::free;
}

/// The cells of one kind as rectangles, in units of cells, as the data of an SVG path. A rectangle
/// is a run along a row, joined with equal runs of the rows that follow.
std::string rectangles(const GridGeometry& geometry,
                       const std::function<bool(std::size_t)>& wanted) {
  struct Run {
    int first, count, row;
  };
  std::string data;
  std::vector<Run> open;  // rectangles that reach up to the last row
  const auto close = [&data](const Run& run, int row) {
    data += formatted("M%d %dh%dv%dh%dz", run.first, run.row, run.count, row - run.row, -run.count);
  };
  for (int row = 0; row <= geometry.rows; ++row) {
    std::vector<Run> runs;
    for (int column = 0; row < geometry.rows && column < geometry.columns; ++column) {
      if (!wanted(geometry.index({column, row}))) continue;
      if (!runs.empty() && runs.back().first + runs.back().count == column) {
        ++runs.back().count;
      } else {
        runs.push_back({column, 1, row});
      }
    }
    for (const Run& below : open) {
      const auto same = std::ranges::find_if(runs, [&below](const Run& run) {
        return run.first == below.first && run.count == below.count;
      });
      if (same != runs.end()) {
        same->row = below.row;
      } else {
        close(below, row);
      }
    }
    open = std::move(runs);
  }
  return data;
}

std::string polyline(const std::vector<Eigen::Vector2d>& points, const char* style) {
  std::string text = "<polyline fill=\"none\" vector-effect=\"non-scaling-stroke\" ";
  text += style;
  text += " points=\"";
  for (const Eigen::Vector2d& p : points) text += formatted("%.7g,%.7g ", p.x(), p.y());
  return text + "\"/>\n";
}

std::string marker(const Eigen::Vector2d& point, double radius, const char* colour,
                   const char* name) {
  return formatted(
      "<circle cx=\"%.7g\" cy=\"%.7g\" r=\"%.7g\" fill=\"%s\"><title>%s</title></circle>\n",
      point.x(), point.y(), radius, colour, name);
}

/// The map with the path, in the map's own metres, y up.
std::string picture(const PlannedPath& planned, std::span<const double> occupancy) {
  const GridGeometry& geometry = planned.grid.geometry();
  const double width = geometry.columns * geometry.cell_size;
  const double height = geometry.rows * geometry.cell_size;
  const Eigen::Vector2d corner = geometry.origin;
  std::string svg = formatted(
      "<svg role=\"img\" aria-label=\"the map with the path\" viewBox=\"%.9g %.9g %.9g %.9g\" "
      "style=\"width:100%%;max-height:90vh;border:1px solid "
      "var(--faint,#d9dee3)\"><g transform=\"scale(1,-1)\">\n<g transform=\"translate(%.9g,%.9g) "
      "scale(%.9g)\" "
      "shape-rendering=\"crispEdges\">\n",
      corner.x(), -corner.y() - height, width, height, corner.x(), corner.y(), geometry.cell_size);
  for (const GroundStyle& style : kStyles) {
    svg += formatted("<path fill=\"%s\" d=\"", style.colour);
    svg += rectangles(geometry, [&](std::size_t index) {
      return ground_of(planned.grid, occupancy, index) == style.ground;
    });
    svg += "\"/>\n";
  }
  svg += "</g>\n";
  std::vector<Eigen::Vector2d> curve;
  for (const PathPoint& point : planned.path.points) curve.push_back(point.position);
  svg += polyline(curve, "stroke=\"var(--path,#0072b2)\" stroke-width=\"2.5\"");
  const double radius = 0.006 * std::max(width, height);  // a few pixels of the page
  svg += marker(planned.request.start, radius, colour::kSensor, "start");
  svg += marker(planned.request.goal.point, radius, colour::kGoal, "goal");
  return svg + "</g></svg>\n";
}

std::string figures(const Path& path) {
  return formatted(
      "<table><tr><td>status<td>%s</tr><tr><td>length<td>%.2f m</tr><tr><td>cost<td>%.2f m</tr>"
      "<tr><td>greatest curvature<td>%.3f / m</tr><tr><td>expansions<td>%zu</tr><tr><td>time"
      "<td>%.1f ms</tr></table>\n",
      std::string(path_status_word(path.status)).c_str(), path.length, path.cost,
      path.greatest_curvature(), path.expansions, 1e3 * path.time);
}

std::string path_headline(const Path& path) {
  switch (path.status) {
    case PathStatus::found:
      return formatted("A path of %.1f m leads to the goal.", path.length);
    case PathStatus::no_path:
      return "No path leads to the goal.";
    case PathStatus::start_outside:
      return "There is no path: the start lies outside of the map.";
    case PathStatus::goal_outside:
      return "There is no path: the goal lies outside of the map.";
    case PathStatus::start_blocked:
      return "There is no path: the start is too near to an obstacle.";
    case PathStatus::goal_blocked:
      return "There is no path: the goal is too near to an obstacle.";
  }
  return {};
}

}  // namespace

std::string path_json(const PlannedPath& planned) {
  const Path& path = planned.path;
  Json json;
  json["format"] = "blindcorner.path/1";
  json["map"] = planned.map;
  json["start_m"] = pair(planned.request.start);
  json["goal_m"] = pair(planned.request.goal.point);
  json["status"] = path_status_word(path.status);
  json["length_m"] = path.length;
  json["cost_m"] = path.cost;
  json["expansions"] = path.expansions;
  json["time_ms"] = 1e3 * path.time;
  json["point_columns"] = {"x_m", "y_m", "heading_rad", "curvature_per_m", "arc_length_m"};
  json["points"] = Json::array();
  for (const PathPoint& p : path.points) {
    json["points"].push_back(
        {p.position.x(), p.position.y(), p.heading, p.curvature, p.arc_length});
  }
  return json.dump() + "\n";
}

std::string path_page(const PlannedPath& planned, std::span<const double> occupancy) {
  return plain_page("Path on " + std::filesystem::path(planned.map).filename().string(),
                    path_headline(planned.path),
                    figures(planned.path) +
                        "<p>Grey: obstacles; brown: too near to one for the vehicle's reference "
                        "point; light grey: unknown; blue: the path, from the dark dot to the "
                        "pink one.</p>\n" +
                        picture(planned, occupancy));
}

}  // namespace blindcorner
