// SPDX-License-Identifier: Apache-2.0
/// What benchmarks on synthetic captures share: true poses, files of captures, how an answer is
/// judged.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"
#include "inverse/search/exhaustive.h"

namespace CLI {
class App;
}

namespace blindcorner {

/// A solver that misses the optimum by at most this much log posterior counts as having reached it.
inline constexpr double kReached = 0.1;

/// Poses from the prior that some exposure can show: those that send the sensor less than a
/// thousandth of the median pose's light are drawn again.
class ShownPoses {
 public:
  ShownPoses(const Scene& scene, std::uint64_t seed);
  PoseVector draw(std::mt19937_64& random) const;

 private:
  const Scene& scene_;
  std::unique_ptr<ForwardModel> model_;
  double least_light_ = 0;
};

/// Distance of a pose from the true one over all positions, m.
double position_error(const Scene& scene, const PoseVector& pose, const PoseVector& truth);

/// True values of the scene's unknowns as a capture states them; NaN where it does not.
PoseVector true_pose(const Scene& scene, const Capture& capture);

/// An answer beside an exhaustive search that also starts from the answer's modes and from the
/// truth.
struct MissedOptimum {
  double log_posterior = 0;  ///< by which the best mode lies below the search's optimum
  ExhaustiveResult bound;
};
MissedOptimum missed_optimum(const ExhaustiveSearch& search, const Capture& capture,
                             const FitResult& result, const PoseVector& truth);

/// Wall-clock times, ms, of fitting each of these captures with a fitter of its own. They include
/// the time to compile the scene.
std::vector<double> first_capture_times(const Scene& scene, const FitOptions& options,
                                        const std::vector<const Capture*>& captures);

/// Directories that captures are written to and read from, a file for each scene; empty: none.
struct CaptureDirectories {
  std::string write, read;
};
void add_capture_directories(CLI::App& command, CaptureDirectories& directories);

/// The file of a scene's captures in a directory.
std::string captures_path(const std::string& directory, const Scene& scene);

/// Writes the captures if a directory to write to is given.
void save_captures(const CaptureDirectories& directories, const Scene& scene,
                   const std::vector<Capture>& captures);

/// The first `count` captures of an earlier run, which must suit the scene. Throws Error.
std::vector<Capture> saved_captures(const CaptureDirectories& directories, const Scene& scene,
                                    std::size_t count);

}  // namespace blindcorner
