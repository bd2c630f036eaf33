// SPDX-License-Identifier: Apache-2.0
/// The parts of `blindcorner cnn`.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/inverse/baseline/cnn.h"
#include "report/point_estimates.h"

namespace CLI {
class App;
}

namespace blindcorner {

void add_cnn_command(CLI::App& app, int& exit_code);
void add_cnn_dataset(CLI::App& cnn, int& exit_code);
void add_cnn_train(CLI::App& cnn, int& exit_code);
void add_cnn_evaluate(CLI::App& cnn, int& exit_code);

/// All captures of files and directories, which must all be readable. Throws Error.
std::vector<Capture> read_all_captures(const std::vector<std::string>& paths, const Scene& scene);

/// What a network says of a capture, beside its truth. Throws Error where that is missing, and as
/// CnnBaseline::predict does.
PointEstimate cnn_estimate(const Scene& scene, const Capture& capture, const CnnBaseline& cnn);

/// Of the captures that a network was trained with, in the same order, those held back.
std::vector<Capture> held_back_captures(const std::vector<Capture>& captures,
                                        const CnnBaseline& cnn);

/// In the directory of a data set, beside its captures.
inline constexpr const char* kDatasetManifest = "dataset.json";

}  // namespace blindcorner
