// SPDX-License-Identifier: Apache-2.0
/// What most options of vehicles and control have to be.
#pragma once

namespace blindcorner {

/// Throws Error "owner.field = value; accepted: a number > 0".
void require_positive(const char* owner, const char* field, double value);

}  // namespace blindcorner
