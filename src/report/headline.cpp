// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/headline.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

/// A sentence names the modes with at least this share of the posterior.
constexpr double kWorthNaming = 0.05;
/// A mode of at least this weight stands for the answer, as for the flag `multimodal`.
constexpr double kDecided = 0.9;
/// Below this probability an object is "perhaps" there.
constexpr double kSure = 0.95;
/// Below this one it is more likely that there is none.
constexpr double kLikely = 0.5;
constexpr double kStandardNormal95 = 1.645;

bool has_flag(const FitResult& result, const char* word) {
  return std::ranges::count(result.flags, word) > 0;
}

bool is_coordinate(const Unknown& unknown) { return unknown.component <= Component::z; }

/// Decimals of a coordinate that is known to within `radius`, m.
std::string coordinate_text(double value, double radius) {
  const int decimals = radius >= 1 ? 1 : radius >= 0.01 ? 2 : radius >= 0.001 ? 3 : 4;
  const double unit = std::pow(10.0, decimals);
  return formatted("%.*f", decimals, std::round(value * unit) / unit + 0.0);
}

/// What the data say about one object in one mode.
struct Place {
  std::string at;      ///< "x 0.31 m, y -0.52 m"; empty: the data determine no unknown coordinate
  std::string open;    ///< "y": coordinates that the data left open
  std::string turned;  ///< "turned to 20 degrees, give or take 5"; empty: yaw is known or left open
  double radius = 0;   ///< m
};

Place place_of(const Scene& scene, const PoseMode& mode, int object) {
  Place place;
  place.radius = position_radius(scene, mode, object);
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    if (unknown.object != object) continue;
    const auto k = static_cast<Eigen::Index>(i);
    const bool open = std::ranges::count(mode.undetermined, static_cast<int>(i)) > 0;
    if (is_coordinate(unknown)) {
      const char name = "xyz"[static_cast<int>(unknown.component)];
      std::string& list = open ? place.open : place.at;
      if (!list.empty()) list += open ? " and " : ", ";
      list += name;
      if (!open) list += " " + coordinate_text(mode.pose[k], place.radius) + " m";
    } else if (unknown.component == Component::yaw && !open) {
      const double spread = 1.96 * std::sqrt(mode.covariance(k, k)) / kDegree;
      place.turned = formatted("turned to %.0f degrees, give or take %.0f",
                               mode.pose[k] / kDegree + 0.0, std::max(std::ceil(spread), 1.0));
    }
  }
  return place;
}

std::string give_or_take(const Place& place) {
  return place.radius > 0 ? "give or take " + said_length(place.radius) : std::string();
}

/// One object of one mode, as part of a sentence.
std::string object_text(const Scene& scene, const PoseMode& mode, int object, bool with_yaw) {
  const Place place = place_of(scene, mode, object);
  std::string text = object_count(scene) > 1 ? hidden_object(scene, object).name + " " : "";
  text += place.at.empty() ? "somewhere in the search region" : "at " + place.at;
  if (!place.at.empty() && place.open.empty()) text += ", " + give_or_take(place);
  if (!place.open.empty() && !place.at.empty()) text += ", " + place.open + " left open";
  if (with_yaw && !place.turned.empty()) text += ", " + place.turned;
  return text;
}

std::string mode_text(const Scene& scene, const PoseMode& mode, bool with_yaw) {
  std::string text;
  for (int object = 0; object < object_count(scene); ++object) {
    const auto belongs = [object](const Unknown& u) { return u.object == object; };
    if (std::ranges::none_of(scene.unknowns, belongs)) continue;
    // With several objects, a mode may leave one out.
    bool there = true;
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      const double value = mode.pose[static_cast<Eigen::Index>(i)];
      there = there && (!belongs(scene.unknowns[i]) || std::isfinite(value));
    }
    if (!there) continue;
    text += (text.empty() ? "" : "; ") + object_text(scene, mode, object, with_yaw);
  }
  return text;
}

/// Whether two modes put an object at places that are further apart than the errors of both modes.
bool apart(const Scene& scene, const PoseMode& a, const PoseMode& b) {
  for (int object = 0; object < object_count(scene); ++object) {
    double squares = 0;
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      if (scene.unknowns[i].object != object || !is_coordinate(scene.unknowns[i])) continue;
      const auto k = static_cast<Eigen::Index>(i);
      squares += std::pow(a.pose[k] - b.pose[k], 2);
    }
    const double reach = std::max(position_radius(scene, a, object),  //
                                  position_radius(scene, b, object));
    if (std::sqrt(squares) > reach) return true;
  }
  return false;
}

