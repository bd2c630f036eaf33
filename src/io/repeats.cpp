// SPDX-License-Identifier: Apache-2.0
#include "io/repeats.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

/// Least ratio of a direct return to the background.
constexpr double kBright = 5.0;
/// Largest deviation of the gain. Automatic exposure changes it in steps of 15 %; a mirror on its
/// way loses half the light.
constexpr double kGainTolerance = 0.3;
/// Largest disagreement of the direct returns of one repeat. Exposure steps change all of them
/// alike.
constexpr double kShapeTolerance = 0.12;
/// In robust standard deviations.
constexpr double kAmbientTolerance = 8.0;
/// In robust standard deviations; positions in direct view are at ten to thousands, others below
/// three.
constexpr double kEarlyTolerance = 8.0;
/// Least share of the brightest direct return that the wall's return has.
constexpr double kWallShare = 0.05;
/// Counters of the sensor have 24 bits.
constexpr double kOverflow = 16777216.0 - 65536.0;

/// Mean of the lower three quarters of the bins outside the direct return: the third bounce lights
/// the upper quarter. The last bin is not used (unusable on this sensor).
double ambient_of(const std::vector<double>& row, const RepeatReference& reference) {
  std::vector<double> dark;
  for (std::size_t b = 0; b + 1 < row.size(); ++b) {
    const bool lit =
        std::any_of(reference.direct.begin(), reference.direct.end(),
                    // One bin more on either side for the rims.
                    [b](const auto& run) { return b + 1 >= run.first && b <= run.second; });
    if (!lit) dark.push_back(row[b]);
  }
  std::sort(dark.begin(), dark.end());
  const std::size_t count = (3 * dark.size() + 3) / 4;
  if (count == 0) return 0;
  return std::accumulate(dark.begin(), dark.begin() + static_cast<std::ptrdiff_t>(count), 0.0) /
         static_cast<double>(count);
}

/// Sum of each run of direct bins, [runs].
std::vector<double> direct_of(const std::vector<double>& row, const RepeatReference& reference) {
  std::vector<double> sums;
  for (const auto& [first, end] : reference.direct) {
    sums.push_back(std::accumulate(row.begin() + static_cast<std::ptrdiff_t>(first),
                                   row.begin() + static_cast<std::ptrdiff_t>(end), 0.0));
  }
  return sums;
}

/// Light in the early bins.
double early_of(const std::vector<double>& row, const RepeatReference& reference) {
  const auto [first, end] = reference.early;
  return std::accumulate(row.begin() + static_cast<std::ptrdiff_t>(first),
                         row.begin() + static_cast<std::ptrdiff_t>(end), 0.0);
}

/// Median of the values of every second repeat, from `parity` on.
double phase_median(const std::vector<double>& values, std::size_t parity) {
  std::vector<double> own;
  for (std::size_t r = parity; r < values.size(); r += 2) own.push_back(values[r]);
  return median(std::move(own));
}

/// Phase of the first repeat: the one with the brighter direct returns is 0.
std::size_t first_phase(const RepeatSeries& series, const RepeatReference& reference) {
  std::vector<double> totals;
  for (const auto& row : series) {
    const std::vector<double> sums = direct_of(row, reference);
    totals.push_back(std::accumulate(sums.begin(), sums.end(), 0.0));
  }
  return phase_median(totals, 0) >= phase_median(totals, 1) ? 0 : 1;
}

/// Light in the early bins of each phase: the mean of the middle half of its repeats, and its
/// standard error from their scatter. This mean is steadier than a median where counts are small
/// whole numbers.
struct EarlyLight {
  std::array<double, 2> mean{}, error{};
};
EarlyLight early_light(const RepeatSeries& series, const RepeatReference& reference,
                       std::size_t first) {
  std::array<std::vector<double>, 2> early;
  for (std::size_t r = 0; r < series.size(); ++r) {
    early[(r + first) % 2].push_back(early_of(series[r], reference));
  }
  EarlyLight light;
  for (std::size_t p = 0; p < 2; ++p) {
    std::sort(early[p].begin(), early[p].end());
    const auto cut = std::ssize(early[p]) / 4;
    light.mean[p] = std::accumulate(early[p].begin() + cut, early[p].end() - cut, 0.0) /
                    static_cast<double>(std::ssize(early[p]) - 2 * cut);
    double square = 0;
    for (const double value : early[p]) square += std::pow(value - light.mean[p], 2);
    light.error[p] = std::sqrt(square) / static_cast<double>(early[p].size());
  }
  return light;
}

