// SPDX-License-Identifier: Apache-2.0
/// Fits of many captures: what they share, and what becomes of one that fails.
#pragma once

#include <span>
#include <string>

#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// Says what is wrong where a capture file's bins, `found` s wide (0: it does not say), are not the
/// scene's within 1 %, by which the last of 128 bins moves by about one; empty: nothing.
std::string bin_width_problem(double found, double expected);

/// Suits sensor and options to the captures of a run: bins that many of them fill are left out,
/// and captures for each sensor placement are counted. Null captures, which could not be read, are
/// passed over. Returns one line that says which bins were left out; empty: none.
std::string suit_captures(std::span<const Capture* const> captures, Sensor& sensor,
                          FitOptions& options);

/// Puts sources and places of the captures into a result, and what is known of the object.
void name_captures(std::span<const Capture* const> captures, FitResult& result);

/// The fit of one capture, named. What it throws becomes the result's error, except what
/// FitOptions::progress throws that is no std::exception.
FitResult fit_named(const Fitter& fitter, const Capture& capture);

/// The joint fit of captures, likewise.
FitResult fit_joint_named(const Fitter& fitter, std::span<const Capture> captures);

}  // namespace blindcorner
