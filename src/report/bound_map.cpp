// SPDX-License-Identifier: Apache-2.0
#include "report/bound_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "blindcorner/forward/scene/footprint.h"
#include "forward/support/quantile.h"
#include "report/birds_eye.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

constexpr double kWidth = 566, kHeight = 640;  // pixels, at most: two fill the page's width
constexpr double kBorder = 34;                 // pixels, for numbers along the edges
constexpr double kDecibelRoom = 1.25;          // factor by which the scale is longer at both ends

/// Dark blue to yellow: the larger the error, the lighter the colour. The order can also be seen by
/// colour-blind eyes and in grey.
constexpr std::array<std::array<double, 3>, 6> kColours{
    {{33, 30, 92}, {49, 76, 144}, {36, 124, 142}, {53, 172, 122}, {158, 207, 66}, {250, 231, 60}}};

std::string colour(double share) {
  const double place = std::clamp(share, 0.0, 1.0) * (kColours.size() - 1.0);
  const auto below = std::min(static_cast<std::size_t>(place), kColours.size() - 2);
  const double t = place - static_cast<double>(below);
  const auto mix = [&](std::size_t i) {
    return static_cast<int>(std::lround(std::lerp(kColours[below][i], kColours[below + 1][i], t)));
  };
  return formatted("#%02x%02x%02x", mix(0), mix(1), mix(2));
}

std::string colour_of(double error, const ErrorScale& scale) {
  return colour(std::log(error / scale.least) / std::log(scale.most / scale.least));
}

std::string length_text(double metres) {
  if (metres < 0.0995) return formatted("%.2g cm", 100 * metres);
  return metres < 0.995 ? formatted("%.0f cm", 100 * metres) : formatted("%.2g m", metres);
}

/// Maps a part of the world, seen from above with north up, to pixels.
struct View {
  Vector2d low, high;  ///< m
  double zoom = 1;     ///< pixels per m
  double width = 0, height = 0;

  View(const Vector2d& from, const Vector2d& to) : low(from), high(to) {
    const Vector2d size = (high - low).cwiseMax(1e-6);
    zoom = std::min((kWidth - 2 * kBorder) / size.x(), (kHeight - 2 * kBorder) / size.y());
    width = size.x() * zoom + 2 * kBorder;
    height = size.y() * zoom + 2 * kBorder;
  }
  double x(double world) const { return kBorder + (world - low.x()) * zoom; }
  double y(double world) const { return kBorder + (high.y() - world) * zoom; }
};

std::string path_of(const View& view, const Outline& outline, bool closed) {
  std::string path;
  for (const Vector2d& p : outline) {
    path += formatted("%s%.1f %.1f", path.empty() ? "M" : "L", view.x(p.x()), view.y(p.y()));
  }
  return closed ? path + "Z" : path;
}

/// `id` tells this picture's clip path from those of others on the page.
std::string begin_svg(const View& view, const std::string& id) {
  return formatted(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" width=\"%.0f\" "
             "height=\"%.0f\" role=\"img\" aria-label=\"error to expect, from above\" "
             "font-family=\"sans-serif\" font-size=\"11\">",
             view.width, view.height, view.width, view.height) +
         "<defs><pattern id=\"unseen\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" "
         "patternTransform=\"rotate(45)\"><rect width=\"7\" height=\"7\" fill=\"#fff\" "
         "fill-opacity=\"0.45\"/><path d=\"M0 0V7\" stroke=\"#333\" stroke-width=\"2.2\"/>"
         "</pattern></defs>" +
         "<clipPath id=\"" + id + "\">" +
         formatted("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/></clipPath>",
                   kBorder, kBorder, view.width - 2 * kBorder, view.height - 2 * kBorder);
}

