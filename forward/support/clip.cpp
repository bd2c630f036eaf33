// SPDX-License-Identifier: Apache-2.0
#include "forward/support/clip.h"

namespace blindcorner {

std::vector<Eigen::Vector3d> clip(const std::vector<Eigen::Vector3d>& polygon,
                                  const Eigen::Vector3d& at, const Eigen::Vector3d& inward) {
  std::vector<Eigen::Vector3d> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3d& p = polygon[i];
    const Eigen::Vector3d& q = polygon[(i + 1) % polygon.size()];
    const double fp = inward.dot(p - at);
    const double fq = inward.dot(q - at);
    if (fp >= 0) kept.push_back(p);
    if ((fp >= 0) != (fq >= 0)) kept.push_back(p + fp / (fp - fq) * (q - p));
  }
  return kept;
}

}  // namespace blindcorner
