// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/result_file.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "blindcorner/forward/scene/shape.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/program_name.h"
#include "report/json_values.h"

namespace blindcorner {

namespace {

using nlohmann::json;

json mode_json(const std::vector<std::string>& names, const PoseMode& mode) {
  json undetermined = json::array();
  for (const int index : mode.undetermined) {
    undetermined.push_back(names.at(static_cast<std::size_t>(index)));
  }
  return {{"weight", number_or_null(mode.weight)},
          {"pose", numbers_json(mode.pose)},
          {"covariance", matrix_json(mode.covariance)},
          {"undetermined", undetermined},
          {"log_likelihood", number_or_null(mode.log_likelihood)},
          {"optimum", numbers_json(mode.optimum)}};
}

json goodness_json(const GoodnessOfFit& goodness) {
  return {{"deviance", number_or_null(goodness.deviance)},
          {"expected", number_or_null(goodness.expected)},
          {"standard_deviation", number_or_null(goodness.standard_deviation)},
          {"inflation", number_or_null(goodness.inflation)}};
}

json times_json(const StageTimes& times) {
  return {{"prepare", number_or_null(times.prepare)},
          {"score", number_or_null(times.score)},
          {"refine", number_or_null(times.refine)},
          {"uncertainty", number_or_null(times.uncertainty)},
          {"detect", number_or_null(times.detect)},
          {"total", number_or_null(times.total)}};
}

json linear_json(const FittedHistograms& fitted) {
  return {{"amplitude", numbers_json(fitted.amplitude)},
          {"ambient", numbers_json(fitted.ambient)},
          {"direct", numbers_json(fitted.direct)}};
}

json track_json(const TrackSummary& track) {
  const bool smoothed = track.smoothed_pose.size() > 0;
  return {
      {"time_s", number_or_null(track.time)},
      {"velocity", numbers_json(track.velocity)},
      {"amplitude", number_or_null(track.amplitude)},
      {"amplitude_sigma_log", number_or_null(track.amplitude_sigma_log)},
      {"predicted_frames", track.coasted},
      {"searched", track.searched},
      {"innovation", number_or_null(track.innovation)},
      {"innovation_expected", number_or_null(track.freedom)},
      {"inflation", number_or_null(track.inflation)},
      {"smoothed_pose", smoothed ? numbers_json(track.smoothed_pose) : json(nullptr)},
      {"smoothed_covariance", smoothed ? matrix_json(track.smoothed_covariance) : json(nullptr)}};
}

json truth_json(const Scene& scene, const std::map<std::string, double>& truth) {
  const std::vector<double> values = truth_vector(scene, truth);
  return values.empty() ? json(nullptr) : numbers_json(values);
}

}  // namespace

bool is_joint(const FitResult& result) { return result.sources.size() > 1; }

json number_or_null(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

std::string dump_json(const json& value, int indent) {
  return value.dump(indent, ' ', false, json::error_handler_t::replace);
}

std::vector<double> truth_vector(const Scene& scene, const std::map<std::string, double>& truth) {
  std::vector<double> values;
  bool any = false;
  for (const std::string& name : unknown_names(scene)) {
    const auto known = truth.find(name);
    any = any || known != truth.end();
    values.push_back(known == truth.end() ? std::numeric_limits<double>::quiet_NaN()
                                          : known->second);
  }
  return any ? values : std::vector<double>{};
}

double position_error(const Scene& scene, const FitResult& result) {
  const double unknown_error = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> truth = truth_vector(scene, result.truth);
  if (!result.error.empty() || result.posterior.modes.empty() || truth.empty()) {
    return unknown_error;
  }
  const PoseVector& pose = result.posterior.modes.front().pose;
  double squares = 0.0;
  bool any = false;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Component component = scene.unknowns[i].component;
    if (component == Component::yaw || component == Component::size) continue;
    const double difference = pose[static_cast<Eigen::Index>(i)] - truth[i];
    squares += difference * difference;
    any = true;
  }
  return any ? std::sqrt(squares) : unknown_error;
}

json capture_json(const Scene& scene, const FitResult& result) {
  const bool failed = !result.error.empty();
  json entry;
  if (is_joint(result)) {
    entry["source"] = result.sources;
    entry["index"] = result.indices;
  } else {
    entry["source"] = result.sources.empty() ? json(nullptr) : json(result.sources.front());
    entry["index"] = result.indices.empty() ? json(nullptr) : json(result.indices.front());
  }
  const PoseMixture& posterior = result.posterior;
  const auto unless_failed = [failed](json value) {
    return failed ? json(nullptr) : std::move(value);
  };
  entry["presence_probability"] = unless_failed(number_or_null(posterior.presence_probability));
  entry["false_alarm_probability"] = unless_failed(
      result.false_alarm_probability ? json(*result.false_alarm_probability) : nullptr);
  entry["modes"] = json::array();
  if (!failed) {
    for (const PoseMode& mode : posterior.modes) {
      entry["modes"].push_back(mode_json(unknown_names(scene), mode));
    }
  }
  const bool no_pose = failed || posterior.modes.empty();
  entry["mean"] = no_pose ? json(nullptr) : numbers_json(posterior.mean);
  entry["covariance"] = no_pose ? json(nullptr) : matrix_json(posterior.covariance);
  entry["goodness_of_fit"] = unless_failed(goodness_json(result.goodness_of_fit));
  entry["linear"] = json::array();
  for (const FittedHistograms& fitted : result.histograms) {
    if (!failed) entry["linear"].push_back(linear_json(fitted));
  }
  if (result.track) entry["track"] = track_json(*result.track);
  entry["flags"] = result.flags;
  entry["hints"] = result.hints;
  entry["truth"] = truth_json(scene, result.truth);
  entry["error"] = failed ? json(result.error) : json(nullptr);
  entry["time_ms"] = times_json(result.time_ms);
  entry["exact_evaluations"] = result.renders;
  return entry;
}

json result_json(const Scene& scene, const std::vector<FitResult>& results) {
  json captures = json::array();
  for (const FitResult& result : results) captures.push_back(capture_json(scene, result));
  return {{"format", kResultFormat},     {"program", program_name()},
          {"scene", scene_place(scene)}, {"unknowns", unknown_names(scene)},
          {"periods", periods(scene)},   {"captures", std::move(captures)}};
}

void write_result(const std::string& directory, const Scene& scene,
                  const std::vector<FitResult>& results) {
  const auto path = std::filesystem::path(directory) / "result.json";
  write_atomically(path.string(), dump_json(result_json(scene, results), 1) + "\n");
}

}  // namespace blindcorner
