// SPDX-License-Identifier: Apache-2.0
/// Feeds arbitrary bytes to one of the file readers: whatever a file holds, a reader returns or
/// throws an Error. `blindcorner_fuzz --reader=NAME [libFuzzer's options] [CORPUS]`.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/io/import_file.h"
#include "blindcorner/io/movingai.h"
#include "blindcorner/io/ros_map.h"
#include "blindcorner/io/scene_file.h"
#include "io/mesh_file.h"

namespace {

namespace fs = std::filesystem;
using namespace blindcorner;

struct Reader {
  const char* file;  ///< what the bytes are called: some readers look at the name
  std::function<void(const std::string& path)> read;
};

ImportOptions with_axes() {
  ImportOptions options;
  options.axes = "capture,zone,bin";
  return options;
}

ImportOptions of_format(ImportFormat format) {
  ImportOptions options;
  options.format = format;
  return options;
}

const std::map<std::string, Reader, std::less<>>& readers() {
  const auto import = [](const ImportOptions& options) {
    return [options](const std::string& path) { import_captures({path}, options); };
  };
  static const std::map<std::string, Reader, std::less<>> all = {
      {"scene", {"in.json", [](const std::string& path) { read_scene(path); }}},
      {"drive", {"in.json", [](const std::string& path) { read_drive(path); }}},
      {"instrument",
       {"in.json",
        [](const std::string& path) { read_scene(SOURCE_DIR "/scenes/tmf8828_wall.json", path); }}},
      {"exr", {"in.exr", [](const std::string& path) { read_captures(path); }}},
      {"npz", {"in.npz", import({})}},
      {"npy", {"in.npy", import(with_axes())}},
      {"mat", {"in.mat", import(of_format(ImportFormat::cheapspad))}},
      {"log", {"in.log", import({})}},
      {"obj", {"in.obj", [](const std::string& path) { read_obj(path, 1.0); }}},
      {"ros_yaml", {"in.yaml", [](const std::string& path) { read_ros_map(path); }}},
      {"ros_pgm",
       {"map.pgm",
        [](const std::string& path) {
          read_ros_map(fs::path(path).replace_filename("map.yaml").string());
        }}},
      {"movingai", {"in.map", [](const std::string& path) { read_movingai_map(path); }}},
      {"scenario", {"in.scen", [](const std::string& path) {
                      read_movingai_scenario(path, GridGeometry{.columns = 8, .rows = 8});
                    }}}};
  return all;
}

const Reader* chosen = nullptr;
fs::path folder;

void leave() {
  std::error_code ignored;
  fs::remove_all(folder, ignored);
}

/// A folder with what files refer to: the bundled scenes, a map's image.
void make_folder() {
  folder = fs::temp_directory_path() / ("blindcorner_fuzz_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  for (const auto& entry : fs::directory_iterator(SOURCE_DIR "/scenes")) {
    fs::create_symlink(entry.path(), folder / entry.path().filename());
  }
  std::ofstream(folder / "map.yaml")
      << "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
         "free_thresh: 0.196\n";
  if (chosen == &readers().at("ros_yaml"))
    std::ofstream(folder / "map.pgm") << "P5\n2 2\n255\nabcd";
  std::atexit(leave);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* count, char*** arguments) {
  constexpr std::string_view kOption = "--reader=";
  for (int i = 1; i < *count; ++i) {
    const std::string_view argument = (*arguments)[i];
    if (!argument.starts_with(kOption)) continue;
    const auto found = readers().find(argument.substr(kOption.size()));
    if (found != readers().end()) chosen = &found->second;
  }
  if (chosen == nullptr) {
    std::fprintf(stderr, "accepted: --reader=NAME, one of");
    for (const auto& [name, reader] : readers()) std::fprintf(stderr, " %s", name.c_str());
    std::fprintf(stderr, "\n");
    std::exit(2);
  }
  make_folder();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  const fs::path file = folder / chosen->file;
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  try {
    chosen->read(file.string());
  } catch (const Error&) {
  }
  return 0;
}
