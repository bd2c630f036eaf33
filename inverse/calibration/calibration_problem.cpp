// SPDX-License-Identifier: Apache-2.0
#include "inverse/calibration/calibration_problem.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// Two directions along the relay surface that a spot lies on.
std::pair<Vector3d, Vector3d> along_surface(const Scene& scene, const Vector3d& point) {
  double nearest = 1e300;
  Vector3d normal = Vector3d::UnitY();
  for (const Surface& surface : scene.surfaces) {
    if (!surface.relay) continue;
    const Vector3d n = surface.T_world_surface.linear().col(0);
    const double distance = std::abs(n.dot(point - surface.T_world_surface.translation()));
    if (distance < nearest) {
      nearest = distance;
      normal = n;
    }
  }
  return surface_axes(normal);
}

void scale_pulse(Scene& scene, double box, double sigma) {
  ResponseShape shape = scene.sensor.response.shape();
  if (auto* gaussian = std::get_if<GaussianResponse>(&shape)) gaussian->sigma *= sigma;
  if (auto* mixed = std::get_if<BoxGaussianResponse>(&shape)) {
    mixed->box *= box;
    mixed->sigma *= sigma;
  }
  if (auto* tailed = std::get_if<ExponentialTailResponse>(&shape)) tailed->sigma *= sigma;
  scene.sensor.response = ImpulseResponse(shape);
}

void add_pulse(const Scene& scene, double log_sigma, std::vector<InstrumentParameter>& list) {
  const ResponseShape& shape = scene.sensor.response.shape();
  InstrumentParameter p;
  p.sigma = log_sigma;
  p.logarithmic = true;
  p.step = 1e-3;
  if (const auto* mixed = std::get_if<BoxGaussianResponse>(&shape)) {
    p.name = "impulse_response.box_ps";
    p.prior = mixed->box * 1e12;
    p.apply = [](Scene& s, double u) { scale_pulse(s, std::exp(u), 1); };
    list.push_back(p);
    p.name = "impulse_response.sigma_ps";
    p.prior = mixed->sigma * 1e12;
    p.step = 5e-3;  // beside the box, sigma changes little
    p.apply = [](Scene& s, double u) { scale_pulse(s, 1, std::exp(u)); };
    list.push_back(p);
  } else if (!std::holds_alternative<TableResponse>(shape)) {
    const double sigma = std::holds_alternative<GaussianResponse>(shape)
                             ? std::get<GaussianResponse>(shape).sigma
                             : std::get<ExponentialTailResponse>(shape).sigma;
    p.name = "impulse_response.fwhm_ps";
    p.prior = sigma * kGaussianFwhm * 1e12;
    p.apply = [](Scene& s, double u) { scale_pulse(s, 1, std::exp(u)); };
    list.push_back(p);
  }
}

void add_spots(const Scene& scene, double sigma, std::vector<InstrumentParameter>& list) {
  const RelaySpots spots = relay_spots(scene);
  for (std::size_t i = 0; i < spots.points.size(); ++i) {
    const auto [u, v] = along_surface(scene, spots.points[i]);
    int axis = 0;
    for (const Vector3d& direction : {u, v}) {
      InstrumentParameter p;
      p.name = "relay_spot[" + std::to_string(i) + "]." + (axis++ == 0 ? "across_m" : "up_m");
      p.prior = spots.points[i].dot(direction);
      p.sigma = sigma;
      p.step = 1e-3;
      p.apply = [spots, i, direction = direction](Scene& s, double shift) {
        for (std::size_t z = 0; z < spots.of_zone.size(); ++z) {
          if (spots.of_zone[z] == i) {
            std::get<Vector3d>(s.sensor.zones[z].footprint) += shift * direction;
          }
        }
      };
      list.push_back(p);
    }
  }
}

void add_law(const Scene& scene, const CalibrationOptions& options,
             std::vector<InstrumentParameter>& list) {
  const auto* law = std::get_if<MeasuredLawMaterial>(&scene.hidden.material);
  if (law == nullptr) return;
  const auto add = [&](const char* name, double MeasuredLawMaterial::*field, double sigma) {
    InstrumentParameter p;
    p.name = std::string("measured_law.") + name;
    p.prior = law->*field;
    p.sigma = sigma;
    p.apply = [field](Scene& s, double u) {
      std::get<MeasuredLawMaterial>(s.hidden.material).*field += u;
    };
    list.push_back(p);
  };
  add("cosine_exponent", &MeasuredLawMaterial::cosine_exponent, options.cosine_exponent);
  add("distance_exponent", &MeasuredLawMaterial::distance_exponent, options.distance_exponent);
  add("axis_across", &MeasuredLawMaterial::axis_across, options.law_axis);
  add("axis_up", &MeasuredLawMaterial::axis_up, options.law_axis);
}

}  // namespace

