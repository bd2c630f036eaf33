// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/claim_study.h"

#include <cmath>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// Tolerance of the fast model that chooses exposures.
constexpr double kStudyTolerance = 0.02;
constexpr std::uint64_t kStudyLevelSeed = 7'919'000'017;

}  // namespace

void ClaimStudyOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("ClaimStudyOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(captures >= 1, "captures", "at least 1");
  require(std::ranges::all_of(photons, [](double p) { return p > 0 && std::isfinite(p); }),
          "photons", "above 0");
  fit.validate();
}

DrawOptions draw_options(const ClaimStudyOptions& options) {
  DrawOptions draw;
  draw.objects = options.captures;
  draw.light = options.light;
  draw.sampling = options.sampling;
  draw.seed = options.seed;
  return draw;
}

std::vector<ClaimLevel> light_levels(const Scene& scene, const ClaimStudyOptions& options) {
  FastModelOptions fast;
  fast.tolerance = kStudyTolerance;
  const auto model = make_fast_model(scene, sensor_placement(scene), fast);
  std::vector<std::optional<double>> lights(options.photons.begin(), options.photons.end());
  if (lights.empty()) lights.emplace_back();
  std::vector<ClaimLevel> levels;
  std::uint64_t seed = options.seed;
  for (const std::optional<double>& photons : lights) {
    seed += kStudyLevelSeed;
    ClaimLevel level;
    level.photons = photons;
    level.exposure =
        photons ? exposure_for(scene, *model, *photons, options.seed) : own_exposure(scene);
    level.seed = seed;
    levels.push_back(std::move(level));
  }
  return levels;
}

void run_trials(std::size_t count, const std::function<void()>& advance,
                const std::function<void(std::size_t)>& run) {
  parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    run(i);
    if (advance) advance();
  });
}

}  // namespace blindcorner