/// A step of 1, 2 or 5 times a power of ten that divides the span into about five.
double tick_step(double span) {
  const double power = std::pow(10.0, std::floor(std::log10(span / 5)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (span / (factor * power) <= 6) return factor * power;
  }
  return 10 * power;
}

std::string frame(const View& view) {
  std::string svg = formatted(
      "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
      "stroke=\"var(--line,#8b949d)\"/>",
      kBorder, kBorder, view.width - 2 * kBorder, view.height - 2 * kBorder);
  const double step =
      tick_step(std::max(view.high.x() - view.low.x(), view.high.y() - view.low.y()));
  const auto number = [](double v) { return formatted("%.4g", std::abs(v) < 1e-9 ? 0.0 : v); };
  for (double t = std::ceil(view.low.x() / step) * step; t <= view.high.x() + 1e-9; t += step) {
    svg += formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">", view.x(t),
                     view.height - kBorder + 14) +
           number(t) + "</text>";
  }
  for (double t = std::ceil(view.low.y() / step) * step; t <= view.high.y() + 1e-9; t += step) {
    svg +=
        formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">", kBorder - 4, view.y(t) + 4) +
        number(t) + "</text>";
  }
  return svg +
         formatted("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">x, m</text>",
                   view.width - kBorder, view.height - 4) +
         formatted("<text x=\"%.1f\" y=\"%.1f\">y, m</text>", 4.0, kBorder - 8);
}

std::string cells(const BoundMap& map, const View& view, const ErrorScale& scale, bool titles) {
  std::string svg;
  for (std::size_t row = 0; row < map.y_m.size(); ++row) {
    for (std::size_t column = 0; column < map.x_m.size(); ++column) {
      const PoseBound& place = map.at(row, column);
      const double x = view.x(map.x_m[column] - map.cell.x() / 2);
      const double y = view.y(map.y_m[row] + map.cell.y() / 2);
      const Vector2d size = map.cell * view.zoom + Vector2d::Constant(0.3);  // no gaps
      const std::string box = formatted(
          "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" ", x, y, size.x(), size.y());
      svg += box + "fill=\"" + colour_of(place.position_error, scale) + "\"";
      const bool noticed = place.detection_probability >= kNoticed;
      std::string title;
      if (titles) {
        title = formatted(
            "<title>x %.3g m, y %.3g m: error %s%s, noticed in %.0f %% of captures, "
            "%.3g photons</title>",
            map.x_m[column], map.y_m[row], length_text(place.position_error).c_str(),
            place.ambiguous ? " (other places look the same)" : "",
            100 * place.detection_probability, place.photons);
      }
      svg += titles && noticed ? ">" + title + "</rect>" : "/>";
      if (!noticed) svg += box + "fill=\"url(#unseen)\">" + title + "</rect>";
      if (noticed && place.ambiguous && titles) {
        svg += formatted(
            "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"1.6\" fill=\"#fff\" "
            "pointer-events=\"none\"/>",
            x + size.x() / 2, y + size.y() / 2);
      }
    }
  }
  return svg;
}

std::string surroundings(const BoundMap& map, const View& view, const SensorOutlines& sensor) {
  std::string svg = "<path d=\"" + path_of(view, sensor.field_of_view, true) +
                    "\" fill=\"var(--field,#f0e442)\" fill-opacity=\"0.22\" "
                    "stroke=\"var(--field-edge,#a39200)\" "
                    "stroke-width=\"0.7\"/>";
  for (const std::vector<Outline>& zone : sensor.zones) {
    for (const Outline& outline : zone) {
      svg += "<path d=\"" + path_of(view, outline, true) +
             "\" fill=\"var(--field,#f0e442)\" fill-opacity=\"0.3\" "
             "stroke=\"var(--field-edge,#a39200)\" stroke-width=\"1.6\"/>";
    }
  }
  for (const Surface& surface : map.scene.surfaces) {
    const Outline outline = footprint(surface.shape, surface.T_world_surface);
    const bool flat = outline.size() < 3;
    const char* stroke = surface.relay      ? "var(--relay,#3d454d)"
                         : surface.occluder ? "var(--occluder,#79838c)"
                                            : "var(--line,#8b949d)";
    svg += "<path d=\"" + path_of(view, outline, true) +
           formatted("\" fill=\"%s\" fill-opacity=\"%s\" stroke=\"%s\" stroke-width=\"%s\"/>",
                     flat || surface.relay ? "none" : stroke, surface.occluder ? "0.35" : "0.1",
                     stroke, flat ? "3" : "1");
  }
  return svg;
}

std::string sensor_mark(const View& view, const SensorOutlines& sensor) {
  const double x = view.x(sensor.position.x()), y = view.y(sensor.position.y());
  const Vector2d ahead = sensor.forward.head<2>() * 18;
  return formatted(
             "<path d=\"M%.1f %.1fl%.1f %.1f\" stroke=\"var(--sensor,#1b1f24)\" "
             "stroke-width=\"2\"/>",
             x, y, ahead.x(), -ahead.y()) +
         formatted("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" fill=\"var(--sensor,#1b1f24)\"/>", x,
                   y) +
         formatted("<text x=\"%.1f\" y=\"%.1f\" fill=\"var(--sensor,#1b1f24)\">sensor</text>",
                   x + 8, y - 6);
}

Vector2d low_corner(const BoundMap& map) {
  return Vector2d(map.x_m.front(), map.y_m.front()) - map.cell / 2;
}
Vector2d high_corner(const BoundMap& map) {
  return Vector2d(map.x_m.back(), map.y_m.back()) + map.cell / 2;
}

}  // namespace