double InstrumentParameter::value(double u) const {
  return logarithmic ? prior * std::exp(u) : prior + unit * u;
}

RelaySpots relay_spots(const Scene& scene) {
  RelaySpots spots;
  for (const Zone& zone : scene.sensor.zones) {
    const auto* point = std::get_if<Vector3d>(&zone.footprint);
    if (point == nullptr || !point->allFinite()) return {};
    std::size_t i = 0;
    while (i < spots.points.size() && (spots.points[i] - *point).norm() > 1e-9) ++i;
    if (i == spots.points.size()) spots.points.push_back(*point);
    spots.of_zone.push_back(i);
  }
  return spots;
}

void move_spots(Scene& scene, const RelaySpots& spots, const std::vector<Vector3d>& points) {
  for (std::size_t z = 0; z < spots.of_zone.size(); ++z) {
    scene.sensor.zones[z].footprint = points[spots.of_zone[z]];
  }
}

std::vector<InstrumentParameter> instrument_parameters(const Scene& scene,
                                                       const CalibrationOptions& options) {
  std::vector<InstrumentParameter> list;
  const double bin = scene.sensor.bin_width;
  const std::size_t zones = scene.sensor.zones.size();
  InstrumentParameter p;
  p.name = "time_zero_ps";
  p.prior = scene.sensor.zones.front().time_zero * 1e12;
  p.unit = bin * 1e12;
  p.sigma = options.time_zero_bins;
  p.apply = [bin](Scene& s, double u) {
    for (Zone& zone : s.sensor.zones) zone.time_zero += u * bin;
  };
  list.push_back(p);
  for (std::size_t z = 0; zones > 1 && z < zones; ++z) {
    if (scene.sensor.zones[z].dead) continue;
    p.name = "time_zero_offset_ps[" + std::to_string(z) + "]";
    p.prior = 0;
    p.sigma = options.zone_time_zero_bins;
    p.apply = [bin, z](Scene& s, double u) { s.sensor.zones[z].time_zero += u * bin; };
    list.push_back(p);
  }
  p = {};
  p.name = "bin_width_ps";
  p.prior = bin * 1e12;
  p.logarithmic = true;
  p.sigma = options.bin_width_relative;
  p.step = 1e-4;  // a hundredth of a bin for light that is a hundred bins away
  p.apply = [](Scene& s, double u) { s.sensor.bin_width *= std::exp(u); };
  list.push_back(p);
  add_pulse(scene, options.pulse_log, list);
  p = {};
  p.name = "gain_factor";
  p.prior = 1;
  p.logarithmic = true;
  p.sigma = options.gain_log;
  p.apply = [](Scene& s, double u) {
    for (Zone& zone : s.sensor.zones) zone.gain *= std::exp(u);
  };
  list.push_back(p);
  for (std::size_t z = 0; zones > 1 && z < zones; ++z) {
    if (scene.sensor.zones[z].dead) continue;
    p.name = "gain_factor[" + std::to_string(z) + "]";
    p.sigma = options.zone_gain_log;
    p.apply = [z](Scene& s, double u) { s.sensor.zones[z].gain *= std::exp(u); };
    list.push_back(p);
  }
  add_law(scene, options, list);
  add_spots(scene, options.spot_m, list);
  std::erase_if(list, [](const InstrumentParameter& q) { return q.sigma <= 0; });
  return list;
}

CalibrationProblem::CalibrationProblem(const Scene& scene, std::vector<Capture> captures,
                                       std::vector<std::optional<PoseVector>> poses,
                                       std::vector<InstrumentParameter> parameters)
    : captures_(std::move(captures)), poses_(std::move(poses)), parameters_(std::move(parameters)) {
  set_base(scene);
  if (!captures_.empty()) {
    sampling_step_ =
        make_fast_model(base_, sensor_placement(base_, &captures_.front()))->sampling_step();
  }
}

Eigen::Index CalibrationProblem::index_of(const std::string& name) const {
  const auto found = std::ranges::find(parameters_, name, &InstrumentParameter::name);
  return found == parameters_.end() ? -1 : found - parameters_.begin();
}

