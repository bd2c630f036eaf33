// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/compiled_scene.h"

#include <tbb/blocked_range.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "forward/support/parallel.h"
#include "forward/transport/scene_transport.h"
#include "forward/transport/static_background.h"
#include "inverse/search/difference_steps.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Grid step in units of the standard deviation of the pulse's path. Half a step off, a matched
/// filter still keeps exp(-0.5^2 / 4 * 1.2^2) = 0.91 of its response.
constexpr double kGridStep = 1.2;
/// Finite-difference step in the same unit: the truncation error is (h / sigma)^2 / 6 = 6e-4.
constexpr double kDifferenceStep = 0.06;
/// Largest yaw steps, rad: cosines change even where no path does. Half a grid step off, a cosine
/// still is cos(pi / 16) = 0.98. A finite difference errs by h^2 / 6 = 2e-5.
constexpr double kYawGrid = kPi / 8;
constexpr double kYawDifference = 0.01;
/// Largest finite-difference steps: of a size, because light is proportional to the size's square,
/// and of any unknown as a share of its range. By judgement: far above rounding, and a hundredth
/// of the size or of the range.
constexpr double kSizeDifference = 0.01;
constexpr double kRangeDifference = 0.01;
/// Least rate of a path, m per unit; an object that moves straight away has 2. Without this limit,
/// an unknown that changes no path would have steps without end. By judgement.
constexpr double kMinRate = 0.2;
/// Light below this share of the brightest bin does not count as reaching a bin: it is less than
/// one of 100,000 photons.
constexpr double kReach = 1e-5;
/// Static background below this share of the brightest bin is rounding (kNoLight in
/// static_background.cpp).
constexpr double kNoBackground = 1e-7;
/// Most memory for the scored poses' histograms, bytes. By judgement, a computer with a few GB can
/// spare it.
constexpr double kTemplateBytes = 6e8;
/// Share of all bins that a histogram holds, to estimate how many histograms fit into the memory: a
/// rough mean, by judgement.
constexpr double kBinsHeld = 0.6;
/// Factor by which a pulse is widened until the grid is small enough: a grid of three unknowns then
/// has up to 1.1^3 = 1.3 times fewer poses than it might. At the largest widening, the pulse tells
/// nothing.
constexpr double kWiden = 1.1, kMaxWidening = 64;
/// Most poses of a grid. They are kept, with some 200 bytes each, and scored in half a minute.
constexpr double kMostGridPoses = 2e6;
/// Grid step for a spline, in units of the pulse: the spline's error is then 0.25 %.
constexpr double kSplineStep = 0.75;
/// Limits of the spline through the histograms. For one pose it reads 4^unknowns of them: 64 for
/// three unknowns and 256 for four. Its memory adds to the histograms' own, and is less.
constexpr std::size_t kSplineUnknowns = 3;
constexpr double kSplineBytes = 4e8;

/// Rate at which the path from the relay to the object and back changes with each unknown, m per
/// unit: root mean square over the search region.
PoseVector path_rates(const Scene& scene, const std::vector<Vector3d>& relay) {
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  PoseVector rates = PoseVector::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Unknown& unknown = scene.unknowns[static_cast<std::size_t>(i)];
    const HiddenObject& object = hidden_object(scene, unknown.object);
    const double radius = bounding_radius(object.shape, Anchor::center);
    int count = 0;
    for (const Placement& probe : probe_placements(scene, unknown.object)) {
      const Vector3d q = object_to_world(object.shape, object.anchor, probe).translation();
      for (const Vector3d& r : relay) {
        const Vector3d direction = (q - r).normalized();
        const Component component = unknown.component;
        const bool position = component <= Component::z;
        rates[i] += position ? std::pow(2 * direction[static_cast<int>(component)], 2)
                             : std::pow(2 * radius * probe.size * 0.5, 2);
        ++count;
      }
    }
    rates[i] = std::max(std::sqrt(rates[i] / count), kMinRate);
  }
  return rates;
}

std::vector<Vector3d> relay_sample(const Scene& scene, const SensorPlacement& placement) {
  if (!placement.relay_points.empty()) {
    std::vector<Vector3d> points;
    for (const Vector3d& p : placement.relay_points) {
      if (p.allFinite()) points.push_back(p);
    }
    return points;
  }
  std::vector<Vector3d> points;
  for (const Surface& surface : scene.surfaces) {
    if (surface.relay) points.push_back(surface.T_world_surface.translation());
  }
  return points;
}

