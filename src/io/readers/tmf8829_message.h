// SPDX-License-Identifier: Apache-2.0
/// What the TMF8829 makers' programs publish through ZeroMQ.
#pragma once

#include <string>
#include <string_view>

namespace blindcorner {

/// One published message as the line of JSON that the makers' log has for it (an element of
/// Result_Set): `mp_histo`, and in dual mode `mp_histo_HA`. Throws Error, one line that says what
/// is damaged or that histograms are switched off.
std::string tmf8829_line(std::string_view message);

}  // namespace blindcorner