void CalibrationProblem::set_base(const Scene& scene) {
  base_ = scene;
  observe_all();
}

void CalibrationProblem::observe_all() {
  const Sensor& sensor = base_.sensor;
  std::vector<std::vector<TimeGate>> gates(1);
  for (int z = 0; z < sensor.zone_count(); ++z) {
    const bool dead = sensor.zones[static_cast<std::size_t>(z)].dead;
    gates[0].push_back(dead ? TimeGate{}
                            : TimeGate{sensor.zones[static_cast<std::size_t>(z)].first_valid_bin,
                                       sensor.valid_end(z)});
  }
  observations_.clear();
  for (const Capture& capture : captures_) {
    observations_.push_back(observe(base_, {&capture, 1}, gates));
  }
}

Scene CalibrationProblem::scene_at(const Eigen::VectorXd& u) const {
  Scene scene = base_;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    parameters_[i].apply(scene, u[static_cast<Eigen::Index>(i)]);
  }
  return scene;
}

std::vector<CalibrationProblem::Evaluation> CalibrationProblem::evaluate(const Scene& scene,
                                                                         bool free_amplitude,
                                                                         bool flat_ambient) const {
  std::vector<Evaluation> evaluations(captures_.size());
  LinearUnknowns unknowns = base_.linear;
  unknowns.amplitude = free_amplitude ? LinearMode::shared : LinearMode::fixed;
  unknowns.fixed_amplitude = 1;
  unknowns.amplitude_prior = {.median = 1, .sigma_log = 3};
  if (flat_ambient) unknowns.ambient_prior.clear();
  // Captures usually share their placement; the model is compiled once for each placement.
  std::vector<std::size_t> model_of(captures_.size());
  std::vector<std::unique_ptr<ForwardModel>> models;
  std::vector<SensorPlacement> placements;
  for (std::size_t c = 0; c < captures_.size(); ++c) {
    const SensorPlacement placement = sensor_placement(scene, &captures_[c]);
    std::size_t m = 0;
    while (m < placements.size() &&
           !(placements[m].T_world_sensor.isApprox(placement.T_world_sensor, 1e-12) &&
             placements[m].relay_points == placement.relay_points)) {
      ++m;
    }
    if (m == placements.size()) {
      placements.push_back(placement);
      FastModelOptions fast;
      fast.sampling_step = sampling_step_;
      models.push_back(make_fast_model(scene, placement, fast));
    }
    model_of[c] = m;
  }
  std::vector<HistogramCube> known;  // static light of each model
  for (const auto& model : models) {
    if (has_static_background(scene))
      known.push_back(static_background(scene, model->static_background()));
  }
  parallel_for(std::size_t{0}, captures_.size(), [&](std::size_t c) {
    const Observation& observation = observations_[c];
    const ForwardModel& model = *models[model_of[c]];
    Evaluation& result = evaluations[c];
    HistogramCube light;
    if (poses_[c]) model.three_bounce(*poses_[c], light);
    std::vector<ZoneShapes> shapes(observation.zones.size());
    result.object.resize(observation.zones.size());
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      const double gain = scene.sensor.zones[static_cast<std::size_t>(zone.zone)].gain;
      auto& object = result.object[i];
      object.assign(zone.counts.size(), 0.0);
      if (poses_[c]) {
        for (int k = 0; k < zone.bins(); ++k) {
          object[static_cast<std::size_t>(k)] = gain * light.zone(zone.zone)[zone.first + k];
        }
        shapes[i].object = object.data();
        shapes[i].object_end = zone.bins();
      }
      if (!known.empty()) {
        const double* row = known[model_of[c]].zone(zone.zone) + zone.first;
        result.known.emplace_back(row, row + zone.bins());
        shapes[i].direct = row;
        shapes[i].direct_end = zone.bins();
      }
    }
    const LinearSolver solver(observation, unknowns);
    solver.solve(shapes, result.linear, false);
    result.residuals.resize(static_cast<std::size_t>(solver.residual_count()));
    solver.residuals(shapes, result.linear, result.residuals.data());
    result.deviance = -2 * result.linear.log_likelihood;
    result.mean.resize(observation.zones.size());
    double information = 0;
    for (std::size_t i = 0; i < observation.zones.size(); ++i) {
      const ObservedZone& zone = observation.zones[i];
      result.mean[i].resize(zone.counts.size());
      solver.expected(zone, shapes[i], result.linear.amplitude[i], result.linear.ambient[i],
                      result.linear.direct[i], result.mean[i].data());
      for (std::size_t k = 0; k < zone.counts.size(); ++k) {
        const double s = result.linear.amplitude[i] * result.object[i][k];
        const BinLikelihood& noise_model = observation.noise_model(zone);
        information += s * s / noise_model.variance(noise_model.lit(result.mean[i][k]));
      }
    }
    result.log_amplitude =
        std::log(result.linear.amplitude.empty() ? 1.0 : result.linear.amplitude[0]);
    result.log_amplitude_error = information > 0 ? 1 / std::sqrt(information) : 1e9;
  });
  return evaluations;
}