/// Points along one unknown, with both bounds: at least four, because a cubic needs them.
GridAxis grid_axis(const Scene& scene, std::size_t unknown, double step) {
  const Unknown& u = scene.unknowns[unknown];
  GridAxis axis;
  axis.first = u.lower;
  axis.periodic = period_of(scene, unknown) > 0;
  const double period = axis.periodic ? period_of(scene, unknown) : u.range();
  const int intervals = static_cast<int>(std::ceil(period / step - 1e-9));
  axis.count = std::max(4, axis.periodic ? intervals : intervals + 1);
  axis.spacing = period / (axis.periodic ? axis.count : axis.count - 1);
  return axis;
}

void make_grid(CompiledScene& compiled, const PoseVector& rates, double pulse,
               double yaw_scale = 1) {
  const std::size_t n = compiled.scene.unknowns.size();
  compiled.axes.clear();
  compiled.spacing.resize(static_cast<Eigen::Index>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    double step = kGridStep * pulse / rates[k];
    const Unknown& unknown = compiled.scene.unknowns[i];
    if (unknown.component == Component::yaw) step = std::min(step, kYawGrid * yaw_scale);
    compiled.axes.push_back(grid_axis(compiled.scene, i, step));
    compiled.spacing[k] = compiled.axes.back().spacing;
  }
}

double grid_size(const CompiledScene& compiled) {
  double size = 1;
  for (const GridAxis& axis : compiled.axes) size *= axis.count;
  return size;
}

/// Throws Error if even the widest pulse leaves more poses than can be kept and scored.
void check_grid_size(const CompiledScene& compiled) {
  if (grid_size(compiled) <= kMostGridPoses) return;
  const auto longest =
      std::ranges::max_element(compiled.axes, {}, [](const GridAxis& axis) { return axis.count; });
  const auto k = static_cast<std::size_t>(longest - compiled.axes.begin());
  const Unknown& unknown = compiled.scene.unknowns[k];
  char text[300];
  std::snprintf(text, sizeof text,
                "the search region asks for %.2g poses to be scored, accepted: up to %.2g; %s has "
                "the most of them, from %g to %g",
                grid_size(compiled), kMostGridPoses, unknown_names(compiled.scene)[k].c_str(),
                unknown.lower, unknown.upper);
  throw Error("unknowns", text);
}

/// Bins that light from the search region or the direct return can reach.
std::vector<std::vector<TimeGate>> reach(const CompiledScene& compiled) {
  const Scene& scene = compiled.scene;
  const Sensor& sensor = scene.sensor;
  const bool summarise = sensor.noise.counts_photons();
  std::vector<PoseVector> probes;
  for (int object = 0; object < object_count(scene); ++object) {
    std::vector<Placement> placements = stated_placements(scene);
    for (const Placement& p : probe_placements(scene, object)) {
      placements[static_cast<std::size_t>(object)] = p;
      probes.push_back(pose_of(placements, scene.unknowns));
    }
  }
  const std::size_t stride = std::max<std::size_t>(1, compiled.poses.size() / 400);
  for (std::size_t i = 0; i < compiled.poses.size(); i += stride)
    probes.push_back(compiled.poses[i]);

  std::vector<std::vector<TimeGate>> gates;
  for (const auto& model : compiled.cheap_models()) {
    HistogramCube brightest(sensor.rows, sensor.columns, sensor.bins);
    HistogramCube light;
    for (const PoseVector& pose : probes) {
      model->three_bounce(pose, light);
      for (std::size_t i = 0; i < light.values.size(); ++i) {
        brightest.values[i] = std::max(brightest.values[i], light.values[i]);
      }
    }
    const HistogramCube direct = static_background(scene, model->static_background());
    const double object_peak = *std::max_element(brightest.values.begin(), brightest.values.end());
    const double direct_peak = *std::max_element(direct.values.begin(), direct.values.end());
    std::vector<TimeGate> zone_gates;
    for (int z = 0; z < sensor.zone_count(); ++z) {
      const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
      TimeGate gate{zone.first_valid_bin, sensor.valid_end(z)};
      if (zone.dead) gate = {0, 0};
      if (summarise && !zone.dead) {
        const auto reached = [&](int k) {
          return brightest.zone(z)[k] > kReach * object_peak ||
                 std::abs(direct.zone(z)[k]) > kNoBackground * direct_peak;
        };
        while (gate.first < gate.end && !reached(gate.first)) ++gate.first;
        while (gate.first < gate.end && !reached(gate.end - 1)) --gate.end;
        // Interior poses may reach a little further than the probed ones.
        gate.first = std::max(zone.first_valid_bin, gate.first - 2);
        gate.end = std::min(sensor.valid_end(z), gate.end + 2);
      }
      zone_gates.push_back(gate);
    }
    gates.push_back(std::move(zone_gates));
  }
  return gates;
}

