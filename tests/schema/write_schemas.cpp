// SPDX-License-Identifier: Apache-2.0
// Writes the JSON schemas of all files (schema/*.schema.json) from what the readers ask of examples
// and of the bundled files, or compares: `blindcorner_schemas DIR [--check]`.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/instrument_file.h"
#include "blindcorner/report/result_file.h"
#include "io/capture_metadata.h"
#include "io/file_bytes.h"
#include "io/json_reader.h"
#include "io/json_schema.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using Json = JsonReader::Json;

const fs::path kScenes = fs::path(SOURCE_DIR) / "scenes";

Json read_json(const fs::path& path) {
  return JsonReader::parse(read_bytes(path.string()), path.string());
}

/// The examples of one kind: a document, and what is put over it (JSON Merge Patch).
std::vector<Json> examples_of(const char* kind) {
  const Json all = read_json(fs::path(SOURCE_DIR) / "tests/schema/examples.json")[kind];
  std::vector<Json> examples;
  for (const Json& change : all["changes"]) {
    examples.push_back(all["base"]);
    examples.back().merge_patch(change);
  }
  return examples;
}

/// Bundled files whose names end so, sorted.
std::vector<fs::path> bundled(bool drives) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(kScenes)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".json" && name.ends_with("_drive.json") == drives) {
      files.push_back(entry.path());
    }
  }
  std::ranges::sort(files);
  return files;
}

Json schema_from(const char* kind, const std::string& title, const SchemaSource::Read& read,
                 const std::vector<fs::path>& files) {
  SchemaSource source(read);
  const std::string beside = (kScenes / "example.json").string();
  for (const Json& example : examples_of(kind)) source.add(example, beside);
  for (const fs::path& file : files) source.add(read_json(file), file.string());
  return source.schema(title);
}

Json scene_schema() {
  return schema_from(
      "scene", "blindcorner: scene",
      [](const Json& json, const std::string& path) { parse_scene_text(json.dump(), path); },
      bundled(false));
}

Json drive_schema() {
  return schema_from(
      "drive", "blindcorner: drive",
      [](const Json& json, const std::string& path) { parse_drive_text(json.dump(), path); },
      bundled(true));
}

Json capture_schema() {
  return schema_from(
      "capture", "blindcorner: metadata of captures",
      [](const Json& json, const std::string& path) { parse_metadata(json.dump(), path); }, {});
}

/// What is measured, in a patch of a scene.
Json instrument_schema(Json scene) {
  Calibration found;
  found.scene = read_scene((kScenes / "tmf8828_wall.json").string());
  found.parameters = {{"time_zero_ps", 0, 1, 0, 1, false, true}, {"a", 0, 1, 0, 1, true, false}};
  found.assignments = {{{0}, 1}};
  found.wraps = {{}};
  found.background = {{}};
  found.left_out = {{0, "reason"}};
  found.notes = {"note"};
  SchemaSource source;
  source.add(instrument_json(found.scene, found), "instrument.json");
  Json schema = source.schema("blindcorner: instrument");
  for (const char* field : {"$schema", "title"}) scene.erase(field);
  schema["properties"]["format"] = {{"const", kInstrumentFormat}};
  schema["properties"]["patch"] = patch_schema(std::move(scene));
  schema["required"] = {"format", "patch"};
  schema["additionalProperties"] = true;
  return schema;
}

FitResult example_result(const Scene& scene, std::size_t captures) {
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  FitResult result;
  for (std::size_t i = 0; i < captures; ++i) {
    result.sources.emplace_back("a.exr");
    result.indices.push_back(0);
    result.histograms.push_back({});
    result.histograms.back().amplitude = result.histograms.back().ambient =
        result.histograms.back().direct = {0.5};
  }
  const PoseVector pose = PoseVector::Constant(n, 0.5);
  const Eigen::MatrixXd covariance = Eigen::MatrixXd::Constant(n, n, 0.5);
  result.posterior = {{{0.5, pose, covariance, {0}, -0.5, pose}}, 0.5, pose, covariance};
  result.false_alarm_probability = 0.5;
  result.flags = {"word"};
  result.hints = {"sentence"};
  result.truth = {{unknown_names(scene).front(), 0.5}};
  result.goodness_of_fit = {0.5, 0.5, 0.5, 1.5};
  result.time_ms = {0.5, 0.5, 0.5, 0.5, 0.5, 0.5};
  return result;
}

