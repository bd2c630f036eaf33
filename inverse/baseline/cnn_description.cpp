// SPDX-License-Identifier: Apache-2.0
#include "inverse/baseline/cnn_description.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "forward/scene/limits.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kPicosecond = 1e-12;
/// Two convolutions of three bins each need five bins to leave one; two of five bins in steps of
/// two need thirteen.
int fewest_bins(CnnArchitecture network) { return network == CnnArchitecture::wide ? 13 : 5; }
/// Angles whose range is at least this share of a whole turn have no ends: scene files state
/// degrees or radians with a few digits.
constexpr double kWholeTurn = 0.999;

/// x (m), y (m) and yaw (rad) of a sensor.
Eigen::Vector3d planar_pose(const Transform& T_world_sensor) {
  return {T_world_sensor.translation().x(), T_world_sensor.translation().y(),
          yaw_pitch_roll_of(T_world_sensor.linear())[0]};
}

/// The yaw's difference is taken the short way around.
Eigen::Vector3d planar_difference(const Eigen::Vector3d& pose, const Eigen::Vector3d& center) {
  Eigen::Vector3d difference = pose - center;
  difference[2] = std::remainder(difference[2], 2 * kPi);
  return difference;
}

std::string place_of(const Capture& capture) {
  return capture.source + " capture " + std::to_string(capture.index);
}

/// Describes the sensor's poses. The mean is taken about the first pose, so that yaws on both sides
/// of half a turn have the right mean.
void describe_sensor_poses(const Scene& scene, std::span<const Capture> captures,
                           CnnDescription& description) {
  std::vector<Eigen::Vector3d> poses;
  for (const Capture& capture : captures) {
    poses.push_back(planar_pose(capture.T_world_sensor.value_or(scene.T_world_sensor)));
  }
  if (poses.empty()) return;
  const auto count = static_cast<double>(poses.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& pose : poses) mean += planar_difference(pose, poses.front()) / count;
  description.sensor_center = poses.front() + mean;
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (const auto& pose : poses) {
    squares += planar_difference(pose, description.sensor_center).cwiseAbs2() / count;
  }
  for (int i = 0; i < 3; ++i) {
    // A value that never changes in training tells nothing, and must not be blown up if it changes
    // later. A micrometre is above rounding and below any move.
    constexpr double kConstant = 1e-6;  // m or rad
    const double deviation = std::sqrt(squares[i]);
    description.sensor_scale[i] = deviation > kConstant ? deviation : 1.0;
  }
}

double bounded(double value, double bound) {
  return bound > 0 ? std::clamp(value, -bound, bound) : value;
}

Json vector_json(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

Eigen::Vector3d parse_vector(const Json& json) {
  const auto values = json.get<std::array<double, 3>>();
  return {values[0], values[1], values[2]};
}

/// The beginning of a value, for messages.
std::string quoted(const Json& json) {
  if (json.is_structured()) return std::string("an ") + json.type_name();
  constexpr std::size_t kMost = 40;
  std::string text = json.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > kMost) text = text.substr(0, kMost) + "...";
  return text;
}

Json unknown_json(const CnnUnknown& unknown) {
  Json json{{"name", unknown.name}, {"lower", unknown.lower}, {"upper", unknown.upper}};
  if (unknown.period > 0) json["period"] = unknown.period;
  return json;
}

/// A whole number from `lower` to `upper`. The library itself would accept other numbers as well.
template <typename Integer>
Integer parse_whole(const Json& object, const std::string& field, Integer lower, Integer upper,
                    const std::string& where) {
  const Json& json = object.at(field);
  if (json.is_number_unsigned()) {
    const auto value = json.get<std::uint64_t>();
    if (value >= static_cast<std::uint64_t>(lower) && value <= static_cast<std::uint64_t>(upper)) {
      return static_cast<Integer>(value);
    }
  }
  throw Error(where + "." + field, "found " + quoted(json) + ", accepted: a whole number from " +
                                       std::to_string(lower) + " to " + std::to_string(upper));
}

