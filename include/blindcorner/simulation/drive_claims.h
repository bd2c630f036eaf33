// SPDX-License-Identifier: Apache-2.0
/// Compares a perception's claims about hidden objects during a drive with the truth.
#pragma once

#include <optional>
#include <string>

#include "blindcorner/simulation/drive_loop.h"

namespace blindcorner {

/// Sums of squared position errors of the heaviest mode against the truth.
struct PositionErrors {
  double squared = 0;     ///< m^2, of x and y together
  double normalised = 0;  ///< d' C^-1 d; expected value: `freedom`
  int positions = 0;      ///< number of hidden objects, summed over frames
  int freedom = 0;        ///< number of components of x and y

  /// Root of the mean squared error, m; empty without positions.
  std::optional<double> rms() const;
  /// Mean normalised squared error: 1 if the covariances are honest.
  std::optional<double> ratio() const;
  void add(const PositionErrors& other);
};

/// Claims of one drive. Answers are those of the perception itself, before an object came in direct
/// sight. The scene bounds where an object may be. Answers while a position is out of these bounds
/// are counted apart: no answer inside can be right.
struct DriveClaims {
  int outside = 0;         ///< answers while an object was outside of the search region
  int answers = 0;         ///< all others
  int sure = 0;            ///< answers with a presence above kSurePresence
  int covered = 0;         ///< sure answers whose 95 % region of all unknowns holds the truth
  int covered_in_map = 0;  ///< the same, for answers moved on to when the map got them
  int wrong = 0;           ///< sure answers with the truth outside the 99.9 % region, or no object
  int wrong_flagged = 0;   ///< wrong answers flagged multimodal, predicted or at_bound
  int lost = 0;            ///< answers that are not sure any more, after the first correct one
  PositionErrors at_capture;  ///< errors of sure answers with one dominating mode, at the capture
  PositionErrors in_map;      ///< the same, for answers moved on to when the map got them

  /// The first sure answer that covers the truth, when the vehicle had it. `time`: s since the
  /// start. `lead_time` and `lead`: s and m driven before the first object came in direct sight (or
  /// before the end). `distance`: m from the vehicle to the nearest hidden object.
  struct First {
    double time = 0, lead_time = 0, lead = 0, distance = 0;
  };
  std::optional<First> first;
};

/// A presence above this is a claim that an object is there.
inline constexpr double kSurePresence = 0.9;

/// Claims of a finished drive. Needs no pictures.
DriveClaims drive_claims(const Drive& drive, const DriveResult& result);

}  // namespace blindcorner
