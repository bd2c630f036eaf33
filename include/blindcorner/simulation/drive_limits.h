// SPDX-License-Identifier: Apache-2.0
/// Physical limits of a drive, whatever is planned: when direct sight and light come, and when the
/// vehicle has to brake.
///
/// The vehicle drives as if nobody were there. The hidden object moves as the drive file says.
/// Intervals are at their middle and velocities at their fastest, because the fastest object comes
/// last into sight. Vehicle and object then touch at a time T_0. All times here count backwards
/// from T_0. A vehicle that brakes at its friction limit from a time t on is later at every place
/// than with any other braking. If any braking lets the object pass or stops before the object,
/// this braking does so too. The last moment is the last t at which this braking still avoids all
/// contact. A frame and the declared delay come before that moment. A vehicle that accelerates to
/// pass in front is not considered, nor a vehicle that leaves its path.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "blindcorner/io/drive_file.h"
#include "blindcorner/simulation/simulated_sensor.h"

namespace blindcorner {

struct DriveLimitsOptions {
  int speeds = 13;  ///< number of wanted speeds, evenly spread over those of the drive's trials
  /// Ratio of the counts by way of the object to the standard deviation of all counts there, in the
  /// best zone (ZoneBudget). Above this ratio, light tells more than noise.
  double signal_to_noise = 3;
  double light_step = 0.5;  ///< s, time step of the first search for light
  /// Light is computed for every so many-th speed, because each speed takes seconds. Its times are
  /// interpolated between these speeds. 0: light is not computed.
  int light_every = 3;

  /// Throws Error naming the field.
  void validate() const;
};

/// Times in s before the vehicle would touch the object. Empty: never, or the two never touch.
struct DriveLimits {
  std::vector<double> speed;                 ///< m/s, wanted speeds
  std::vector<std::optional<double>> sight;  ///< when direct sight first shows the object
  /// Time needed to stop, or to slow down until the object has passed, from the frame on that shows
  /// the object.
  std::vector<std::optional<double>> stop;
  /// When the light first tells more than noise. The time by which the solver's declared delay
  /// exceeds that of direct sight is subtracted. To be compared with `stop` as well.
  std::vector<std::optional<double>> light;
  /// Lowest speed, m/s, above which direct sight or light comes too late to stop. Empty: it comes
  /// in time at all speeds.
  std::optional<double> sight_limit, light_limit;
};

/// Whether the drive file says where the vehicle meets an object: by `hidden.meeting`, or by the
/// place of the first object.
bool states_who_is_met(const Drive& drive);

/// Computes the limits. `sensor` is made from the drive's scene.
DriveLimits drive_limits(const Drive& drive, const SimulatedSensor& sensor,
                         const DriveLimitsOptions& options = {});

/// The limits as the text of limits.json.
std::string limits_json(const DriveLimits& limits);

}  // namespace blindcorner
