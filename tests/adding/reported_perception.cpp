// SPDX-License-Identifier: Apache-2.0
/// A perception: a camera at the corner tells where the object is. docs/adding.md shows it;
/// adding_test.cpp asks it.
#include <algorithm>

#include "adding/examples.h"

namespace blindcorner {
namespace {

// [perception]
/// Knows what a camera at the corner has reported, once a second, and nothing of what has happened
/// since then.
class ReportedPerception final : public Perception {
 public:
  explicit ReportedPerception(const PerceptionSetup& setup)
      : scene_(setup.scene), truth_(setup.truth) {}

  PerceptionAnswer perceive(const Capture& /*capture*/, const Transform& /*T_world_sensor*/,
                            double time) override {
    constexpr double kPeriod = 1;  // s
    if (!reported_ || time >= report_time_ + kPeriod) {
      report_time_ = time;
      reported_ = known_pose(scene_, truth_(time));
    }
    PerceptionAnswer answer;
    answer.mixture = reported_;
    return answer;
  }
  bool needs_histograms() const override { return false; }

 private:
  const Scene& scene_;
  std::function<std::optional<PoseVector>(double)> truth_;
  std::optional<PoseMixture> reported_;
  double report_time_ = 0;  ///< s
};

std::unique_ptr<Perception> make_reported_perception(const PerceptionSetup& setup) {
  return std::make_unique<ReportedPerception>(setup);
}
// [/perception]

}  // namespace

std::unique_ptr<Perception> reported_perception(const PerceptionSetup& setup) {
  return make_reported_perception(setup);
}

}  // namespace blindcorner
