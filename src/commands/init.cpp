// SPDX-License-Identifier: Apache-2.0
/// `blindcorner init --sensor PRESET [-o SCENE]`: a scene file to begin with, drawn and explained.
#include "commands/init.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/io/sensor_presets.h"
#include "blindcorner/io/starter_scene.h"
#include "blindcorner/report/page.h"
#include "commands/commands.h"
#include "forward/support/comma_list.h"

namespace blindcorner::embedded {

/// Text of schema/NAME.schema.json.
std::string_view json_schema(std::string_view name);

}  // namespace blindcorner::embedded

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

struct InitArguments {
  std::string sensor;
  std::string output = "my_scene.json";
};

/// JSON has no comments, so this is what they would say. @: the scene file.
constexpr const char* kExplanation = R"(
What stands in it, and what to put in. Lengths are metres, z points up.
  sensor       the preset. A field beside it replaces the preset's own, such as "gain".
  sensor_pose  where the sensor stands and which way it looks.
  surfaces     what is known to stand about. "relay": light goes by way of it, as by the wall.
               "occluder": it hides the object, as the partition does.
  hidden       the object: shape, size, albedo. position_m is [x, y, z]. A component that is
               unknown is null. The box stands on the desk, so its z is known: 0.
  unknowns     what the fit has to find, and in which range.
  linear       brightness, ambient light and direct return are unknown too.
All fields: docs/scene.md. Editors complete and check them by scene.schema.json beside the file.

Then
  blindcorner info @ -o .        draw it again
  blindcorner explain @          photons to expect
  blindcorner render @ -o test.exr
  blindcorner fit @ test.exr -o out
)";

int run_init(const InitArguments& arguments) {
  const fs::path path = arguments.output;
  const std::vector<std::string> presets = sensor_preset_names();
  if (std::ranges::count(presets, arguments.sensor) == 0) {
    throw Error("--sensor", "found \"" + arguments.sensor + "\", accepted: " + comma_list(presets));
  }
  if (path.extension() != ".json") {
    throw Error("--output", "found " + path.string() + ", accepted: a name that ends in .json");
  }
  const std::string page = fs::path(path).replace_extension(".html").string();
  for (const std::string& file : {path.string(), page}) {
    if (!fs::exists(file)) continue;
    throw Error("--output", "found " + file + ", which is there already, accepted: a new name");
  }
  const std::string text = starter_scene(arguments.sensor);
  const Scene scene = parse_scene_text(text, path.string());
  write_atomically(path.string(), text);
  write_atomically(page, scene_page(scene));
  const fs::path schema = path.parent_path() / "scene.schema.json";
  if (!fs::exists(schema)) {
    write_atomically(schema.string(), std::string(embedded::json_schema("scene")));
  }
  std::printf("%s: a box on a desk, seen by %s. %s draws it.\n", path.c_str(),
              arguments.sensor.c_str(), page.c_str());
  std::string explanation = kExplanation;
  for (std::size_t at = 0; (at = explanation.find('@', at)) != std::string::npos;) {
    explanation.replace(at, 1, path.string());
    at += path.string().size();  // the name may hold one too
  }
  std::fputs(explanation.c_str(), stdout);
  return kAllWell;
}

}  // namespace

void add_init_command(CLI::App& app, int& exit_code) {
  CLI::App& command =
      *app.add_subcommand("init", "write a scene file to begin with, draw and explain it");
  const auto arguments = std::make_shared<InitArguments>();
  command.add_option("--sensor", arguments->sensor, "preset of the sensor (docs/scene.md)")
      ->required()
      ->type_name("PRESET");
  command.add_option("-o,--output", arguments->output, "scene file to write; its drawing is .html")
      ->capture_default_str()
      ->type_name("FILE");
  command.callback([arguments, &exit_code] { exit_code = run_init(*arguments); });
}

}  // namespace blindcorner
