// SPDX-License-Identifier: Apache-2.0
/// Impulse response of laser, detector and timing electronics together.
#pragma once

#include <variant>
#include <vector>

namespace blindcorner {

/// Gaussian of standard deviation `sigma` seconds.
struct GaussianResponse {
  double sigma = 1e-10;
};
/// Box of full width `box` convolved with a Gaussian of standard deviation `sigma`, seconds.
struct BoxGaussianResponse {
  double box = 1e-9;
  double sigma = 1e-10;
};
/// One exponential tail: `fraction` of the energy, decay time in seconds.
struct Tail {
  double fraction = 0.1;
  double decay = 1e-10;
};
/// Gaussian core. For each tail, the tail's fraction of the core is convolved with a one-sided
/// exponential (diffusion tail of a SPAD).
struct ExponentialTailResponse {
  double sigma = 1e-10;
  std::vector<Tail> tails;
};
/// Measured response: values at increasing times, linear in between, zero outside.
struct TableResponse {
  std::vector<double> times;   ///< s, increasing
  std::vector<double> values;  ///< >= 0, any scale
};

using ResponseShape =
    std::variant<GaussianResponse, BoxGaussianResponse, ExponentialTailResponse, TableResponse>;

/// A response that integrates to one. Its time axis is shifted so that its peak is at t = 0.
class ImpulseResponse {
 public:
  /// Throws Error when the shape is not a density (negative values, no width, fractions over one).
  explicit ImpulseResponse(ResponseShape shape = GaussianResponse{});

  const ResponseShape& shape() const { return shape_; }

  /// Integral of the response, convolved with a centred Gaussian of variance `blur` (s^2), up to
  /// time `t` (s) after the unblurred peak.
  double cumulative(double t, double blur = 0.0) const;

  /// Standard deviation of a Gaussian with the same full width at half maximum, s. Path spreads are
  /// judged against this width.
  double core_sigma() const { return core_sigma_; }

  /// Start and end of the pulse, s: at most the share `outside` of the energy lies before the
  /// start, and at most the same share after the end.
  std::pair<double, double> support(double outside, double blur = 0.0) const;

 private:
  double cumulative_from_origin(double t, double blur) const;
  double density_from_origin(double t) const;

  ResponseShape shape_;
  std::vector<double> table_integral_;  // of TableResponse up to its times, not normalised
  double peak_ = 0.0;                   // s, of the unshifted density
  double core_sigma_ = 0.0;             // s
};

}  // namespace blindcorner
