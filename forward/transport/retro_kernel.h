// SPDX-License-Identifier: Apache-2.0
/// The part that both kernels of a retroreflector share. A retroreflector sends light back to where
/// it came from. Each group of relay patches, or each pair of patches, is one pulse with its
/// weight, mean path and path variance. Pulses with nearly the same path are joined: each adds its
/// moments to the two nearest cells of a path axis, in proportion to nearness. The sum thus stays
/// continuous in the pose, and every moment up to the second is kept.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "forward/transport/transport_kernel.h"

namespace blindcorner {

class RetroKernel : public TransportKernel {
 public:
  void render(const ObjectInPlace& object, Scratch& s) const final;

 protected:
  /// A cell of the object with what hides the relay from each of its nodes.
  struct ShadedCell {
    std::size_t index;
    const CellNodes& nodes;
    const std::vector<ShadowView>& shadows;  ///< one per node; empty without occluders
    std::span<const std::vector<OccluderFace>> occluders;  ///< of each node, or one list for all

    const ShadowView* shadow(std::size_t node) const {
      return shadows.empty() ? nullptr : &shadows[node];
    }
  };

  explicit RetroKernel(const KernelInputs& inputs);

  /// Called before the first cell of a placement.
  virtual void begin(const std::vector<SurfaceCell>& /*cells*/, Scratch& /*s*/) const {}
  virtual void add_cell(const ShadedCell& cell, Scratch& s) const = 0;
  /// Whether an object takes milliseconds: its cells are then shared among threads.
  virtual bool costly() const { return false; }

  const Scene& scene() const { return transport_->scene; }
  const Sampling& sampling() const { return *sampling_; }
  bool confocal() const { return confocal_; }
  double lobe_sigma() const {
    return std::get<RetroreflectiveMaterial>(scene().hidden.material).lobe_sigma;
  }
  /// Adds the pulses [begin, end) to the path cells of a zone.
  void add_pulses(Scratch& s, int zone, std::size_t begin, std::size_t end) const;

 private:
  void add_cells(const ObjectInPlace& object, const std::vector<SurfaceCell>& cells,
                 std::size_t first, std::size_t step, Scratch& s) const;
  void collect(Scratch& part, Scratch& whole) const;
  void flush(Scratch& s) const;

  std::shared_ptr<const SceneTransport> transport_;
  std::shared_ptr<const Sampling> sampling_;
  bool confocal_;
  bool whole_axis_;
  double extra_variance_;  ///< s^2
  std::shared_ptr<const PulseTable> pulses_;
  int axis_bins_;
  double bins_per_metre_;
  double cells_per_metre_;
  int path_cells_;
};

}  // namespace blindcorner
