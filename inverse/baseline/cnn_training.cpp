// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/cnn_training.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>

#include "blindcorner/forward/error.h"
#include "inverse/baseline/cnn_description.h"
#include "inverse/likelihood/observation.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kCheckpointFormat = "blindcorner.cnn.checkpoint/1";
constexpr const char* kCheckpoint = "checkpoint";

PoseVector truth_of(const Scene& scene, const Capture& capture) {
  PoseVector pose(static_cast<Eigen::Index>(scene.unknowns.size()));
  Eigen::Index i = 0;
  for (const std::string& name : unknown_names(scene)) {
    const auto known = capture.truth.find(name);
    if (known == capture.truth.end() || !std::isfinite(known->second)) {
      throw Error(capture.source + " capture " + std::to_string(capture.index),
                  "truth." + name + " is missing, accepted: the true value of every unknown");
    }
    pose[i++] = known->second;
  }
  return pose;
}

/// Captures in the order in which they are learnt; the captures that are held back come last.
struct PreparedCaptures {
  CnnDescription description;
  CnnData data;
  std::size_t training = 0;
};

PreparedCaptures prepare(const Scene& scene, std::span<const Capture> captures,
                         const CnnTrainingOptions& options) {
  for (const Capture& capture : captures) check_cnn_capture(scene, capture);
  PreparedCaptures prepared{describe_cnn(scene, captures, options), {}, 0};
  const auto held_back = validation_captures(captures, prepared.description.training);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < captures.size(); ++i) {
    if (!std::ranges::binary_search(held_back, i)) order.push_back(i);
  }
  prepared.training = order.size();
  if (prepared.training < 2) {
    throw Error("captures", "found " + std::to_string(prepared.training) +
                                " to learn from, accepted: at least 2");
  }
  if (options.standardise) {
    std::vector<const Capture*> learnt;
    for (const std::size_t i : order) learnt.push_back(&captures[i]);
    standardise_inputs(learnt, prepared.description);
  }
  order.insert(order.end(), held_back.begin(), held_back.end());
  for (const std::size_t i : order) {
    const Capture& capture = captures[i];
    const PoseVector truth = truth_of(scene, capture);
    add_capture(prepared.description, capture,
                capture.T_world_sensor.value_or(scene.T_world_sensor), prepared.data);
    const std::vector<float> targets = encode_pose(prepared.description, truth);
    prepared.data.targets.insert(prepared.data.targets.end(), targets.begin(), targets.end());
  }
  return prepared;
}

/// FNV-1a over all that is learnt: a training must not go on from a checkpoint of other captures.
std::uint64_t hash_of(const CnnData& data) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const auto* values : {&data.histograms, &data.sensors, &data.targets}) {
    for (const float value : *values) {
      hash = (hash ^ std::bit_cast<std::uint32_t>(value)) * 1099511628211ull;
    }
  }
  return hash;
}

/// What must be equal for a training to go on. The number of epochs is not part of it, as it may
/// grow.
Json study_of(const PreparedCaptures& prepared, const CnnTrainingOptions& options) {
  return {{"network", cnn_architecture_name(options.network)},
          {"captures", hash_of(prepared.data)},
          {"batch", options.batch},
          {"learning_rate", options.learning_rate},
          {"validation_share", options.validation_share},
          {"early_stopping", options.early_stopping},
          {"seed", options.seed},
          {"split_seed", options.split_seed}};
}

/// How far a training has come.
struct TrainingState {
  std::vector<CnnEpoch> history;
  int best_epoch = 0;  ///< from 1; 0: none yet
  double best = std::numeric_limits<double>::infinity();
  RunTime run_time;

  int epochs() const { return static_cast<int>(history.size()); }
};

Json number_json(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

double parse_number(const Json& json) {
  return json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>();
}

std::string checkpoint_text(const Json& study, const TrainingState& state) {
  Json json{{"format", kCheckpointFormat},
            {"study", study},
            {"best_epoch", state.best_epoch},
            {"time_s", state.run_time.wall},
            {"processor_time_s", state.run_time.processor},
            {"history", Json::array()}};
  for (const CnnEpoch& epoch : state.history) {
    json["history"].push_back({number_json(epoch.training), number_json(epoch.validation)});
  }
  return json.dump();
}

void add_epoch(TrainingState& state, const CnnEpoch& epoch) {
  state.history.push_back(epoch);
  if (!(epoch.validation < state.best)) return;
  state.best = epoch.validation;
  state.best_epoch = state.epochs();
}

TrainingState parse_checkpoint(const std::string& text, const Json& study) {
  TrainingState state;
  try {
    const Json json = Json::parse(text);
    if (!json.is_object() || json.value("format", "") != kCheckpointFormat) {
      throw Error(kCheckpoint, std::string("metadata.format: accepted: '") + kCheckpointFormat +
                                   "', which cnn train writes");
    }
    for (const auto& [name, value] : study.items()) {
      if (json.at("study").at(name) == value) continue;
      throw Error(kCheckpoint, name + ": found " + json["study"][name].dump() +
                                   ", accepted: that of this training, " + value.dump());
    }
    state.run_time = {json.value("time_s", 0.0), json.value("processor_time_s", 0.0)};
    for (const Json& epoch : json.at("history")) {
      add_epoch(state, {parse_number(epoch.at(0)), parse_number(epoch.at(1))});
    }
  } catch (const nlohmann::json::exception& error) {
    throw Error(kCheckpoint, error.what());
  }
  return state;
}

bool stops_early(const TrainingState& state, const CnnTrainingOptions& options) {
  return options.early_stopping > 0 && state.epochs() - state.best_epoch >= options.early_stopping;
}

/// Throws Error if the loss is no number, unless good weights are remembered. Steps too long for
/// the data drive the weights out of all bounds, and hours of training must not end in a file that
/// nobody can read.
void check_loss(const TrainingState& state, const CnnTrainingOptions& options) {
  if (std::isfinite(state.history.back().training)) return;
  if (options.early_stopping > 0 && state.best_epoch > 0) return;
  char rate[32];
  std::snprintf(rate, sizeof rate, "%g", options.learning_rate);
  throw Error("CnnTrainingOptions.learning_rate",
              std::string("found ") + rate + ", with which the loss of epoch " +
                  std::to_string(state.epochs()) + " is no number, accepted: a smaller one");
}

}  // namespace

