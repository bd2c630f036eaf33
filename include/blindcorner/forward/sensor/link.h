// SPDX-License-Identifier: Apache-2.0
/// The physical quantities that turn light into counts.
#pragma once

namespace blindcorner {

/// Laser, optics, detector and daylight of one capture, in SI units.
struct Link {
  double pulse_energy = 1e-9;        ///< J, of one pulse over the whole field of illumination
  double repetition_rate = 1e6;      ///< pulses per second
  double exposure = 0.03;            ///< s, duration of one capture
  double wavelength = 940e-9;        ///< m
  double aperture = 1e-3;            ///< m, diameter of the round receiving aperture
  double transmission = 1.0;         ///< of receiving optics and filter at the wavelength, 0..1
  double detection_efficiency = 1;   ///< counts per photon on the detector, fill factor included
  double filter_width = 10e-9;       ///< m, equivalent width of the filter
  double ambient_illuminance = 0.0;  ///< lx, daylight on the known surfaces
  double dark_rate = 0.0;            ///< counts per second and zone
  double detectors = 1;              ///< SPADs that share a zone, each with its own dead time

  /// Number of pulses in one capture.
  double pulses() const { return repetition_rate * exposure; }
  /// Mean optical power, W.
  double power() const { return pulse_energy * repetition_rate; }
};

}  // namespace blindcorner