Json result_schema() {
  SchemaSource source;
  for (const char* name : {"tmf8828_wall.json", "street_two.json"}) {
    const Scene scene = read_scene((kScenes / name).string());
    FitResult found = example_result(scene, 1);
    FitResult lost = found;  // null stands for what is not a number
    lost.posterior.modes[0].pose[0] = lost.posterior.mean[0] = std::nan("");
    lost.posterior.modes[0].optimum[0] = lost.posterior.modes[0].covariance(0, 0) = std::nan("");
    lost.posterior.covariance(0, 0) = std::nan("");
    lost.posterior.modes[0].log_likelihood = std::nan("");
    lost.histograms[0].amplitude = lost.histograms[0].ambient =
        lost.histograms[0].direct = {std::nan("")};
    lost.false_alarm_probability.reset();
    lost.truth.clear();
    lost.time_ms = {std::nan(""), std::nan(""), std::nan(""),
                    std::nan(""), std::nan(""), std::nan("")};
    lost.goodness_of_fit = {std::nan(""), std::nan(""), std::nan(""), std::nan("")};
    FitResult tracked = found;
    tracked.track =
        TrackSummary{0.5, found.posterior.mean, 0.5, 0.5, 1, true, 0.5, 0.5, 0.5, {}, {}};
    FitResult smoothed = tracked;
    smoothed.track->velocity[0] = smoothed.track->amplitude = std::nan("");
    smoothed.track->amplitude_sigma_log = smoothed.track->innovation = std::nan("");
    smoothed.track->smoothed_pose = found.posterior.mean;
    smoothed.track->smoothed_covariance = found.posterior.covariance;
    FitResult failed;
    failed.error = "reason";
    const Json document = Json::parse(
        result_json(scene, {found, lost, tracked, smoothed, failed, example_result(scene, 2)})
            .dump());
    source.add(document, "result.json");
  }
  Json schema = source.schema("blindcorner: result");
  schema["properties"]["format"] = {{"const", kResultFormat}};
  return schema;
}

/// Objects and arrays that fit stand on one line, others have a line for each element.
std::string readable(const Json& json, const std::string& indent = "") {
  constexpr std::size_t kColumns = 120;
  if (json.empty() || json.is_primitive()) return json.dump();
  const char* brackets = json.is_array() ? "[]" : "{}";
  const std::string inner = indent + " ";
  std::string line, lines;
  for (const auto& [name, value] : json.items()) {
    const std::string element =
        (json.is_array() ? "" : Json(name).dump() + ": ") + readable(value, inner);
    line += (line.empty() ? "" : ", ") + element;
    lines += (lines.empty() ? "\n" : ",\n") + inner + element;
  }
  const bool fits = indent.size() + line.size() < kColumns && line.find('\n') == std::string::npos;
  return brackets[0] + (fits ? line : lines + "\n" + indent) + brackets[1];
}

int run(const fs::path& directory, bool check) {
  const Json scene = scene_schema();
  const std::vector<std::pair<std::string, Json>> schemas{{"scene", scene},
                                                          {"drive", drive_schema()},
                                                          {"capture", capture_schema()},
                                                          {"instrument", instrument_schema(scene)},
                                                          {"result", result_schema()}};
  int wrong = 0;
  for (const auto& [name, schema] : schemas) {
    const std::string path = (directory / (name + ".schema.json")).string();
    const std::string text = readable(schema) + "\n";
    if (!check) {
      std::ofstream(path) << text;
    } else if (!fs::exists(path) || read_bytes(path) != text) {
      std::fprintf(stderr, "%s: is not what the reader asks; blindcorner_schemas %s writes it\n",
                   path.c_str(), directory.string().c_str());
      ++wrong;
    }
  }
  return wrong > 0 ? 1 : 0;
}

}  // namespace
}  // namespace blindcorner

int main(int argc, char** argv) {
  try {
    if (argc < 2) throw blindcorner::Error("DIR", "found none");
    return blindcorner::run(argv[1], argc > 2 && std::string(argv[2]) == "--check");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
