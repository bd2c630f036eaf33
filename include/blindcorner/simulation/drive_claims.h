// SPDX-License-Identifier: Apache-2.0
/// What a perception claimed of hidden objects during a drive, against the truth.
#pragma once

#include <optional>
#include <string>

#include "blindcorner/simulation/drive_loop.h"

namespace blindcorner {

/// Sums over squared errors of positions, heaviest mode against truth.
struct PositionErrors {
  double squared = 0;     ///< m^2, of x and y together
  double normalised = 0;  ///< d' C^-1 d; expected: `freedom`
  int positions = 0;      ///< hidden objects, frame by frame
  int freedom = 0;        ///< components of x and y

  /// Root of the mean squared error, m; nothing without positions.
  std::optional<double> rms() const;
  /// Mean normalised squared error: 1 where covariances are honest.
  std::optional<double> ratio() const;
  void add(const PositionErrors& other);
};

/// Of one drive. Answers are those of the perception itself, before an object came in sight.
struct DriveClaims {
  int answers = 0;
  int sure = 0;            ///< of them: presence above kSurePresence
  int covered = 0;         ///< of the sure ones: the truth lies in the 95 % region of all unknowns
  int covered_in_map = 0;  ///< the same moved on to when the map got the answer
  int wrong = 0;           ///< of the sure ones: it lies outside of the 99.9 % region
  int wrong_flagged = 0;   ///< of the wrong ones: with rival modes or a flag that says so
  int lost = 0;            ///< not sure any more, after the first correct one
  PositionErrors at_capture;  ///< of sure answers with one dominating mode, at the capture
  PositionErrors in_map;      ///< the same moved on to when the map got them

  /// The first sure answer that covers the truth, when the vehicle had it: s since the start, s and
  /// m driven before the first object came in direct sight (or before the end), and m from the
  /// vehicle to the nearest hidden object.
  struct First {
    double time = 0, lead_time = 0, lead = 0, distance = 0;
  };
  std::optional<First> first;
};

/// A presence above this is a claim that an object is there.
inline constexpr double kSurePresence = 0.9;

/// Of a finished drive; needs no pictures.
DriveClaims drive_claims(const Drive& drive, const DriveResult& result);

}  // namespace blindcorner
