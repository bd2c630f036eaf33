// SPDX-License-Identifier: Apache-2.0
#include "io/material.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "forward/scene/limits.h"

namespace blindcorner {
namespace {

using namespace limits;

Material read_retroreflective(const JsonReader& reader) {
  reader.allow_only({"lobe_sigma_deg"});
  return RetroreflectiveMaterial{reader.at("lobe_sigma_deg").number_or(1, kLobe) * kDegree};
}

Material read_measured_law(const JsonReader& reader) {
  reader.allow_only({"cosine_exponent", "distance_exponent", "axis_across", "axis_up"});
  return MeasuredLawMaterial{.cosine_exponent = reader.at("cosine_exponent").number(kExponent),
                             .distance_exponent = reader.at("distance_exponent").number(kExponent),
                             .axis_across = reader.at("axis_across").number_or(0, kTangent),
                             .axis_up = reader.at("axis_up").number_or(0, kTangent)};
}

/// How scene files state a material: by its name alone, by an object of its fields, or both.
struct MaterialEntry {
  std::string_view name;
  Material (*alone)();                  ///< null: it has fields that must be there
  Material (*read)(const JsonReader&);  ///< reads its fields; null: it has none
};
constexpr std::array kMaterials{
    MaterialEntry{"lambertian", [] { return Material{LambertianMaterial{}}; }, nullptr},
    MaterialEntry{"retroreflective", [] { return Material{RetroreflectiveMaterial{kDegree}}; },
                  read_retroreflective},
    MaterialEntry{"measured_law", nullptr, read_measured_law},
};

}  // namespace

Material read_material(const JsonReader& reader) {
  if (!reader.present()) return LambertianMaterial{};
  std::vector<std::string_view> words, objects;
  for (const MaterialEntry& entry : kMaterials) {
    if (entry.alone != nullptr) words.push_back(entry.name);
    if (entry.read != nullptr) objects.push_back(entry.name);
  }
  const auto named = [](std::string_view name) {
    return *std::ranges::find(kMaterials, name, &MaterialEntry::name);
  };
  if (reader.is_string()) return named(reader.word(words)).alone();
  if (!reader.is_object()) {
    std::vector<std::string> accepted;
    for (const std::string_view word : words) accepted.push_back('"' + std::string(word) + '"');
    for (const std::string_view name : objects) {
      accepted.push_back("{\"" + std::string(name) + "\": {...}}");
    }
    reader.fail(list_choices(accepted));
  }
  reader.allow_only(objects);
  const std::string_view name = reader.exactly_one_of(objects);
  return named(name).read(reader.at(name));
}

}  // namespace blindcorner