std::string count_word(std::size_t count) {
  static constexpr std::array kWords{"No", "One", "Two", "Three", "Four", "Five", "Six"};
  return count < kWords.size() ? kWords[count] : std::to_string(count);
}

std::string rivals_text(const Scene& scene, const std::vector<PoseMode>& modes) {
  std::vector<const PoseMode*> named;
  for (const PoseMode& mode : modes) {
    if (mode.weight >= kWorthNaming || named.empty()) named.push_back(&mode);
  }
  bool places = true;
  for (std::size_t i = 1; i < named.size(); ++i) {
    places = places && apart(scene, *named[0], *named[i]);
  }
  std::string text = count_word(named.size()) + (places ? " place" : " answer") +
                     (named.size() == 1 ? " explains the light: " : "s explain the light: ");
  for (std::size_t i = 0; i < named.size(); ++i) {
    if (i > 0) text += i + 1 == named.size() ? "; or " : "; ";
    text += mode_text(scene, *named[i], !places) + formatted(" (%.0f %%)", 100 * named[i]->weight);
  }
  return text + ".";
}

}  // namespace

std::string said_length(double metres) {
  if (!std::isfinite(metres)) return "an unknown length";
  if (metres < 0.00095) return formatted("%.2g mm", 1e3 * metres);
  if (metres < 0.0095) return formatted("%.0f mm", 1e3 * metres);
  if (metres < 0.995) return formatted("%.0f cm", 1e2 * metres);
  return metres < 9.95 ? formatted("%.1f m", metres) : formatted("%.0f m", metres);
}

double position_radius(const Scene& scene, const PoseMode& mode, int object) {
  std::vector<Eigen::Index> own;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].object != object || !is_coordinate(scene.unknowns[i])) continue;
    own.push_back(static_cast<Eigen::Index>(i));
  }
  const Eigen::MatrixXd covariance = mode.covariance(own, own);
  const double mean = covariance.trace();
  if (own.empty() || !(mean > 0)) return 0;
  // The gamma distribution is that of a scaled chi-square. Its degrees of freedom, 1 to 3, are by
  // Satterthwaite, its quantile by Wilson and Hilferty.
  const double freedom = mean * mean / covariance.squaredNorm();
  const double part = 2 / (9 * freedom);
  const double quantile = freedom * std::pow(1 - part + kStandardNormal95 * std::sqrt(part), 3);
  return std::sqrt(mean / freedom * quantile);
}

bool found_something(const FitResult& result) {
  return result.error.empty() && !result.posterior.modes.empty() &&
         !has_flag(result, "nothing_detected") && !has_flag(result, "no_photons");
}

std::string fit_headline(const Scene& scene, const FitResult& result) {
  if (!result.error.empty()) return "This capture could not be fitted.";
  if (has_flag(result, "no_photons")) return "Nothing found: the capture holds no light at all.";
  if (has_flag(result, "nothing_detected")) {
    return "Nothing found: an empty scene explains this light as well.";
  }
  const std::vector<PoseMode>& modes = result.posterior.modes;
  if (modes.empty()) return "Nothing is tracked in this frame.";
  const double presence = result.posterior.presence_probability;
  std::string text;
  if (presence < kLikely) {
    text =
        formatted("Unsure: the probability that an object is there is %.2g. If it is: ", presence);
  }
  if (modes.size() > 1 && modes.front().weight < kDecided) {
    text += rivals_text(scene, modes);
  } else {
    text += (presence < kLikely ? "" : "Found ") + mode_text(scene, modes.front(), true) + ".";
  }
  if (presence >= kLikely && presence < kSure) {
    text += formatted(" It may not be there: the probability that it is, is %.2f.", presence);
  }
  if (has_flag(result, "predicted"))
    text += " This frame does not show it: its place is predicted.";
  if (has_flag(result, "at_bound")) {
    text += " It lies on the edge of the search region and may be beyond it.";
  }
  return text;
}

std::string fits_headline(const std::vector<FitResult>& results) {
  const auto found = std::ranges::count_if(results, found_something);
  const auto failed =
      std::ranges::count_if(results, [](const FitResult& r) { return !r.error.empty(); });
  const auto all = std::ssize(results);
  const auto nothing = all - found - failed;
  std::string text = found == all ? formatted("Found in all %td captures", all)
                                  : formatted("Found in %td of %td captures", found, all);
  if (nothing > 0) text += formatted(", nothing in %td", nothing);
  if (failed > 0) text += formatted(", %td could not be fitted", failed);
  return text + ".";
}

}  // namespace blindcorner
