// SPDX-License-Identifier: Apache-2.0
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <mutex>
#include <nlohmann/json.hpp>

#include "arrays.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/io/map_file.h"
#include "blindcorner/planner/path/path_planner.h"
#include "blindcorner/report/drive_report.h"
#include "blindcorner/report/path_page.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/report/trial_study.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/lit_drive.h"
#include "blindcorner/simulation/perception.h"
#include "interrupt.h"
#include "module.h"

namespace blindcorner::python {
namespace {

// --- Drives --------------------------------------------------------------------------------------

/// A drive with what is made once for all runs of it.
struct DriveData {
  Drive drive;
  std::once_flag once;
  std::unique_ptr<SimulatedSensor> sensor;

  const SimulatedSensor& sensed() {
    std::call_once(once, [this] { sensor = std::make_unique<SimulatedSensor>(drive.scene); });
    return *sensor;
  }
};
using DrivePointer = std::shared_ptr<DriveData>;

struct DriveRun {
  DrivePointer drive;
  DriveOptions options;
  DriveResult result;
};

DrivePointer load_drive(const std::string& path, double light) {
  const auto data = std::make_shared<DriveData>();
  data->drive = read_lit_drive(path, light);
  return data;
}

std::shared_ptr<DriveRun> run_drive(const DrivePointer& data, const std::string& perception,
                                    std::uint64_t seed, std::optional<double> speed,
                                    double injected_error, const std::vector<std::string>& weights,
                                    bool pictures, nb::object progress) {
  const std::string used = perception.empty() ? data->drive.perception : perception;
  check_perception(used, "perception");
  DriveOptions options;
  options.perception = used;
  options.seed = seed;
  options.speed = speed;
  options.injected_error = injected_error;
  options.keep_pictures = pictures;
  options.networks = load_networks(data->drive, weight_files(data->drive, weights, {used}));
  const StopFlag flag;
  const Callback callback(std::move(progress));
  return interruptible(
      [=]() mutable {
        options.progress = [&](double time) {
          flag.check();
          if (callback) callback(time);
        };
        auto run = std::make_shared<DriveRun>();
        run->drive = data;
        run->result = drive_through(data->drive, data->sensed(), options);
        options.progress = nullptr;
        run->options = options;
        return run;
      },
      [flag] { flag.ask(); });
}

/// [steps, 3] x, y (m), yaw (rad).
Array<2> trace(nb::handle_t<DriveRun> self) {
  const DriveRun& run = nb::cast<const DriveRun&>(self);
  std::vector<double> values;
  for (const Eigen::Vector3d& step : run.result.trace) {
    values.insert(values.end(), step.data(), step.data() + 3);
  }
  return array_of<2>(std::move(values), {run.result.trace.size(), 3});
}

const DriveFrame& frame_of(const DriveRun& run, std::size_t index) {
  if (index < run.result.frames.size()) return run.result.frames[index];
  throw Error("frame", "found " + std::to_string(index) + ", accepted: 0 to " +
                           std::to_string(run.result.frames.size()) + ", exclusively");
}

/// [rows, columns] probabilities, NaN where nothing is known; [0, 0] where no map was kept.
Array<2> occupancy(nb::handle_t<DriveRun> self, std::size_t index) {
  const DriveRun& run = nb::cast<const DriveRun&>(self);
  const std::vector<double>& cells = frame_of(run, index).occupancy;
  const GridGeometry& map = run.drive->drive.map;
  if (cells.empty()) return array_of<2>({}, {0, 0});
  return view_of<2>(
      cells, {static_cast<std::size_t>(map.rows), static_cast<std::size_t>(map.columns)}, self);
}

/// [zones, bins] counts as sensed; [0, 0] where the frame has none.
Array<2> sensed_counts(const DriveRun& run, std::size_t index) {
  const auto& counts = frame_of(run, index).counts;
  if (!counts) return array_of<2>({}, {0, 0});
  const Sensor& sensor = run.drive->drive.scene.sensor;
  return array_of<2>(counts->values, {static_cast<std::size_t>(sensor.zone_count()),
                                      static_cast<std::size_t>(sensor.bins)});
}

void require_pictures(const DriveRun& run) {
  if (run.options.keep_pictures) return;
  throw Error("pictures", "found False, accepted: True, so that there is a page");
}

// --- Paths ---------------------------------------------------------------------------------------

/// What a plan was asked for and what came of it.
struct PlanRun {
  std::string map;
  OccupancyMap occupancy;
  PathRequest request;
  std::optional<PlanningGrid> grid;
  Path path;

