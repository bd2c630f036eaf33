// SPDX-License-Identifier: Apache-2.0
/// The three-bounce sum, pair by pair, onto a fine time axis.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "forward/relay/ray_scene.h"
#include "forward/relay/relay_setup.h"

namespace blindcorner {

/// Share of the energy that a tabulated pulse of the reference may lose at either end: far below
/// the reference's own error.
inline constexpr double kPulseTail = 1e-8;

/// Bodies that may stand in the way of an inner leg.
using Blockers = std::vector<const RayScene*>;

/// Light is first collected on a fine time axis with at least 16 cells per bin and 16 per pulse
/// width. The light of each pair is shared linearly between two cells. At the end, the cells are
/// convolved with the pulse. Sharing adds a variance of at most a quarter of a cell squared, which
/// is below 1e-3 of the pulse's.
class FineAxis {
 public:
  explicit FineAxis(const Sensor& sensor);

  int cells() const { return (bins_ + 2 * margin_) * fine_ + 1; }
  double cells_per_bin() const { return fine_; }
  double origin() const { return margin_ * fine_; }  ///< cell of time zero
  /// Adds the light of `cells` to the unwrapped bins of `row`.
  void convolve(const std::vector<double>& cells, double* row) const;

 private:
  int bins_, fine_;
  int first_ = 0, length_ = 0, margin_ = 0;
  std::vector<double> pulse_;  // [phase][bin]
};

/// Light between one cell and one relay patch.
struct Leg {
  double weight = 0;                                    ///< without the cosine at the cell
  double cosine = 0;                                    ///< at the cell
  double length = 0;                                    ///< m, outer and inner leg
  std::size_t patch = 0;                                ///< index of the patch
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< from the cell, unit
};

/// Legs from a cell to those patches that it faces and sees. `surface`: patches of this known
/// surface are left out (the cell is part of it, and convex); -1: none. `soften` takes the patch
/// for a disc, whose form factor stays finite where cell and patch meet.
std::vector<Leg> legs_to(const SurfaceCell& cell, const std::vector<WeightedPatch>& patches,
                         const Blockers& blockers, int surface = -1, bool soften = false);

/// Sums light over pairs of a way in and a way out, zone by zone.
class PairSum {
 public:
  explicit PairSum(const Sensor& sensor);

  /// Adds the light of a whole path of `length` m.
  void add(int zone, double weight, double length);
  /// Lambertian cell: `scattered` is its area times albedo over pi.
  void add_lambertian(int zone, double scattered, const std::vector<Leg>& in,
                      const std::vector<Leg>& out);
  /// Cell with any BRDF: `area_albedo` is its area times albedo.
  void add_brdf(int zone, double area_albedo, const Brdf& brdf, const Eigen::Vector3d& normal,
                const std::vector<Leg>& in, const std::vector<Leg>& out);
  /// Retroreflective cell of `area` m^2: f = rho G(alpha; sigma) / sqrt(cos_i cos_o). The Gaussian
  /// G takes the chord of the unit sphere for alpha, so that it is normalised exactly.
  void add_retroreflective(int zone, double area, double albedo, double sigma,
                           const std::vector<Leg>& in, const std::vector<Leg>& out);

  /// Adds the light, convolved with the pulse and wrapped, to the cube.
  void finish(HistogramCube& cube) const;

 private:
  struct Deposit;
  Deposit deposit(int zone);

  const Sensor& sensor_;
  FineAxis axis_;
  double cells_per_metre_;
  std::vector<std::vector<double>> light_;  // [zone][fine cell]
};

}  // namespace blindcorner
