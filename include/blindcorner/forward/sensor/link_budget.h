// SPDX-License-Identifier: Apache-2.0
/// Photons per capture from the physical quantities of the link: can the sensor see the object?
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/link.h"
#include "blindcorner/forward/transport/forward_model.h"

namespace blindcorner {

/// Energy of one photon, h c / lambda, J.
double photon_energy(double wavelength);

/// Counts of one capture per W/m^2 of mean irradiance on the aperture:
/// pi/4 D^2 * transmission * efficiency * exposure / (h c / lambda).
double link_gain(const Link& link);

/// Radiant intensity inside the field, averaged over time, W/sr: pulse energy * repetition rate
/// over the field's solid angle. `solid_angle` in sr.
double link_radiant_intensity(const Link& link, double solid_angle);

/// Spectral irradiance of daylight, W/m^2 per m of wavelength, for an illuminance in lx. The model
/// is a black body at the sun's 5778 K with a luminous efficacy of 93 lm/W. At 850 and 905 nm it
/// agrees with ASTM G173 within 10 %. At 940 nm water vapour absorbs about half of the light, which
/// the model neglects.
double daylight_irradiance(double wavelength, double illuminance);

/// Sets the scene's gains, radiant intensity and (where the scene states none) ambient counts from
/// its link. `ambient_stated`: whether the scene itself states ambient counts.
void apply_link(Scene& scene, bool ambient_stated);

/// Expected counts of one zone in one capture.
struct ZoneBudget {
  double direct = 0;        ///< first bounce and measured background, all bins
  double three_bounce = 0;  ///< light by way of the hidden object, all bins
  double peak = 0;          ///< three-bounce counts of the brightest bin
  double gate_bins = 0;     ///< bins, brightest first, that hold 90 % of three_bounce
  double background = 0;    ///< daylight and dark counts per bin
  /// Three-bounce counts inside the gate over the standard deviation of all counts in the gate.
  double signal_to_noise = 0;
};

/// Budget of every zone for the scene's gains and linear values at one pose. Dead zones are zero.
std::vector<ZoneBudget> link_budget(const Scene& scene, const ForwardModel& model,
                                    const PoseVector& pose);

/// Detections per pulse and detector in the busiest zone, from all light together; nothing without
/// a link. A detection behind an earlier one of the same pulse is lost. Bin k therefore loses at
/// most the share 1 - exp(-sum of the means before k), which is less than this number (Coates, J.
/// Phys. E 1, 1968).
std::optional<double> detections_per_pulse(const Scene& scene,
                                           const std::vector<ZoneBudget>& budget);

/// Adds the decision about pile-up to a plan, unless the sensor states its pile-up cycles. The
/// bound is a share of the bin's own counts.
void decide_pile_up(TransportPlan& plan, const Scene& scene, const std::vector<ZoneBudget>& budget);

/// Exponents of the light's decrease with distance: d log counts / d log distance.
struct DistanceExponents {
  double direct_relay = 0;  ///< direct return against the distance from sensor to relay
  double three_bounce_relay = 0;
  double three_bounce_object = 0;  ///< three-bounce light against the distance from relay to object
};

/// The exponents at one placement of the hidden object, from differences of 5 %. The sensor and the
/// object each move along their line from the middle of the lit and seen relay. With known relay
/// points, the exponents against the relay distance are zero.
DistanceExponents distance_exponents(const Scene& scene, const SensorPlacement& sensor,
                                     const Placement& object);

}  // namespace blindcorner
