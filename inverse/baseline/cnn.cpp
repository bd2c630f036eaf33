// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/cnn.h"

#include <cmath>
#include <fstream>
#include <sstream>

#include "blindcorner/forward/error.h"
#include "forward/support/comma_list.h"
#include "inverse/baseline/cnn_description.h"

namespace blindcorner {
namespace {

/// Relative tolerance of the bin width, as between captures and scenes: a difference this large
/// moves the last of 128 bins by about one bin.
constexpr double kBinWidthTolerance = 0.01;

}  // namespace

bool CnnBaseline::available() { return find_cnn_backend() != nullptr; }

CnnBaseline CnnBaseline::load(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  const std::string bytes = content.str();
  if (bytes.empty()) {
    throw Error(path,
                "no such file, or it is empty or a directory; accepted: a file of weights of cnn "
                "train");
  }
  return parse(bytes, path);
}

CnnBaseline CnnBaseline::parse(const std::string& bytes, const std::string& where) {
  const CnnBackend& backend = cnn_backend();
  CnnBaseline cnn;
  cnn.where_ = where;
  cnn.description_ = parse_description(backend.metadata(bytes, where), where);
  cnn.network_ = backend.network(bytes, shape_of(cnn.description_), where);
  return cnn;
}

std::string CnnBaseline::bytes() const { return network_->bytes(description_text(description_)); }

PoseVector CnnBaseline::predict(const Capture& capture, const Transform& T_world_sensor) const {
  CnnData data;
  add_capture(description_, capture, T_world_sensor, data);
  return decode_pose(description_, statement_of(description_, network_->evaluate(data)).mean);
}

PoseMixture CnnBaseline::posterior(const Capture& capture, const Transform& T_world_sensor) const {
  CnnData data;
  add_capture(description_, capture, T_world_sensor, data);
  const CnnStatement statement = statement_of(description_, network_->evaluate(data));
  PoseMode mode;
  mode.weight = 1;
  mode.pose = mode.optimum = decode_pose(description_, statement.mean);
  if (statement.covariance.size() > 0) mode.covariance = decode_covariance(description_, statement);
  PoseMixture mixture;
  mixture.presence_probability = 1;
  mixture.mean = mode.pose;
  mixture.covariance = mode.covariance;
  mixture.modes.push_back(std::move(mode));
  return mixture;
}

void CnnBaseline::check_scene(const Scene& scene) const {
  const CnnDescription& d = description_;
  const Sensor& sensor = scene.sensor;
  if (d.zones != sensor.zone_count() || d.bins != sensor.bins) {
    throw Error(where_, "found a network for " + std::to_string(d.zones) + " zones of " +
                            std::to_string(d.bins) + " bins, accepted: the scene's " +
                            std::to_string(sensor.zone_count()) + " zones of " +
                            std::to_string(sensor.bins) + " bins");
  }
  if (std::abs(d.bin_width / sensor.bin_width - 1) > kBinWidthTolerance) {
    throw Error(where_ + ": metadata.bin_width_ps",
                "found " + std::to_string(d.bin_width * 1e12) + ", accepted: the scene's " +
                    std::to_string(sensor.bin_width * 1e12) + " within 1 %");
  }
  std::vector<std::string> names;
  for (const CnnUnknown& unknown : d.unknowns) names.push_back(unknown.name);
  if (names != unknown_names(scene)) {
    throw Error(where_ + ": metadata.unknowns", "found " + comma_list(names) +
                                                    ", accepted: the scene's " +
                                                    comma_list(unknown_names(scene)));
  }
}

}  // namespace blindcorner