/// Rows of the template matrix for the gates.
int gate_rows(const CompiledScene& compiled) {
  int rows = 0;
  for (const auto& zones : compiled.gates) {
    for (const TimeGate& gate : zones) rows += std::max(0, gate.end - gate.first);
  }
  return rows;
}

}  // namespace

double period_of(const Scene& scene, std::size_t unknown) {
  const Unknown& u = scene.unknowns[unknown];
  if (u.component != Component::yaw) return 0;
  const double period = yaw_period(hidden_object(scene, u.object).shape);
  return period > 0 && u.range() >= period * (1 - 1e-9) ? period : 0;
}

PoseVector pose_difference(const Scene& scene, const PoseVector& a, const PoseVector& b) {
  PoseVector d = b - a;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const double period = period_of(scene, i);
    auto& value = d[static_cast<Eigen::Index>(i)];
    if (period > 0) value -= period * std::round(value / period);
  }
  return d;
}

bool within_spacings(const CompiledScene& compiled, const PoseVector& a, const PoseVector& b,
                     double spacings) {
  const PoseVector difference = pose_difference(compiled.scene, a, b);
  return (difference.array().abs() < spacings * compiled.spacing.array()).all();
}

double step_within(const CompiledScene& compiled, const PoseVector& pose, Eigen::Index unknown) {
  const double step = compiled.step[unknown];
  const auto k = static_cast<std::size_t>(unknown);
  const bool beyond =
      period_of(compiled.scene, k) == 0 && pose[unknown] + step > compiled.scene.unknowns[k].upper;
  return beyond ? -step : step;
}

void wrap_pose(const Scene& scene, PoseVector& pose) {
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const double period = period_of(scene, i);
    if (period <= 0) continue;
    auto& value = pose[static_cast<Eigen::Index>(i)];
    const double lower = scene.unknowns[i].lower;
    value -= period * std::floor((value - lower) / period);
  }
}

double log_pose_prior(const Scene& scene, const PoseVector& pose) {
  double log_density = 0;
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    const double value = pose[static_cast<Eigen::Index>(i)];
    const double period = period_of(scene, i);
    const double range = period > 0 ? period : unknown.range();
    if (period <= 0 && (value < unknown.lower || value > unknown.upper)) {
      return -std::numeric_limits<double>::infinity();
    }
    log_density -= std::log(range);
    if (unknown.prior) {
      const double u = (value - unknown.prior->mean) / unknown.prior->sigma;
      log_density -= 0.5 * u * u;
    }
  }
  return log_density;
}

PoseVector difference_steps(const Scene& scene, const SensorPlacement& placement) {
  const double pulse_path = kSpeedOfLight * std::hypot(scene.sensor.response.core_sigma(),
                                                       scene.sensor.bin_width / std::sqrt(12.0));
  const PoseVector rates = path_rates(scene, relay_sample(scene, placement));
  PoseVector steps(rates.size());
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    double step = kDifferenceStep * pulse_path / rates[k];
    if (scene.unknowns[i].component == Component::yaw) step = std::min(step, kYawDifference);
    if (scene.unknowns[i].component == Component::size) step = std::min(step, kSizeDifference);
    steps[k] = std::min(step, kRangeDifference * scene.unknowns[i].range());
  }
  return steps;
}

SceneKnowledge::SceneKnowledge(const Scene& scene)
    : scene_(scene), transport_(make_scene_transport(scene_)) {
  bool measured = false;
  for (int i = 0; i < object_count(scene); ++i) {
    measured =
        measured || std::holds_alternative<MeasuredLawMaterial>(hidden_object(scene, i).material);
  }
  if (!measured) coarse_ = std::make_shared<const CoarseScene>(scene_);
}

std::optional<SamplingStep> SceneKnowledge::sampling_step(double tolerance) const {
  const SensorPlacement own = sensor_placement(scene_);
  const auto stated = [](const Vector3d& point) { return point.allFinite(); };
  if (!coarse_ || !std::ranges::all_of(own.relay_points, stated)) return std::nullopt;
  const std::scoped_lock lock(mutex_);
  const auto known = sampling_steps_.find(tolerance);
  if (known != sampling_steps_.end()) return known->second;
  FastModelOptions fast;
  fast.tolerance = tolerance;
  // Isolated: while the lock's holder waits for its own loops, it must not take up a task that
  // waits for the lock.
  const SamplingStep found =
      tbb::this_task_arena::isolate([&] { return *choose_sampling(transport_, own, fast); });
  return sampling_steps_.emplace(tolerance, found).first->second;
}

