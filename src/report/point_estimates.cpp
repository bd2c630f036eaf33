// SPDX-License-Identifier: Apache-2.0
#include "report/point_estimates.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/report/headline.h"
#include "forward/support/quantile.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

ErrorFigures figures_of(const std::string& name, const std::vector<double>& lengths) {
  const std::size_t count = lengths.size();
  ErrorFigures figures{name};
  for (const double length : lengths) {
    figures.mean += length / static_cast<double>(count);
    figures.rmse += length * length / static_cast<double>(count);
  }
  figures.rmse = std::sqrt(figures.rmse);
  figures.median = median(lengths);
  figures.p90 = quantile(lengths, 0.9);
  return figures;
}

/// Indices of the first object's x and y among the unknowns. Empty if either is known.
std::optional<std::pair<Eigen::Index, Eigen::Index>> plane_of(const Scene& scene) {
  Eigen::Index x = -1, y = -1;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].object != 0) continue;
    if (scene.unknowns[i].component == Component::x) x = static_cast<Eigen::Index>(i);
    if (scene.unknowns[i].component == Component::y) y = static_cast<Eigen::Index>(i);
  }
  if (x < 0 || y < 0) return std::nullopt;
  return std::pair{x, y};
}

std::string polygon(const Footprint& corners, const char* style) {
  std::string text = "<polygon vector-effect=\"non-scaling-stroke\" ";
  text += style;
  text += " points=\"";
  for (const Vector2d& p : corners) text += formatted("%.7g,%.7g ", p.x(), p.y());
  return text + "\"/>\n";
}

std::string dot(const Vector2d& at, double radius, const std::string& style,
                const std::string& title = {}) {
  return formatted("<circle cx=\"%.7g\" cy=\"%.7g\" r=\"%.7g\" ", at.x(), at.y(), radius) + style +
         (title.empty() ? "/>\n" : "><title>" + html_safe(title) + "</title></circle>\n");
}

Footprint corners_of(const Eigen::AlignedBox2d& box) {
  using Box = Eigen::AlignedBox2d;
  return {box.corner(Box::BottomLeft), box.corner(Box::BottomRight), box.corner(Box::TopRight),
          box.corner(Box::TopLeft)};
}

Eigen::AlignedBox2d search_region(const Scene& scene, Eigen::Index x, Eigen::Index y) {
  const Unknown& along = scene.unknowns[static_cast<std::size_t>(x)];
  const Unknown& across = scene.unknowns[static_cast<std::size_t>(y)];
  return {Vector2d(along.lower, across.lower), Vector2d(along.upper, across.upper)};
}

/// Surfaces, search region and sensors.
std::string surroundings_svg(const Scene& scene, const std::vector<PointEstimate>& estimates,
                             const Eigen::AlignedBox2d& region, double radius) {
  std::string svg;
  for (const Surface& surface : scene.surfaces) {
    const bool floor = std::abs(surface.T_world_surface.linear()(2, 0)) > 0.5 &&
                       std::holds_alternative<RectangleShape>(surface.shape);
    if (floor) continue;  // it would cover all
    svg += polygon(footprint(surface.shape, surface.T_world_surface),
                   "fill=\"var(--occluder,#79838c)\" fill-opacity=\"0.4\" "
                   "stroke=\"var(--relay,#3d454d)\" stroke-width=\"1.5\"");
  }
  svg += polygon(
      corners_of(region),
      "fill=\"none\" stroke=\"var(--search,#8b949d)\" stroke-width=\"1\" stroke-dasharray=\"5 4\"");
  std::vector<Vector2d> sensors;
  for (const PointEstimate& e : estimates) {
    const Vector2d at = e.T_world_sensor.translation().head<2>();
    if (std::ranges::find(sensors, at) == sensors.end()) sensors.push_back(at);
  }
  for (const Vector2d& at : sensors)
    svg += dot(at, 1.5 * radius, "fill=\"var(--sensor,#1b1f24)\"", "sensor");
  return svg;
}

}  // namespace

std::vector<double> position_errors(const Scene& scene,
                                    const std::vector<PointEstimate>& estimates) {
  const auto is_position = [](const Unknown& u) { return u.component <= Component::z; };
  if (std::ranges::none_of(scene.unknowns, is_position)) return {};
  std::vector<double> distances;
  for (const PointEstimate& e : estimates) {
    double squares = 0;
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      if (is_position(scene.unknowns[i])) squares += std::pow(e.estimate[k] - e.truth[k], 2);
    }
    distances.push_back(std::sqrt(squares));
  }
  return distances;
}

std::vector<ErrorFigures> point_errors(const Scene& scene,
                                       const std::vector<PointEstimate>& estimates) {
  if (estimates.empty()) throw Error("errors", "found no estimates, accepted: at least one");
  const std::vector<std::string> names = unknown_names(scene);
  std::vector<std::vector<double>> lengths(names.size());
  for (const PointEstimate& e : estimates) {
    const PoseVector error = pose_error(scene, e.estimate, e.truth).cwiseAbs();
    for (std::size_t i = 0; i < names.size(); ++i) {
      lengths[i].push_back(error[static_cast<Eigen::Index>(i)]);
    }
  }
  std::vector<ErrorFigures> figures;
  for (std::size_t i = 0; i < names.size(); ++i)
    figures.push_back(figures_of(names[i], lengths[i]));
  const std::vector<double> distances = position_errors(scene, estimates);
  if (!distances.empty()) {
    figures.push_back(figures_of("position_m", distances));
  }
  return figures;
}