CnnTrainingOptions CnnTrainingOptions::of(CnnArchitecture network) {
  CnnTrainingOptions options;
  if (network == CnnArchitecture::published) return options;
  options.network = network;
  // By judgement: for ten times the captures, the batch is four times as large. Training ends when
  // nothing more is learnt, which is after 32 epochs on tmf8828_wall.
  options.epochs = 60;
  options.batch = 64;
  options.early_stopping = 10;
  return options;
}

void CnnTrainingOptions::validate() const {
  const auto fail = [](const char* field, double found, const char* accepted) {
    throw Error(field, "found " + std::to_string(found) + ", accepted: " + accepted);
  };
  if (epochs < 1) fail("epochs", epochs, ">= 1");
  if (batch < 2) fail("batch", batch, ">= 2");
  if (!(learning_rate > 0) || !std::isfinite(learning_rate)) {
    fail("learning_rate", learning_rate, "> 0");
  }
  if (!(validation_share >= 0 && validation_share < 1)) {
    fail("validation_share", validation_share, "0 to less than 1");
  }
  if (!(input_bound >= 0) || !std::isfinite(input_bound)) {
    fail("input_bound", input_bound, "> 0, or 0 for none");
  }
  if (early_stopping < 0) fail("early_stopping", early_stopping, ">= 0");
  if (early_stopping > 0 && validation_share <= 0) {
    fail("validation_share", validation_share, "> 0 where training stops early");
  }
}

std::vector<std::size_t> validation_captures(std::size_t count, double share, std::uint64_t seed) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 random(seed);
  std::shuffle(order.begin(), order.end(), random);
  order.resize(static_cast<std::size_t>(std::llround(share * static_cast<double>(count))));
  std::ranges::sort(order);
  return order;
}

std::vector<std::size_t> validation_captures(std::span<const Capture> captures,
                                             const CnnTrainingRecord& record) {
  if (!record.split_by_truth) {
    return validation_captures(captures.size(), record.validation_share, record.split_seed);
  }
  // Places of the object in the order of their first captures.
  std::map<std::map<std::string, double>, std::size_t> known;
  std::vector<std::size_t> place;
  for (const Capture& capture : captures) {
    place.push_back(known.emplace(capture.truth, known.size()).first->second);
  }
  const auto chosen = validation_captures(known.size(), record.validation_share, record.split_seed);
  std::vector<std::size_t> held_back;
  for (std::size_t i = 0; i < captures.size(); ++i) {
    if (std::ranges::binary_search(chosen, place[i])) held_back.push_back(i);
  }
  return held_back;
}

void check_cnn_capture(const Scene& scene, const Capture& capture) {
  if (!(scene.sensor.saturation > 0)) return check_capture(scene, capture);
  Scene unlimited = scene;
  unlimited.sensor.saturation = 0;
  check_capture(unlimited, capture);
}

CnnTrainingResult train_cnn(const Scene& scene, std::span<const Capture> captures,
                            const CnnTrainingOptions& options,
                            const CnnTrainingCallbacks& callbacks, const std::string& checkpoint) {
  options.validate();
  const CnnBackend& backend = cnn_backend();
  const Stopwatch stopwatch;
  PreparedCaptures prepared = prepare(scene, captures, options);
  const Json study = study_of(prepared, options);
  TrainingState state;
  if (!checkpoint.empty()) {
    state = parse_checkpoint(backend.metadata(checkpoint, kCheckpoint), study);
  }
  const auto trainer = backend.trainer(shape_of(prepared.description), prepared.data,
                                       prepared.training, options, checkpoint, kCheckpoint);
  const RunTime before = state.run_time;
  while (state.epochs() < options.epochs && !stops_early(state, options)) {
    add_epoch(state, trainer->run_epoch(state.epochs() + 1));
    check_loss(state, options);
    state.run_time = before + stopwatch.since_start();
    if (options.early_stopping > 0 && state.best_epoch == state.epochs()) trainer->remember();
    if (!callbacks.epoch) continue;
    callbacks.epoch(state.epochs(), state.history.back(),
                    [&] { return trainer->checkpoint(checkpoint_text(study, state)); });
  }
  const bool remembered = options.early_stopping > 0 && state.best_epoch > 0;
  CnnTrainingResult result;
  result.history = state.history;
  result.epoch = remembered ? state.best_epoch : state.epochs();
  result.run_time = state.run_time;
  prepared.description.training.epoch = result.epoch;
  result.weights = trainer->weights(description_text(prepared.description), remembered);
  return result;
}

}  // namespace blindcorner
