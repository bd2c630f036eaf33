// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/retro_kernel.h"

#include <algorithm>

#include "blindcorner/forward/constants.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// Width of a path cell in pulse standard deviations: pairs in one cell differ by a spread of s =
/// 0.4^2 / 6 = 0.03, whose closure error is below 1e-4. With wider cells, the light has kinks as
/// the pose changes.
constexpr double kPathCell = 0.4;
/// Number of parts in which a costly object's cells are summed in parallel. It is fixed, so that
/// sums do not depend on the number of threads. By judgement: some for each core.
constexpr std::size_t kParts = 4;

}  // namespace

RetroKernel::RetroKernel(const KernelInputs& inputs)
    : transport_(inputs.view.transport),
      sampling_(inputs.sampling),
      confocal_(inputs.view.confocal),
      whole_axis_(inputs.whole_axis),
      extra_variance_(inputs.extra_variance),
      pulses_(transport_->pulses(extra_variance_, inputs.view.kernel)),
      axis_bins_(unwrapped_bins(scene().sensor)),
      bins_per_metre_(1 / (kSpeedOfLight * scene().sensor.bin_width)),
      cells_per_metre_(1 / (kPathCell * transport_->pulse_sigma(extra_variance_))),
      path_cells_(static_cast<int>(axis_bins_ / bins_per_metre_ * cells_per_metre_) +
                  2 * kCellMargin) {}

void RetroKernel::render(const ObjectInPlace& object, Scratch& s) const {
  s.prepare(scene().sensor.zone_count(), path_cells_);
  const std::vector<SurfaceCell> cells = divide(scene().hidden.shape, object.T_world_object,
                                                object.placement.size, sampling_->object_edge, 1);
  begin(cells, s);
  if (!costly() || cells.size() < kParts) {
    add_cells(object, cells, 0, 1, s);
  } else {
    thread_local std::vector<Scratch> parts(kParts);
    std::vector<Scratch>& own = parts;  // this thread's, whoever works on them
    // The loop is isolated (parallel.h), because another render on this thread would need the same
    // scratch.
    parallel_for(std::size_t{0}, kParts, [&](std::size_t part) {
      own[part].prepare(scene().sensor.zone_count(), path_cells_);
      own[part].pair_count = 0;
      add_cells(object, cells, part, kParts, own[part]);
    });
    for (Scratch& part : own) collect(part, s);
  }
  flush(s);
}

/// Adds every `step`-th cell from `first` on.
void RetroKernel::add_cells(const ObjectInPlace& object, const std::vector<SurfaceCell>& cells,
                            std::size_t first, std::size_t step, Scratch& s) const {
  std::vector<ShadowView> shadows;
  std::vector<std::vector<OccluderFace>> faces;  // of each node, where bodies are in the way
  for (std::size_t c = first; c < cells.size(); c += step) {
    if (!faces_relay(*sampling_, cells[c].center, cells[c].normal)) continue;
    const CellNodes nodes(cells[c], sampling_->object_midpoint);
    shadows.clear();
    faces.clear();
    for (std::size_t n = 0; object.shaded() && n < nodes.count; ++n) {
      const Eigen::Vector3d& point = nodes.nodes[n].center;
      if (!object.bodies.empty()) {
        faces.push_back(object.occluders);
        object.bodies.faces_seen_from(point, faces.back());
      }
      object.bodies.cast(point, shadows.emplace_back(object.occluders, point));
    }
    using Lists = std::span<const std::vector<OccluderFace>>;
    add_cell({c, nodes, shadows, faces.empty() ? Lists(&object.occluders, 1) : Lists(faces)}, s);
  }
}

/// Moves the light of a part to the whole, and leaves the part's cells empty.
void RetroKernel::collect(Scratch& part, Scratch& whole) const {
  whole.pair_count += part.pair_count;
  for (std::size_t z = 0; z < static_cast<std::size_t>(scene().sensor.zone_count()); ++z) {
    Range& own = part.touched[z];
    if (whole_axis_) own = {0, path_cells_};
    if (own.begin >= own.end) continue;
    Range& all = whole.touched[z];
    all = all.begin < all.end ? Range{std::min(all.begin, own.begin), std::max(all.end, own.end)}
                              : own;
    Sums* from = part.cells.data() + z * static_cast<std::size_t>(path_cells_);
    Sums* to = whole.cells.data() + z * static_cast<std::size_t>(path_cells_);
    for (int c = own.begin; c < own.end; ++c) {
      to[c].weight += from[c].weight;
      to[c].first += from[c].first;
      to[c].second += from[c].second;
      from[c] = {};
    }
    own = {};
  }
}

void RetroKernel::add_pulses(Scratch& s, int zone, std::size_t begin, std::size_t end) const {
  add_to_cells(s.pulses, begin, end, cells_per_metre_, path_cells_,
               s.cells.data() + static_cast<std::ptrdiff_t>(zone) * path_cells_,
               s.touched[static_cast<std::size_t>(zone)]);
}

/// Renders one pulse for each path cell that holds light, and leaves the cells empty.
void RetroKernel::flush(Scratch& s) const {
  const Sensor& sensor = scene().sensor;
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const double start = sensor.zones[static_cast<std::size_t>(z)].time_zero / sensor.bin_width;
    Sums* cells = s.cells.data() + static_cast<std::ptrdiff_t>(z) * path_cells_;
    double* row = s.rows + static_cast<std::ptrdiff_t>(z) * axis_bins_;
    Range& touched = s.touched[static_cast<std::size_t>(z)];
    if (whole_axis_) touched = {0, path_cells_};
    for (int c = touched.begin; c < touched.end; ++c) {
      if (cells[c].weight <= 0) continue;
      const double mean = cells[c].first / cells[c].weight;
      const double variance = std::max(cells[c].second / cells[c].weight - mean * mean, 0.0);
      const double path = (c - kCellMargin) / cells_per_metre_ + mean;
      pulses_->add(row, axis_bins_, start + path * bins_per_metre_,
                   variance / (kSpeedOfLight * kSpeedOfLight) + extra_variance_, cells[c].weight);
    }
    if (touched.begin < touched.end) std::fill(cells + touched.begin, cells + touched.end, Sums{});
    touched = {};
  }
}

}  // namespace blindcorner
