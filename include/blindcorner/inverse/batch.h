// SPDX-License-Identifier: Apache-2.0
/// Fits of many captures: the settings that they share, and the result of a fit that fails.
#pragma once

#include <span>
#include <string>

#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// Describes the problem where the bin width `found` of a capture file (s; 0: the file does not
/// state it) differs from the scene's by more than 1 %. At 1 %, the last of 128 bins moves by about
/// one. Empty: no problem.
std::string bin_width_problem(double found, double expected);

/// Adapts sensor and options to the captures of a run: leaves out bins that many captures fill, and
/// counts captures for each sensor placement. Null captures, which could not be read, are skipped.
/// Returns one line that says which bins were left out; empty: none.
std::string suit_captures(std::span<const Capture* const> captures, Sensor& sensor,
                          FitOptions& options);

/// Writes the captures' sources and indices, and the known truth about the object, into a result.
void name_captures(std::span<const Capture* const> captures, FitResult& result);

/// Fits one capture and names it. An exception becomes the result's error, except one that is no
/// std::exception, which FitOptions::progress may throw.
FitResult fit_named(const Fitter& fitter, const Capture& capture);

/// The same for a joint fit of captures.
FitResult fit_joint_named(const Fitter& fitter, std::span<const Capture> captures);

}  // namespace blindcorner