Eigen::VectorXd CalibrationProblem::residuals(const Eigen::VectorXd& u,
                                              const std::vector<double>& weights) const {
  const auto evaluations = evaluate(scene_at(u));
  std::size_t rows = parameters_.size();
  for (const Evaluation& e : evaluations) rows += e.residuals.size();
  Eigen::VectorXd out(static_cast<Eigen::Index>(rows));
  Eigen::Index row = 0;
  for (std::size_t c = 0; c < evaluations.size(); ++c) {
    const double root = std::sqrt(weights[c]);
    for (const double r : evaluations[c].residuals) out[row++] = root * r;
  }
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    out[row++] = u[static_cast<Eigen::Index>(i)] / parameters_[i].sigma;
  }
  return out;
}

Eigen::MatrixXd CalibrationProblem::jacobian(const Eigen::VectorXd& u, const Eigen::VectorXd& at,
                                             const std::vector<double>& weights) const {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(at.size(), u.size());
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const InstrumentParameter& p = parameters_[static_cast<std::size_t>(i)];
    if (p.fixed) continue;
    Eigen::VectorXd moved = u;
    moved[i] += p.step;
    jacobian.col(i) = (residuals(moved, weights) - at) / p.step;
  }
  return jacobian;
}

/// All residuals in one block: the parameters are few and shared by all captures.
class StackedCost final : public ceres::CostFunction {
 public:
  StackedCost(const CalibrationProblem& problem, const std::vector<double>& weights, int rows)
      : problem_(problem), weights_(weights) {
    set_num_residuals(rows);
    mutable_parameter_block_sizes()->push_back(static_cast<int>(problem.parameters().size()));
  }
  bool Evaluate(double const* const* parameters, double* out, double** jacobians) const override {
    const auto n = static_cast<Eigen::Index>(problem_.parameters().size());
    const Eigen::VectorXd u = Eigen::Map<const Eigen::VectorXd>(parameters[0], n);
    const Eigen::VectorXd r = problem_.residuals(u, weights_);
    if (!r.allFinite()) return false;
    Eigen::Map<Eigen::VectorXd>(out, r.size()) = r;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          jacobians[0], r.size(), n) = problem_.jacobian(u, r, weights_);
    }
    return true;
  }

 private:
  const CalibrationProblem& problem_;
  const std::vector<double>& weights_;
};

void CalibrationProblem::solve(Eigen::VectorXd& u, int iterations,
                               const std::vector<double>& weights) const {
  const auto rows = static_cast<int>(residuals(u, weights).size());
  ceres::Problem problem;
  problem.AddParameterBlock(u.data(), static_cast<int>(u.size()));
  problem.AddResidualBlock(new StackedCost(*this, weights, rows), nullptr, u.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-5;  // of 1e5 bins' half deviance: a unit of log likelihood
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (summary.termination_type == ceres::FAILURE) {
    throw Error("calibrate", "the least squares problem cannot be evaluated: " + summary.message);
  }
}

Eigen::MatrixXd CalibrationProblem::covariance(const Eigen::VectorXd& u,
                                               const std::vector<double>& weights) const {
  const Eigen::MatrixXd j = jacobian(u, residuals(u, weights), weights);
  Eigen::MatrixXd information = j.transpose() * j;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    if (parameters_[static_cast<std::size_t>(i)].fixed) information(i, i) = 1;
  }
  Eigen::MatrixXd covariance =
      information.ldlt().solve(Eigen::MatrixXd::Identity(u.size(), u.size()));
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    if (!parameters_[static_cast<std::size_t>(i)].fixed) continue;
    covariance.row(i).setZero();
    covariance.col(i).setZero();
  }
  return covariance;
}

}  // namespace blindcorner
