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

/// What one histogram looks at: a rectangle of directions, or one known point on a relay surface
/// (world, m) that stands for a spot too small to matter.
using ZoneFootprint = std::variant<AngularRectangle, Eigen::Vector3d>;

struct Zone {
  ZoneFootprint footprint = AngularRectangle{};
  double time_zero = 0.0;  ///< s, when light of zero path length peaks
  double gain = 1.0;       ///< counts per W/m^2
  bool dead = false;       ///< carries no information
  int first_valid_bin = 0;
  int last_valid_bin = -1;  ///< inclusive; -1: the sensor's last bin
  int wrap_bins = -1;       ///< as the sensor's, of this zone; -1: the sensor's
  double variance_floor =
      -1;  ///< counts^2, as a Gaussian noise model's, of this zone; -1: the model's
  /// [bins] static light as measured (cover glass, crosstalk, clutter that the scene does not
  /// know), counts beside the ambient light and the direct return; empty: none.
  std::vector<double> background;

  double background_at(int bin) const {
    return background.empty() ? 0.0 : background[static_cast<std::size_t>(bin)];
  }
};

enum class Illumination {
  flash,    ///< one field lights all, every zone sees light from everywhere
  confocal  ///< each zone is lit by itself
};

/// From where optical path lengths are counted.
enum class PathOrigin {
  sensor,  ///< source to detector, all legs
  relay    ///< the direct path of each zone (twice its distance) has been taken off
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
  /// Laser pulses times detectors of a zone in one capture. Each detector reports at most the first
  /// photon of a pulse, so early light hides later light (pile-up). 0: no pile-up.
  double pile_up_cycles = 0.0;
  double saturation = 0.0;  ///< most counts that a bin can hold; 0: any number
  /// [receiving zone][zone] share of a zone's light that a zone records, row by row; empty: each
  /// zone records its own light and no other.
  std::vector<double> crosstalk;
  Illumination illumination = Illumination::flash;
  FieldOfIllumination field = AngularCone{};
  double radiant_intensity = 1.0;                          ///< W/sr inside the field
  Eigen::Vector3d light_offset = Eigen::Vector3d::Zero();  ///< m, sensor frame
  PathOrigin path_origin = PathOrigin::sensor;
  std::optional<Link> link;  ///< where given, gains and radiant intensity come from it

  int zone_count() const { return rows * columns; }
  /// Bins after which light of a zone reappears at the start; 0: never.
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
