// SPDX-License-Identifier: Apache-2.0
/// `blindcorner info FILE... [-o DIR]`: what is in scene and capture files; scenes as pictures.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/capture_metadata.h"
#include "blindcorner/io/capture_text.h"
#include "blindcorner/io/import_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/page.h"
#include "commands/commands.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "report/reading_units.h"

namespace blindcorner {

namespace {

struct InfoArguments {
  std::vector<std::string> files;
  std::string output;
  Printout out;
  DescribeOptions options;
};

template <typename... Values>
std::string line(const char* format, Values... values) {
  char text[512];
  std::snprintf(text, sizeof text, format, values...);
  return std::string(text) + "\n";
}

std::string sensor_text(const Sensor& sensor) {
  int dead = 0;
  for (const Zone& zone : sensor.zones) dead += zone.dead ? 1 : 0;
  std::string text =
      line("sensor    %s: %d x %d zones (%d dead), %d bins of %.6g ps, %s", sensor.name.c_str(),
           sensor.rows, sensor.columns, dead, sensor.bins, sensor.bin_width * 1e12,
           sensor.illumination == Illumination::flash ? "flash" : "confocal");
  text += line("          %s noise, pulse %.4g ps (standard deviation of its core)",
               sensor.noise.name(), sensor.response.core_sigma() * 1e12);
  return text;
}

std::string unknowns_text(const Scene& scene) {
  std::string text;
  const std::vector<std::string> names = unknown_names(scene);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Unknown& unknown = scene.unknowns[i];
    const double unit = reading_unit(names[i]);
    text += line("unknown   %-8s %.4g to %.4g", reading_name(names[i]).c_str(),
                 unit * unknown.lower, unit * unknown.upper);
    if (unknown.prior) {
      text.pop_back();
      text += line(", prior %.4g +- %.4g", unit * unknown.prior->mean, unit * unknown.prior->sigma);
    }
  }
  return text;
}

std::string describe_scene(const Scene& scene) {
  std::string text = "scene     " + scene.name + "\n" + sensor_text(scene.sensor);
  const Eigen::Vector3d place = scene.T_world_sensor.translation();
  const Eigen::Vector3d look = scene.T_world_sensor.linear() * Eigen::Vector3d::UnitX();
  text += line("          at (%.4g, %.4g, %.4g) m, looks along (%.3g, %.3g, %.3g)", place.x(),
               place.y(), place.z(), look.x(), look.y(), look.z());
  for (const Surface& surface : scene.surfaces) {
    const Eigen::Vector3d center = surface.T_world_surface.translation();
    text +=
        line("surface   %s: %s at (%.4g, %.4g, %.4g) m, albedo %.3g%s%s", surface.name.c_str(),
             shape_name(surface.shape).c_str(), center.x(), center.y(), center.z(), surface.albedo,
             surface.relay ? ", relay" : "", surface.occluder ? ", occluder" : "");
  }
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& hidden = hidden_object(scene, i);
    text += line("hidden    %s: %s, %s, albedo %.3g, there with probability %.3g beforehand",
                 hidden.name.c_str(), shape_name(hidden.shape).c_str(),
                 material_name(hidden.material).c_str(), hidden.albedo, scene.presence_prior);
  }
  return text + unknowns_text(scene);
}

bool is_scene(const std::string& path) {
  return std::filesystem::path(path).extension() == ".json";
}

CaptureFile captures_of(const std::string& path) {
  const bool capture = std::filesystem::path(path).extension() == ".exr";
  return capture ? read_captures(path) : import_captures({path});
}

using Json = nlohmann::ordered_json;

