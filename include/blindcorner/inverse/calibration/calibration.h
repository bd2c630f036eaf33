// SPDX-License-Identifier: Apache-2.0
/// Calibration of the instrument from captures of known objects, or of no object.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// Standard deviations of the priors about the values of the scene file; 0 keeps a parameter fixed.
/// They are by judgement: a scene file states times to a bin (zones share this error except for a
/// twentieth of a bin), a clock to 3 %, a pulse's width to a third, spots to 3 cm, and gains hardly
/// at all. A parameter about which the captures say more than its prior does not depend on the
/// prior (`determined`).
struct CalibrationOptions {
  double time_zero_bins = 1.0;        ///< bins, shared by all zones
  double zone_time_zero_bins = 0.05;  ///< bins, each zone's own on top of that
  double bin_width_relative = 0.03;
  double pulse_log = 0.3;      ///< natural logarithm of the pulse's widths
  double gain_log = 5.0;       ///< natural logarithm, shared by all zones
  double zone_gain_log = 1.0;  ///< natural logarithm, each zone's own on top of that
  double spot_m = 0.03;        ///< m, relay spots along either axis of their surface
  double cosine_exponent = 1.5;
  double distance_exponent = 0.5;
  double law_axis = 0.15;  ///< tangent of the measured law's axis against the relay's normal
  bool noise = true;       ///< estimate the noise from the residuals
  bool ambient = true;     ///< estimate the prior of each zone's ambient light
  /// Try all assignments of relay spots to zones, when there are at most five spots.
  bool permutations = true;
  /// Try where each zone's time axis may wrap.
  bool wraps = true;
  /// Estimate each zone's static background, and find bins that cannot be used.
  bool background = true;
  /// A capture whose deviance is this many standard deviations too large is left out. By judgement:
  /// a model that is a little off spreads deviances more than noise does.
  double outlier_sigmas = 8.0;
  /// A parameter is determined when its standard error is below this share of its prior's sigma.
  /// Above this share, the captures told less than a third of a bit about the parameter (log2 of
  /// 0.8 is -0.32).
  double determined_share = 0.8;
  /// Smallest spread of the object's brightness, natural logarithm. By judgement: objects of one
  /// kind are no more alike.
  double least_brightness_log = 0.05;
  /// Probability that something which the model does not know disturbs a capture, where the scene
  /// states none; see Scene. By judgement: captures for a calibration are taken with care.
  double outlier_probability = 0.01;
  /// Enlarge the noise until fits of the calibration's own captures, with their poses taken as
  /// unknown, have a mean squared normalised error of at most one.
  bool variance_scale = true;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

struct CalibratedParameter {
  std::string name;        ///< such as "time_zero_ps", "gain_factor[3]", "relay_spot[0].up_m"
  double prior = 0;        ///< value in the scene file
  double prior_sigma = 0;  ///< of the parameter itself, or of its logarithm if `logarithmic`
  double value = 0;
  double standard_error = 0;  ///< in the unit of prior_sigma
  bool logarithmic = false;
  bool determined = true;  ///< false: the data say little, and the prior's value is kept
};

/// One assignment of relay spots to zones.
struct SpotAssignment {
  std::vector<int> spot;  ///< [spots] which of the scene's spots stands in each place
  double deviance = 0;    ///< over the captures of the layout search, less is better
};

/// Wrap of a zone's time axis. It is given for zones whose valid bins refute what the scene states,
/// or confirm it against all other wraps.
struct ZoneWrap {
  int zone = 0;
  int stated = 0, found = 0;  ///< bins after which light reappears at the start; 0: never
  double margin = 0;          ///< deviance by which `found` beats the next best wrap
  int next = 0;               ///< the next best wrap
};

/// Static light in a bin, besides the ambient light and the light that the scene describes.
struct BackgroundBin {
  int zone = 0, bin = 0;
  double counts = 0, standard_error = 0;
};

/// A capture that was not used.
struct LeftOutCapture {
  int index = 0;  ///< index in the captures given
  std::string reason;
};

/// Mean histograms of one zone over the captures, for display. The static background is subtracted,
/// and each capture is aligned to the expected arrival of the object's light, so that the object's
/// pulse does not smear.
struct CalibrationView {
  int zone = 0;
  std::vector<double> measured, before, after;  ///< [bins] mean counts
};

struct Calibration {
  Scene scene;  ///< the scene given, with all results put in
  std::vector<CalibratedParameter> parameters;
  std::vector<SpotAssignment> assignments;  ///< best first; empty: not tried
  std::vector<ZoneWrap> wraps;              ///< of zones whose data decide
  std::vector<BackgroundBin> background;    ///< bins in which static light was found
  std::vector<LeftOutCapture> left_out;
  std::vector<CalibrationView> views;
  int used = 0;                ///< number of captures used
  double deviance_before = 0;  ///< at the scene's values, except the shared gain
  double deviance_after = 0;
  double expected_deviance = 0;    ///< at the noise found
  double brightness_log = 0;       ///< spread of the object's brightness from capture to capture
  double variance_scale = 1;       ///< factor on the noise's variance, see the options
  std::vector<std::string> notes;  ///< what was left out or could not be done, one line each
};

/// Maximum a posteriori estimate of the instrument's parameters (Levenberg-Marquardt on the
/// deviance residuals; ambient light eliminated capture by capture). The estimate goes in rounds:
/// first the parameters, then outliers, ambient light, noise and static background from the
/// residuals. The spread of the brightness follows after the rounds. Captures need the true value
/// of every unknown of the scene. With `no_object`, captures show no object, and only the direct
/// return and the background give information. `advance` is called with the share done, 0 to 1.
/// Throws Error.
Calibration calibrate(const Scene& stated, std::span<const Capture> captures,
                      const CalibrationOptions& options = {}, bool no_object = false,
                      const std::function<void(double)>& advance = {});

}  // namespace blindcorner
