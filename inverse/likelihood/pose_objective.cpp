// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/pose_objective.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "blindcorner/forward/sensor/photon_noise.h"

namespace blindcorner {
namespace {

/// Largest scale of a correction, and the inverse of the smallest one. By judgement: a light that
/// needs more is not even roughly right, and is corrected by what is added alone.
constexpr double kMaxScale = 4;

ShapeBuffer& scratch() {
  thread_local ShapeBuffer buffer;
  return buffer;
}

}  // namespace

bool RecentLight::find(const ModelSet& models, const PoseVector& pose,
                       std::vector<double>& light) const {
  const std::scoped_lock lock(mutex_);
  for (const Entry& entry : entries_) {
    if (entry.models != &models || entry.pose.size() != pose.size() || entry.pose != pose) continue;
    light = entry.light;
    return true;
  }
  return false;
}

void RecentLight::keep(const ModelSet& models, const PoseVector& pose,
                       const std::vector<double>& light) {
  const std::scoped_lock lock(mutex_);
  Entry& entry = entries_[oldest_];
  oldest_ = (oldest_ + 1) % kPoses;
  entry.models = &models;
  entry.pose = pose;
  entry.light = light;
}

PoseObjective::PoseObjective(const CompiledScene& compiled, const Observation& observation)
    : compiled_(compiled),
      background_(observation.fine_background ? compiled.fine_background() : compiled.background),
      models_(&compiled.models()),
      rough_(&compiled.models()),
      solver_(observation, compiled.scene.linear) {
  for (const ObservedZone& zone : observation.zones) {
    std::pair<int, int> lit{0, 0};
    if (!background_.light.empty()) {
      const double* direct = background_.light.data() + rows_;
      lit.second = zone.bins();
      while (lit.first < lit.second && direct[lit.first] == 0) ++lit.first;
      while (lit.second > lit.first && direct[lit.second - 1] == 0) --lit.second;
    }
    direct_range_.push_back(lit);
    rows_ += zone.bins();
  }
}

std::vector<double> PoseObjective::shadow_at(const PoseVector& pose, bool coarsely) const {
  if (background_.light.empty()) return {};
  std::vector<double> shadow;
  HistogramCube shaded;
  int current = -1;
  for (const ObservedZone& zone : solver_.observation().zones) {
    if (zone.capture != current) {
      current = zone.capture;
      const ForwardModel& model = *compiled_.models()[static_cast<std::size_t>(current)];
      shaded = static_background(compiled_.scene, model.shadowed_background(pose, coarsely));
    }
    const HistogramCube& lit = compiled_.static_background[static_cast<std::size_t>(current)];
    for (int k = zone.first; k < zone.first + zone.bins(); ++k) {
      shadow.push_back(lit.zone(zone.zone)[k] - shaded.zone(zone.zone)[k]);
    }
  }
  if (std::ranges::all_of(shadow, [](double s) { return s == 0; })) shadow.clear();
  return shadow;
}

void PoseObjective::cast(std::vector<double> shadow) {
  shadow_ = std::move(shadow);
  shaded_.clear();
  for (std::size_t r = 0; r < shadow_.size(); ++r) {
    shaded_.push_back(std::max(background_.light[r] - shadow_[r], 0.0));
  }
}

void PoseObjective::point(ShapeBuffer& buffer, bool object) const {
  const auto& zones = solver_.observation().zones;
  buffer.shapes.resize(zones.size());
  const std::vector<double>& direct = object && !shaded_.empty() ? shaded_ : background_.light;
  std::size_t row = 0;
  for (std::size_t z = 0; z < zones.size(); ++z) {
    ZoneShapes& shapes = buffer.shapes[z];
    const int bins = zones[z].bins();
    shapes.object = object ? buffer.object.data() + row : nullptr;
    shapes.direct = direct.empty() ? nullptr : direct.data() + row;
    shapes.object_first = 0;
    shapes.object_end = object ? bins : 0;
    if (object) {
      while (shapes.object_first < shapes.object_end && shapes.object[shapes.object_first] <= 0) {
        ++shapes.object_first;
      }
      while (shapes.object_end > shapes.object_first && shapes.object[shapes.object_end - 1] <= 0) {
        --shapes.object_end;
      }
    }
    std::tie(shapes.direct_first, shapes.direct_end) = direct_range_[z];
    row += static_cast<std::size_t>(bins);
  }
}

void PoseObjective::render(const LightSource& light, const PoseVector& pose,
                           std::vector<double>& object) const {
  thread_local HistogramCube cube;
  thread_local SparseLight sparse;
  double* out = object.data();
  int current = -1;
  for (const ObservedZone& zone : solver_.observation().zones) {
    if (zone.capture != current) {
      current = zone.capture;
      const auto c = static_cast<std::size_t>(current);
      if (light.coarse != nullptr) {
        (*light.coarse)[c].three_bounce(pose, light.extra_pulse_sigma, sparse);
      } else {
        (*light.models)[c]->three_bounce(pose, cube);
      }
    }
    const double* values =
        (light.coarse != nullptr ? sparse.cube : cube).zone(zone.zone) + zone.first;
    for (int k = 0; k < zone.bins(); ++k) *out++ = zone.gain * values[k];
  }
}

void PoseObjective::shapes(const LightSource& light, const PoseVector& pose,
                           ShapeBuffer& buffer) const {
  buffer.object.resize(static_cast<std::size_t>(rows_));
  if (light.linear != nullptr) {
    const Linearisation& at = *light.linear;
    const Eigen::VectorXd change = at.slope * pose_difference(compiled_.scene, at.pose, pose);
    for (std::size_t r = 0; r < buffer.object.size(); ++r) {
      buffer.object[r] = std::max(at.light[r] + change[static_cast<Eigen::Index>(r)], 0.0);
    }
  } else if (light.spline != nullptr) {
    light.spline->evaluate(pose, buffer.object.data());
  } else if (light.local != nullptr) {
    light.local->light(compiled_.scene, pose, buffer.object.data());
  } else {
    // Remembered light counts too, because it is chance which thread finds it.
    if (light.models != nullptr) renders_ += solver_.observation().captures;
    if (light.models == nullptr || !recent_.find(*light.models, pose, buffer.object)) {
      render(light, pose, buffer.object);
      if (light.models != nullptr && !light.once) recent_.keep(*light.models, pose, buffer.object);
    }
  }
  if (light.correction != nullptr) correct(*light.correction, buffer);
  point(buffer, true);
}

void PoseObjective::correct(const Correction& correction, ShapeBuffer& buffer) const {
  std::size_t r = 0;
  for (std::size_t z = 0; z < solver_.observation().zones.size(); ++z) {
    for (int k = 0; k < solver_.observation().zones[z].bins(); ++k, ++r) {
      buffer.object[r] =
          std::max(correction.scale[z] * buffer.object[r] + correction.added[r], 0.0);
    }
  }
}

Correction PoseObjective::correction(const ShapeBuffer& light, const ShapeBuffer& cheap) const {
  Correction c;
  c.added.resize(light.object.size());
  std::size_t begin = 0;
  for (const ObservedZone& zone : solver_.observation().zones) {
    const std::size_t end = begin + static_cast<std::size_t>(zone.bins());
    double right = 0, cheaply = 0;
    for (std::size_t r = begin; r < end; ++r) {
      right += light.object[r];
      cheaply += cheap.object[r];
    }
    // Zones that the cheap light leaves almost dark are corrected by what is added alone.
    // A spline has the right scale.
    const double scale = cheaply > 0 && !compiled_.spline ? right / cheaply : 1.0;
    c.scale.push_back(scale > 1 / kMaxScale && scale < kMaxScale ? scale : 1.0);
    for (std::size_t r = begin; r < end; ++r) {
      c.added[r] = light.object[r] - c.scale.back() * cheap.object[r];
    }
    begin = end;
  }
  return c;
}

void PoseObjective::shapes_of(std::span<const double> light, ShapeBuffer& buffer) const {
  buffer.object.assign(light.begin(), light.end());
  point(buffer, true);
}

void PoseObjective::empty_shapes(ShapeBuffer& buffer) const { point(buffer, false); }

PoseValue PoseObjective::evaluate(const ShapeBuffer& buffer, const PoseVector& pose,
                                  LinearSolution& solution, bool warm, double accuracy) const {
  solver_.solve(buffer.shapes, solution, warm, accuracy);
  PoseValue value;
  value.log_likelihood = solution.log_likelihood;
  value.log_posterior =
      solution.log_likelihood + solution.log_prior + log_pose_prior(compiled_.scene, pose);
  value.log_integrand = value.log_posterior + solution.log_volume;
  return value;
}

PoseValue PoseObjective::evaluate(const LightSource& light, const PoseVector& pose,
                                  LinearSolution& solution, bool warm, double accuracy) const {
  ShapeBuffer& buffer = scratch();
  shapes(light, pose, buffer);
  return evaluate(buffer, pose, solution, warm, accuracy);
}

PoseValue PoseObjective::evaluate_template(int index, LinearSolution& solution, bool warm,
                                           double accuracy) const {
  ShapeBuffer& buffer = scratch();
  buffer.object.assign(static_cast<std::size_t>(rows_), 0.0);
  const Templates::Column& column = compiled_.templates().column(static_cast<std::size_t>(index));
  for (const Templates::Piece& piece : column.pieces) {
    const float* counts = column.counts.data() + piece.from;
    std::copy(counts, counts + piece.count, buffer.object.data() + piece.row);
  }
  point(buffer, true);
  return evaluate(buffer, compiled_.poses[static_cast<std::size_t>(index)], solution, warm,
                  accuracy);
}

double PoseObjective::evaluate_light(const Eigen::VectorXf& light, LinearSolution& solution,
                                     double accuracy) const {
  ShapeBuffer& buffer = scratch();
  buffer.object.assign(light.data(), light.data() + light.size());
  point(buffer, true);
  solver_.solve(buffer.shapes, solution, false, accuracy);
  return solution.log_likelihood + solution.log_prior;
}

PoseValue PoseObjective::evaluate_empty(LinearSolution& solution) const {
  ShapeBuffer buffer;
  point(buffer, false);
  solver_.solve(buffer.shapes, solution, false);
  PoseValue value;
  value.log_likelihood = solution.log_likelihood;
  // The ambient light has its prior with and without an object.
  value.log_posterior = solution.log_likelihood + solution.log_prior;
  value.log_integrand = value.log_posterior + solution.log_volume;
  return value;
}

}  // namespace blindcorner
