// SPDX-License-Identifier: Apache-2.0
/// `blindcorner cnn dataset|train|evaluate|baseline`: the learned baseline.
#include "commands/cnn.h"

#include <CLI/CLI.hpp>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/cnn_training.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/synthetic_trials.h"

namespace blindcorner {

PointEstimate cnn_estimate(const Scene& scene, const Capture& capture, const CnnBaseline& cnn) {
  PointEstimate estimate{capture.source,
                         capture.index,
                         true_pose(scene, capture),
                         {},
                         {},
                         capture.T_world_sensor.value_or(scene.T_world_sensor)};
  if (!estimate.truth.allFinite()) {
    throw Error(capture.source + " capture " + std::to_string(capture.index),
                "truth is missing, accepted: the true value of every unknown");
  }
  const PoseMixture posterior = cnn.posterior(capture, estimate.T_world_sensor);
  estimate.estimate = posterior.mean;
  if (posterior.covariance.size() > 0) {
    estimate.sigma = posterior.covariance.diagonal().cwiseSqrt();
  }
  return estimate;
}

std::vector<Capture> held_back_captures(const std::vector<Capture>& captures,
                                        const CnnBaseline& cnn) {
  const CnnTrainingRecord& record = cnn.description().training;
  std::vector<Capture> chosen;
  for (const std::size_t i : validation_captures(captures, record)) {
    chosen.push_back(captures[i]);
  }
  return chosen;
}

nlohmann::ordered_json run_time_json(const RunTime& time) {
  return {{"wall", time.wall}, {"processor", time.processor}};
}

void add_cnn_command(CLI::App& app, int& exit_code) {
  CLI::App& cnn = *app.add_subcommand(
      "cnn",
      "learned baselines, the published network first: data to learn from, training, errors");
  cnn.require_subcommand(1);
  add_cnn_dataset(cnn, exit_code);
  add_cnn_train(cnn, exit_code);
  add_cnn_evaluate(cnn, exit_code);
  add_cnn_baseline(cnn, exit_code);
}

}  // namespace blindcorner
