// SPDX-License-Identifier: Apache-2.0
/// Will the sensor see it? Photons per capture from the physical quantities of the link.
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

/// Spectral irradiance of daylight, W/m^2 per m of wavelength, for an illuminance in lx: a black
/// body of the sun's 5778 K with its luminous efficacy of 93 lm/W. At 850 and 905 nm within 10 % of
/// ASTM G173; at 940 nm water vapour takes about half of it, which this does not.
double daylight_irradiance(double wavelength, double illuminance);

/// Puts gain, radiant intensity and (where the scene states none) ambient counts of the link into a
/// scene. `ambient_stated`: whether the scene gives ambient counts itself.
void apply_link(Scene& scene, bool ambient_stated);

/// Expected counts of one zone in one capture.
struct ZoneBudget {
  double direct = 0;        ///< first bounce and measured background, all bins
  double three_bounce = 0;  ///< by way of the hidden object, all bins
  double peak = 0;          ///< of that, the brightest bin
  double gate_bins = 0;     ///< bins, brightest first, that hold 90 % of it
  double background = 0;    ///< daylight and dark counts, per bin
  /// Three-bounce counts inside the gate over the standard deviation of all counts there.
  double signal_to_noise = 0;
};

/// Budget of every zone for the scene's gains and linear values at one pose. Dead zones are zero.
std::vector<ZoneBudget> link_budget(const Scene& scene, const ForwardModel& model,
                                    const PoseVector& pose);

/// Detections per pulse and detector in the busiest zone, all light together; nothing without a
/// link. Detections behind an earlier one of the same pulse are lost, so bin k loses at most the
/// share 1 - exp(-sum of the means before k): less than this number (Coates, J. Phys. E 1, 1968).
std::optional<double> detections_per_pulse(const Scene& scene,
                                           const std::vector<ZoneBudget>& budget);

/// Adds the decision about pile-up to a plan. Its bound is a share of the bin's own counts.
void decide_pile_up(TransportPlan& plan, const Scene& scene, const std::vector<ZoneBudget>& budget);

/// How light falls with the distances, as exponents: d log counts / d log distance.
struct DistanceExponents {
  double direct_relay = 0;  ///< direct return against the distance sensor - relay
  double three_bounce_relay = 0;
  double three_bounce_object = 0;  ///< against the distance relay - object
};

/// The exponents at one placement of the hidden object, by differences of 5 %: the sensor moves
/// along its axis, the object along the line from the middle of the lit spot.
DistanceExponents distance_exponents(const Scene& scene, const SensorPlacement& sensor,
                                     const Placement& object);

}  // namespace blindcorner
