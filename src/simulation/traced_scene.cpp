// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/traced_scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/simulation/synthetic.h"
#include "io/npz.h"

namespace blindcorner {
namespace {

NpyArray read_array(const NpzFile& file, const std::string& path, const std::string& name,
                    const std::vector<std::size_t>& shape) {
  NpyArray array = file.read(name);
  if (array.is_text || array.shape != shape) {
    NpyArray accepted;
    accepted.shape = shape;
    throw Error(path + ": " + name, "found an array of shape " + array.shape_text() +
                                        ", accepted: numbers of shape " + accepted.shape_text());
  }
  return array;
}

/// The scene's unknowns if its first object is at x, y, z (m) and yaw (degrees). The other objects
/// move along.
PoseVector pose_at(const Scene& scene, const double* at) {
  std::vector<Placement> placements = stated_placements(scene);
  const Eigen::Vector3d moved = Eigen::Vector3d(at[0], at[1], at[2]) - placements.front().position;
  for (Placement& placement : placements) placement.position += moved;
  placements.front().yaw = at[3] * kDegree;
  return pose_of(placements, scene.unknowns);
}

}  // namespace

TracedScene read_traced_scene(const Scene& scene, const std::string& path) {
  const Sensor& sensor = scene.sensor;
  const std::vector<std::size_t> cube = {static_cast<std::size_t>(sensor.rows),
                                         static_cast<std::size_t>(sensor.columns),
                                         static_cast<std::size_t>(sensor.bins)};
  const NpzFile file(path);
  const std::size_t count = std::max<std::size_t>(1, file.read("poses").values.size() / 4);
  const NpyArray poses = read_array(file, path, "poses", {count, 4});
  const auto read = [&](const std::string& name, std::size_t number) {
    std::vector<std::size_t> shape = cube;
    if (number > 0) shape.insert(shape.begin(), number);
    return read_array(file, path, name, shape).values;
  };
  const std::vector<double> mean = read("mean", count), error = read("standard_error", count);
  const auto light_at = [&](const std::vector<double>& means, const std::vector<double>& errors,
                            std::size_t index) {
    TracedLight light;
    light.mean = light.standard_error = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
    const std::size_t size = light.mean.values.size();
    const auto first = static_cast<std::ptrdiff_t>(index * size);
    std::copy_n(means.begin() + first, size, light.mean.values.begin());
    std::copy_n(errors.begin() + first, size, light.standard_error.values.begin());
    return light;
  };
  TracedScene traced;
  traced.empty = light_at(read("empty_mean", 0), read("empty_standard_error", 0), 0);
  for (std::size_t i = 0; i < count; ++i) {
    traced.poses.push_back(pose_at(scene, poses.values.data() + 4 * i));
    traced.light.push_back(light_at(mean, error, i));
  }
  return traced;
}

std::string traced_file(const std::string& directory, const std::string& scene_path) {
  namespace fs = std::filesystem;
  std::string name = fs::path(scene_path).stem().string();
  constexpr std::string_view kPrefix = "reference_";
  if (name.starts_with(kPrefix)) name.erase(0, kPrefix.size());
  const fs::path inside = fs::path(directory) / "mitransient" / (name + ".npz");
  return (fs::exists(inside) ? inside : fs::path(directory) / (name + ".npz")).string();
}

HistogramCube object_light(const TracedScene& traced, std::size_t pose) {
  HistogramCube light = traced.light[pose].mean;
  for (std::size_t i = 0; i < light.values.size(); ++i) {
    light.values[i] -= traced.empty.mean.values[i];
  }
  return light;
}

TracedScene rendered_objects(const Scene& scene, const TracedScene& traced, double sampling) {
  const auto renderer =
      make_reference_renderer(scene, sensor_placement(scene), reference_sampling(sampling));
  TracedScene rendered = traced;
  const auto forget = [](HistogramCube& errors) { std::ranges::fill(errors.values, 0.0); };
  forget(rendered.empty.standard_error);
  for (std::size_t i = 0; i < rendered.poses.size(); ++i) {
    TracedLight& light = rendered.light[i];
    light.mean = renderer->three_bounce(rendered.poses[i]);
    for (std::size_t k = 0; k < light.mean.values.size(); ++k) {
      light.mean.values[k] += rendered.empty.mean.values[k];
    }
    forget(light.standard_error);
  }
  return rendered;
}

TracedCaptures::TracedCaptures(const Scene& scene, TracedScene traced,
                               const HistogramCube* own_light)
    : scene_(scene), traced_(std::move(traced)), objects_alone_(own_light != nullptr) {
  const HistogramCube& own = own_light != nullptr ? *own_light : traced_.empty.mean;
  LinearValues linear;
  for (std::size_t i = 0; i < poses(); ++i) {
    const HistogramCube light = object_light(traced_, i);
    mean_counts_ += total_counts(scene_, light) / static_cast<double>(poses());
    linear.ambient += equal_ambient(scene_, light) / static_cast<double>(poses());
  }
  if (!(mean_counts_ > 0)) {
    throw Error(scene_place(scene_), "its traced light does not show the object");
  }
  ambient_ = linear.ambient;
  for (std::size_t i = 0; i < poses(); ++i) {
    expected_.push_back(expected_counts(scene_, object_light(traced_, i), own, linear));
    // Values below zero are the tracer's noise about a mean of zero.
    for (double& value : expected_.back().values) value = std::max(value, 0.0);
  }
}

HistogramCube TracedCaptures::standard_error(std::size_t pose) const {
  HistogramCube error = traced_.light[pose].standard_error;
  for (std::size_t k = 0; k < error.values.size() && objects_alone_; ++k) {
    error.values[k] = std::hypot(error.values[k], traced_.empty.standard_error.values[k]);
  }
  return error;
}

Capture TracedCaptures::capture(std::size_t pose, double photons, std::uint64_t seed) const {
  Capture capture;
  capture.exposures = exposures(photons);
  capture.counts = draw_counts(scene_, expected_[pose], capture.exposures, seed);
  capture.source = scene_.name;
  const std::vector<std::string> names = unknown_names(scene_);
  for (std::size_t i = 0; i < names.size(); ++i) {
    capture.truth[names[i]] = traced_.poses[pose][static_cast<Eigen::Index>(i)];
  }
  return capture;
}

}  // namespace blindcorner