namespace {

/// Fills the grid with the scored poses and their log priors.
void fill_grid(CompiledScene& compiled) {
  const Scene& scene = compiled.scene;
  const auto count = static_cast<std::size_t>(grid_size(compiled));
  for (std::size_t index = 0; index < count; ++index) {
    PoseVector pose(compiled.unknown_count());
    std::size_t rest = index;
    for (std::size_t i = scene.unknowns.size(); i-- > 0;) {
      const GridAxis& axis = compiled.axes[i];
      const auto along = static_cast<std::size_t>(axis.count);
      const auto k = static_cast<Eigen::Index>(i);
      pose[k] = axis.first + static_cast<double>(rest % along) * axis.spacing;
      if (!axis.periodic) pose[k] = std::min(pose[k], scene.unknowns[i].upper);
      rest /= along;
    }
    compiled.log_prior.push_back(static_cast<float>(log_pose_prior(scene, pose)));
    compiled.poses.push_back(pose);
  }
}

/// Copies one capture's light inside the time gates, times the zones' gains.
float* copy_gates(const Scene& scene, const std::vector<TimeGate>& gates,
                  const HistogramCube& light, float* out) {
  for (int z = 0; z < light.zones(); ++z) {
    const TimeGate& gate = gates[static_cast<std::size_t>(z)];
    const double gain = scene.sensor.zones[static_cast<std::size_t>(z)].gain;
    for (int k = gate.first; k < gate.end; ++k) {
      *out++ = static_cast<float>(gain * light.zone(z)[k]);
    }
  }
  return out;
}

/// Histograms of the scored poses from `models`, [rows, poses].
Eigen::MatrixXf render_templates(const CompiledScene& compiled, const ModelSet& models) {
  Eigen::MatrixXf templates(gate_rows(compiled), std::ssize(compiled.poses));
  parallel_for(std::size_t{0}, compiled.poses.size(), [&](std::size_t index) {
    HistogramCube light;
    float* out = templates.col(static_cast<Eigen::Index>(index)).data();
    for (std::size_t c = 0; c < models.size(); ++c) {
      models[c]->three_bounce(compiled.poses[index], light);
      out = copy_gates(compiled.scene, compiled.gates[c], light, out);
    }
  });
  return templates;
}

/// First row of each zone, [all captures' zones with rows + 1].
std::vector<int> zone_rows(const CompiledScene& compiled) {
  std::vector<int> begin{0};
  for (const auto& gates : compiled.gates) {
    for (const TimeGate& gate : gates) {
      if (gate.first < gate.end) begin.push_back(begin.back() + gate.end - gate.first);
    }
  }
  return begin;
}

/// Adds one capture's light, times the zones' gains, to a column. The column's rows are still bins.
void append_light(const Sensor& sensor, const SparseLight& light, Templates::Column& column) {
  for (std::size_t z = 0; z < light.lit.size(); ++z) {
    const SparseLight::Range& lit = light.lit[z];
    column.pieces.push_back({lit.begin, lit.end - lit.begin, column.counts.size()});
    const double* row = light.cube.zone(static_cast<int>(z));
    for (int k = lit.begin; k < lit.end; ++k) {
      column.counts.push_back(static_cast<float>(sensor.zones[z].gain * row[k]));
    }
  }
}

/// Turns the bins of a column's pieces into rows of the time gates.
void cut_to_gates(const CompiledScene& compiled, Templates::Column& column) {
  std::vector<Templates::Piece> pieces;
  auto piece = column.pieces.begin();
  int row = 0;
  for (const auto& gates : compiled.gates) {
    for (const TimeGate& gate : gates) {
      const Templates::Piece& own = *piece++;
      const int first = std::max(own.row, gate.first);
      const int end = std::min(own.row + own.count, gate.end);
      if (gate.first >= gate.end) continue;
      pieces.push_back({row + std::max(first - gate.first, 0), std::max(end - first, 0),
                        own.from + static_cast<std::size_t>(std::max(first - own.row, 0))});
      row += gate.end - gate.first;
    }
  }
  column.pieces = std::move(pieces);
}

/// Time gates from the closed form: the bins that any pose may light, and the tails of the pulse
/// that the closed form cuts off.
std::vector<std::vector<TimeGate>> closed_form_gates(const CompiledScene& compiled) {
  const Scene& scene = compiled.scene;
  const Sensor& sensor = scene.sensor;
  const auto [early, late] = sensor.response.support(kReach, 0);
  const int before = 2 + static_cast<int>(std::ceil(std::abs(early) / sensor.bin_width));
  const int after = 2 + static_cast<int>(std::ceil(std::abs(late) / sensor.bin_width));
  const bool summarise = sensor.noise.counts_photons();
  std::vector<std::vector<TimeGate>> all;
  for (std::size_t c = 0; c < compiled.coarse.size(); ++c) {
    const std::vector<SparseLight::Range> reached = compiled.coarse[c].reach();
    std::vector<TimeGate> gates;
    for (int z = 0; z < sensor.zone_count(); ++z) {
      const Zone& zone = sensor.zones[static_cast<std::size_t>(z)];
      const int valid_end = sensor.valid_end(z);
      TimeGate gate{zone.first_valid_bin, valid_end};
      if (zone.dead) gate = {0, 0};
      if (summarise && !zone.dead) {
        gate = {valid_end, zone.first_valid_bin};
        const SparseLight::Range& lit = reached[static_cast<std::size_t>(z)];
        if (lit.begin < lit.end) gate = {lit.begin - before, lit.end + after};
        if (has_static_background(scene)) {
          const HistogramCube& light = compiled.static_background[c];
          const double* direct = light.zone(z);
          const double peak = *std::ranges::max_element(light.values);
          for (int k = 0; k < sensor.bins; ++k) {
            if (std::abs(direct[k]) <= kNoBackground * peak) continue;
            gate.first = std::min(gate.first, k - 2);
            gate.end = std::max(gate.end, k + 3);
          }
        }
        gate.first = std::max(gate.first, zone.first_valid_bin);
        gate.end = std::min(gate.end, valid_end);
        if (gate.first >= gate.end) gate = {zone.first_valid_bin, zone.first_valid_bin};
      }
      gates.push_back(gate);
    }
    all.push_back(std::move(gates));
  }
  return all;
}

/// Histograms of the scored poses in closed form, with pulses wider by `extra_sigma` (s).
Templates render_closed_form(const CompiledScene& compiled, double extra_sigma) {
  std::vector<Templates::Column> columns(compiled.poses.size());
  // In chunks: the view from the object's middle is then computed once for all its yaws.
  parallel_for(tbb::blocked_range<std::size_t>(0, columns.size(), 16), [&](const auto& part) {
    SparseLight light;
    for (std::size_t i = part.begin(); i != part.end(); ++i) {
      for (const CoarseModel& model : compiled.coarse) {
        model.three_bounce(compiled.poses[i], extra_sigma, light);
        append_light(compiled.scene.sensor, light, columns[i]);
      }
      cut_to_gates(compiled, columns[i]);
    }
  });
  return {gate_rows(compiled), std::move(columns)};
}

/// The light of each object alone, at as many poses as a scene with only that object would score.
std::vector<CompiledScene::ObjectGrid> render_objects(const CompiledScene& compiled, int most) {
  const Scene& scene = compiled.scene;
  std::vector<CompiledScene::ObjectGrid> grids;
  for (int object = 0; object_count(scene) > 1 && object < object_count(scene); ++object) {
    CompiledScene alone;
    alone.scene = only_object(scene, object);
    const PoseVector rates =
        path_rates(alone.scene, relay_sample(alone.scene, compiled.placements.front()));
    double pulse = compiled.pulse_path;
    make_grid(alone, rates, pulse);
    while (grid_size(alone) > most) {
      pulse *= kWiden;
      make_grid(alone, rates, pulse, pulse / compiled.pulse_path);
    }
    fill_grid(alone);
    const double wide = pulse / compiled.pulse_path;
    const double extra =
        compiled.pulse_path / kSpeedOfLight * std::sqrt(std::max(wide * wide - 1, 0.0));
    CompiledScene::ObjectGrid grid;
    grid.poses = std::move(alone.poses);
    grid.spacing = alone.spacing;
    std::vector<Templates::Column> columns(grid.poses.size());
    parallel_for(std::size_t{0}, grid.poses.size(), [&](std::size_t i) {
      std::vector<Placement> placements = stated_placements(scene);
      placements[static_cast<std::size_t>(object)] =
          placements_at(alone.scene, grid.poses[i]).front();
      SparseLight light;
      for (const CoarseModel& model : compiled.coarse) {
        model.three_bounce(placements, extra, light, object);
        append_light(scene.sensor, light, columns[i]);
      }
      cut_to_gates(compiled, columns[i]);
    });
    grid.templates = {gate_rows(compiled), std::move(columns)};
    grids.push_back(std::move(grid));
  }
  return grids;
}

}  // namespace

