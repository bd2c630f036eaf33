// SPDX-License-Identifier: Apache-2.0
/// What fits cost where models are dear, whatever else the machine does.
#pragma once

namespace blindcorner {

/// Histograms of one capture that fast models have rendered for all fits of this process so far.
/// Thread safe.
long renders_of_fits();

}  // namespace blindcorner
