// SPDX-License-Identifier: Apache-2.0
#include "report/colours.h"

#include <array>
#include <utility>

#include "report/formatted.h"

namespace blindcorner::colour {
namespace {

constexpr std::array<const char*, 8> kSeries{"#0072b2", "#d55e00", "#009e73", "#7a5ccf",
                                             "#e69f00", "#3a8fd0", "#8f6b2e", "#cc79a7"};

constexpr std::array<std::pair<std::string_view, const char*>, 11> kMethods{
    {{"solver", kFound},
     {"oracle", kTruth},
     {"los", "var(--series-0,#0072b2)"},
     {"cnn", "var(--series-3,#7a5ccf)"},
     {"published network", "var(--series-3,#7a5ccf)"},
     {"cnn_wide", "var(--series-7,#cc79a7)"},
     {"wide network", "var(--series-7,#cc79a7)"},
     {"back-projection", "var(--series-5,#3a8fd0)"},
     {"multilateration", "var(--series-6,#8f6b2e)"},
     {"oracle_disc", "var(--series-4,#e69f00)"},
     {"oracle_covariance", kTruth}}};

}  // namespace

std::string of_series(std::size_t i) {
  const std::size_t k = i % kSeries.size();
  return formatted("var(--series-%zu,%s)", k, kSeries[k]);
}

std::string of_method(std::string_view name, std::size_t place) {
  for (const auto& [known, colour] : kMethods) {
    if (known == name) return colour;
  }
  return of_series(place + 4);
}

}  // namespace blindcorner::colour