  PlannedPath planned() const { return {map, request, *grid, path}; }
};

std::shared_ptr<PlanRun> run_plan(const std::string& name, const Input<2>& occupancy,
                                  double cell_size, const Eigen::Vector2d& origin,
                                  const Eigen::Vector2d& start, const Eigen::Vector2d& goal,
                                  std::optional<double> start_heading,
                                  std::optional<double> goal_heading, std::optional<double> length,
                                  std::optional<double> width, double radius,
                                  double min_turning_radius, double unknown, double risk_weight,
                                  double risk_radius, double heuristic_weight) {
  auto run = std::make_shared<PlanRun>();
  run->map = name;
  GridGeometry& geometry = run->occupancy.geometry;
  geometry.rows = static_cast<int>(occupancy.shape(0));
  geometry.columns = static_cast<int>(occupancy.shape(1));
  geometry.cell_size = cell_size;
  geometry.origin = origin;
  geometry.validate();
  run->occupancy.occupancy.assign(occupancy.data(), occupancy.data() + geometry.cells());
  run->request = {start, start_heading, {goal, goal_heading, std::nullopt}};
  PathPlannerOptions options;
  if (length.has_value() != width.has_value()) {
    throw Error("vehicle_length_m and vehicle_width_m", "found one of them, accepted: both");
  }
  options.footprint =
      length ? VehicleFootprint::rectangle(*length, *width) : VehicleFootprint::disc(radius);
  options.curves.turning_radius = min_turning_radius;
  options.grid.unknown_occupancy = unknown;
  options.grid.risk_weight = risk_weight;
  options.grid.risk_radius = risk_radius;
  options.search.heuristic_weight = heuristic_weight;
  return interruptible(
      [=] {
        const PathPlanner planner(options);
        run->grid = planner.grid(run->occupancy.geometry, run->occupancy.occupancy);
        run->path = planner.plan(*run->grid, run->request);
        return run;
      },
      [] {});
}

nb::tuple load_map(const std::string& path) {
  OccupancyMap map = interruptible([path] { return read_map(path); }, [] {});
  const GridGeometry& geometry = map.geometry;
  return nb::make_tuple(
      array_of<2>(std::move(map.occupancy), {static_cast<std::size_t>(geometry.rows),
                                             static_cast<std::size_t>(geometry.columns)}),
      geometry.cell_size, geometry.origin);
}

// --- Trials --------------------------------------------------------------------------------------

/// perception, speed zone, seed, speed (m/s), injected error (m).
using TrialTuple = std::tuple<std::string, int, std::uint64_t, double, double>;

Trial trial_of(const TrialTuple& t) {
  return {std::get<0>(t), std::get<1>(t), std::get<2>(t), std::get<3>(t), std::get<4>(t)};
}

TrialRequest request_of(const std::string& drive, int trials,
                        const std::vector<std::string>& perceptions, std::uint64_t seed,
                        int error_trials, double light, const std::vector<std::string>& weights) {
  TrialRequest request{drive, light, weights, {}};
  request.options.trials = trials;
  if (!perceptions.empty()) request.options.perceptions = perceptions;
  request.options.seed = seed;
  request.options.error_trials = error_trials;
  return request;
}

struct Study {
  TrialStudy study;
  std::mutex mutex;
};

}  // namespace

void add_drive(nb::module_& m) {
  nb::class_<DriveData>(m, "Drive", "A drive file with its scene.")
      .def_static("load", &load_drive, nb::arg("path"), nb::arg("light") = 0.0,
                  "Reads a drive file; `light`: factor on the laser's light, 0: the file's.")
      .def_prop_ro("name", [](const DriveData& d) { return d.drive.name; })
      .def_prop_ro("path", [](const DriveData& d) { return d.drive.path; })
      .def_prop_ro("scene_path", [](const DriveData& d) { return d.drive.scene.path; })
      .def_prop_ro("perception", [](const DriveData& d) { return d.drive.perception; })
      .def_prop_ro(
          "body",
          [](const DriveData& d) {
            return Eigen::Vector3d(d.drive.vehicle.length, d.drive.vehicle.width,
                                   d.drive.vehicle.height);
          },
          "Length, width and height of the vehicle, m.")
      .def_prop_ro("goal_tolerance", [](const DriveData& d) { return d.drive.goal_tolerance; })
      .def_prop_ro(
          "finish_line",
          [](const DriveData& d) -> std::optional<Eigen::Matrix2d> {
            if (!d.drive.finish_line) return std::nullopt;
            Eigen::Matrix2d ends;
            ends << (*d.drive.finish_line)[0].transpose(), (*d.drive.finish_line)[1].transpose();
            return ends;
          },
          "[2, 2] its ends, m; None: there is none.")
      .def_prop_ro(
          "mount",
          [](const DriveData& d) -> Eigen::Matrix4d {
            return d.drive.sensor.T_vehicle_sensor.matrix();
          },
          "[4, 4] takes sensor coordinates to the vehicle's, m.")
      .def_prop_ro(
          "map",
          [](const DriveData& d) {
            const GridGeometry& map = d.drive.map;
            return nb::make_tuple(map.rows, map.columns, map.cell_size, map.origin);
          },
          "Rows, columns, size of a cell (m) and lower left corner (m) of the map.")
      .def_prop_ro("vehicle",
                   [](const DriveData& d) {
                     return d.drive.vehicle.kind == VehicleKind::car ? "car" : "robot";
                   })
      .def_prop_ro(
          "route", [](const DriveData& d) { return d.drive.route; },
          "Points on the way, m; the last one is the goal.")
      .def_prop_ro("rate", [](const DriveData& d) { return d.drive.sensor.rate; })
      .def_prop_ro("time_limit", [](const DriveData& d) { return d.drive.time_limit; });
  nb::class_<DriveRun>(m, "DriveRun", "One simulated drive.")
      .def_prop_ro(
          "text",
          [](const DriveRun& r) {
            return dump_json(drive_json(r.drive->drive, r.options, r.result), 1) + "\n";
          },
          "Text of drive.json.")
      .def_prop_ro("outcome", [](const DriveRun& r) { return outcome_word(r.result.outcome); })
      .def_prop_ro("clearance", [](const DriveRun& r) { return r.result.clearance; })
      .def_prop_ro("length", [](const DriveRun& r) { return r.result.length; })
      .def_prop_ro("time", [](const DriveRun& r) { return r.result.time; })
      .def_prop_ro("mean_speed", [](const DriveRun& r) { return r.result.mean_speed; })
      .def_prop_ro("frames", [](const DriveRun& r) { return r.result.frames.size(); })
      .def("occupancy", &occupancy, nb::arg("frame"),
           "[rows, columns] of the vehicle's map at a frame; NaN where nothing is known.")
      .def("counts", &sensed_counts, nb::arg("frame"), "[zones, bins] as sensed at a frame.")
      .def_prop_ro("trace_step", [](const DriveRun& r) { return r.result.trace_step; })
      .def_prop_ro("trace", &trace, nb::rv_policy::automatic, "[steps, 3] x, y (m), yaw (rad).")
      .def(
          "page",
          [](const DriveRun& r) {
            require_pictures(r);
            return drive_page(r.drive->drive, r.options, r.result);
          },
          "A page that plays the drive.")
      .def(
          "animation",
          [](const DriveRun& r) {
            require_pictures(r);
            return drive_animation(r.drive->drive, r.result);
          },
          "The map of that page as an animated SVG.");
  m.def("drive", &run_drive, nb::arg("drive"), nb::arg("perception"), nb::arg("seed"),
        nb::arg("speed").none(), nb::arg("injected_error"), nb::arg("weights"), nb::arg("pictures"),
        nb::arg("progress").none(), "Drives.");
  m.def("perception_names", &perception_names, "What may stand behind a drive's sensor.");

  nb::class_<PlanRun>(m, "PlanRun", "A planned path.")
      .def_prop_ro(
          "text", [](const PlanRun& r) { return path_json(r.planned()); }, "Text of path.json.")
      .def(
          "page", [](const PlanRun& r) { return path_page(r.planned(), r.occupancy.occupancy); },
          "A page with a picture of map and path.");
  m.def("plan", &run_plan, nb::arg("map"), nb::arg("occupancy"), nb::arg("cell_size"),
        nb::arg("origin"), nb::arg("start"), nb::arg("goal"), nb::arg("start_heading").none(),
        nb::arg("goal_heading").none(), nb::arg("vehicle_length").none(),
        nb::arg("vehicle_width").none(), nb::arg("radius"), nb::arg("min_turning_radius"),
        nb::arg("unknown"), nb::arg("risk_weight"), nb::arg("risk_radius"),
        nb::arg("heuristic_weight"), "Plans a path.");
  m.def("load_map", &load_map, nb::arg("path"),
        "(occupancy [rows, columns], cell size (m), origin (m)) of a map file.");

  nb::class_<TrialRunner>(m, "TrialRunner", "Drives trials; keeps what all of them share.")
      .def_static(
          "make",
          [](const std::string& drive, int trials, const std::vector<std::string>& perceptions,
             std::uint64_t seed, int error_trials, double light,
             const std::vector<std::string>& weights) {
            const TrialRequest request =
                request_of(drive, trials, perceptions, seed, error_trials, light, weights);
            return interruptible([request] { return std::make_shared<TrialRunner>(request); },
                                 [] {});
          },
          nb::arg("drive"), nb::arg("trials"), nb::arg("perceptions"), nb::arg("seed"),
          nb::arg("error_trials"), nb::arg("light"), nb::arg("weights"))
      .def_prop_ro("study", &TrialRunner::study, "JSON of all that results depend on.")
      .def(
          "run",
          [](const std::shared_ptr<TrialRunner>& runner, const TrialTuple& trial) {
            return interruptible(
                [runner, wanted = trial_of(trial)] { return journal_line(runner->run(wanted)); },
                [] {});
          },
          nb::arg("trial"), "Drives one trial; its line of the journal.");
  nb::class_<Study>(m, "TrialStudy", "A study of trials in a directory.")
      .def_static(
          "open",
          [](const std::string& directory, const std::string& drive, int trials,
             const std::vector<std::string>& perceptions, std::uint64_t seed, int error_trials,
             double light, const std::vector<std::string>& weights) {
            const TrialRequest request =
                request_of(drive, trials, perceptions, seed, error_trials, light, weights);
            return interruptible(
                [request, directory] {
                  return std::shared_ptr<Study>(new Study{{request, directory}, {}});
                },
                [] {});
          },
          nb::arg("directory"), nb::arg("drive"), nb::arg("trials"), nb::arg("perceptions"),
          nb::arg("seed"), nb::arg("error_trials"), nb::arg("light"), nb::arg("weights"))
      .def_prop_ro("study", [](const Study& s) { return s.study.study(); })
      .def(
          "open_trials",
          [](Study& s) {
            const std::scoped_lock lock(s.mutex);
            std::vector<TrialTuple> open;
            for (const Trial& t : s.study.open()) {
              open.emplace_back(t.perception, t.zone, t.seed, t.speed, t.error);
            }
            return open;
          },
          "Trials without a result, in the order of their plan.")
      .def(
          "add",
          [](Study& s, const std::string& line) {
            const TrialResult result = parse_journal_line(line);
            const nb::gil_scoped_release released;
            const std::scoped_lock lock(s.mutex);
            s.study.add(result);
          },
          nb::arg("line"), "Adds a journal's line durably; one that is there is not added again.")
      .def_prop_ro(
          "finished",
          [](Study& s) {
            const std::scoped_lock lock(s.mutex);
            return s.study.results().size();
          },
          "Number of trials with a result.")
      .def(
          "write_tables",
          [](Study& s) {
            const std::scoped_lock lock(s.mutex);
            s.study.write_tables();
          },
          "trials.csv and errors.csv.")
      .def(
          "finish",
          [](const std::shared_ptr<Study>& s, int replays) {
            const StopFlag flag;
            interruptible(
                [s, replays, flag] {
                  const std::scoped_lock lock(s->mutex);
                  s->study.write_tables();
                  for (const Trial& trial : s->study.missing_replays(replays)) {
                    flag.check();
                    s->study.write_replay(trial);
                  }
                  s->study.write_page();
                },
                [flag] { flag.ask(); });
          },
          nb::arg("replays"), "Tables, pages of failed trials, and the page.");
}

}  // namespace blindcorner::python
