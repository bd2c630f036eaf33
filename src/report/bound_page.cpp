// SPDX-License-Identifier: Apache-2.0
#include "report/bound_page.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "forward/support/quantile.h"
#include "report/bound_map.h"
#include "report/formatted.h"
#include "report/html.h"
#include "report/json_values.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

/// A length for readers of a page, with two significant digits.
std::string length(double metres) {
  if (!std::isfinite(metres)) return "-";
  return metres < 1 ? formatted("%.2g cm", 100 * metres) : formatted("%.2g m", metres);
}

std::string percent(double share) { return formatted("%.0f %%", 100 * share); }

Json deviations(const Eigen::MatrixXd& covariance) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    list.push_back(number(std::sqrt(covariance(i, i))));
  }
  return list;
}

Json numbers(const Eigen::VectorXd& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(number(value));
  return list;
}

Json place_json(const Scene& scene, const PoseBound& place) {
  return {{"pose", numbers(place.pose)},
          {"photons", number(place.photons)},
          {"detection_probability", number(place.detection_probability)},
          {"position_error_m", number(place.position_error)},
          {"ambiguous", place.ambiguous},
          {"cramer_rao_m", number(std::sqrt(position_trace(scene, place.cramer_rao)))},
          {"with_prior_m", number(std::sqrt(position_trace(scene, place.with_prior)))},
          {"ambiguity_m", number(std::sqrt(position_trace(scene, place.ambiguity)))},
          {"cramer_rao", deviations(place.cramer_rao)},
          {"with_prior", deviations(place.with_prior)},
          {"ambiguity", deviations(place.ambiguity)}};
}

Json map_json(const BoundMap& map) {
  const BoundSummary summary = summarise(map);
  Json json{{"sensor_pose", map.name},
            {"exposures", map.options.exposures},
            {"ambient_counts_per_bin", map.options.ambient},
            {"prior_counted", map.options.prior},
            {"prior_error_m", number(map.prior_error)},
            {"noticed_share", number(summary.noticed_share)},
            {"median_error_m", number(summary.median_error)},
            {"p90_error_m", number(summary.p90_error)},
            {"ambiguous_share", number(summary.ambiguous_share)},
            {"median_photons", number(summary.median_photons)},
            {"cell_m", {map.cell.x(), map.cell.y()}},
            {"x_m", map.x_m},
            {"y_m", map.y_m}};
  json["places"] = Json::array();
  for (const PoseBound& place : map.places) json["places"].push_back(place_json(map.scene, place));
  return json;
}

std::string table_html(const std::vector<BoundMap>& maps) {
  std::string html =
      "<table><tr><th>sensor pose<th>noticed at<th>median error<th>90 % below"
      "<th>mistakable<th>median photons</tr>\n";
  for (const BoundMap& map : maps) {
    const BoundSummary s = summarise(map);
    html += "<tr><td>" + html_safe(map.name) + "<td>" + percent(s.noticed_share) +
            " of places<td>" + length(s.median_error) + "<td>" + length(s.p90_error) + "<td>" +
            percent(s.ambiguous_share) + " of places<td>" + formatted("%.3g", s.median_photons) +
            "</tr>\n";
  }
  return html + "</table>\n";
}

/// Which sensor pose is better: more places where the object is noticed, then smaller errors.
std::string best_pose(const std::vector<BoundMap>& maps) {
  if (maps.size() < 2) return {};
  const auto rank = [](const BoundMap& map) {
    const BoundSummary s = summarise(map);
    const double error = std::isfinite(s.median_error) ? s.median_error : 1e9;
    return std::pair(-std::round(100 * s.noticed_share), error);
  };
  const auto best = std::ranges::min_element(maps, {}, rank);
  return "<p><b>Of these sensor poses " + html_safe(best->name) +
         " is the best</b>: it notices the object at the most places, and among equals has the "
         "smallest median error.</p>\n";
}

const char* const kExplanation =
    "<p>Colours show the error that no method can be expected to beat, distance over all unknown "
    "coordinates: the larger one of two bounds. The first is the Cramer-Rao bound from the fast "
    "model's derivatives, brightness, ambient light and direct return counted as unknown, with "
    "what "
    "the scene says about the pose beforehand. The second one (Weiss and Weinstein's, s = 1/2) "
    "looks "
    "at poses elsewhere in the hidden area whose light can be mistaken for this one's; where it is "
    "the larger one, the place is mistakable and a dot says so. Hatching marks places where a fit "
    "would report "
    "<i>nothing_detected</i> in most captures: its threshold lets 5 % of empty captures pass. "
    "Pile-up and errors of the model are not counted. Point at a place of the right picture for "
    "its "
    "numbers.</p>\n";

}  // namespace

