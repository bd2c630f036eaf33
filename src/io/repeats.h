// SPDX-License-Identifier: Apache-2.0
/// Sorts repeated measurements of one zone: tells two alternating phases apart, and finds bad
/// repeats.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace blindcorner {

/// Histograms of one relay spot in the order they were taken, [repeats][bins].
using RepeatSeries = std::vector<std::vector<double>>;

/// Why a repeat is not used.
enum class Rejection {
  none,
  overflow,     ///< a value is negative or beyond 24 bits
  gain,         ///< the direct return is far from the median of its phase
  unsettled,    ///< parts of the direct return disagree: the spot was elsewhere
  background,   ///< ambient light is far from the median of its phase
  direct_view,  ///< the spot's light reaches the object before the wall, or the sensor sees it
};
std::string rejection_text(Rejection reason);

/// What all series of a spot have in common.
struct RepeatReference {
  /// Runs of bins that a direct return lights, [first, end).
  std::vector<std::pair<std::size_t, std::size_t>> direct;
  double ambient_scale = 1.0;  ///< robust spread of (ambient - median) / sqrt(median)
  /// Bins before the wall's return and after any earlier direct return, [first, end). The wall's
  /// return is the last run that is not far dimmer than the brightest. Only the presence of an
  /// object in direct view lights these bins.
  std::pair<std::size_t, std::size_t> early = {0, 0};
  /// Light in the early bins, counts, [phase]: median over the series.
  std::array<double, 2> early_usual = {0, 0};
  std::array<double, 2> early_scale = {0, 0};  ///< its robust spread; 0: not known
};

/// Reference from all series of one spot. Bins whose median is over five times the background are
/// lit by a direct return.
RepeatReference repeat_reference(const std::vector<const RepeatSeries*>& all);

struct SortedRepeats {
  std::vector<int> phase;           ///< [repeats] 0: the brighter direct return
  std::vector<Rejection> rejected;  ///< [repeats]
};

/// Phases alternate from repeat to repeat; the one with the brighter direct return is phase 0. A
/// repeat is rejected if its direct return is over 30 % off the median of its phase, if its direct
/// returns (where there are several) disagree by over 12 %, or if its ambient light is over eight
/// times the usual spread from its phase's median. All repeats of a series are rejected if the
/// early bins of both phases hold more light than usual, by over eight times the spread. (Light
/// that wraps around lights the early bins of only one phase.)
SortedRepeats sort_repeats(const RepeatSeries& series, const RepeatReference& reference);

}  // namespace blindcorner
