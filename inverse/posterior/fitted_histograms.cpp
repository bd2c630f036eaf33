// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/fitted_histograms.h"

#include <algorithm>

#include "blindcorner/forward/sensor/photon_noise.h"

namespace blindcorner {

FittedHistograms fitted_histograms(const PoseObjective& objective, const Refined& best,
                                   const ShapeBuffer& at, const Capture& capture, int index) {
  const Scene& scene = objective.compiled().scene;
  const Sensor& sensor = scene.sensor;
  FittedHistograms h;
  h.measured = capture.counts;
  h.model = HistogramCube(sensor.rows, sensor.columns, sensor.bins);
  h.object = h.model;
  h.zone_used.assign(static_cast<std::size_t>(sensor.zone_count()), false);
  h.amplitude.assign(h.zone_used.size(), 0.0);
  h.ambient.assign(h.zone_used.size(), 0.0);
  h.direct.assign(h.zone_used.size(), 0.0);
  h.first_bin = sensor.bins;
  const auto capture_index = static_cast<std::size_t>(index);
  HistogramCube known = h.model;
  if (!objective.compiled().static_background.empty()) {
    known = objective.compiled().static_background[capture_index];
  }
  const auto& zones = objective.solver().observation().zones;
  for (std::size_t i = 0; i < zones.size(); ++i) {
    if (zones[i].capture != index) continue;
    const auto z = static_cast<std::size_t>(zones[i].zone);
    h.zone_used[z] = true;
    h.amplitude[z] = best.linear.amplitude[i];
    h.ambient[z] = best.linear.ambient[i];
    const double scale =
        objective.compiled().background.light.empty() ? 0.0 : best.linear.direct[i];
    h.direct[z] =
        scene.linear.direct == LinearMode::fixed ? scale * scene.linear.fixed_direct : scale;
    h.first_bin = std::min(h.first_bin, zones[i].first);
    h.end_bin = std::max(h.end_bin, zones[i].first + zones[i].bins());
    double* object = h.object.zone(zones[i].zone);
    for (int k = at.shapes[i].object_first; k < at.shapes[i].object_end; ++k) {
      object[zones[i].first + k] = h.amplitude[z] * at.shapes[i].object[k];
    }
    double* light = known.zone(zones[i].zone);
    if (at.shapes[i].direct != nullptr) {  // less what the object's shadow takes
      std::copy_n(at.shapes[i].direct, zones[i].bins(), light + zones[i].first);
    }
    for (int k = 0; k < sensor.bins; ++k) {
      h.model.zone(zones[i].zone)[k] = object[k] + h.ambient[z] + scale * light[k];
    }
  }
  return h;
}

}  // namespace blindcorner