BoundSummary summarise(const BoundMap& map) {
  BoundSummary summary;
  std::vector<double> errors;
  std::vector<double> photons;
  const auto count = static_cast<double>(map.places.size());
  for (const PoseBound& place : map.places) {
    photons.push_back(place.photons);
    if (place.ambiguous) summary.ambiguous_share += 1 / count;
    if (place.detection_probability < kNoticed) continue;
    summary.noticed_share += 1 / count;
    errors.push_back(place.position_error);
  }
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  summary.median_error = errors.empty() ? nothing : quantile(errors, 0.5);
  summary.p90_error = errors.empty() ? nothing : quantile(errors, 0.9);
  summary.median_photons = quantile(photons, 0.5);
  return summary;
}

std::string bound_headline(const BoundMap& map) {
  const BoundSummary s = summarise(map);
  if (!std::isfinite(s.median_error)) {
    return "Nothing would be noticed anywhere in the hidden area: it takes more light, or another "
           "place for the sensor.";
  }
  const std::string where = s.noticed_share > 0.995 ? "everywhere in the hidden area"
                                                    : "at " + percent(s.noticed_share) +
                                                          " of the places in the hidden area";
  return "An object would be noticed " + where + "; there expect its position to be wrong by " +
         length(s.median_error) + " at the typical place and by less than " + length(s.p90_error) +
         " at nine of ten (" + length(map.prior_error) + " without looking).";
}

std::string bound_json(const std::vector<BoundMap>& maps) {
  Json document{{"format", "blindcorner.bound/1"},
                {"scene", maps.front().scene.name},
                {"unknowns", unknown_names(maps.front().scene)}};
  document["maps"] = Json::array();
  for (const BoundMap& map : maps) document["maps"].push_back(map_json(map));
  return document.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string bound_csv(const std::vector<BoundMap>& maps) {
  const Scene& scene = maps.front().scene;
  const std::vector<std::string> names = unknown_names(scene);
  std::string text = "map";
  for (const std::string& name : names) text += "," + name;
  text += ",photons,detection_probability,position_error_m,cramer_rao_m,with_prior_m,ambiguity_m";
  for (const std::string& name : names) text += ",with_prior_" + name;
  for (const std::string& name : names) text += ",ambiguity_" + name;
  text += "\n";
  for (std::size_t m = 0; m < maps.size(); ++m) {
    for (const PoseBound& place : maps[m].places) {
      text += std::to_string(m);
      for (const double value : place.pose) text += formatted(",%.6g", value);
      text += formatted(",%.5g,%.4f,%.5g", place.photons, place.detection_probability,
                        place.position_error);
      for (const auto* matrix : {&place.cramer_rao, &place.with_prior, &place.ambiguity}) {
        text += formatted(",%.5g", std::sqrt(position_trace(scene, *matrix)));
      }
      for (const auto* matrix : {&place.with_prior, &place.ambiguity}) {
        for (Eigen::Index i = 0; i < matrix->rows(); ++i) {
          text += formatted(",%.5g", std::sqrt((*matrix)(i, i)));
        }
      }
      text += "\n";
    }
  }
  return text;
}

std::string bound_page(const std::vector<BoundMap>& maps) {
  const ErrorScale scale = error_scale(maps);
  std::string body;
  body += best_pose(maps) + table_html(maps) + scale_html(scale);
  int number = 0;
  for (const BoundMap& map : maps) {
    ++number;
    if (maps.size() > 1) {
      body +=
          "<h2>" + html_safe(map.name) + "</h2>\n<p>" + html_safe(bound_headline(map)) + "</p>\n";
    }
    for (const std::string& hint : map.hints) body += "<p>" + html_safe(hint) + "</p>\n";
    body += "<div class=\"charts\">" + overview_svg(map, scale, number) +
            area_svg(map, scale, number) + "</div>\n";
  }
  body +=
      "<p class=\"open\">Dark dot: the sensor; yellow: what it looks at; thick grey lines: relay "
      "surfaces; filled grey: occluders. Left the scene from above, right the hidden area by "
      "itself.</p>\n";
  body += kExplanation;
  return plain_page("Error to expect: " + maps.front().scene.name,
                    maps.size() == 1 ? bound_headline(maps.front()) : "", body);
}

}  // namespace blindcorner
