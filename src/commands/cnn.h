// SPDX-License-Identifier: Apache-2.0
/// The parts of `blindcorner cnn`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/run_time.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/inverse/baseline/cnn_training.h"
#include "blindcorner/simulation/dataset.h"
#include "commands/printout.h"
#include "report/point_estimates.h"

namespace CLI {
class App;
}

namespace blindcorner {

/// Arguments of the parts. Each part writes its files and returns an exit code.
struct CnnDatasetArguments {
  std::string scene;
  std::string output;
  double sensor_spread = -1;  ///< m; negative: the default
  double sensor_yaw_spread_deg = 2;
  int threads = 0;
  int environments = 0;  ///< > 0: SCENE is a drive file
  int places = 1;        ///< of a drive file, as in DriveDatasetOptions
  DatasetOptions options;
};
int run_cnn_dataset(const CnnDatasetArguments& arguments);

struct CnnTrainArguments {
  std::string scene;
  std::vector<std::string> captures;
  std::string output;
  std::string network = "published";
  bool resume = false;
  int checkpoint_every = 20;
  std::optional<std::uint64_t> split_seed;
  std::optional<int> epochs, batch, early_stopping;  ///< empty: the network's own defaults
  std::optional<double> learning_rate;
  CnnTrainingOptions options;
  Printout out;

  std::string file(const char* name) const {
    return (std::filesystem::path(output) / name).string();
  }
};
int run_cnn_train(CnnTrainArguments arguments);

struct CnnEvaluateArguments {
  std::string scene;
  std::string weights;
  std::vector<std::string> captures;
  std::string output;
  bool held_back = false;
  Printout out;
};
int run_cnn_evaluate(const CnnEvaluateArguments& arguments);

void add_cnn_command(CLI::App& app, int& exit_code);
void add_cnn_dataset(CLI::App& cnn, int& exit_code);
void add_cnn_train(CLI::App& cnn, int& exit_code);
void add_cnn_evaluate(CLI::App& cnn, int& exit_code);
void add_cnn_baseline(CLI::App& cnn, int& exit_code);

/// A network's estimate of a capture, beside the truth. Throws Error if the truth is missing, and
/// whenever CnnBaseline::predict does.
PointEstimate cnn_estimate(const Scene& scene, const Capture& capture, const CnnBaseline& cnn);

/// The captures that a network's training held back. `captures` are all captures of the training,
/// in the same order.
std::vector<Capture> held_back_captures(const std::vector<Capture>& captures,
                                        const CnnBaseline& cnn);

/// {"wall": ..., "processor": ...}
nlohmann::ordered_json run_time_json(const RunTime& time);

/// Name of the file that describes a data set. It stands beside the captures of the set.
inline constexpr const char* kDatasetManifest = "dataset.json";

}  // namespace blindcorner
