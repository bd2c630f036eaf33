// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark vehicles`: error and run time of the integrators of vehicles, and
/// vehicles driven by a table of commands.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/planner/vehicles/vehicle.h"
#include "commands/benchmark.h"
#include "commands/cpu_clock.h"
#include "commands/csv_table.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

constexpr double kInputPeriod = 0.1;  ///< commands are drawn anew every so many seconds
constexpr double kDuration = 2;       ///< of a run, s
/// A run in which any state is off by so much (m, rad, m/s, rad/s) counts as unstable. Friction is
/// bounded: wheels swing to and fro rather than to infinity.
constexpr double kUnstable = 1;
/// What braking leaves of the speed of models that cannot stand, m/s.
constexpr double kSlowest = 0.5;
constexpr double kMinDrawn = 1e-6;  ///< mm
constexpr IntegratorTolerance kReference{1e-10, 1e-10};
constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct VehicleArguments : StudyArguments {
  std::string vehicle = "car";
  std::string inputs, trajectory;
  double speed = 10;  ///< at the start of `inputs`, m/s
};

struct Method {
  std::string name;
  std::shared_ptr<const Integrator> integrator;
  std::vector<double> steps;  ///< s
};

struct Measurement {
  std::string method;
  double speed = 0;  ///< at the start, m/s
  double step = 0;   ///< s
  double error = 0;  ///< largest of the position at the inputs' changes, m; infinite: unstable
  double cost = 0;   ///< processor time per second of driving, us
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

/// Full braking, throttle, coasting and steering in any order. The same for all methods.
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
  // The peers' single tracks cannot stand, nor roll backwards (single_track.h).
  const bool keeps_rolling = arguments.vehicle.starts_with("single_track");
  std::vector<StateVector> states;
  const auto steps = static_cast<int>(std::lround(kInputPeriod / step));
  for (VehicleCommand command : harsh_commands(arguments.seed)) {
    if (keeps_rolling) {
      const double gentlest = (kSlowest - vehicle.state().speed) / kInputPeriod;
      command.acceleration = std::max(command.acceleration, gentlest);
    }
    for (int i = 0; i < steps; ++i) vehicle.step(command, step);
    states.push_back(vehicle.states());
  }
  return states;
}

Measurement measure(const VehicleArguments& arguments, const Method& method, double speed,
                    double step, const std::vector<StateVector>& reference) {
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
  return {method.name, speed, step, error, spent / kDuration};
}

std::vector<Measurement> measure_all(const VehicleArguments& arguments) {
  std::vector<Measurement> measured;
  const std::vector<Method> methods = all_methods();
  for (const double speed : {0.0, 0.5, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0}) {
    const auto reference = drive(arguments, make_stiff_integrator(kReference), speed, kInputPeriod);
    for (const Method& method : methods) {
      for (const double step : method.steps) {
        measured.push_back(measure(arguments, method, speed, step, reference));
      }
    }
  }
  return measured;
}

/// Over the speeds: worst error, mean cost.
Measurement summary(const std::vector<Measurement>& measured, const std::string& method,
                    double step) {
  Measurement result{.method = method, .step = step};
  int runs = 0;
  for (const Measurement& m : measured) {
    if (m.method != method || m.step != step) continue;
    result.error = std::max(result.error, m.error);
    result.cost += m.cost, ++runs;
  }
  result.cost /= std::max(runs, 1);
  return result;
}

void print(const Printout& out, const std::vector<Measurement>& measured) {
  out.text("%-12s %9s %14s %18s\n", "method", "step ms", "worst error mm", "us per s driven");
  for (const Method& method : all_methods()) {
    for (const double step : method.steps) {
      const Measurement m = summary(measured, method.name, step);
      const std::string error =
          std::isfinite(m.error) ? formatted("%14.3g", 1e3 * m.error) : "      unstable";
      out.text("%-12s %9.3g %s %18.0f\n", m.method.c_str(), 1e3 * step, error.c_str(), m.cost);
    }
  }
}

std::string csv(const std::vector<Measurement>& measured) {
  std::string text = "method,speed_m_per_s,step_s,error_m,us_per_second\n";
  for (const Measurement& m : measured) {
    text += formatted("%s,%g,%g,", m.method.c_str(), m.speed, m.step);
    text += (std::isfinite(m.error) ? formatted("%.4g", m.error) : std::string("unstable")) +
            formatted(",%.4g\n", m.cost);
  }
  return text;
}

/// Longest step of a method that is stable at a speed and at all shorter steps, s; 0: none.
double longest_stable(const std::vector<Measurement>& measured, const Method& method,
                      double speed) {
  double longest = 0;
  for (const double step : method.steps) {
    for (const Measurement& m : measured) {
      if (m.method != method.name || m.speed != speed || m.step != step) continue;
      if (!std::isfinite(m.error)) return longest;
      longest = step;
    }
  }
  return longest;
}

