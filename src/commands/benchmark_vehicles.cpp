// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark vehicles`: error and run time of the integrators of vehicles.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>

#include "blindcorner/planner/vehicles/vehicle.h"
#include "commands/benchmark.h"
#include "commands/cpu_clock.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

constexpr double kInputPeriod = 0.1;  ///< s, between new commands
constexpr double kDuration = 2;       ///< of a run, s
/// Speeds at the start of the runs, m/s.
constexpr double kSpeeds[] = {0, 0.5, 1, 2, 4, 6, 8, 10, 12};
/// A run in which any state is off by this much (m, rad, m/s, rad/s) counts as unstable. States
/// need not grow to infinity: friction is bounded, so unstable wheels swing to and fro.
constexpr double kUnstable = 1;
constexpr double kMinDrawn = 1e-6;  ///< mm
constexpr IntegratorTolerance kReference{1e-10, 1e-10};
constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct VehicleArguments : StudyArguments {
  std::string vehicle = "car";
};

struct Method {
  std::string name;
  std::shared_ptr<const Integrator> integrator;
  std::vector<double> steps;  ///< s
};

struct Run {
  double speed = 0;  ///< at the start, m/s
  double error = 0;  ///< largest of the position at the input changes, m; infinite: unstable
  double cost = 0;   ///< processor time per second of driving, us
};

/// The runs of a method with one step, from all speeds.
struct MethodStep {
  std::string method;
  double step = 0;  ///< s
  std::vector<Run> runs;

  double worst_error() const { return std::ranges::max(runs, {}, &Run::error).error; }
  double mean_cost() const {
    double sum = 0;
    for (const Run& run : runs) sum += run.cost;
    return sum / static_cast<double>(runs.size());
  }
};

std::vector<Method> all_methods() {
  const std::vector<double> asked{0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1};
  std::vector<double> shorter{1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4};
  shorter.insert(shorter.end(), asked.begin(), asked.end());
  return {{"stiff 1e-4", make_stiff_integrator({1e-4, 1e-4}), asked},
          {"stiff 1e-6", make_stiff_integrator(), asked},
          {"stiff 1e-8", make_stiff_integrator({1e-8, 1e-8}), asked},
          {"Euler", make_euler_integrator(), shorter},
          {"RK4", make_rk4_integrator(), shorter}};
}

/// Commands of full braking, throttle, coasting and steering in random order, the same for all
/// methods.
std::vector<VehicleCommand> harsh_commands(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto share = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<VehicleCommand> commands(static_cast<std::size_t>(kDuration / kInputPeriod));
  for (VehicleCommand& command : commands) {
    command.acceleration = std::clamp(-12 + 18 * share(), -9.0, 5.0);
    command.steering = -0.4 + 0.8 * share();
  }
  return commands;
}

/// States at the ends of the input periods.
std::vector<StateVector> drive(const VehicleArguments& arguments,
                               const std::shared_ptr<const Integrator>& integrator, double speed,
                               double step) {
  Vehicle vehicle(make_vehicle_model(arguments.vehicle), integrator);
  vehicle.place({.speed = speed});
  std::vector<StateVector> states;
  const auto steps = static_cast<int>(std::lround(kInputPeriod / step));
  for (const VehicleCommand& command : harsh_commands(arguments.seed)) {
    for (int i = 0; i < steps; ++i) vehicle.step(command, step);
    states.push_back(vehicle.states());
  }
  return states;
}

Run measure(const VehicleArguments& arguments, const Method& method, double speed, double step,
            const std::vector<StateVector>& reference) {
  const double start = cpu_seconds();
  const std::vector<StateVector> states = drive(arguments, method.integrator, speed, step);
  const double spent = 1e6 * (cpu_seconds() - start);
  double error = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const StateVector off = states[i] - reference[i];
    const bool stable = off.cwiseAbs().maxCoeff() < kUnstable && off.allFinite();
    error = stable ? std::max(error, off.head<2>().norm()) : kInfinite;
    if (!stable) break;
  }
  return {speed, error, spent / kDuration};
}

/// An error, or a word where a run was unstable.
TableCell error_cell(double error) {
  return std::isfinite(error) ? TableCell(error) : TableCell("unstable");
}

std::string csv(const std::vector<MethodStep>& measured) {
  std::string text = "method,speed_m_per_s,step_s,error_m,us_per_second\n";
  for (const MethodStep& m : measured) {
    for (const Run& run : m.runs) {
      text += formatted("%s,%g,%g,", m.method.c_str(), run.speed, m.step) +
              (std::isfinite(run.error) ? formatted("%.4g", run.error) : "unstable") +
              formatted(",%.4g\n", run.cost);
    }
  }
  return text;
}

