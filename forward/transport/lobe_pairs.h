// SPDX-License-Identifier: Apache-2.0
/// Light of a retroreflector from pairs of a lit and a seen relay patch, as one point of the object
/// sees them: what leaves towards r of the light that came from p is the lobe's density between
/// their directions. Whatever the lobe's width; only pairs within its reach cost time.
///
/// Directions are points X of a stereographic map about the object's normal m, X = (d - c m) /
/// (1 + c) with c = d . m. It keeps angles, and the chord between two directions is exactly
/// |X - Y| sqrt((1 + c) (1 + c')), so that lobe and patches are distributions in one plane and a
/// pair adds their covariances and fourth cumulants: a normal distribution with Edgeworth's first
/// correction. Within a pair the lobe favours the parts of both patches that are near each other:
/// where they are follows from the joint normal distribution, and with it the path.
///
/// Light from even patches side by side has to look even. At the frequency of a row of patches of
/// edge w the true distribution, flat over both patches, has nothing: its transform is sinc^2.
/// Normal distributions have exp(-2 pi^2 (s^2 / w^2 + 1/6)) there (s: the lobe), which is up to 4 %
/// of the light, twice: lit and seen patches often coincide, so that every pair sees the same phase
/// of the ripples and the light is too bright. The correction multiplies this by
/// 1 - pi^4 / 90 = -0.08, whatever the lobe's width.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

namespace blindcorner {

/// Pulses on their way to a zone's path cells.
struct Pulses {
  std::vector<double> weight;    ///< 0: no light
  std::vector<double> path;      ///< m
  std::vector<double> variance;  ///< m^2
  std::size_t count = 0;         ///< of pairs: how many are in use, dark ones included

  void resize(std::size_t size) {
    for (auto* v : {&weight, &path, &variance}) {
      if (v->size() < size) v->resize(size);
    }
  }
};

/// Patches [begin, begin + count).
struct PatchRange {
  std::size_t begin, count;
};

/// Pieces of relay patches as a point of the object sees them: arrays of one length, not owned.
struct LobePieces {
  const double* weight;        ///< light by way of the piece, W or sr; 0: not seen
  const double* cosine;        ///< at the object
  const double* path;          ///< m
  const double* distance;      ///< m, inner part of the path
  const double *dx, *dy, *dz;  ///< unit directions from the object
  const double *lx, *ly, *lz;  ///< gradient of the outer leg
  const double *ux, *uy, *uz;  ///< half edges, m
  const double *vx, *vy, *vz;
  const double *left_u, *left_v;  ///< shares of the edges that are seen
  const double *bx, *by, *bz;     ///< m, from the point that was asked about to the piece's middle
};

/// Patches of one side: light's mean and covariance of place and path over the pieces of a group.
class LobeEnds {
 public:
  /// `group_end`: one past the last piece of each group, neighbours near each other; `group_zone`
  /// its zone, equal ones together. `half_u`, `half_v`: half edges of the object's cell, m, along
  /// which both legs change (zero where its nodes stand for it).
  void fill(const LobePieces& pieces, const std::vector<int>& group_end,
            const std::vector<int>& group_zone, const Eigen::Vector3d& normal,
            const Eigen::Vector3d& half_u, const Eigen::Vector3d& half_v);

 private:
  friend class LobePairs;
  /// Blocks of consecutive patches of one zone, and what bounds each: arrays of one length.
  struct Blocks {
    std::vector<PatchRange> patches;
    std::vector<int> zone;
    std::vector<double> left, right, low, high;  ///< of the map
    std::vector<double> factor;                  ///< largest of 1 / (1 + c)
    std::vector<double> ee, ff;                  ///< largest variances of a patch along both axes

    std::size_t size() const { return patches.size(); }
    void clear();
    void add(const LobeEnds& ends, std::size_t begin);
    /// [first, end) of those of a zone.
    std::array<std::size_t, 2> of_zone(int z) const;
  };
  /// Pieces on the map.
  struct Mapped {
    std::vector<double> x, y, path, ux, uy, vx, vy, along_u, along_v, weight;

    void resize(std::size_t count);
  };
  void map(const LobePieces& pieces, std::size_t count, const Eigen::Vector3d& normal,
           const Eigen::Vector3d& e, const Eigen::Vector3d& f);
  bool add(std::size_t begin, std::size_t end, std::size_t to);
  void find_fourth(std::size_t begin, std::size_t end, std::size_t to);

  std::size_t size_ = 0;
  Mapped mapped_;
  std::vector<double> weight_, path_, variance_;
  std::vector<double> x_, y_;         ///< on the map
  std::vector<double> factor_;        ///< 1 / (1 + c)
  std::vector<double> ee_, ff_, ef_;  ///< covariance of a patch's extent on the map
  std::vector<double> xxxx_, xxxy_, xxyy_, xyyy_, yyyy_;  ///< and its fourth cumulants
  std::vector<double> ke_, kf_;  ///< covariance of place and path over a patch, m
  std::vector<double> gu_, gv_;  ///< change of the leg along the object's cell, m
  std::vector<int> zone_;
  Blocks blocks_;
};

/// The sum over pairs. The lobe ends four standard deviations off, where it is lowered to zero and
/// scaled to hold all of its light: 0.3 % too high in the middle, its variance 1 % too small.
class LobePairs {
 public:
  /// `sigma`: standard deviation of the lobe, rad; `same_zone`: zones see their own light
  /// only.
  LobePairs(double sigma, bool same_zone) : variance_(sigma * sigma), same_zone_(same_zone) {}

  /// Visits the pulses that go out to each seen patch, in units of both weights times `scale` over
  /// sr. The lobe is averaged over both patches.
  template <typename Visit>  // (int zone, const Pulses&)
  void visit(const LobeEnds& lit, const LobeEnds& seen, double scale, Pulses& pulses,
             const Visit& visit_pulses) const {
    Reach reach;
    reach.blocks = {0, lit.blocks_.size()};
    for (std::size_t i = 0; i < seen.size_; ++i) {
      const int zone = seen.zone_[i];
      const bool other = i == 0 || zone != seen.zone_[i - 1];
      if (same_zone_ && other) reach.blocks = lit.blocks_.of_zone(zone);
      find_reached(lit, seen, i, reach);
      if (reach.reached.empty()) continue;
      pair(lit, reach.reached, seen, i, scale, pulses);
      visit_pulses(zone, pulses);
    }
  }

 private:
  /// Lit blocks that a seen patch may reach, [first, end), and those that it does.
  struct Reach {
    std::array<std::size_t, 2> blocks;
    std::vector<PatchRange> reached;
    std::vector<double> within;  ///< [blocks] reach less distance, signed
  };

  void find_reached(const LobeEnds& lit, const LobeEnds& seen, std::size_t i, Reach& reach) const;
  void pair(const LobeEnds& lit, const std::vector<PatchRange>& blocks, const LobeEnds& seen,
            std::size_t i, double scale, Pulses& pulses) const;

  double variance_;
  bool same_zone_;
};

}  // namespace blindcorner
