// SPDX-License-Identifier: Apache-2.0
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "blindcorner/inverse/hints.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/io/sensor_presets.h"
#include "blindcorner/simulation/named_pose.h"
#include "blindcorner/simulation/sensor_path.h"
#include "interrupt.h"
#include "module.h"

namespace blindcorner::python {
namespace {

ScenePointer load(const std::string& path, const std::string& instrument) {
  Scene scene = read_scene(path, instrument);
  const double nominal =
      instrument.empty() ? scene.sensor.bin_width : read_scene(path).sensor.bin_width;
  return std::make_shared<const SceneData>(
      SceneData{std::move(scene), scene_text(path, instrument), nominal});
}

ScenePointer from_text(const std::string& text, const std::string& path, double nominal) {
  Scene scene = parse_scene_text(text, path);
  const double width = nominal > 0 ? nominal : scene.sensor.bin_width;
  return std::make_shared<const SceneData>(SceneData{std::move(scene), text, width});
}

/// [unknowns, 2] lower and upper ends, SI units.
Eigen::MatrixXd bounds(const SceneData& data) {
  const auto& unknowns = data.scene.unknowns;
  Eigen::MatrixXd ends(static_cast<Eigen::Index>(unknowns.size()), 2);
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    ends.row(static_cast<Eigen::Index>(i)) << unknowns[i].lower, unknowns[i].upper;
  }
  return ends;
}

std::vector<std::string> objects(const SceneData& data) {
  std::vector<std::string> names;
  for (int i = 0; i < object_count(data.scene); ++i) {
    names.push_back(hidden_object(data.scene, i).name);
  }
  return names;
}

PoseVector pose_from_names(const SceneData& data, const std::vector<NamedNumber>& values) {
  return pose_of(placements_from(data.scene, "pose", values), data.scene.unknowns);
}

Eigen::Matrix4d sensor_pose_from_names(const SceneData& data,
                                       const std::vector<NamedNumber>& values) {
  return sensor_pose_from(data.scene, "sensor_pose", values).matrix();
}

std::vector<std::string> hints(const ScenePointer& data) {
  return interruptible([data] { return scene_hints(data->scene, sensor_placement(data->scene)); },
                       [] {});
}

/// A scene's text with an instrument file's patch over it (RFC 7386).
std::string patched_text(const std::string& text, const std::string& instrument) {
  auto document = nlohmann::ordered_json::parse(text);
  document.merge_patch(nlohmann::ordered_json::parse(instrument).at("patch"));
  return document.dump(1) + "\n";
}

}  // namespace

void add_scene(nb::module_& m) {
  nb::class_<SceneData>(m, "Scene", "A scene as the library reads it.")
      .def_static("load", &load, nb::arg("path"), nb::arg("instrument") = "",
                  "Reads a scene file, with an instrument file over it unless that is empty.")
      .def_static("from_text", &from_text, nb::arg("text"), nb::arg("path") = "",
                  nb::arg("nominal_bin_width_s") = 0.0,
                  "The same from JSON; `path` names it in messages and resolves relative files.")
      .def_ro("text", &SceneData::text, "JSON text that the scene was read from.")
      .def_ro("nominal_bin_width_s", &SceneData::nominal_bin_width,
              "Width of a bin as captures state it, before a calibration corrected it.")
      .def_prop_ro("name", [](const SceneData& d) { return d.scene.name; })
      .def_prop_ro("path", [](const SceneData& d) { return d.scene.path; })
      .def_prop_ro(
          "place", [](const SceneData& d) { return scene_place(d.scene); },
          "The scene's file, or its name.")
      .def_prop_ro(
          "unknowns", [](const SceneData& d) { return unknown_names(d.scene); },
          "Names with units, in the order of all vectors.")
      .def_prop_ro(
          "periods", [](const SceneData& d) { return periods(d.scene); },
          "After how much each unknown repeats, rad; 0: it does not.")
      .def_prop_ro("bounds", &bounds, "[unknowns, 2] ends of the search region, m, rad or 1.")
      .def_prop_ro("objects", &objects, "Names of the hidden objects.")
      .def_prop_ro("sensor", [](const SceneData& d) { return d.scene.sensor.name; })
      .def_prop_ro("rows", [](const SceneData& d) { return d.scene.sensor.rows; })
      .def_prop_ro("columns", [](const SceneData& d) { return d.scene.sensor.columns; })
      .def_prop_ro("bins", [](const SceneData& d) { return d.scene.sensor.bins; })
      .def_prop_ro("bin_width_s", [](const SceneData& d) { return d.scene.sensor.bin_width; })
      .def_prop_ro(
          "sensor_pose",
          [](const SceneData& d) -> Eigen::Matrix4d { return d.scene.T_world_sensor.matrix(); },
          "[4, 4] takes sensor coordinates to the world, m.")
      .def_prop_ro(
          "stated_pose",
          [](const SceneData& d) -> PoseVector {
            return pose_of(stated_placements(d.scene), d.scene.unknowns);
          },
          "[unknowns] what the scene itself states of the objects, m, rad or 1.")
      .def("pose", &pose_from_names, nb::arg("values"),
           "[unknowns] the stated pose with (name, value) pairs put in.")
      .def("sensor_pose_with", &sensor_pose_from_names, nb::arg("values"),
           "[4, 4] the sensor's pose with (name, value) pairs put in.");
  m.def("scene_hints", &hints, nb::arg("scene"), "Sentences on what is odd about a scene.");
  m.def("patched_text", &patched_text, nb::arg("text"), nb::arg("instrument"),
        "A scene's text with the patch of an instrument file's text over it.");
  m.def("preset_names", &sensor_preset_names, "Names of sensors that scenes may use.");
  m.def("preset_text", &sensor_preset_text, nb::arg("name"), "JSON of a preset's fields.");
}

}  // namespace blindcorner::python
