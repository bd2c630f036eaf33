// SPDX-License-Identifier: Apache-2.0
/// Light of a capture beside the static background: the classical baselines look for the object in
/// it.
#pragma once

#include <memory>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/sensor/pulse_table.h"
#include "inverse/baseline/relay_paths.h"

namespace blindcorner {

/// One zone's counts less the static background, its time gate, and the scatter of the counts.
struct ZoneSignal {
  bool used = false;           ///< neither dead nor without exposures or light
  double earliest = 0;         ///< bins, earliest arrival of light from the search region
  double latest = 0;           ///< bins, latest arrival
  double blur = 0;             ///< s^2, mean variance of the arrival times over the region
  std::vector<double> counts;  ///< [bins] per exposure; 0 in bins that do not count
  std::vector<double> weight;  ///< [bins] 1 / variance; 0 in bins that do not count
};

/// A grid over the free coordinates of the hidden object's position.
struct PositionGrid {
  std::vector<std::size_t> unknowns;  ///< [axes] places among the scene's unknowns
  std::vector<int> counts;            ///< [axes] values along each
  std::vector<double> first, step;    ///< [axes] m

  std::size_t size() const;
  /// Coordinates [axes] of a grid point; the first axis changes fastest.
  std::vector<double> at(std::size_t index) const;
};

/// Grid over the ranges, both ends included, with neighbours at most `spacing` m apart. The spacing
/// grows until there are at most `most` points.
PositionGrid position_grid(const Scene& scene, double spacing, int most);

/// Middles of `count` equal parts of each range.
PositionGrid cell_centers(const Scene& scene, int count);

/// Point (m, world) that stands for the hidden object at a pose: the centre of its shape.
Eigen::Vector3d scattering_point(const Scene& scene, const PoseVector& pose);

/// What belongs to a scene and not to a capture: static background, tabulated pulses.
class SignalScene {
 public:
  /// Throws Error for a scene that classical methods cannot answer: several hidden objects, or no
  /// unknown position.
  explicit SignalScene(Scene scene);

  const Scene& scene() const { return scene_; }
  double pulse_path() const { return pulse_path_; }  ///< m, standard deviation of pulse and bin

  /// Signal of one capture, [zones], at the sensor's `paths`. The time gate holds the bins that
  /// light of the search region may reach. In the other bins, the scale of the static background
  /// and the ambient light, where they are free, are fitted by weighted least squares. Both are
  /// then subtracted. Throws Error for a capture that does not suit the scene.
  std::vector<ZoneSignal> extract(const Capture& capture, const RelayPaths& paths) const;

  /// Adds the correlations of a pulse p with a zone's signal s: sum p s / var and sum p^2 / var.
  /// The pulse is that of unit light at `position` bins with extra variance `blur`, s^2.
  void correlate(int zone, const ZoneSignal& signal, double position, double blur,
                 double& signal_sum, double& pulse_sum) const;

  /// Arrival of a path (m) on a zone's time axis, bins before any wrap.
  double position(int zone, double path) const;

 private:
  void find_gates(const RelayPaths& paths, std::vector<ZoneSignal>& signals) const;
  void take_off_known_light(const Capture& capture, const HistogramCube& known,
                            const HistogramCube& error, int zone, ZoneSignal& signal) const;

  Scene scene_;
  std::shared_ptr<const SceneTransport> transport_;
  PulseTable pulses_;
  double pulse_path_;
};

}  // namespace blindcorner
