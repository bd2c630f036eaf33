// SPDX-License-Identifier: Apache-2.0
/// `result.json`: what a fit found, for other programs. docs/result.md explains every field.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

inline constexpr const char* kResultFormat = "blindcorner.result/1";

/// Whether a result is of a joint fit, which lists the sources and indices of all its captures.
bool is_joint(const FitResult& result);

/// The results in the given order. Vectors follow the scene's unknowns (SI units). A number that is
/// not finite becomes null, so the file is always valid JSON. A capture with an error has no modes,
/// and null in place of the answer.
nlohmann::json result_json(const Scene& scene, const std::vector<FitResult>& results);

/// One result as an entry of the list `captures`.
nlohmann::json capture_json(const Scene& scene, const FitResult& result);

/// Writes DIR/result.json atomically; the directory must exist. Throws Error.
void write_result(const std::string& directory, const Scene& scene,
                  const std::vector<FitResult>& results);

/// The number, or null when it is not finite.
nlohmann::json number_or_null(double value);

/// Text of any JSON value, compact unless `indent` is 0 or more; bytes that are not UTF-8 (odd file
/// names) are replaced.
std::string dump_json(const nlohmann::json& value, int indent = -1);

/// True values of the scene's unknowns in their order; NaN where `truth` does not contain the
/// value. Empty if `truth` contains none.
std::vector<double> truth_vector(const Scene& scene, const std::map<std::string, double>& truth);

/// Distance of the first mode's position (the heaviest mode) from the true one over the unknown
/// coordinates, m; NaN without a mode, without truth, or if no coordinate is unknown.
double position_error(const Scene& scene, const FitResult& result);

}  // namespace blindcorner
