// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/scene_transport.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/validate.h"
#include "forward/relay/visibility.h"

namespace blindcorner {
namespace {

std::vector<Transform> transforms(const Scene& scene, const std::vector<Placement>& placements) {
  std::vector<Transform> made;
  for (const Placement& p : placements) {
    made.push_back(object_to_world(scene.hidden.shape, scene.hidden.anchor, p));
  }
  return made;
}

/// Poses all over the given ranges of the unknowns.
std::vector<PoseVector> halton_poses(const std::vector<Unknown>& unknowns) {
  // By judgement: the time of a search for a sampling is proportional to the number of poses. Each
  // unknown has its own base, from the smallest primes (Halton).
  constexpr int kPoses = 8;
  constexpr std::array<int, 6> kPrimes{2, 3, 5, 7, 11, 13};
  std::vector<PoseVector> poses;
  for (int i = 0; i < (unknowns.empty() ? 1 : kPoses); ++i) {
    PoseVector pose(static_cast<Eigen::Index>(unknowns.size()));
    for (std::size_t k = 0; k < unknowns.size(); ++k) {
      // Radical inverse (Halton).
      const int base = kPrimes[k % kPrimes.size()];
      double t = 0;
      double digit = 1.0 / base;
      for (int n = i + 1; n > 0; n /= base, digit /= base) t += digit * (n % base);
      pose[static_cast<Eigen::Index>(k)] = unknowns[k].lower + t * unknowns[k].range();
    }
    poses.push_back(pose);
  }
  return poses;
}

/// Poses that a sampling is judged by: all over the search region and, if the part near the relay
/// is smaller, also in this part, because light and its detail are there.
std::vector<PoseVector> poses_to_judge_by(const Scene& scene) {
  std::vector<PoseVector> poses = halton_poses(scene.unknowns);
  if (const auto near = ranges_near_relay(scene)) {
    std::ranges::move(halton_poses(*near), std::back_inserter(poses));
  }
  return poses;
}

/// Largest standard deviation of a pulse's path, in standard deviations of the sensor's own pulse.
/// Points of a rule have none. Sampling keeps that of a group of patches below two. A lobe on a
/// grazing relay spreads paths by itself, by judgement up to six; wider pulses are taken as that
/// wide.
double widest_blur(Kernel kernel) {
  switch (kernel) {
    case Kernel::lambertian:
    case Kernel::brdf_pairs:
      return 0;
    case Kernel::retro_single:
      return 6;
    case Kernel::retro_pairs:
      break;
  }
  return 2;
}

}  // namespace

SceneTransport::SceneTransport(const Scene& one, std::shared_ptr<const SurfaceRays> surface_rays)
    : scene(one),
      rays(std::move(surface_rays)),
      occluders(occluder_faces(scene.surfaces)),
      probes(probe_placements(scene)),
      T_world_probes(transforms(scene, probes)),
      probe_poses(poses_to_judge_by(scene)) {}

SceneTransport::SceneTransport(const Scene& all)
    : SceneTransport(all, std::make_shared<SurfaceRays>(all.surfaces)) {
  if (object_count(scene) == 1 && is_convex(scene.hidden.shape)) return;
  for (int i = 0; i < object_count(scene); ++i) {
    objects.push_back(std::make_shared<SceneTransport>(only_object(scene, i), rays));
  }
}

double SceneTransport::pulse_sigma(double extra) const {
  return kSpeedOfLight * std::hypot(scene.sensor.response.core_sigma(),
                                    scene.sensor.bin_width / std::sqrt(12.0), std::sqrt(extra));
}

std::shared_ptr<const PulseTable> SceneTransport::pulses(double extra, Kernel kernel) const {
  // Share of the energy that may be cut off at either end: a hundredth of the fast model's own
  // default tolerance.
  constexpr double kOutside = 1e-4;
  return pulses_.get({extra, kernel}, [&] {
    const double widest =
        extra + std::pow(widest_blur(kernel) * pulse_sigma(extra) / kSpeedOfLight, 2);
    return std::make_shared<PulseTable>(scene.sensor.response, scene.sensor.bin_width, widest,
                                        kOutside);
  });
}

std::shared_ptr<const PathGrid> SceneTransport::grid(PathGrid::Paths paths, double extra,
                                                     double way_back, double tolerance) const {
  // Whole metres, so that many poses share a grid.
  const double most_back = std::ceil(way_back);
  return grids_.get({paths, extra, most_back, tolerance}, [&] {
    return std::make_shared<PathGrid>(scene.sensor, paths, extra, unwrapped_bins(scene.sensor),
                                      most_back, tolerance);
  });
}

std::shared_ptr<const SceneTransport> make_scene_transport(const Scene& scene) {
  validate(scene);
  return std::make_shared<SceneTransport>(scene);
}

}  // namespace blindcorner