std::vector<Chart> charts(const std::vector<MethodStep>& measured) {
  Chart by_step{"Error against step", "step, ms", "worst error of the position, mm"};
  Chart by_time{"Error against run time", "processor time per second of driving, us",
                "worst error of the position, mm"};
  Chart stable{"Longest stable step", "speed at the start, m/s (standing drawn at 0.1)",
               "longest stable step, ms"};
  for (std::size_t first = 0, end = 0; first < measured.size(); first = end) {
    ChartSeries steps{measured[first].method, {}, SeriesStyle::marked_line};
    ChartSeries times = steps, limits = steps;
    for (; end < measured.size() && measured[end].method == measured[first].method; ++end) {
      const MethodStep& m = measured[end];
      const double error = std::max(1e3 * m.worst_error(), kMinDrawn);
      std::string label = formatted("%g ms", 1e3 * m.step);
      if (1e3 * m.worst_error() < kMinDrawn) label += formatted(", below %g mm", kMinDrawn);
      steps.points.push_back({1e3 * m.step, error, label});
      times.points.push_back({m.mean_cost(), error, label});
    }
    for (std::size_t v = 0; v < std::size(kSpeeds); ++v) {
      double longest = 0;  // of the steps that are stable as all shorter ones are
      for (std::size_t i = first; i < end && std::isfinite(measured[i].runs[v].error); ++i) {
        longest = measured[i].step;
      }
      limits.points.push_back({std::max(kSpeeds[v], 0.1), 1e3 * longest});
    }
    by_step.series.push_back(std::move(steps));
    by_time.series.push_back(std::move(times));
    stable.series.push_back(std::move(limits));
  }
  std::vector<Chart> list{std::move(by_step), std::move(by_time), std::move(stable)};
  for (Chart& chart : list) chart.logarithmic = true, chart.width = 560, chart.height = 400;
  return list;
}

TableRow row_of(const MethodStep& m) {
  return {{{"", "method", "%-12s", m.method},
           {"", "step ms", "%9.3g", m.step, 1e3},
           {"", "worst error mm", "%14.3g", error_cell(m.worst_error()), 1e3},
           {"", "us per s driven", "%18.0f", m.mean_cost()}}};
}

const Study<MethodStep> kStudy{
    "vehicles",
    "Integration of vehicles' equations of motion",
    "Two seconds of full braking, throttle and steering in any order, from standstill to 12 m/s. "
    "Worst errors over the speeds, against the same equations at a tolerance of 1e-10. Runs in "
    "which any state (m, rad, m/s, rad/s) is off by 1 or more count as unstable and are not drawn. "
    "The stiff method (Rosenbrock, order 4) chooses inner steps by its "
    "tolerance; Euler's and Runge and Kutta's take the step as it is.",
    row_of,
    charts,
    csv};

void run(const VehicleArguments& arguments) {
  std::vector<std::vector<StateVector>> references;
  for (const double speed : kSpeeds) {
    references.push_back(drive(arguments, make_stiff_integrator(kReference), speed, kInputPeriod));
  }
  StudyRun run(kStudy, arguments);
  for (const Method& method : all_methods()) {
    for (const double step : method.steps) {
      MethodStep measured{method.name, step, {}};
      for (std::size_t v = 0; v < std::size(kSpeeds); ++v) {
        measured.runs.push_back(measure(arguments, method, kSpeeds[v], step, references[v]));
      }
      run.add(std::move(measured));
    }
  }
  run.end();
}

}  // namespace

void add_vehicles_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "vehicles",
      "error and run time of the integration of a vehicle's motion, beside Euler's and Runge and "
      "Kutta's methods; writes vehicles.csv and vehicles.html");
  const auto arguments = std::make_shared<VehicleArguments>();
  command.add_option("--vehicle", arguments->vehicle, "equations of motion")
      ->check(CLI::IsMember(vehicle_model_names()));
  command.add_option("-o,--output", arguments->output, "directory to write to");
  command.add_option("--seed", arguments->seed, "of the commands");
  arguments->out.add_option(command, "the rows of vehicles.csv");
  command.callback([arguments, &exit_code] {
    run(*arguments);
    exit_code = kAllWell;
  });
}

}  // namespace blindcorner