namespace {

/// The fast models of all captures. `made` receives the share of them that is finished.
ModelSet make_models(const CompiledScene& compiled, FastModelOptions fast,
                     const std::function<void(double)>& made = {}) {
  ModelSet set;
  for (const SensorPlacement& placement : compiled.placements) {
    set.push_back(make_fast_model(compiled.knowledge->transport(), placement, fast));
    fast.sampling_step = set.front()->sampling_step();
    if (made) {
      made(static_cast<double>(set.size()) / static_cast<double>(compiled.placements.size()));
    }
  }
  return set;
}

/// Options of the fast model at a level. The light of lobes comes from patch pairs, because a
/// single sum has an error of its own; pairs coarser than sqrt(8) had a larger error than a single
/// sum. The pairs' sampling follows from the first level's, without a search.
FastModelOptions options_of(int level, const CompiledScene& compiled, bool lobes) {
  FastModelOptions fast;
  if (!lobes) {
    fast.tolerance = kLevelTolerance[static_cast<std::size_t>(level)];
    if (level + 1 < kModelLevels) {
      fast.sampling_step = compiled.knowledge->sampling_step(fast.tolerance);
      return fast;
    }
    // A search this fine takes seconds. Instead, the level takes twice as many points as the level
    // before along the object's edges, on which a partition's shadow ends, and sqrt(2) times as
    // many along the relay's.
    fast.sampling_step =
        compiled.knowledge->sampling_step(kLevelTolerance[static_cast<std::size_t>(level) - 1]);
    if (fast.sampling_step) {
      fast.sampling_step->relay /= std::sqrt(2.0);
      fast.sampling_step->object /= 2;
    }
    return fast;
  }
  const SamplingStep first = *compiled.models().front()->sampling_step();
  fast.tolerance = kFirstTolerance;
  const double finer = std::pow(2.0, 0.5 * (level - 1));
  SamplingStep pairs{std::sqrt(8.0) / finer, std::sqrt(8.0) / finer, true};
  if (first.lobe_pairs) {
    // Otherwise this level might be no finer than the first one, and a result that it does not move
    // would pass for exact.
    pairs.relay = std::min(pairs.relay, first.relay / std::sqrt(2.0) / finer);
    pairs.object = std::min(pairs.object, first.object / std::sqrt(2.0) / finer);
  }
  fast.sampling_step = pairs;
  return fast;
}

/// Paths that one render of all captures sums over where models pair the patches of lobes.
double paths_of(const ModelSet& set) {
  double paths = 0;
  for (const auto& model : set) {
    const std::optional<SamplingStep> sampling = model->sampling_step();
    const std::optional<ModelSize> size = model->size();
    if (!sampling || !sampling->lobe_pairs || !size) continue;
    paths += static_cast<double>(size->lit_points) * size->seen_points * size->object_points;
  }
  return paths;
}

}  // namespace

