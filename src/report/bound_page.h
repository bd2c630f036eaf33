// SPDX-License-Identifier: Apache-2.0
/// Results of `blindcorner bound`: maps of the error to expect, as JSON, CSV and a page.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/bound/error_bound.h"

namespace blindcorner {

/// The object counts as noticed at a place where at least this share of the captures shows it.
inline constexpr double kNoticed = 0.5;

/// The bounds over the hidden area for one place of the sensor. The object is at the centres of
/// cells along x and y. Every other unknown has the same value at all places.
struct BoundMap {
  std::string name;                           ///< of the sensor pose
  Scene scene;                                ///< seen from there
  std::vector<Eigen::Vector3d> relay_points;  ///< [zones] where the scene does not give them
  BoundOptions options;
  double prior_error = 0;          ///< m
  std::vector<double> x_m, y_m;    ///< cell centres; one where the coordinate is known
  Eigen::Vector2d cell{0, 0};      ///< m, edges of a cell along x and y
  std::vector<PoseBound> places;   ///< [y][x]
  std::vector<std::string> hints;  ///< which parts of the region cannot be seen, and why

  const PoseBound& at(std::size_t row, std::size_t column) const {
    return places[row * x_m.size() + column];
  }
};

/// What a map says in a few numbers.
struct BoundSummary {
  double noticed_share = 0;    ///< of the places
  double median_error = 0;     ///< m, of the places where the object is noticed; NaN: no such place
  double p90_error = 0;        ///< m, the same
  double ambiguous_share = 0;  ///< of the places
  double median_photons = 0;
};
BoundSummary summarise(const BoundMap& map);

/// The sentences that stand first on the page.
std::string bound_headline(const BoundMap& map);

std::string bound_json(const std::vector<BoundMap>& maps);
std::string bound_csv(const std::vector<BoundMap>& maps);
std::string bound_page(const std::vector<BoundMap>& maps);

}  // namespace blindcorner
