// SPDX-License-Identifier: Apache-2.0
/// Detections and false alarms: page, table for a terminal, CSV and JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "blindcorner/simulation/detection_study.h"

namespace blindcorner {

/// The sentence that stands first: how many stated false-alarm probabilities hold.
std::string detection_headline(const DetectionReport& report);
std::string detection_text(const DetectionScene& scene);
/// A row for each level of light (docs/benchmark.md).
std::string detection_csv(const DetectionReport& report);
/// A row for each stated false-alarm probability.
std::string false_alarms_csv(const DetectionReport& report);
/// A row for each point of the curves.
std::string roc_csv(const DetectionReport& report);
/// "blindcorner.detection/1".
nlohmann::ordered_json detection_json(const DetectionReport& report);
/// One self-contained page.
std::string detection_page(const DetectionReport& report);

}  // namespace blindcorner