const ModelSet& CompiledScene::models_at(int level) const {
  if (level == 0) return models();
  const std::scoped_lock lock(mutex_);
  const auto known = finer_.find(level);
  if (known != finer_.end()) return known->second;
  const bool lobes = std::holds_alternative<RetroreflectiveMaterial>(scene.hidden.material);
  const FastModelOptions fast = options_of(level, *this, lobes);
  // Isolated: while the lock's holder waits for its own loops, it must not take up a task that
  // waits for the lock.
  return finer_
      .emplace(level, tbb::this_task_arena::isolate([&] { return make_models(*this, fast); }))
      .first->second;
}

bool CompiledScene::pairs_lobes() const {
  const std::optional<SamplingStep> sampling = models().front()->sampling_step();
  return sampling && sampling->lobe_pairs;
}

const ModelSet* CompiledScene::models_within(int level, double most_paths) const {
  // Models are not made only to find out that they have far too many paths. Patches and cells grow
  // as many as the squares of their edges shrink, roughly.
  constexpr double kRoughly = 4;
  if (level > 0 && pairs_lobes()) {
    const SamplingStep first = *models().front()->sampling_step();
    const SamplingStep finer = *options_of(level, *this, true).sampling_step;
    const double more =
        std::pow(first.relay / finer.relay, 4) * std::pow(first.object / finer.object, 2);
    if (paths_of(models()) * more > kRoughly * most_paths) return nullptr;
  }
  const ModelSet& set = models_at(level);
  return paths_of(set) > most_paths ? nullptr : &set;
}

