// SPDX-License-Identifier: Apache-2.0
/// What a scene accepts, in the units of scene files. The limits hold for scenes from files and for
/// scenes made in code.
#pragma once

#include "forward/support/number_range.h"

namespace blindcorner::limits {

// Limits against slips of the pen: no scene is larger than 100 km or finer than a micrometre, or
// lies further than 10,000 km from the origin.
inline const NumberRange kPosition = NumberRange::between(-1e7, 1e7);    // m
inline const NumberRange kLength = NumberRange::between(1e-6, 1e5);      // m
inline const NumberRange kSize = NumberRange::between(0.01, 100);        // factor on all lengths
inline const NumberRange kAnyAngle = NumberRange::between(-3600, 3600);  // degrees
inline const NumberRange kShare{.lower = 0, .upper = 1};
inline const NumberRange kPositiveShare{.lower = 0, .upper = 1, .above_lower = true};
inline const NumberRange kProperShare{.lower = 0, .upper = 1, .below_upper = true};
inline const NumberRange kPositive = NumberRange::above(0);
inline const NumberRange kNotNegative = NumberRange::at_least(0);
inline const NumberRange kInside01 = NumberRange::inside(0, 1);

// Instruments. The limits lie far beyond any real instrument.
inline constexpr int kMaxZonesPerSide = 256;
/// Zones of a capture. With more, a fit takes minutes: sums go over zones, relay patches and object
/// points.
inline constexpr int kMaxZones = 4096;
inline constexpr int kMaxCounts = 1 << 22;
inline constexpr int kMaxBins = 1 << 17;
inline const NumberRange kDuration{.lower = 0, .upper = 1e9, .above_lower = true};  // ps
inline const NumberRange kTime = NumberRange::between(-1e9, 1e9);                   // ps
inline const NumberRange kAngle = NumberRange::inside(-90, 90);                     // degrees
inline const NumberRange kHalfAngle = NumberRange::inside(0, 90);                   // degrees
inline const NumberRange kFullAngle = NumberRange::inside(0, 180);                  // degrees
inline const NumberRange kLightOffset = NumberRange::between(-100, 100);            // m
/// Above this, rounding the number of laser cycles that are still free loses single photons.
inline const NumberRange kPileUpCycles = NumberRange::between(1, 1e15);
inline const NumberRange kBackground = NumberRange::between(-1e30, 1e30);    // counts
inline const NumberRange kPhotonBackground = NumberRange::between(0, 1e30);  // counts

// Materials and priors.
inline const NumberRange kLobe{.lower = 0, .upper = 45, .above_lower = true};  // degrees
inline const NumberRange kExponent = NumberRange::between(0, 50);
inline const NumberRange kTangent = NumberRange::between(-1, 1);
/// Beyond this a squared brightness times counts leaves double precision.
inline const NumberRange kMedian = NumberRange::between(1e-30, 1e30);
inline const NumberRange kSigmaLog{.lower = 0, .upper = 20, .above_lower = true};

}  // namespace blindcorner::limits
