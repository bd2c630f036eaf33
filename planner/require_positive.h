// SPDX-License-Identifier: Apache-2.0
/// Check for options of vehicles and control, most of which have to be positive.
#pragma once

namespace blindcorner {

/// Throws Error "owner.field = value; accepted: a number > 0".
void require_positive(const char* owner, const char* field, double value);

}  // namespace blindcorner
