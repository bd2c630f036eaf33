// SPDX-License-Identifier: Apache-2.0
#include "fuzz/readers.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/io/import_file.h"
#include "blindcorner/io/movingai.h"
#include "blindcorner/io/ros_map.h"
#include "blindcorner/io/scene_file.h"
#include "inverse/baseline/cnn_description.h"
#include "io/mesh_file.h"

namespace blindcorner::fuzzing {
namespace {

namespace fs = std::filesystem;

ImportOptions with_axes() {
  ImportOptions options;
  options.axes = "capture,zone,bin";
  return options;
}

ImportOptions of_format(const std::string& format) {
  ImportOptions options;
  options.format = format;
  return options;
}

ImportOptions of_pattern(const std::string& pattern) {
  ImportOptions options;
  options.pattern = pattern;
  return options;
}

/// The description that a file of weights holds; the rest of it is libtorch's.
void read_weights_description(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  parse_description({std::istreambuf_iterator<char>(file), {}}, path);
}

}  // namespace

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
      {"mat", {"in.mat", import(of_format("cheapspad"))}},
      {"log", {"in.log", import({})}},
      {"table", {"in.txt", import(of_pattern("zone,counts"))}},
      {"hdf5", {"in.hdf5", import({})}},
      {"obj", {"in.obj", [](const std::string& path) { read_obj(path, 1.0); }}},
      {"ros_yaml", {"in.yaml", [](const std::string& path) { read_ros_map(path); }}},
      {"ros_pgm",
       {"map.pgm",
        [](const std::string& path) {
          read_ros_map(fs::path(path).replace_filename("map.yaml").string());
        }}},
      {"weights_json", {"weights.json", read_weights_description}},
      {"movingai", {"in.map", [](const std::string& path) { read_movingai_map(path); }}},
      {"scenario", {"in.scen", [](const std::string& path) {
                      read_movingai_scenario(path, GridGeometry{.columns = 8, .rows = 8});
                    }}}};
  return all;
}

Folder::Folder(const Reader& reader) {
  path_ = fs::temp_directory_path() / ("blindcorner_fuzz_" + std::to_string(::getpid()));
  fs::create_directories(path_);
  for (const auto& entry : fs::directory_iterator(SOURCE_DIR "/scenes")) {
    fs::create_symlink(entry.path(), path_ / entry.path().filename());
  }
  std::ofstream(path_ / "map.yaml")
      << "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
         "free_thresh: 0.196\n";
  if (&reader == &readers().at("ros_yaml")) {
    std::ofstream(path_ / "map.pgm") << "P5\n2 2\n255\nabcd";
  }
}

Folder::~Folder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::string Folder::write(const Reader& reader, std::string_view bytes) const {
  const fs::path file = path_ / reader.file;
  std::ofstream(file, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return file.string();
}

}  // namespace blindcorner::fuzzing
