// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/random_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <random>
#include <utility>
#include <vector>

#include "blindcorner/io/sensor_presets.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

/// Least and greatest light of the object, photons.
constexpr double kFaintest = 10, kBrightest = 1e7;

/// Draws numbers by rules of its own: the standard library's distributions differ between
/// implementations.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}

  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  bool chance(double share) { return uniform() < share; }
  std::size_t index(std::size_t count) {
    return std::min(static_cast<std::size_t>(uniform() * static_cast<double>(count)), count - 1);
  }
  /// A number between these, rounded to three digits, as a person writes it.
  double between(double low, double high) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", low + (high - low) * uniform());
    return std::stod(text);
  }

 private:
  std::mt19937_64 random_;
};

/// A wedge that stands on z = 0, centred in x and y, as an OBJ file.
std::string wedge(Draw& draw, double scale) {
  const double length = scale * draw.between(0.1, 0.3);
  const double width = scale * draw.between(0.08, 0.2);
  const double height = scale * draw.between(0.1, 0.3);
  char text[512];
  std::snprintf(text, sizeof text,
                "# A wedge: a ramp that rises along +x. Metres.\n"
                "v %.4g %.4g 0\nv %.4g %.4g 0\nv %.4g %.4g 0\nv %.4g %.4g 0\n"
                "v %.4g %.4g %.4g\nv %.4g %.4g %.4g\n"
                "f 1 4 3 2\nf 2 3 6 5\nf 1 5 6 4\nf 1 2 5\nf 4 6 3\n",
                -length / 2, -width / 2, length / 2, -width / 2, length / 2, width / 2, -length / 2,
                width / 2, length / 2, -width / 2, height, length / 2, width / 2, height);
  return text;
}

Json material(Draw& draw) {
  if (!draw.chance(0.3)) return "lambertian";
  return {{"retroreflective", {{"lobe_sigma_deg", draw.between(0.5, 3)}}}};
}

}  // namespace

RandomScene random_scene(std::uint64_t seed) {
  Draw draw(seed);
  RandomScene random;
  random.name = "random_" + std::to_string(seed);
  random.photons = kFaintest * std::pow(kBrightest / kFaintest, draw.uniform());

  const std::vector<std::string> presets = sensor_preset_names();
  const std::string preset = presets[draw.index(presets.size())];
  const double scale = sensor_preset_scale(preset);
  const auto length = [&](double low, double high) { return scale * draw.between(low, high); };

  Json scene;
  scene["name"] = random.name;
  scene["sensor"] = {{"preset", preset}};
  const double height = length(0.15, 0.4);
  scene["sensor_pose"] = {{"position_m", {0, 0, height}},
                          {"look", {1, draw.between(-0.1, 0.25), draw.between(-0.3, 0.1)}}};

  const double wall = length(0.45, 0.9);
  Json surfaces = Json::array();
  surfaces.push_back({{"name", "wall"},
                      {"shape", "rectangle"},
                      {"center_m", {wall, scale * 0.3, scale * 0.6}},
                      {"normal", {-1, draw.between(-0.2, 0.2), 0}},
                      {"width_m", length(1.5, 3)},
                      {"height_m", scale * 1.2},
                      {"albedo", draw.between(0.3, 0.9)},
                      {"relay", true}});
  if (draw.chance(0.7)) {
    surfaces.push_back({{"name", "floor"},
                        {"shape", "rectangle"},
                        {"center_m", {0, 0, 0}},
                        {"normal", {0, 0, 1}},
                        {"width_m", scale * 4},
                        {"height_m", scale * 4},
                        {"albedo", draw.between(0.1, 0.7)},
                        {"relay", draw.chance(0.3)}});
  }
  const double partition = length(0.15, 0.3);
  const double thickness = scale * 0.02;
  const double reach = wall * draw.between(0.6, 0.85);  // where the partition ends before the wall
  surfaces.push_back({{"name", "partition"},
                      {"shape", "box"},
                      {"base_m", {reach / 2 - scale * 0.2, partition, 0}},
                      {"size_m", {reach + scale * 0.4, thickness, scale * draw.between(0.8, 1.5)}},
                      {"albedo", draw.between(0.03, 0.6)},
                      {"occluder", true}});
  scene["surfaces"] = surfaces;

  Json hidden{{"name", "object"}};
  const std::vector<std::string> shapes{"box", "sphere", "rectangle", "cylinder", "mesh"};
  const std::string shape = shapes[draw.index(shapes.size())];
  hidden["shape"] = shape;
  const double across = length(0.08, 0.25);
  const double up = length(0.1, 0.3);
  if (shape == "box") hidden["size_m"] = {across, length(0.08, 0.25), up};
  if (shape == "sphere" || shape == "cylinder") hidden["radius_m"] = across / 2;
  if (shape == "cylinder" || shape == "rectangle") hidden["height_m"] = up;
  if (shape == "rectangle") hidden["width_m"] = across;
  if (shape == "mesh") {
    random.mesh = wedge(draw, scale);
    hidden["file"] = random.name + ".obj";
    hidden["anchor"] = "base";
  }
  hidden["material"] = material(draw);
  hidden["albedo"] = draw.between(0.3, 0.9);

  Json unknowns;
  const double margin =
      scale * 0.15;  // nearer, the object would stand in the wall or the partition
  unknowns["x_m"] = {-scale * draw.between(0, 0.1), std::max(wall - margin, margin)};
  unknowns["y_m"] = {partition + margin, partition + margin + length(0.3, 0.7)};
  const bool floats = shape == "sphere" || shape == "rectangle";
  if (floats && draw.chance(0.5)) {
    hidden["position_m"] = {nullptr, nullptr, nullptr};
    unknowns["z_m"] = {scale * 0.15, scale * draw.between(0.4, 0.7)};
  } else {
    hidden["position_m"] = {nullptr, nullptr, floats ? height : 0};
  }
  if (shape == "box" || shape == "mesh") unknowns["yaw_deg"] = {-90, 90};
  if (shape == "rectangle") {
    unknowns["yaw_deg"] = {-80, 30};  // its front meets the wall or comes near it
  }
  if (draw.chance(0.15)) unknowns["size"] = {0.7, 1.4};
  scene["hidden"] = hidden;
  scene["unknowns"] = unknowns;
  scene["linear"] = {{"amplitude",
                      {{"mode", "shared"},
                       {"prior", {{"median", 1}, {"sigma_log", draw.chance(0.5) ? 1.0 : 0.3}}}}},
                     {"ambient", {{"mode", "per_zone"}}},
                     {"direct", {{"mode", draw.chance(0.5) ? "per_zone" : "fixed"}}}};
  random.text = scene.dump(2) + "\n";
  return random;
}

}  // namespace blindcorner
