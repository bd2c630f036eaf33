// SPDX-License-Identifier: Apache-2.0
/// Scenes and comparisons that the rows share.
#pragma once

#include <functional>
#include <string>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "stability/stability.h"

namespace blindcorner {

/// One zone of 10 degrees looks along +x at a wall 0.6 m ahead; a plate of 0.2 m stands 0.5 m to
/// its left. 128 bins of 100 ps, Gaussian pulse of 150 ps. Unknown: x and y of the plate.
Scene wall_scene();

/// The wall scene seen by 3 x 3 zones of 10 degrees each.
Scene nine_zone_scene();

/// The scene of nine zones with a partition that hides some of the plate: a box of `size` about
/// `middle`, m.
Scene partitioned_scene(const Eigen::Vector3d& size, const Eigen::Vector3d& middle);

/// A partitioned scene in which much is hidden: the partition leaves 0.2 m to the wall.
Scene occluded_scene();

/// The scene with all lengths and times multiplied.
Scene scaled(const Scene& scene, double factor);

/// The scene with everything in it moved, m.
Scene moved(const Scene& scene, const Eigen::Vector3d& by);

/// The pose that the scene states.
PoseVector stated_pose(const Scene& scene);

HistogramCube fast_light(const Scene& scene);
HistogramCube reference_light(const Scene& scene);

double total(const HistogramCube& light);
/// Relative L2 difference of two cubes; infinite where their sizes differ.
double relative_difference(const HistogramCube& got, const HistogramCube& want);

/// A capture of the stated pose with `photons` expected three-bounce photons. The light comes from
/// the reference renderer.
Capture photon_capture(const Scene& scene, double photons, double background_ratio,
                       std::uint64_t seed);

/// Options for fits whose false-alarm probability does not matter.
FitOptions without_empty_captures();

/// Smallest squared distance of a pose from a mode, by the mode's covariance. NaN if there are no
/// modes.
double mode_distance(const Scene& scene, const PoseMixture& posterior, const PoseVector& pose);

/// Whether all values of a fit are finite and in their ranges, and the modes' covariances are
/// valid.
bool is_sound(const Scene& scene, const FitResult& result);

/// 0 if the action throws a clear error (one line that says what is accepted), else 1.
StabilityMeasurement refusal(const std::function<void()>& action);

}  // namespace blindcorner