nlohmann::ordered_json point_errors_json(const std::vector<ErrorFigures>& figures) {
  nlohmann::ordered_json json;
  for (const ErrorFigures& f : figures) {
    json[f.name] = {
        {"mean_absolute", f.mean}, {"rmse", f.rmse}, {"median", f.median}, {"p90", f.p90}};
  }
  return json;
}

std::string point_errors_text(const std::vector<ErrorFigures>& figures) {
  std::string text =
      formatted("%-14s %13s %9s %9s %9s\n", "", "mean absolute", "RMSE", "median", "90 %");
  for (const ErrorFigures& f : figures) {
    text += formatted("%-14s %13.4f %9.4f %9.4f %9.4f\n", f.name.c_str(), f.mean, f.rmse, f.median,
                      f.p90);
  }
  return text;
}

std::string point_errors_html(const std::vector<ErrorFigures>& figures) {
  std::string html = "<table><tr><th>error<th>mean absolute<th>RMSE<th>median<th>90 %</tr>\n";
  for (const ErrorFigures& f : figures) {
    html += "<tr><td>" + html_safe(f.name) +
            formatted("<td>%.4f<td>%.4f<td>%.4f<td>%.4f</tr>\n", f.mean, f.rmse, f.median, f.p90);
  }
  return html + "</table>\n";
}

std::string point_errors_headline(const Scene& scene, const std::vector<PointEstimate>& estimates) {
  const std::vector<double> distances = position_errors(scene, estimates);
  if (distances.empty()) return {};
  return "Half of the estimates are within " + said_length(median(distances)) +
         " of the truth, nine of ten within " + said_length(quantile(distances, 0.9)) + ".";
}

std::string point_estimates_csv(const Scene& scene, const std::vector<PointEstimate>& estimates) {
  const std::vector<std::string> names = unknown_names(scene);
  const bool stated = !estimates.empty() && estimates.front().sigma.size() > 0;
  std::string csv = "source,index";
  for (const std::string& name : names) {
    csv += "," + name + "," + name + "_estimate," + name + "_error";
    if (stated) csv += "," + name + "_sigma";
  }
  csv += "\n";
  for (const PointEstimate& e : estimates) {
    const PoseVector error = pose_error(scene, e.estimate, e.truth);
    csv += "\"" + e.source + "\"," + std::to_string(e.index);
    for (Eigen::Index i = 0; i < error.size(); ++i) {
      csv += formatted(",%.9g,%.9g,%.9g", e.truth[i], e.estimate[i], error[i]);
      if (stated) csv += formatted(",%.9g", e.sigma[i]);
    }
    csv += "\n";
  }
  return csv;
}

std::string point_estimates_svg(const Scene& scene, const std::vector<PointEstimate>& estimates) {
  const auto plane = plane_of(scene);
  if (!plane) return {};
  const auto [x, y] = *plane;
  const Eigen::AlignedBox2d region = search_region(scene, x, y);
  Eigen::AlignedBox2d view = region;
  for (const PointEstimate& e : estimates) {
    view.extend(Vector2d(e.T_world_sensor.translation().head<2>()));
    view.extend(Vector2d(e.estimate[x], e.estimate[y]));
  }
  const Vector2d margin = Vector2d::Constant(0.08 * view.sizes().maxCoeff());
  view = {view.min() - margin, view.max() + margin};
  const double radius = 0.003 * view.sizes().maxCoeff();  // a few pixels
  std::string svg = formatted(
      "<svg viewBox=\"%.9g %.9g %.9g %.9g\" style=\"width:100%%;max-height:80vh;border:1px solid "
      "var(--faint,#d9dee3)\"><g transform=\"scale(1,-1)\">\n",
      view.min().x(), -view.max().y(), view.sizes().x(), view.sizes().y());
  svg += surroundings_svg(scene, estimates, region, radius);
  for (const PointEstimate& e : estimates) {
    const Vector2d truth(e.truth[x], e.truth[y]);
    const Vector2d found(e.estimate[x], e.estimate[y]);
    svg += formatted(
        "<path d=\"M%.7g %.7gL%.7g %.7g\" stroke=\"var(--found,#d55e00)\" stroke-width=\"1\" "
        "stroke-opacity=\"0.5\" vector-effect=\"non-scaling-stroke\"/>\n",
        truth.x(), truth.y(), found.x(), found.y());
    svg += dot(truth, radius, "fill=\"var(--truth,#009e73)\"");
    svg += dot(found, radius, "fill=\"var(--found,#d55e00)\"",
               "capture " + std::to_string(e.index) +
                   formatted(": off by %.3g m", (found - truth).norm()));
  }
  return svg + "</g></svg>\n";
}

}  // namespace blindcorner
