// SPDX-License-Identifier: Apache-2.0
/// What came out, in a sentence for a reader who knows nothing of the method.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// "4 cm", "1.3 m": two digits at most.
std::string said_length(double metres);

/// Radius, m, that holds the true position of an object with a probability of 0.95 under one mode,
/// over the coordinates that are unknown; 0 where none is. The distance's square is a sum of scaled
/// chi-squares, taken for the one gamma law with its mean and variance.
double position_radius(const Scene& scene, const PoseMode& mode, int object);

/// Whether a fit found something: else neither its modes nor their ellipses mean anything.
bool found_something(const FitResult& result);

/// Where the object is, give or take how much; or that there is none, or several explanations.
std::string fit_headline(const Scene& scene, const FitResult& result);

/// The same of many captures: in how many of them something was found.
std::string fits_headline(const std::vector<FitResult>& results);

}  // namespace blindcorner