/// Learns what the early bins usually hold. The spread stays 0 (not known) if all series are alike
/// and do not scatter. The bin next to a direct return is its rim, and no early bin.
void learn_early_light(const std::vector<const RepeatSeries*>& all,
                       const std::vector<double>& typical, RepeatReference& reference) {
  if (reference.direct.empty()) return;
  // The wall's return is the last run that is no third bounce: third bounces are far dimmer.
  const auto brightest = [&](const std::pair<std::size_t, std::size_t>& run) {
    return *std::max_element(typical.begin() + static_cast<std::ptrdiff_t>(run.first),
                             typical.begin() + static_cast<std::ptrdiff_t>(run.second));
  };
  double most = 0;
  for (const auto& run : reference.direct) most = std::max(most, brightest(run));
  const auto wall =
      std::find_if(reference.direct.rbegin(), reference.direct.rend(),
                   [&](const auto& run) { return brightest(run) >= kWallShare * most; });
  const auto before = std::next(wall);
  const std::size_t first = before == reference.direct.rend() ? 0 : before->second + 1;
  if (wall->first <= first + 1) return;
  reference.early = {first, wall->first - 1};
  std::array<std::vector<double>, 2> light, errors;
  for (const RepeatSeries* series : all) {
    if (series->size() < 2) continue;
    const EarlyLight own = early_light(*series, reference, first_phase(*series, reference));
    for (std::size_t p = 0; p < 2; ++p) {
      light[p].push_back(own.mean[p]);
      errors[p].push_back(own.error[p]);
    }
  }
  for (std::size_t p = 0; p < 2; ++p) {
    if (light[p].empty()) return;
    const double usual = median(light[p]);
    for (double& value : light[p]) value = std::abs(value - usual);
    reference.early_usual[p] = usual;
    reference.early_scale[p] =
        std::max(1.4826 * median(std::move(light[p])), median(std::move(errors[p])));
  }
}

bool in_direct_view(const RepeatSeries& series, const RepeatReference& reference,
                    std::size_t first) {
  if (series.size() < 2 || reference.early.first == reference.early.second) return false;
  const std::array<double, 2> light = early_light(series, reference, first).mean;
  for (std::size_t p = 0; p < 2; ++p) {
    if (reference.early_scale[p] <= 0) return false;
    if (light[p] - reference.early_usual[p] <= kEarlyTolerance * reference.early_scale[p]) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string rejection_text(Rejection reason) {
  switch (reason) {
    case Rejection::overflow:
      return "a counter overflowed";
    case Rejection::gain:
      return "the direct return is far from its median";
    case Rejection::unsettled:
      return "the spot had not settled (direct returns disagree)";
    case Rejection::background:
      return "the ambient light is far from its median";
    case Rejection::direct_view:
      return "the object is in direct view (light before the wall's return)";
    default:
      return "kept";
  }
}

RepeatReference repeat_reference(const std::vector<const RepeatSeries*>& all) {
  RepeatReference reference;
  if (all.empty() || all.front()->empty()) return reference;
  const std::size_t bins = all.front()->front().size();
  std::vector<double> typical(bins);
  for (std::size_t b = 0; b < bins; ++b) {
    std::vector<double> values;
    for (const RepeatSeries* series : all) {
      for (const auto& row : *series) values.push_back(row[b]);
    }
    typical[b] = median(std::move(values));
  }
  const double background = std::max(median(typical), 1e-3 * *std::ranges::max_element(typical));
  for (std::size_t b = 0; b < bins; ++b) {
    if (typical[b] <= kBright * background) continue;
    if (!reference.direct.empty() && reference.direct.back().second == b) {
      ++reference.direct.back().second;
    } else {
      reference.direct.emplace_back(b, b + 1);
    }
  }
  std::vector<double> deviations;
  for (const RepeatSeries* series : all) {
    std::vector<double> ambient;
    for (const auto& row : *series) ambient.push_back(ambient_of(row, reference));
    for (std::size_t r = 0; r < ambient.size(); ++r) {
      const double usual = phase_median(ambient, r % 2);
      if (usual > 0) deviations.push_back(std::abs(ambient[r] - usual) / std::sqrt(usual));
    }
  }
  reference.ambient_scale = std::max(1.4826 * median(std::move(deviations)), 1e-9);
  learn_early_light(all, typical, reference);
  return reference;
}

SortedRepeats sort_repeats(const RepeatSeries& series, const RepeatReference& reference) {
  const std::size_t repeats = series.size();
  SortedRepeats sorted;
  sorted.phase.resize(repeats);
  sorted.rejected.assign(repeats, Rejection::none);
  std::vector<std::vector<double>> direct(reference.direct.size(), std::vector<double>(repeats));
  std::vector<double> ambient(repeats);
  for (std::size_t r = 0; r < repeats; ++r) {
    const std::vector<double> sums = direct_of(series[r], reference);
    for (std::size_t g = 0; g < sums.size(); ++g) direct[g][r] = sums[g];
    ambient[r] = ambient_of(series[r], reference);
  }
  const std::size_t first = first_phase(series, reference);
  const bool direct_view = in_direct_view(series, reference, first);
  for (std::size_t r = 0; r < repeats; ++r) {
    sorted.phase[r] = static_cast<int>((r + first) % 2);
    Rejection& reason = sorted.rejected[r];
    if (std::ranges::any_of(series[r], [](double n) { return n < 0 || n >= kOverflow; })) {
      reason = Rejection::overflow;
      continue;
    }
    if (direct_view) {
      reason = Rejection::direct_view;
      continue;
    }
    std::vector<double> gains;
    for (const auto& sums : direct) {
      const double usual = phase_median(sums, r % 2);
      if (usual > 0) gains.push_back(sums[r] / usual);
    }
    const double usual_ambient = phase_median(ambient, r % 2);
    if (!gains.empty() && std::abs(gains.front() - 1) > kGainTolerance) {
      reason = Rejection::gain;
    } else if (std::ranges::any_of(gains, [&](double gain) {
                 return std::abs(gain / gains.front() - 1) > kShapeTolerance;
               })) {
      reason = Rejection::unsettled;
    } else if (std::abs(ambient[r] - usual_ambient) >
               kAmbientTolerance * reference.ambient_scale * std::sqrt(usual_ambient)) {
      reason = Rejection::background;
    }
  }
  return sorted;
}

}  // namespace blindcorner
