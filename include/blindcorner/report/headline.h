// SPDX-License-Identifier: Apache-2.0
/// The outcome in a sentence, for a reader who knows nothing of the method.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// "4 cm", "1.3 m": two digits at most.
std::string said_length(double metres);

/// Radius, m, that contains the true position of an object with a probability of 0.95 under one
/// mode, over the unknown coordinates; 0 if none is unknown. The squared distance is a sum of
/// scaled chi-squares. It is approximated by the gamma distribution with the same mean and
/// variance.
double position_radius(const Scene& scene, const PoseMode& mode, int object);

/// Whether a fit found something; otherwise its modes and their ellipses mean nothing.
bool found_something(const FitResult& result);

/// Where the object is, with its uncertainty; or that there is no object, or several explanations.
std::string fit_headline(const Scene& scene, const FitResult& result);

/// The same for many captures: in how many of them the fits found something.
std::string fits_headline(const std::vector<FitResult>& results);

}  // namespace blindcorner
