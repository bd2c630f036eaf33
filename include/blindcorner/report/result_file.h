// SPDX-License-Identifier: Apache-2.0
/// `result.json`: what a fit found, for other programs. Every field is explained in docs/result.md.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

inline constexpr const char* kResultFormat = "blindcorner.result/1";

/// A joint fit lists the sources and indices of all its captures.
bool is_joint(const FitResult& result);

/// The results in the order given. Vectors follow the scene's unknowns (SI units). A number that is
/// not finite becomes null, so the file is always valid JSON; a capture with an error has no modes
/// and null where the answer would be.
nlohmann::json result_json(const Scene& scene, const std::vector<FitResult>& results);

/// One result as it stands in the list `captures`.
nlohmann::json capture_json(const Scene& scene, const FitResult& result);

/// Writes DIR/result.json atomically; the directory must exist. Throws Error.
void write_result(const std::string& directory, const Scene& scene,
                  const std::vector<FitResult>& results);

/// The number, or null when it is not finite.
nlohmann::json number_or_null(double value);

/// Compact text of any JSON value; bytes that are not UTF-8 (odd file names) are replaced.
std::string dump_json(const nlohmann::json& value, int indent = -1);

/// True values of the scene's unknowns as far as `truth` knows them, in their order; NaN where it
/// does not. Empty when it knows none.
std::vector<double> truth_vector(const Scene& scene, const std::map<std::string, double>& truth);

/// Distance of the heaviest mode's position from the true one over the unknown coordinates, m; NaN
/// without mode, without truth or when no coordinate is unknown.
double position_error(const Scene& scene, const FitResult& result);

}  // namespace blindcorner
