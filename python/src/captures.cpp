// SPDX-License-Identifier: Apache-2.0
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <random>

#include "arrays.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/export_file.h"
#include "blindcorner/io/import_file.h"
#include "blindcorner/simulation/named_pose.h"
#include "blindcorner/simulation/rendering.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/synthetic.h"
#include "interrupt.h"
#include "module.h"

namespace blindcorner::python {
namespace {

nb::tuple load(const std::string& path) {
  return arrays_of(interruptible([path] { return read_captures(path); }, [] {}));
}

void save(const std::string& path, const Input<3>& counts, const std::string& metadata,
          const std::vector<std::string>& sources, const std::vector<int>& indices) {
  const auto file =
      std::make_shared<const CaptureFile>(captures_of({counts, metadata, sources, indices}));
  interruptible(
      [file, path] {
        if (path.ends_with(".exr")) return write_captures(path, *file);
        export_captures(path, *file);
      },
      [] {});
}

nb::tuple import(const std::vector<std::string>& paths, const std::string& format,
                 const std::string& axes, const std::string& array, const std::string& pattern,
                 int rows, int columns, double bin_width_s, std::optional<double> exposures,
                 std::optional<double> dispersion, const std::string& sensor,
                 const std::string& description, const std::string& sensor_positions,
                 const std::string& axes_world, double sensor_yaw_rad, int i2c_address,
                 int repeats) {
  ImportOptions options;
  options.format = format;
  options.axes = axes;
  options.array = array;
  options.pattern = pattern;
  options.rows = rows;
  options.columns = columns;
  options.bin_width = bin_width_s;
  options.exposures = exposures;
  options.dispersion = dispersion;
  options.sensor = sensor;
  options.description = description;
  options.sensor_positions = sensor_positions;
  options.axes_world = axes_world;
  options.sensor_rotation = Eigen::AngleAxisd(sensor_yaw_rad, Eigen::Vector3d::UnitZ());
  options.i2c_address = i2c_address;
  options.repeats_per_sample = repeats;
  options.validate();
  std::pair<CaptureFile, std::vector<std::string>> read = interruptible(
      [paths, options] {
        std::vector<std::string> warnings;
        CaptureFile file = import_captures(paths, options, &warnings);
        return std::pair(std::move(file), std::move(warnings));
      },
      [] {});
  return nb::make_tuple(arrays_of(std::move(read.first)), read.second);
}

using Pose = std::vector<NamedNumber>;

/// Renders captures. `poses` are those of the objects, by names; `sensor_poses` are [n, 4, 4].
nb::tuple render(const ScenePointer& data, const std::vector<Pose>& poses, int random,
                 const std::vector<Eigen::Matrix4d>& sensor_poses, int frames,
                 const std::string& model, bool noiseless, bool empty, std::uint64_t seed,
                 double photons, std::optional<double> sampling, std::optional<double> tolerance,
                 nb::object progress) {
  const Scene& scene = data->scene;
  RenderOptions options;
  options.model = model;
  options.noiseless = noiseless;
  options.empty = empty;
  options.seed = seed;
  options.photons = photons;
  options.sampling = sampling;
  if (tolerance) options.fast.tolerance = *tolerance;
  options.validate();
  std::vector<std::vector<Placement>> placements;
  for (const Pose& pose : poses) placements.push_back(placements_from(scene, "pose", pose));
  std::mt19937_64 drawn(seed);
  for (int i = 0; i < random; ++i) {
    placements.push_back(placements_at(scene, draw_pose(scene, drawn)));
  }
  if (placements.empty()) placements.push_back(stated_placements(scene));
  std::vector<Transform> sensors;
  for (const Eigen::Matrix4d& pose : sensor_poses) sensors.emplace_back(pose);
  if (sensors.empty()) sensors.push_back(scene.T_world_sensor);
  if (frames > 0) sensors = sensor_path(sensors, frames);
  const std::size_t count = capture_count(placements.size(), sensors.size());
  const StopFlag flag;
  const Callback callback(std::move(progress));
  return arrays_of(interruptible(
      [=] {
        std::atomic<std::size_t> done{0};
        RenderHooks hooks;
        hooks.stop = [&flag] { return flag.asked(); };
        if (callback) hooks.advance = [&] { callback(++done, count); };
        return render_captures(data->scene, placements, sensors, options, hooks);
      },
      [flag] { flag.ask(); }));
}

}  // namespace

void add_captures(nb::module_& m) {
  const char* arrays = "Returns (counts [captures, zones, bins], metadata JSON, sources, indices).";
  m.def("load_captures", &load, nb::arg("path"), arrays);
  m.def("save_captures", &save, nb::arg("path"), nb::arg("counts"), nb::arg("metadata"),
        nb::arg("sources"), nb::arg("indices"), "Writes .exr, .npz or .csv.");
  m.def("import_captures", &import, nb::arg("paths"), nb::arg("format"), nb::arg("axes"),
        nb::arg("array"), nb::arg("pattern"), nb::arg("rows"), nb::arg("columns"),
        nb::arg("bin_width_s"), nb::arg("exposures").none(), nb::arg("dispersion").none(),
        nb::arg("sensor"), nb::arg("description"), nb::arg("sensor_positions"),
        nb::arg("axes_world"), nb::arg("sensor_yaw_rad"), nb::arg("i2c_address"),
        nb::arg("repeats"), "Returns ((counts, metadata, sources, indices), warnings).");
  m.def("render", &render, nb::arg("scene"), nb::arg("poses"), nb::arg("random"),
        nb::arg("sensor_poses"), nb::arg("frames"), nb::arg("model"), nb::arg("noiseless"),
        nb::arg("empty"), nb::arg("seed"), nb::arg("photons"), nb::arg("sampling").none(),
        nb::arg("tolerance").none(), nb::arg("progress").none(), arrays);
}

}  // namespace blindcorner::python
