// SPDX-License-Identifier: Apache-2.0
/// The instrument: zones, time axis, pulse, noise, illumination. Data, not code.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "blindcorner/forward/scene/pose.h"
#include "blindcorner/forward/sensor/impulse_response.h"
#include "blindcorner/forward/sensor/link.h"
#include "blindcorner/forward/sensor/noise_model.h"

namespace blindcorner {

/// Rectangle of directions about the optical axis (+x of the sensor frame), radians, measured in
/// the two axis planes: a direction is proportional to (1, -tan(right), -tan(down)).
struct AngularRectangle {
  double left = 0.0, right = 0.0;  ///< rightwards positive, left < right
  double top = 0.0, bottom = 0.0;  ///< downwards positive, top < bottom
};
/// Cone about the optical axis; half angle in radians.
struct AngularCone {
  double half_angle = 0.0;
};
using FieldOfIllumination = std::variant<AngularRectangle, AngularCone>;

/// Footprint of the zone of one histogram: a rectangle of directions, or one known point on a relay
/// surface (world, m). The point stands for a spot of negligible size.
using ZoneFootprint = std::variant<AngularRectangle, Eigen::Vector3d>;

struct Zone {
  ZoneFootprint footprint = AngularRectangle{};
  double time_zero = 0.0;  ///< s, time at which light of zero path length peaks
  double gain = 1.0;       ///< counts per W/m^2
  bool dead = false;       ///< the zone carries no information
  int first_valid_bin = 0;
  int last_valid_bin = -1;     ///< inclusive; -1: the sensor's last bin
  int wrap_bins = -1;          ///< this zone's value of Sensor::wrap_bins; -1: the sensor's
  double variance_floor = -1;  ///< counts^2, this zone's Gaussian noise floor; -1: the model's
  /// [bins] measured static light, counts, in addition to the ambient light and the direct return:
  /// cover glass, crosstalk, or clutter that the scene does not describe. Empty: none.
  std::vector<double> background;

  double background_at(int bin) const {
    return background.empty() ? 0.0 : background[static_cast<std::size_t>(bin)];
  }
};

enum class Illumination {
  flash,    ///< one field lights everything, and every zone sees light from everywhere
  confocal  ///< each zone is lit separately
};

/// Where optical path lengths start.
enum class PathOrigin {
  sensor,  ///< source to detector, all legs
  relay    ///< the direct path of each zone (twice its distance) has been subtracted
};

struct Sensor {
  std::string name = "custom";
  int rows = 1;
  int columns = 1;
  std::vector<Zone> zones;  ///< [rows * columns], row by row
  int bins = 128;
  double bin_width = 1e-10;  ///< s
  ImpulseResponse response;
  int wrap_bins = 0;  ///< light later than this bin reappears this many bins earlier; 0: never
  NoiseModel noise = PoissonNoise{};
  double dispersion = 1.0;  ///< variance / mean of one exposure's counts
  /// Number of laser pulses in one capture times number of detectors in a zone. Each detector
  /// reports at most the first photon of a pulse, so early light hides later light (pile-up). 0: no
  /// pile-up.
  double pile_up_cycles = 0.0;
  double saturation = 0.0;  ///< largest count that a bin can hold; 0: no limit
  /// [receiving zone][zone] share of a zone's light that the receiving zone records, row by row.
  /// Empty: each zone records only its own light.
  std::vector<double> crosstalk;
  Illumination illumination = Illumination::flash;
  FieldOfIllumination field = AngularCone{};
  double radiant_intensity = 1.0;                          ///< W/sr inside the field
  Eigen::Vector3d light_offset = Eigen::Vector3d::Zero();  ///< m, sensor frame
  PathOrigin path_origin = PathOrigin::sensor;
  std::optional<Link> link;  ///< if given, gains and radiant intensity follow from the link

  int zone_count() const { return rows * columns; }
  /// Number of bins after which a zone's light reappears at the start; 0: never.
  int wrap(int zone) const {
    const int own = zones[static_cast<std::size_t>(zone)].wrap_bins;
    return own < 0 ? wrap_bins : own;
  }
  /// Whether any zone has a noise floor of its own.
  bool zones_have_noise_floors() const {
    return std::ranges::any_of(zones, [](const Zone& zone) { return zone.variance_floor > 0; });
  }
  /// Whether any zone has a measured background.
  bool has_background() const {
    return std::ranges::any_of(zones, [](const Zone& zone) { return !zone.background.empty(); });
  }
  /// Noise model of a zone's counts.
  NoiseModel noise_of(int zone) const {
    NoiseModel own = noise;
    const double floor = zones[static_cast<std::size_t>(zone)].variance_floor;
    const auto line = noise.stated_line();
    if (line && floor > 0) own.state_line({floor, line->per_count});
    return own;
  }
  /// Whether a bin that holds this many counts is full.
  bool saturates(double counts) const {
    return saturation > 0 && counts >= saturation * (1 - 1e-6);  // captures may hold floats
  }
  /// One past the last valid bin of a zone.
  int valid_end(int zone) const {
    const int last = zones[static_cast<std::size_t>(zone)].last_valid_bin;
    return last < 0 ? bins : last + 1;
  }
};

}  // namespace blindcorner