ErrorScale error_scale(const std::vector<BoundMap>& maps) {
  std::vector<double> errors;
  for (const BoundMap& map : maps) {
    for (const PoseBound& place : map.places) errors.push_back(place.position_error);
  }
  ErrorScale scale{quantile(errors, 0.02) / kDecibelRoom, quantile(errors, 0.98) * kDecibelRoom};
  scale.least = std::max(scale.least, 1e-9);
  scale.most = std::max(scale.most, scale.least * 2);
  return scale;
}

std::string overview_svg(const BoundMap& map, const ErrorScale& scale, int number) {
  const std::string id = "overview" + std::to_string(number);
  const SensorOutlines sensor =
      sensor_outlines(map.scene, map.scene.T_world_sensor, map.relay_points);
  Vector2d low = low_corner(map), high = high_corner(map);
  const auto include = [&](const Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  };
  include(sensor.position.head<2>());
  for (const auto& zone : sensor.zones) {
    for (const Outline& outline : zone) std::ranges::for_each(outline, include);
  }
  const double margin = 0.08 * (high - low).maxCoeff();
  const View view(low - Vector2d::Constant(margin), high + Vector2d::Constant(margin));
  return begin_svg(view, id) + "<g clip-path=\"url(#" + id + ")\">" +
         cells(map, view, scale, false) + surroundings(map, view, sensor) +
         sensor_mark(view, sensor) + "</g>" + frame(view) + "</svg>";
}

std::string area_svg(const BoundMap& map, const ErrorScale& scale, int number) {
  const std::string id = "area" + std::to_string(number);
  const View view(low_corner(map), high_corner(map));
  return begin_svg(view, id) + "<g clip-path=\"url(#" + id + ")\">" +
         cells(map, view, scale, true) + "</g>" + frame(view) + "</svg>";
}

std::string scale_html(const ErrorScale& scale) {
  constexpr int kSteps = 50, kStepWidth = 6, kSide = 24, kWide = kSteps * kStepWidth;
  std::string svg = formatted(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"40\" "
      "font-family=\"sans-serif\" font-size=\"12\">",
      kWide + 2 * kSide);
  for (int i = 0; i < kSteps; ++i) {
    svg += formatted("<rect x=\"%d\" y=\"4\" width=\"%d\" height=\"16\" fill=\"%s\"/>",
                     kSide + i * kStepWidth, kStepWidth + 1, colour((i + 0.5) / kSteps).c_str());
  }
  for (int i = 0; i <= 4; ++i) {
    const double share = i / 4.0;
    svg += formatted("<text x=\"%.0f\" y=\"34\" text-anchor=\"middle\">", kSide + share * kWide) +
           length_text(scale.least * std::pow(scale.most / scale.least, share)) + "</text>";
  }
  svg += "</svg>";
  const std::string hatched =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"26\" height=\"18\"><defs><pattern "
      "id=\"key\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" "
      "patternTransform=\"rotate(45)\"><rect width=\"7\" height=\"7\" fill=\"#fff\"/><path "
      "d=\"M0 0V7\" stroke=\"#333\" stroke-width=\"2.2\"/></pattern></defs><rect x=\"1\" y=\"1\" "
      "width=\"24\" height=\"16\" fill=\"url(#key)\" stroke=\"#333\"/></svg>";
  const std::string dot =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"10\" height=\"18\"><circle cx=\"5\" "
      "cy=\"9\" r=\"3\" fill=\"#fff\" stroke=\"#333\"/></svg>";
  const std::string piece = "<span style=\"display:inline-flex;align-items:center;gap:6px\">";
  return "<div style=\"display:flex;flex-wrap:wrap;align-items:center;gap:4px 18px\">" + piece +
         "error to expect</span>" + svg + piece + hatched + "not noticed in most captures</span>" +
         piece + dot + "other places look the same</span></div>\n";
}

}  // namespace blindcorner
