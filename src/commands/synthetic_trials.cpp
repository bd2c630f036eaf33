// SPDX-License-Identifier: Apache-2.0
#include "commands/synthetic_trials.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/output_directory.h"
#include "forward/support/quantile.h"
#include "inverse/likelihood/observation.h"

namespace blindcorner {
namespace {

constexpr double kMinLight = 1e-3;
constexpr int kTypicalPoses = 64;

}  // namespace

ShownPoses::ShownPoses(const Scene& scene, std::uint64_t seed)
    : scene_(scene), model_(make_fast_model(scene, sensor_placement(scene))) {
  std::mt19937_64 typical(seed);
  std::vector<double> light(kTypicalPoses);
  for (double& l : light) l = total_light(*model_, draw_pose(scene, typical));
  least_light_ = kMinLight * quantile(light, 0.5);
}

PoseVector ShownPoses::draw(std::mt19937_64& random) const {
  PoseVector pose;
  do {
    pose = draw_pose(scene_, random);
  } while (total_light(*model_, pose) < least_light_);
  return pose;
}

double position_error(const Scene& scene, const PoseVector& pose, const PoseVector& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].component > Component::z) continue;
    sum += std::pow(pose[static_cast<Eigen::Index>(i)] - truth[static_cast<Eigen::Index>(i)], 2);
  }
  return std::sqrt(sum);
}

PoseVector true_pose(const Scene& scene, const Capture& capture) {
  const std::vector<double> values = truth_vector(scene, capture.truth);
  PoseVector pose = PoseVector::Constant(static_cast<Eigen::Index>(scene.unknowns.size()),
                                         std::numeric_limits<double>::quiet_NaN());
  std::copy(values.begin(), values.end(), pose.begin());
  return pose;
}

MissedOptimum missed_optimum(const ExhaustiveSearch& search, const Capture& capture,
                             const FitResult& result, const PoseVector& truth) {
  std::vector<PoseVector> found;
  double best = -1e300;
  for (const PoseMode& mode : result.posterior.modes) {
    found.push_back(mode.optimum);
    best = std::max(best, search.log_posterior(capture, mode.optimum));
  }
  if (truth.allFinite()) found.push_back(truth);
  MissedOptimum missed{0, search.search(capture, found)};
  missed.log_posterior = missed.bound.log_posterior - best;
  return missed;
}

std::vector<double> first_capture_times(const Scene& scene, const FitOptions& options,
                                        const std::vector<const Capture*>& captures) {
  std::vector<double> times;
  for (const Capture* capture : captures) {
    const auto start = std::chrono::steady_clock::now();
    Fitter(scene, options).fit(*capture);
    times.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
  }
  return times;
}

void add_capture_directories(CLI::App& command, CaptureDirectories& directories) {
  command.add_option("--save-captures", directories.write,
                     "directory for the captures, one file a scene");
  command.add_option("--saved-captures", directories.read,
                     "directory of captures that an earlier run with the same --seed saved: fitted "
                     "instead of new ones");
}

std::string captures_path(const std::string& directory, const Scene& scene) {
  return (std::filesystem::path(directory) / (scene.name + ".exr")).string();
}

void save_captures(const CaptureDirectories& directories, const Scene& scene,
                   const std::vector<Capture>& captures) {
  if (directories.write.empty()) return;
  make_directory(directories.write);
  CaptureFile file;
  file.bin_width = scene.sensor.bin_width;
  file.sensor = scene.sensor.name;
  file.captures = captures;
  write_captures(captures_path(directories.write, scene), file);
}

std::vector<Capture> saved_captures(const CaptureDirectories& directories, const Scene& scene,
                                    std::size_t count) {
  const std::string path = captures_path(directories.read, scene);
  std::vector<Capture> captures = read_captures(path).captures;
  if (captures.size() < count) {
    throw Error(path, "found " + std::to_string(captures.size()) +
                          " captures, accepted: at least " + std::to_string(count));
  }
  captures.resize(count);
  for (const Capture& capture : captures) check_capture(scene, capture);
  return captures;
}

}  // namespace blindcorner