CnnDescription read_fields(const Json& json, CnnArchitecture network, const std::string& where) {
  constexpr int kMost = std::numeric_limits<int>::max();
  constexpr std::uint64_t kMostSeed = std::numeric_limits<std::uint64_t>::max();
  CnnDescription d;
  d.network = network;
  d.scene = json.at("scene").get<std::string>();
  d.zones = parse_whole(json, "zones", 1, limits::kMaxZones, where);
  d.bins = parse_whole(json, "bins", fewest_bins(network), limits::kMaxBins, where);
  d.bin_width = json.at("bin_width_ps").get<double>() * kPicosecond;
  d.input_scale = json.at("input_scale").get<double>();
  if (json.contains("input_mean")) {
    d.input_mean = json.at("input_mean").get<std::vector<double>>();
    d.input_deviation = json.at("input_deviation").get<std::vector<double>>();
  }
  d.input_bound = json.at("input_bound").get<double>();
  d.sensor_center = parse_vector(json.at("sensor_pose").at("center"));
  d.sensor_scale = parse_vector(json.at("sensor_pose").at("scale"));
  for (const Json& entry : json.at("unknowns")) {
    d.unknowns.push_back({entry.at("name").get<std::string>(), entry.at("lower").get<double>(),
                          entry.at("upper").get<double>(), entry.value("period", 0.0)});
  }
  const Json& training = json.at("training");
  const std::string training_where = where + ".training";
  d.training.captures = parse_whole(training, "captures", 0, kMost, training_where);
  d.training.validation_share = training.at("validation_share").get<double>();
  d.training.split_seed =
      parse_whole(training, "split_seed", std::uint64_t{0}, kMostSeed, training_where);
  d.training.seed = parse_whole(training, "seed", std::uint64_t{0}, kMostSeed, training_where);
  d.training.epoch = parse_whole(training, "epoch", 0, kMost, training_where);
  d.training.split_by_truth = training.value("split_by_truth", false);
  return d;
}

void check_fields(const CnnDescription& d, const std::string& where) {
  const auto fail = [&](const std::string& field, const std::string& accepted) {
    throw Error(where + ": metadata." + field, "accepted: " + accepted);
  };
  if (!(d.bin_width >= 0)) fail("bin_width_ps", "a number >= 0");
  if (!(d.input_scale > 0)) fail("input_scale", "a number > 0");
  const std::size_t values = static_cast<std::size_t>(d.zones) * static_cast<std::size_t>(d.bins);
  if (!d.input_mean.empty() && d.input_mean.size() != values) {
    fail("input_mean", std::to_string(values) + " numbers");
  }
  if (d.input_deviation.size() != d.input_mean.size() ||
      !std::ranges::all_of(d.input_deviation, [](double v) { return v > 0; })) {
    fail("input_deviation", "as many numbers as input_mean, > 0");
  }
  if (!(d.input_bound >= 0)) fail("input_bound", "a number > 0, or 0 for none");
  if (!d.sensor_center.allFinite()) fail("sensor_pose.center", "finite numbers");
  if (!(d.sensor_scale.minCoeff() > 0)) fail("sensor_pose.scale", "numbers > 0");
  if (d.unknowns.empty()) fail("unknowns", "at least one");
  for (const CnnUnknown& unknown : d.unknowns) {
    if (!(unknown.lower < unknown.upper)) fail("unknowns." + unknown.name, "lower < upper");
    if (!(unknown.period >= 0)) fail("unknowns." + unknown.name + ".period", "a number > 0");
  }
}

constexpr std::array kArchitectures{"published", "wide"};

}  // namespace

std::string cnn_architecture_name(CnnArchitecture architecture) {
  return kArchitectures.at(static_cast<std::size_t>(architecture));
}

std::vector<std::string> cnn_architecture_names() {
  return {kArchitectures.begin(), kArchitectures.end()};
}

CnnArchitecture parse_cnn_architecture(const std::string& name, const std::string& where) {
  for (std::size_t i = 0; i < kArchitectures.size(); ++i) {
    if (name == kArchitectures.at(i)) return static_cast<CnnArchitecture>(i);
  }
  throw Error(where, "found '" + name + "', accepted: 'published', 'wide'");
}

int CnnDescription::outputs() const {
  return std::accumulate(unknowns.begin(), unknowns.end(), 0,
                         [](int sum, const CnnUnknown& u) { return sum + (u.period > 0 ? 2 : 1); });
}

CnnDescription describe_cnn(const Scene& scene, std::span<const Capture> captures,
                            const CnnTrainingOptions& options) {
  CnnDescription d;
  d.scene = scene.name;
  d.zones = scene.sensor.zone_count();
  d.bins = scene.sensor.bins;
  d.network = options.network;
  const int fewest = fewest_bins(d.network);
  if (d.bins < fewest) {
    throw Error(scene_place(scene) + ": sensor.bins", "found " + std::to_string(d.bins) +
                                                          ", accepted for the network: at least " +
                                                          std::to_string(fewest));
  }
  d.bin_width = scene.sensor.bin_width;
  // The scaled values have a mean of one. With a sum of one they would be so small that the
  // normalisation's own epsilon (1e-5) outweighs the variance of the first convolution.
  d.input_scale = static_cast<double>(d.zones) * d.bins;
  d.input_bound = options.input_bound;
  describe_sensor_poses(scene, captures, d);
  const std::vector<std::string> names = unknown_names(scene);
  const std::vector<double> turns = periods(scene);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    const bool endless = turns[i] > 0 && unknown.range() >= kWholeTurn * turns[i];
    d.unknowns.push_back({names[i], unknown.lower, unknown.upper, endless ? turns[i] : 0.0});
  }
  d.training = {static_cast<int>(captures.size()),
                options.validation_share,
                options.split_seed,
                options.seed,
                0,
                options.network == CnnArchitecture::wide};
  return d;
}