std::vector<Chart> charts(const std::vector<Measurement>& measured) {
  Chart by_step{"Error against step", "step, ms", "worst error of the position, mm"};
  Chart by_time{"Error against run time", "processor time per second of driving, us",
                "worst error of the position, mm"};
  Chart stable{"Longest stable step", "speed at the start, m/s (standing drawn at 0.1)",
               "longest stable step, ms"};
  for (const Method& method : all_methods()) {
    const ChartSeries empty{method.name, {}, SeriesStyle::marked_line};
    ChartSeries steps = empty, times = empty, limits = empty;
    for (const double step : method.steps) {
      const Measurement m = summary(measured, method.name, step);
      const double error = std::max(1e3 * m.error, kMinDrawn);
      std::string label = formatted("%g ms", 1e3 * step);
      if (1e3 * m.error < kMinDrawn) label += formatted(", below %g mm", kMinDrawn);
      steps.points.push_back({1e3 * step, error, label});
      times.points.push_back({m.cost, error, label});
    }
    for (const double speed : {0.0, 0.5, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0}) {
      limits.points.push_back(
          {std::max(speed, 0.1), 1e3 * longest_stable(measured, method, speed)});
    }
    by_step.series.push_back(std::move(steps));
    by_time.series.push_back(std::move(times));
    stable.series.push_back(std::move(limits));
  }
  std::vector<Chart> list{std::move(by_step), std::move(by_time), std::move(stable)};
  for (Chart& chart : list) chart.logarithmic = true, chart.width = 560, chart.height = 400;
  return list;
}

const StudyFiles kFiles{
    "vehicles", "Integration of vehicles' equations of motion",
    "Two seconds of full braking, throttle and steering in any order, from standstill to 12 m/s. "
    "Worst errors over the speeds, against the same equations at a tolerance of 1e-10. Runs in "
    "which any state (m, rad, m/s, rad/s) is off by 1 or more count as unstable and are not drawn. "
    "The stiff method (Rosenbrock, order 4) chooses inner steps by its "
    "tolerance; Euler's and Runge and Kutta's take the step as it is."};

double number(const CsvTable& table, std::size_t row, const std::string& column,
              const std::string& path) {
  const auto at = std::ranges::find(table.header, column);
  if (at == table.header.end()) throw Error(path, "has no column " + column);
  const std::string& cell = table.rows[row][static_cast<std::size_t>(at - table.header.begin())];
  try {
    std::size_t read = 0;
    const double value = std::stod(cell, &read);
    if (read == cell.size() && std::isfinite(value)) return value;
  } catch (const std::exception&) {  // said below
  }
  throw Error(csv_place(path, row), "found " + column + " '" + cell + "', accepted: a number");
}

/// A row of states per row of commands, after it.
void follow_inputs(const VehicleArguments& arguments) {
  const CsvTable table = read_csv_table(arguments.inputs);
  Vehicle vehicle(make_vehicle_model(arguments.vehicle));
  vehicle.place({.speed = arguments.speed});
  std::string text = "time_s";
  for (const std::string& name : vehicle.model().state_names()) text += "," + name;
  text += "\n";
  double time = 0;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const double dt = number(table, row, "dt_s", arguments.inputs);
    vehicle.step(VehicleCommand{number(table, row, "acceleration_m_per_s2", arguments.inputs),
                                number(table, row, "steering", arguments.inputs)},
                 dt);
    time += dt;
    text += formatted("%.9g", time);
    for (const double value : vehicle.states()) text += formatted(",%.12g", value);
    text += "\n";
  }
  write_atomically(arguments.trajectory, text);
}

void run(const VehicleArguments& arguments) {
  if (!arguments.inputs.empty()) return follow_inputs(arguments);
  const std::vector<Measurement> measured = measure_all(arguments);
  print(arguments.out, measured);
  write_study(arguments, kFiles, csv(measured), charts(measured));
  print_study_files(arguments, kFiles);
}

}  // namespace

void add_vehicles_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "vehicles",
      "error and run time of the integration of a vehicle's motion, beside Euler's and Runge and "
      "Kutta's methods; writes vehicles.csv and vehicles.html");
  const auto arguments = std::make_shared<VehicleArguments>();
  command.add_option("--vehicle", arguments->vehicle, "equations of motion")
      ->check(CLI::IsMember(vehicle_model_names()))
      ->capture_default_str();
  command.add_option("-o,--output", arguments->output, "directory to write to")
      ->capture_default_str();
  command.add_option("--seed", arguments->seed, "of the commands")->capture_default_str();
  CLI::Option* inputs = command.add_option(
      "--inputs", arguments->inputs,
      "instead: drive by a table (.csv) with columns dt_s, acceleration_m_per_s2 and steering "
      "(rad/s; robot: rad/s^2)");
  CLI::Option* trajectory =
      command.add_option("--trajectory", arguments->trajectory, "table to write the states to")
          ->needs(inputs);
  inputs->type_name("FILE")->needs(trajectory);
  trajectory->type_name("FILE");
  command.add_option("--speed", arguments->speed, "at the start, with --inputs, m/s")
      ->needs(inputs)
      ->capture_default_str();
  arguments->out.add_option(command, "the rows of vehicles.csv");
  command.callback([arguments, &exit_code] {
    run(*arguments);
    exit_code = kAllWell;
  });
}

}  // namespace blindcorner