Json scene_figures(const Scene& scene) {
  const Sensor& sensor = scene.sensor;
  Json json{{"name", scene.name},
            {"sensor",
             {{"name", sensor.name},
              {"rows", sensor.rows},
              {"columns", sensor.columns},
              {"bins", sensor.bins},
              {"bin_width_ps", sensor.bin_width * 1e12}}},
            {"surfaces", Json::array()},
            {"hidden", Json::array()},
            {"unknowns", Json::array()}};
  for (const Surface& surface : scene.surfaces) {
    json["surfaces"].push_back({{"name", surface.name},
                                {"shape", shape_name(surface.shape)},
                                {"albedo", surface.albedo},
                                {"relay", surface.relay},
                                {"occluder", surface.occluder}});
  }
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& hidden = hidden_object(scene, i);
    json["hidden"].push_back({{"name", hidden.name},
                              {"shape", shape_name(hidden.shape)},
                              {"material", material_name(hidden.material)},
                              {"albedo", hidden.albedo}});
  }
  const std::vector<std::string> names = unknown_names(scene);
  for (std::size_t i = 0; i < names.size(); ++i) {
    json["unknowns"].push_back({{"name", names[i]},
                                {"lower", scene.unknowns[i].lower},
                                {"upper", scene.unknowns[i].upper}});
  }
  return json;
}

/// The metadata, and the sum of the finite counts of each capture.
Json capture_figures(const CaptureFile& file, const std::string& path) {
  check_captures(file, path);
  Json json = Json::parse(metadata_text(file));
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    double total = 0;
    for (const double count : file.captures[i].counts.values) {
      if (std::isfinite(count)) total += count;
    }
    json["captures"][i]["total"] = total;
  }
  return json;
}

Json file_figures(const std::string& path) {
  Json json{{"file", path}};
  if (is_scene(path)) {
    json["scene"] = scene_figures(read_scene(path));
  } else {
    json["captures"] = capture_figures(captures_of(path), path);
  }
  return json;
}

std::string describe_file(const std::string& path, const DescribeOptions& options) {
  if (is_scene(path)) return describe_scene(read_scene(path));
  return describe(captures_of(path), options);
}

/// A page for each scene, named after its file.
void draw_scenes(const InfoArguments& arguments) {
  std::vector<std::pair<std::string, std::string>> pages;  // [scenes] file, page
  std::set<std::string> names;
  for (const std::string& path : arguments.files) {
    if (!is_scene(path)) continue;
    const std::string name = std::filesystem::path(path).stem().string() + ".html";
    if (!names.insert(name).second) {
      throw Error("--output", "found two scenes that would both be drawn as " + name +
                                  ", accepted: scene files of different names");
    }
    pages.emplace_back((std::filesystem::path(arguments.output) / name).string(),
                       scene_page(read_scene(path)));
  }
  if (pages.empty()) throw Error("--output", "found no scene to draw, accepted: with a .json file");
  make_directory(arguments.output);
  for (const auto& [path, page] : pages) {
    write_atomically(path, page);
    arguments.out.text("\n%s: the scene as a picture\n", path.c_str());
  }
}

int run_info(const InfoArguments& arguments) {
  arguments.options.validate();
  Json figures = Json::array();
  for (const std::string& path : arguments.files) {
    if (arguments.out.json()) {
      figures.push_back(file_figures(path));
      continue;
    }
    const std::string text = describe_file(path, arguments.options);
    arguments.out.text("%s%s\n%s", &path == &arguments.files.front() ? "" : "\n", path.c_str(),
                       text.c_str());
  }
  arguments.out.document(figures.dump(1));
  if (!arguments.output.empty()) draw_scenes(arguments);
  return kAllWell;
}

}  // namespace

void add_info_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand("info", "tell what scene and capture files hold");
  const auto arguments = std::make_shared<InfoArguments>();
  command.add_option("FILE", arguments->files, "scene (.json) or capture files")->required();
  command
      .add_option("-o,--output", arguments->output,
                  "draw each scene as a page DIR/NAME.html; the directory is made if missing")
      ->type_name("DIR");
  command.add_option("--capture", arguments->options.capture,
                     "capture whose histograms are drawn; -1: none");
  command.add_option("--width", arguments->options.width, "characters per histogram");
  arguments->out.add_option(command, "a list of objects, one for each file,");
  command.add_flag("--log", arguments->options.logarithmic, "draw the logarithm of the counts");
  command.callback([arguments, &exit_code] { exit_code = run_info(*arguments); });
}

}  // namespace blindcorner
