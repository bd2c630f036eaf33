// SPDX-License-Identifier: Apache-2.0
#include "inverse/fit_options.h"

#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

const std::vector<std::pair<FitRule, std::string>>& fit_rules() {
  static const std::vector<std::pair<FitRule, std::string>> rules{
      {FitRule::turn, "turn"},
      {FitRule::rearrange, "rearrange"},
      {FitRule::sharpen, "sharpen"},
      {FitRule::shadow, "shadow"},
      {FitRule::along_axis, "along_axis"},
      {FitRule::ridges, "ridges"},
      {FitRule::local_light, "local_light"}};
  return rules;
}

void FitOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* accepted) {
    if (!condition)
      throw Error(std::string("FitOptions.") + field, std::string("accepted: ") + accepted);
  };
  require(!model_tolerance ||
              (*model_tolerance >= FastModelOptions::kLeastTolerance && *model_tolerance < 1),
          "model_tolerance", "1e-5 to less than 1");
  require(max_scored_poses >= 1, "max_scored_poses", "at least 1");
  require(max_closed_form_poses >= 1, "max_closed_form_poses", "at least 1");
  require(captures_per_placement >= 1, "captures_per_placement", "at least 1");
  require(max_starts >= 1, "max_starts", "at least 1");
  require(negligible_log_posterior > 0, "negligible_log_posterior", "above 0");
  require(importance_samples >= 0, "importance_samples", "at least 0");
  require(empty_captures == 0 || empty_captures >= 16, "empty_captures", "0 or at least 16");
}

void validate_scene(const Scene& scene) {
  validate(scene);
  if (scene.unknowns.empty()) {
    throw Error(scene_place(scene),
                "unknowns: found none, accepted: at least one component to fit");
  }
  check_relay_visible(scene);
}

}  // namespace blindcorner