namespace {

/// Appends the light of one capture inside its gates, with `unit` counts per W/m^2 at unit gain.
void append_gated(const CompiledScene& compiled, std::size_t capture, const HistogramCube& light,
                  double unit, std::vector<double>& rows) {
  for (int z = 0; z < light.zones(); ++z) {
    const TimeGate& gate = compiled.gates[capture][static_cast<std::size_t>(z)];
    const double counts = unit * compiled.scene.sensor.zones[static_cast<std::size_t>(z)].gain;
    for (int k = gate.first; k < gate.end; ++k) rows.push_back(counts * light.zone(z)[k]);
  }
}

/// Appends counts, which include the gains already, in the order of append_gated().
void append_counts(const CompiledScene& compiled, std::size_t capture, const HistogramCube& counts,
                   std::vector<double>& rows) {
  for (int z = 0; z < counts.zones(); ++z) {
    const TimeGate& gate = compiled.gates[capture][static_cast<std::size_t>(z)];
    rows.insert(rows.end(), counts.zone(z) + gate.first,
                counts.zone(z) + std::max(gate.first, gate.end));
  }
}

/// `light` is the models' own static background, [captures], in counts.
GatedBackground gated_background(const CompiledScene& compiled, const ModelSet& models,
                                 const std::vector<HistogramCube>& light) {
  GatedBackground gated;
  for (std::size_t c = 0; c < light.size(); ++c) append_counts(compiled, c, light[c], gated.light);
  if (std::ranges::all_of(gated.light, [](double v) { return v == 0; })) return {};
  const LinearUnknowns& linear = compiled.scene.linear;
  const double unit = linear.direct == LinearMode::fixed ? linear.fixed_direct : 1.0;
  for (std::size_t c = 0; c < models.size(); ++c) {
    const BackgroundError error = models[c]->background_error();
    append_gated(compiled, c, total(error), unit, gated.error);
  }
  const bool none = std::ranges::all_of(gated.error, [](double e) { return e == 0; });
  if (none || gated.error.size() != gated.light.size()) gated.error.clear();
  return gated;
}

}  // namespace

std::unique_ptr<CompiledScene> compile(const Scene& scene,
                                       const std::vector<SensorPlacement>& placements,
                                       const FitOptions& options, const GridOptions& grid,
                                       std::shared_ptr<const SceneKnowledge> knowledge) {
  if (!knowledge) knowledge = std::make_shared<const SceneKnowledge>(scene);
  auto compiled = std::make_unique<CompiledScene>();
  compiled->scene = scene;
  const double pulse_time =
      std::hypot(scene.sensor.response.core_sigma(), scene.sensor.bin_width / std::sqrt(12.0));
  compiled->pulse_path = kSpeedOfLight * pulse_time;
  const PoseVector rates = path_rates(scene, relay_sample(scene, placements.front()));
  bool closed_form = grid.closed_form && knowledge->coarse() != nullptr;

  compiled->knowledge = knowledge;
  compiled->known_light = options.known_light;
  compiled->placements = placements;
  const auto models = [&](double extra_sigma, double tolerance) {
    FastModelOptions fast;
    fast.sampling_step = knowledge->sampling_step(tolerance);
    fast.tolerance = tolerance;
    fast.extra_pulse_sigma = extra_sigma;
    fast.known_light = options.known_light;
    const auto made = [&](double share) {
      if (options.progress && placements.size() > 1) options.progress("compiling", share);
    };
    return make_models(*compiled, fast, made);
  };
  const double features = static_cast<double>(placements.size()) * scene.sensor.zone_count() *
                          scene.sensor.bins * kBinsHeld;
  double most = std::min<double>(grid.max_poses, kTemplateBytes / (4 * features));
  // The grid is made fine enough for a spline if that is affordable.
  bool spline = false;
  if (grid.spline && !closed_form && scene.unknowns.size() <= kSplineUnknowns) {
    make_grid(*compiled, rates, kSplineStep / kGridStep * compiled->pulse_path,
              kSplineStep / kGridStep);
    spline = grid_size(*compiled) <= most && 4 * features * grid_size(*compiled) < kSplineBytes;
  }
  if (!spline && !closed_form && grid.closed_form_poses > 0 && knowledge->coarse() != nullptr) {
    closed_form = true;
    most = grid.closed_form_poses;
  }
  // Otherwise the pulse is widened until the grid is small enough. In closed form poses are cheap,
  // so the grid has as many as it may: a pulse as wide as the search region does not tell where the
  // light of a shadow or a lobe changes.
  double widening = 1 / grid.density;
  if (!spline) {
    const auto lay = [&] {
      make_grid(*compiled, rates, widening * compiled->pulse_path, widening);
    };
    lay();
    for (; closed_form && grid_size(*compiled) < most && widening > 1 / kMaxWidening; lay()) {
      widening /= kWiden;
    }
    for (; grid_size(*compiled) > most && widening < kMaxWidening; lay()) widening *= kWiden;
    check_grid_size(*compiled);
  }
  widening = std::max(widening * grid.density, 1.0);
  const double widest = grid.widen ? pulse_time * std::sqrt(widening * widening - 1) : 0.0;
  // A descent with twice the pulse's width ends at a place from which the pulse itself leads on.
  for (double sigma = widest; sigma > (closed_form ? 1.0 : 0.5) * pulse_time; sigma /= 2) {
    compiled->widths.push_back(sigma);
  }
  compiled->widths.push_back(0);
  const double tolerance = options.model_tolerance.value_or(kFirstTolerance);
  const double cheap = std::max(kFirstTolerance, tolerance);
  if (!closed_form) {
    for (const double sigma : compiled->widths) compiled->ladder.push_back(models(sigma, cheap));
  }
  knowledge->sampling_step(tolerance);
  parallel_invoke([&] { compiled->ladder.push_back(models(0, tolerance)); },
                  [&] {
                    if (!closed_form) return;
                    for (const SensorPlacement& placement : placements) {
                      compiled->coarse.emplace_back(knowledge->coarse(), placement);
                    }
                  });
  // This is not part of the parallel call above: a thread that waits for work that is parallel
  // inside may not help with it.
  if (has_static_background(scene)) {
    for (const auto& model : compiled->models()) {
      compiled->static_background.push_back(static_background(scene, model->static_background()));
    }
  }

  compiled->step = difference_steps(scene, placements.front());
  fill_grid(*compiled);
  if (closed_form) {
    compiled->gates = closed_form_gates(*compiled);
    compiled->render_later(compiled->widths.front(), grid.max_poses);
    // The objects' own grids are so fine that a descent need not begin with a wide pulse.
    if (object_count(scene) > 1) compiled->widths = {0};
  } else {
    compiled->gates = reach(*compiled);
    const Eigen::MatrixXf templates = render_templates(
        *compiled, grid.sharp || spline ? compiled->models() : compiled->ladder.front());
    if (spline) compiled->spline = std::make_unique<SplineGrid>(templates, compiled->axes);
    compiled->set_templates(Templates(templates, zone_rows(*compiled)));
  }
  compiled->background =
      gated_background(*compiled, compiled->models(), compiled->static_background);
  return compiled;
}