std::string description_text(const CnnDescription& d) {
  Json json;
  json["format"] = kCnnFormat;
  json["network"] = cnn_architecture_name(d.network);
  json["scene"] = d.scene;
  json["zones"] = d.zones;
  json["bins"] = d.bins;
  json["bin_width_ps"] = d.bin_width / kPicosecond;
  json["input_scale"] = d.input_scale;
  if (!d.input_mean.empty()) {
    json["input_mean"] = d.input_mean;
    json["input_deviation"] = d.input_deviation;
  }
  json["input_bound"] = d.input_bound;
  json["sensor_pose"] = {{"names", {"x_m", "y_m", "yaw_rad"}},
                         {"center", vector_json(d.sensor_center)},
                         {"scale", vector_json(d.sensor_scale)}};
  json["unknowns"] = Json::array();
  for (const CnnUnknown& unknown : d.unknowns) json["unknowns"].push_back(unknown_json(unknown));
  json["training"] = {
      {"captures", d.training.captures},     {"validation_share", d.training.validation_share},
      {"split_seed", d.training.split_seed}, {"seed", d.training.seed},
      {"epoch", d.training.epoch},           {"split_by_truth", d.training.split_by_truth}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

CnnDescription parse_description(const std::string& text, const std::string& where) {
  CnnDescription description;
  try {
    const Json json = Json::parse(text);
    const std::string format = json.is_object() ? json.value("format", "") : "";
    if (format != kCnnFormat) {
      throw Error(where + ": metadata.format",
                  "found '" + format + "', accepted: '" + kCnnFormat + "'");
    }
    const auto network =
        parse_cnn_architecture(json.value("network", "published"), where + ": metadata.network");
    description = read_fields(json, network, where + ": metadata");
  } catch (const nlohmann::json::exception& error) {
    throw Error(where + ": metadata", error.what());
  }
  check_fields(description, where);
  return description;
}

CnnShape shape_of(const CnnDescription& description) {
  return {description.zones, description.bins, description.outputs(), description.network};
}

void add_capture(const CnnDescription& d, const Capture& capture, const Transform& T_world_sensor,
                 CnnData& data) {
  const HistogramCube& counts = capture.counts;
  if (counts.zones() != d.zones || counts.bins != d.bins) {
    throw Error(place_of(capture), "counts: found " + std::to_string(counts.zones()) +
                                       " zones of " + std::to_string(counts.bins) +
                                       " bins, accepted: the network's " + std::to_string(d.zones) +
                                       " zones of " + std::to_string(d.bins) + " bins");
  }
  const double sum = std::accumulate(counts.values.begin(), counts.values.end(), 0.0);
  if (!(sum > 0) || !std::isfinite(sum)) {
    throw Error(place_of(capture), "counts: found a sum of " + std::to_string(sum) +
                                       ", accepted: finite counts whose sum is > 0");
  }
  for (std::size_t i = 0; i < counts.values.size(); ++i) {
    double value = counts.values[i] / sum * d.input_scale;
    if (!d.input_mean.empty()) {
      value = bounded((value - d.input_mean[i]) / d.input_deviation[i], d.input_bound);
    }
    data.histograms.push_back(static_cast<float>(value));
  }
  const Eigen::Vector3d pose = planar_difference(planar_pose(T_world_sensor), d.sensor_center);
  for (int i = 0; i < 3; ++i) {
    data.sensors.push_back(static_cast<float>(bounded(pose[i] / d.sensor_scale[i], d.input_bound)));
  }
}

void standardise_inputs(std::span<const Capture* const> captures, CnnDescription& d) {
  const std::size_t size = static_cast<std::size_t>(d.zones) * static_cast<std::size_t>(d.bins);
  std::vector<double> mean(size), square(size);
  const auto count = static_cast<double>(captures.size());
  for (const Capture* capture : captures) {
    const std::vector<double>& counts = capture->counts.values;
    const double sum = std::accumulate(counts.begin(), counts.end(), 0.0);
    for (std::size_t i = 0; i < size && i < counts.size(); ++i) {
      const double value = counts[i] / sum * d.input_scale;
      // Welford's way would be needed where deviations are below 1e-8 of the mean.
      mean[i] += value / count;
      square[i] += value * value / count;
    }
  }
  // A bin whose deviation is below this share of its mean never changes, as in a dead zone. The
  // share is above the rounding of squares, 1e-8.
  constexpr double kConstant = 1e-7;
  for (std::size_t i = 0; i < size; ++i) {
    const double deviation = std::sqrt(std::max(0.0, square[i] - mean[i] * mean[i]));
    square[i] = deviation > kConstant * std::abs(mean[i]) ? deviation : 1.0;
  }
  d.input_mean = std::move(mean);
  d.input_deviation = std::move(square);
}

CnnStatement statement_of(const CnnDescription& d, const std::vector<float>& values) {
  if (d.network == CnnArchitecture::published) return {values, {}};
  const auto outputs = static_cast<Eigen::Index>(d.outputs());
  const auto members = static_cast<Eigen::Index>(values.size()) / (2 * outputs);
  const Eigen::Map<const Eigen::MatrixXf> stated(values.data(), outputs, 2 * members);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(outputs);
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(outputs, outputs);
  for (Eigen::Index m = 0; m < members; ++m) {
    const Eigen::VectorXd at = stated.col(2 * m).cast<double>();
    const Eigen::VectorXd variance = stated.col(2 * m + 1).cast<double>().array().exp();
    mean += at / static_cast<double>(members);
    square += at * at.transpose() / static_cast<double>(members);
    square.diagonal() += variance / static_cast<double>(members);
  }
  const Eigen::VectorXf rounded = mean.cast<float>();
  return {{rounded.begin(), rounded.end()}, square - mean * mean.transpose()};
}

Eigen::MatrixXd decode_covariance(const CnnDescription& d, const CnnStatement& statement) {
  const auto count = static_cast<Eigen::Index>(d.unknowns.size());
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(count, d.outputs());  // d pose / d outputs
  Eigen::Index next = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    const CnnUnknown& u = d.unknowns[static_cast<std::size_t>(i)];
    if (u.period > 0) {
      const double cosine = statement.mean[static_cast<std::size_t>(next)];
      const double sine = statement.mean[static_cast<std::size_t>(next + 1)];
      const double turn = u.period / (2 * kPi);
      const double square = std::max(cosine * cosine + sine * sine, 1e-6);  // shorter: no angle
      slope(i, next++) = -turn * sine / square;
      slope(i, next++) = turn * cosine / square;
    } else {
      slope(i, next++) = (u.upper - u.lower) / 2;
    }
  }
  Eigen::MatrixXd covariance = slope * statement.covariance * slope.transpose();
  // No unknown is less certain than a uniform distribution over its range. A short pair of cosine
  // and sine would make it so.
  for (Eigen::Index i = 0; i < count; ++i) {
    const CnnUnknown& u = d.unknowns[static_cast<std::size_t>(i)];
    const double most = (u.upper - u.lower) * (u.upper - u.lower) / 12;
    if (covariance(i, i) <= most) continue;
    const double factor = std::sqrt(most / covariance(i, i));
    covariance.row(i) *= factor;
    covariance.col(i) *= factor;
  }
  return covariance;
}

std::vector<float> encode_pose(const CnnDescription& description, const PoseVector& pose) {
  std::vector<float> outputs;
  for (std::size_t i = 0; i < description.unknowns.size(); ++i) {
    const CnnUnknown& u = description.unknowns[i];
    const double value = pose[static_cast<Eigen::Index>(i)];
    if (u.period > 0) {
      const double angle = 2 * kPi * value / u.period;
      outputs.push_back(static_cast<float>(std::cos(angle)));
      outputs.push_back(static_cast<float>(std::sin(angle)));
    } else {
      outputs.push_back(static_cast<float>(2 * (value - u.lower) / (u.upper - u.lower) - 1));
    }
  }
  return outputs;
}

PoseVector decode_pose(const CnnDescription& description, std::span<const float> outputs) {
  PoseVector pose(static_cast<Eigen::Index>(description.unknowns.size()));
  std::size_t next = 0;
  for (std::size_t i = 0; i < description.unknowns.size(); ++i) {
    const CnnUnknown& u = description.unknowns[i];
    double value = outputs[next++];
    if (u.period > 0) {
      const double turns = std::atan2(static_cast<double>(outputs[next++]), value) / (2 * kPi);
      value = u.period * (turns - std::floor(turns - u.lower / u.period));
    } else {
      // An answer outside of the search region is never right.
      value = std::clamp(u.lower + (value + 1) / 2 * (u.upper - u.lower), u.lower, u.upper);
    }
    pose[static_cast<Eigen::Index>(i)] = value;
  }
  return pose;
}

}  // namespace blindcorner
