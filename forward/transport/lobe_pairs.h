// SPDX-License-Identifier: Apache-2.0
/// Light of a retroreflector as a sum over pairs of a lit and a seen relay patch, as one point of
/// the object sees them. The share of the light from p that leaves towards r is the lobe's density
/// between their directions. The sum holds for any width of the lobe, and only pairs within its
/// reach cost time.
///
/// Directions are points X of a stereographic map about the object's normal m, X = (d - c m) / (1 +
/// c) with c = d . m. The map keeps angles, and the chord between two directions is exactly |X - Y|
/// sqrt((1 + c) (1 + c')). The lobe and the patches are therefore distributions in one plane. A
/// pair adds their covariances and fourth cumulants, which gives a normal distribution with
/// Edgeworth's first correction. Within a pair, the lobe favours the parts of both patches that are
/// near each other. The joint normal distribution tells where these parts are, and so gives the
/// path.
///
/// Light from even patches side by side has to look even. The true distribution is flat over both
/// patches; its transform sinc^2 is zero at the frequency of a row of patches of edge w. The
/// transform of a normal distribution is exp(-2 pi^2 (s^2 / w^2 + 1/6)) there (s: the lobe), up to
/// 4 % of the light, and ripples have twice this amplitude. Lit and seen patches often coincide, so
/// every pair sees the same phase of the ripples and the light is too bright. Edgeworth's
/// correction multiplies the ripples by 1 - pi^4 / 90 = -0.08, whatever the lobe's width.
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
  std::size_t count = 0;         ///< pulses of pairs in use, dark ones included

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
  const double *bx, *by, *bz;     ///< m, from the point that has this path to the piece's middle
};

/// Patches of one side, lit or seen. A patch has the mean and the covariance of place and path of
/// the light over the pieces of a group.
class LobeEnds {
 public:
  /// `group_end`: one past the last piece of each group; consecutive groups should lie near each
  /// other. `group_zone`: the zone of each group; groups of one zone are consecutive. `half_u`,
  /// `half_v`: half edges of the object's cell, m, along which both legs change (zero where the
  /// cell's nodes stand for its extent).
  void fill(const LobePieces& pieces, const std::vector<int>& group_end,
            const std::vector<int>& group_zone, const Eigen::Vector3d& normal,
            const Eigen::Vector3d& half_u, const Eigen::Vector3d& half_v);

 private:
  friend class LobePairs;
  /// Blocks of consecutive patches of one zone, with bounds on their patches: arrays of one length.
  struct Blocks {
    std::vector<PatchRange> patches;
    std::vector<int> zone;
    std::vector<double> left, right, low, high;  ///< bounds on the map
    std::vector<double> factor;                  ///< largest of 1 / (1 + c)
    std::vector<double> ee, ff;                  ///< largest variances of a patch along both axes

    std::size_t size() const { return patches.size(); }
    void clear();
    void add(const LobeEnds& ends, std::size_t begin);
    /// Blocks [first, end) of a zone.
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

/// The sum over pairs. The lobe ends at four standard deviations: it is lowered so that it is zero
/// there, and scaled so that it holds all of its light. It is then 0.3 % too high in the middle,
/// and its variance is 1 % too small.
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
  /// Lit blocks [first, end) that a seen patch may reach, and those that it reaches.
  struct Reach {
    std::array<std::size_t, 2> blocks;
    std::vector<PatchRange> reached;
    std::vector<double> within;  ///< [blocks] squared reach less squared distance; > 0: reached
  };

  void find_reached(const LobeEnds& lit, const LobeEnds& seen, std::size_t i, Reach& reach) const;
  void pair(const LobeEnds& lit, const std::vector<PatchRange>& blocks, const LobeEnds& seen,
            std::size_t i, double scale, Pulses& pulses) const;

  double variance_;
  bool same_zone_;
};

}  // namespace blindcorner
