// SPDX-License-Identifier: Apache-2.0
/// What physics allows on a drive, whatever is planned: when direct sight and light come, and when
/// the vehicle has to brake.
///
/// The vehicle drives as it would if nobody were there, and the hidden object as the drive file
/// says (intervals at their middle, velocities at their fastest: who comes last into sight). They
/// then touch at a time T_0, from which all times here count backwards. A vehicle that from a time
/// t on brakes at its friction limit is later at every place than with any other braking, so that
/// whatever lets the object pass or stops before it can be done if this can: the last t at which
/// this still avoids all contact is the last moment. A frame and the declared delay come before it.
/// An accelerating vehicle, which would pass in front, is not looked at, nor one that leaves its
/// path.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "blindcorner/io/drive_file.h"
#include "blindcorner/simulation/simulated_sensor.h"

namespace blindcorner {

struct DriveLimitsOptions {
  int speeds = 13;  ///< wanted speeds, evenly over those of the drive's trials
  /// Counts by way of the object over the deviation of all counts there, in the best zone, from
  /// which light tells more than noise (ZoneBudget).
  double signal_to_noise = 3;
  double light_step = 0.5;  ///< s, between the times at which light is looked at first
  /// Light is looked at for every so many-th speed, since it takes seconds for each; its times are
  /// interpolated between them. 0: it is not looked at.
  int light_every = 3;

  /// Throws Error naming the field.
  void validate() const;
};

/// Times in s before the vehicle would touch the object; empty: never, or they never touch.
struct DriveLimits {
  std::vector<double> speed;                 ///< m/s, wanted
  std::vector<std::optional<double>> sight;  ///< direct sight first shows the object
  /// Needed to stop, or to slow down until the object has passed, from the frame on that shows it.
  std::vector<std::optional<double>> stop;
  /// The light first tells more than noise, less what the solver's declared delay is longer than
  /// that of direct sight: to be compared with `stop` as well.
  std::vector<std::optional<double>> light;
  /// Lowest of the speeds above which what comes too late comes too late to stop, m/s; empty: it is
  /// in time at all speeds.
  std::optional<double> sight_limit, light_limit;
};

/// Whether the drive file says where the vehicle meets whom: by `hidden.meeting`, or by the place
/// of the first object.
bool states_who_is_met(const Drive& drive);

/// `sensor` is made from the drive's scene.
DriveLimits drive_limits(const Drive& drive, const SimulatedSensor& sensor,
                         const DriveLimitsOptions& options = {});

/// As limits.json has them.
std::string limits_json(const DriveLimits& limits);

}  // namespace blindcorner
