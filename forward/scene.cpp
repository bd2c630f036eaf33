// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene.h"

namespace blindcorner {

std::vector<std::string> unknown_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const Unknown& unknown : scene.unknowns) names.push_back(component_name(unknown.component));
  return names;
}

}  // namespace blindcorner