const GatedBackground& CompiledScene::fine_background() const {
  const StaticBackgroundModel& known = *knowledge->transport()->static_background();
  if (known_light == KnownLightSampling::timely && known.any_coarser()) return background;
  if (!known.any_finer()) return background;
  std::call_once(fine_background_once_, [this] {
    FastModelOptions fast;
    fast.sampling_step = models().front()->sampling_step();
    // Isolated: a thread that waits here must not take up another fit that waits for this one.
    tbb::this_task_arena::isolate([&] {
      fast.known_light = KnownLightSampling::fine;
      const ModelSet fine = make_models(*this, fast);
      std::vector<HistogramCube> light;
      for (const auto& model : fine) {
        light.push_back(blindcorner::static_background(scene, model->static_background()));
      }
      fine_background_ = gated_background(*this, fine, light);
    });
  });
  return fine_background_;
}

const CompiledScene::Rendered& CompiledScene::rendered() const {
  std::call_once(rendered_once_, [&] {
    if (!wanted_) return;
    rendered_.templates = render_closed_form(*this, wanted_->extra_sigma);
    rendered_.objects = render_objects(*this, wanted_->most_poses);
    rendered_bytes_ = rendered_.bytes();
  });
  return rendered_;
}

void CompiledScene::render_later(double extra_sigma, int most_poses) {
  wanted_ = {extra_sigma, most_poses};
}

void CompiledScene::set_templates(Templates templates) {
  rendered_.templates = std::move(templates);
  rendered_bytes_ = rendered_.bytes();
}

std::size_t CompiledScene::Rendered::bytes() const {
  std::size_t sum = templates.bytes();
  for (const ObjectGrid& grid : objects) sum += grid.templates.bytes();
  return sum;
}

std::size_t CompiledScene::bytes() const {
  const std::size_t points = poses.size() * (sizeof(PoseVector) + sizeof(double) * axes.size());
  // A model holds patches of relay and object, a few hundred bytes each, and tabulated pulses.
  const std::size_t a_model = 2'000'000;
  std::size_t sets = ladder.size();
  {
    const std::scoped_lock lock(mutex_);
    sets += finer_.size();
  }
  const std::size_t dense =
      spline ? static_cast<std::size_t>(gate_rows(*this)) * poses.size() * sizeof(float) : 0;
  return rendered_bytes_ + 2 * dense + points + sets * models().size() * a_model;
}

}  // namespace blindcorner
