// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/scene_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "blindcorner/forward/scene/validate.h"
#include "blindcorner/forward/sensor/link_budget.h"
#include "forward/scene/limits.h"
#include "forward/support/overloaded.h"
#include "io/file_bytes.h"
#include "io/file_kind.h"
#include "io/json_reader.h"
#include "io/material.h"
#include "io/mesh_file.h"
#include "io/sensor_reader.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;
using Json = JsonReader::Json;

using namespace limits;

/// Sine of the smallest angle between two directions that span a plane.
constexpr double kParallel = 1e-6;

/// A freed component as scene files name it.
struct UnknownName {
  const char* key;
  Component component;
  double unit;  ///< SI per unit of the file
};
constexpr std::array<UnknownName, 5> kUnknownNames = {{{"x_m", Component::x, 1.0},
                                                       {"y_m", Component::y, 1.0},
                                                       {"z_m", Component::z, 1.0},
                                                       {"yaw_deg", Component::yaw, kDegree},
                                                       {"size", Component::size, 1.0}}};

// --- Directions and poses ------------------------------------------------------------------------

Vector3d read_direction(const JsonReader& reader) {
  const Vector3d v = reader.vector(kPosition);
  if (v.norm() < 1e-9) reader.fail("a direction of length > 0");
  return v.normalized();
}

/// Matrix with the columns x (given), y = z cross x, and z ("up" made orthogonal to x). By default
/// up is +z, or +x if x itself is vertical.
Eigen::Matrix3d axes(const Vector3d& x, const JsonReader& up_field) {
  const bool vertical = x.cross(Vector3d::UnitZ()).norm() < kParallel;
  Vector3d up = vertical ? Vector3d::UnitX() : Vector3d::UnitZ();
  if (up_field.present()) {
    up = read_direction(up_field);
    if (x.cross(up).norm() < kParallel) {
      up_field.fail("a direction that is not parallel to the normal or line of sight");
    }
  }
  Eigen::Matrix3d rotation;
  rotation.col(0) = x;
  rotation.col(2) = (up - up.dot(x) * x).normalized();
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  return rotation;
}

Eigen::Matrix3d yaw_rotation(double yaw) {
  return Eigen::AngleAxisd(yaw, Vector3d::UnitZ()).toRotationMatrix();
}

Eigen::Matrix3d read_rotation(const JsonReader& reader) {
  const std::string_view way =
      reader.at_most_one_of({"look", "yaw_pitch_roll_deg", "quaternion_wxyz"});
  if (way == "look") return axes(read_direction(reader.at("look")), reader.at("up"));
  reader.exclude("up", "no up without \"look\"");
  if (way.empty()) return Eigen::Matrix3d::Identity();
  if (way == "yaw_pitch_roll_deg")
    return rotation_of(reader.at("yaw_pitch_roll_deg").vector(kAnyAngle) * kDegree);
  return reader.at("quaternion_wxyz").quaternion().toRotationMatrix();
}

/// Standard deviations: one number for all three axes, or three numbers.
Vector3d read_sigmas(const JsonReader& reader, const NumberRange& range) {
  if (reader.is_array()) return reader.vector(range);
  return Vector3d::Constant(reader.number_or(0, range));
}

void read_sensor_pose(const JsonReader& reader, Scene& scene) {
  reader.allow_only({"position_m", "look", "up", "yaw_pitch_roll_deg", "quaternion_wxyz", "sigma_m",
                     "sigma_deg"});
  scene.T_world_sensor.translation() = reader.at("position_m").vector(kPosition);
  scene.T_world_sensor.linear() = read_rotation(reader);
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << read_sigmas(reader.at("sigma_m"), NumberRange::between(0, 1e3)),
      read_sigmas(reader.at("sigma_deg"), NumberRange::between(0, 180)) * kDegree;
  if (sigma.maxCoeff() > 0) {
    scene.sensor_covariance = Eigen::Matrix<double, 6, 6>(sigma.cwiseAbs2().asDiagonal());
  }
}

// --- Shapes --------------------------------------------------------------------------------------

/// "file", "scale" and "two_sided" of a mesh. A relative file name counts from the scene file's
/// folder.
MeshShape read_mesh(const JsonReader& reader) {
  const JsonReader file = reader.at("file");
  const std::filesystem::path beside = std::filesystem::path(reader.file()).parent_path();
  const double scale = reader.at("scale").number_or(1, NumberRange::between(1e-6, 1e6));
  const std::string name = file.text();
  MeshShape shape;
  try {
    shape.mesh = read_obj((beside / name).string(), std::isfinite(scale) ? scale : 1.0);
  } catch (const Error& error) {
    file.refuse(error.what());
  }
  shape.two_sided = reader.at("two_sided").boolean_or(!shape.mesh->closed);
  return shape;
}

/// Refuses a hidden body whose faces point inwards, because no light would leave its outside.
void check_winding(const JsonReader& reader, const Shape& shape) {
  const auto* mesh = std::get_if<MeshShape>(&shape);
  if (mesh == nullptr || !mesh->mesh->closed || mesh->two_sided) return;
  double volume = 0;  // signed, of the pyramids over all faces (divergence theorem)
  for (const auto& corners : mesh->mesh->triangles) {
    const auto vertex = [&](std::size_t k) -> const Eigen::Vector3d& {
      return mesh->mesh->vertices[static_cast<std::size_t>(corners[k])];
    };
    volume += vertex(0).dot(vertex(1).cross(vertex(2))) / 6;
  }
  if (volume >= 0) return;
  char cubic_metres[32];
  std::snprintf(cubic_metres, sizeof cubic_metres, "%.3g", volume);
  reader.at("file").fail(
      "faces that are wound inwards (signed volume " + std::string(cubic_metres) + " m^3)",
      "corners counter-clockwise as seen from outside, or \"two_sided\": true");
}

/// "center_m", "normal" and "up" of a rectangle.
Transform place_rectangle(const JsonReader& reader, const Shape& /*shape*/) {
  Transform T = Transform::Identity();
  T.translation() = reader.at("center_m").vector(kPosition);
  T.linear() = axes(read_direction(reader.at("normal")), reader.at("up"));
  return T;
}

/// "center_m" or "base_m", and "yaw_deg".
Transform place_upright(const JsonReader& reader, const Shape& shape) {
  const std::string_view key = reader.exactly_one_of({"center_m", "base_m"});
  Placement placement;
  placement.position = reader.at(key).vector(kPosition);
  placement.yaw = reader.at("yaw_deg").number_or(0, kAnyAngle) * kDegree;
  return object_to_world(shape, key == "base_m" ? Anchor::base : Anchor::center, placement);
}

/// "position_m" of the file's own origin, so that a file may use world coordinates, and "yaw_deg".
Transform place_mesh(const JsonReader& reader, const Shape& shape) {
  Transform T = Transform::Identity();
  T.linear() = yaw_rotation(reader.at("yaw_deg").number_or(0, kAnyAngle) * kDegree);
  const Vector3d position = reader.has("position_m") ? reader.at("position_m").vector(kPosition)
                                                     : Vector3d(Vector3d::Zero());
  T.translation() = position - T.linear() * std::get<MeshShape>(shape).mesh->origin;
  return T;
}

/// How scene files state a shape.
struct ShapeEntry {
  std::string_view name;
  std::vector<std::string_view> dimensions;  ///< fields
  Shape (*read)(const JsonReader&);
  /// Fields that place a known surface of this shape, and their reader. Round shapes have none,
  /// because relays and occluders cannot be round.
  std::vector<std::string_view> placing;
  Transform (*place)(const JsonReader&, const Shape&);
};

template <class S>
Shape read_lengths(const JsonReader& reader) {
  S shape;
  S::lengths(
      shape,
      overloaded{
          [&](const char* name, double& value) { value = reader.at(name).number(kLength); },
          [&](const char* name, Vector3d& value) { value = reader.at(name).vector(kLength); }});
  return shape;
}

/// A shape that consists of its lengths.
template <class S>
ShapeEntry of_lengths(std::string_view name, std::vector<std::string_view> placing = {},
                      Transform (*place)(const JsonReader&, const Shape&) = nullptr) {
  std::vector<std::string_view> dimensions;
  const S shape;
  S::lengths(shape, [&](const char* length, const auto&) { dimensions.emplace_back(length); });
  return {name, dimensions, read_lengths<S>, std::move(placing), place};
}

const std::array kShapes = {
    of_lengths<RectangleShape>("rectangle", {"center_m", "normal", "up"}, place_rectangle),
    of_lengths<BoxShape>("box", {"center_m", "base_m", "yaw_deg"}, place_upright),
    of_lengths<SphereShape>("sphere"), of_lengths<CylinderShape>("cylinder"),
    ShapeEntry{"mesh",
               {"file", "scale", "two_sided"},
               [](const JsonReader& r) -> Shape { return read_mesh(r); },
               {"position_m", "yaw_deg"},
               place_mesh}};
static_assert(kShapes.size() == std::variant_size_v<Shape>,
              "a shape that scene files cannot state");

/// The entry that "shape" names. For a known surface, only its possible shapes are accepted.
const ShapeEntry& read_entry(const JsonReader& reader, bool surface) {
  std::vector<std::string_view> names;
  for (const ShapeEntry& entry : kShapes) {
    if (!surface || entry.place != nullptr) names.push_back(entry.name);
  }
  return *std::ranges::find(kShapes, reader.at("shape").deciding_word(names), &ShapeEntry::name);
}

/// Adds those of `more` that `fields` does not contain yet.
void add_fields(std::vector<std::string_view>& fields, const std::vector<std::string_view>& more) {
  for (const std::string_view field : more) {
    if (std::ranges::find(fields, field) == fields.end()) fields.push_back(field);
  }
}

// --- Surfaces ------------------------------------------------------------------------------------

Surface read_surface(const JsonReader& reader, const std::string& default_name) {
  if (!reader.is_object()) reader.fail("an object with \"shape\"");
  const ShapeEntry& entry = read_entry(reader, true);
  std::vector<std::string_view> fields = {"name", "shape"};
  add_fields(fields, entry.placing);
  add_fields(fields, entry.dimensions);
  add_fields(fields, {"albedo", "relay", "occluder"});
  reader.allow_only(fields);
  Surface surface;
  reader.attempt([&] {
    surface.shape = entry.read(reader);
    surface.T_world_surface = entry.place(reader, surface.shape);
  });
  surface.name = default_name;
  reader.attempt([&] { surface.name = reader.at("name").text_or(default_name); });
  surface.albedo = reader.at("albedo").number_or(0.5, kShare);
  surface.relay = reader.at("relay").boolean_or(false);
  surface.occluder = reader.at("occluder").boolean_or(false);
  if (surface.relay && surface.albedo <= 0) {
    reader.at("albedo").fail("a number > 0 and <= 1 for a relay surface");
  }
  return surface;
}

std::vector<Surface> read_surfaces(const JsonReader& reader) {
  std::vector<Surface> surfaces;
  const std::size_t before = reader.noted();
  for (const JsonReader& surface : reader.elements(1)) {
    surfaces.emplace_back();
    surface.attempt([&] {
      surfaces.back() = read_surface(surface, "surface " + std::to_string(surfaces.size() - 1));
    });
  }
  const bool relay = std::ranges::any_of(surfaces, &Surface::relay);
  if (!relay && reader.noted() == before) {
    reader.fail("no surface with \"relay\": true", "at least one relay surface");
  }
  return surfaces;
}

// --- The hidden object and its unknowns ----------------------------------------------------------

Shape read_hidden_shape(const JsonReader& reader) {
  const ShapeEntry& own = read_entry(reader, false);
  for (const ShapeEntry& other : kShapes) {
    for (const std::string_view key : other.dimensions) {
      if (std::ranges::find(own.dimensions, key) != own.dimensions.end()) continue;
      reader.exclude(key, "dimensions of a " + std::string(own.name) + ", " +
                              list_words({own.dimensions.begin(), own.dimensions.end()}));
    }
  }
  return own.read(reader);
}

bool has_yaw(const Shape& shape) { return yaw_period(shape) > 0; }

/// Text for "accepted" from one unknown's range.
std::string range_words(const Unknown& unknown, double unit) {
  return NumberRange::between(unknown.lower / unit, unknown.upper / unit).text();
}

Unknown read_unknown(const JsonReader& reader, const UnknownName& name) {
  Unknown unknown;
  unknown.component = name.component;
  JsonReader range = reader;
  if (reader.is_object()) {
    reader.allow_only({"range", "prior"});
    range = reader.at("range");
    if (const JsonReader prior = reader.at("prior"); prior.present()) {
      prior.allow_only({"mean", "sigma"});
      unknown.prior = NormalPrior{.mean = prior.at("mean").number(kPosition) * name.unit,
                                  .sigma = prior.at("sigma").number(kPositive) * name.unit};
    }
  } else if (!reader.is_array()) {
    reader.fail(R"([lower, upper] or {"range": [lower, upper], "prior": {...}})");
  }
  const bool size = name.component == Component::size;
  const bool yaw = name.component == Component::yaw;
  const auto [lower, upper] = range.interval(size ? kSize : yaw ? kAnyAngle : kPosition);
  if (yaw && upper - lower > 360) range.fail("a range of at most 360 degrees");
  unknown.lower = lower * name.unit;
  unknown.upper = upper * name.unit;
  return unknown;
}

/// Component and object that a key names: "x_m", or "front.x_m" if names tell the objects apart.
std::pair<const UnknownName*, int> find_unknown_name(const std::string& key,
                                                     const std::vector<HiddenObject>& objects) {
  for (int object = 0; object < static_cast<int>(objects.size()); ++object) {
    const std::string prefix =
        objects.size() > 1 ? objects[static_cast<std::size_t>(object)].name + "." : "";
    for (const UnknownName& name : kUnknownNames) {
      if (key == prefix + name.key) return {&name, object};
    }
  }
  return {nullptr, 0};
}

std::vector<std::string> names_of_unknowns(const std::vector<HiddenObject>& objects) {
  std::vector<std::string> names;
  for (const HiddenObject& object : objects) {
    const std::string prefix = objects.size() > 1 ? object.name + "." : "";
    for (const UnknownName& name : kUnknownNames) names.push_back(prefix + name.key);
  }
  return names;
}

Unknown read_named_unknown(const std::string& key, const JsonReader& field,
                           const std::vector<HiddenObject>& objects) {
  const auto [name, object] = find_unknown_name(key, objects);
  if (name == nullptr) {
    const std::string prefix = objects.size() > 1 ? objects.front().name + "." : "";
    std::vector<std::string> words;
    for (const UnknownName& known : kUnknownNames) words.push_back(prefix + known.key);
    field.fail("an unknown of no known name",
               list_words(words) + (objects.size() > 1 ? ", or with another object's name" : ""));
  }
  const Shape& shape = objects[static_cast<std::size_t>(object)].shape;
  if (name->component == Component::yaw && !has_yaw(shape)) {
    field.fail("an angle", "no yaw, because a turned " + shape_name(shape) + " looks the same");
  }
  Unknown unknown = read_unknown(field, *name);
  unknown.object = object;
  return unknown;
}

std::vector<Unknown> read_unknowns(const JsonReader& reader,
                                   const std::vector<HiddenObject>& objects) {
  std::vector<Unknown> unknowns;
  reader.looks_for(names_of_unknowns(objects));
  for (const auto& item : reader.fields()) {
    item.second.attempt(
        [&] { unknowns.push_back(read_named_unknown(item.first, item.second, objects)); });
  }
  if (unknowns.empty() && reader.fields().empty()) reader.fail("at least one unknown");
  return unknowns;
}

const Unknown* find_unknown(const std::vector<Unknown>& unknowns, Component component, int object) {
  const auto it = std::find_if(unknowns.begin(), unknowns.end(), [&](const Unknown& u) {
    return u.component == component && u.object == object;
  });
  return it == unknowns.end() ? nullptr : &*it;
}

/// Value of one component. A given value must lie within the unknown's range if the component is
/// unknown. An absent value is the middle of that range, or the default of a known component.
void read_component(const JsonReader& field, const UnknownName& name, const NumberRange& range,
                    std::optional<double> absent, const Unknown* unknown, Placement& placement) {
  if (!field.present() || field.is_null()) {
    if (unknown == nullptr && (!absent || field.is_null())) {
      field.fail(range.text() + ", because " + name.key + " is not among the unknowns");
    }
    placement.set(name.component,
                  unknown != nullptr ? (unknown->lower + unknown->upper) / 2 : *absent);
    return;
  }
  double value = field.number(range) * name.unit;
  if (unknown != nullptr) {
    if (name.component == Component::yaw) {  // any turn of the same direction
      value += 2 * kPi * std::ceil((unknown->lower - value) / (2 * kPi) - 1e-12);
    }
    const double slack = 1e-9 * unknown->range();
    if (value < unknown->lower - slack || value > unknown->upper + slack) {
      field.fail(range_words(*unknown, name.unit) + ", the range of the unknown " + name.key);
    }
  }
  placement.set(name.component, value);
}

/// Refuses an absent position if some of its components are known, because these have to be given.
void require_position(const JsonReader& position, const std::array<const Unknown*, 3>& unknowns) {
  std::string form = "[";
  std::string letters, known;  // of components that have to be given
  int count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string letter(1, "XYZ"[i]);
    form += (i > 0 ? ", " : "") + (unknowns[i] != nullptr ? "null" : letter);
    if (unknowns[i] != nullptr) continue;
    const char* const joint = count++ > 0 ? " and " : "";
    letters += joint + letter;
    known += joint + std::string(kUnknownNames[i].key);
  }
  if (count == 0) return;
  position.fail(form + "], " + letters + " " + kPosition.text() + ", because " + known +
                (count > 1 ? " are" : " is") + " not among the unknowns");
}

Placement read_placement(const JsonReader& reader, const Shape& shape,
                         const std::vector<Unknown>& unknowns, int object) {
  Placement placement;
  const auto unknown = [&](std::size_t component) {
    return find_unknown(unknowns, kUnknownNames[component].component, object);
  };
  const JsonReader position = reader.at("position_m");
  std::vector<JsonReader> parts(3, position);
  if (position.present()) {
    parts = position.elements_exactly(3, "numbers (null for unknown ones)");
  } else {
    require_position(position, {unknown(0), unknown(1), unknown(2)});
  }
  for (std::size_t i = 0; i < 3; ++i) {
    read_component(parts[i], kUnknownNames[i], kPosition, {}, unknown(i), placement);
  }
  const JsonReader yaw = reader.at("yaw_deg");
  if (yaw.present() && !has_yaw(shape)) {
    yaw.fail("no yaw, because a turned " + shape_name(shape) + " looks the same");
  }
  read_component(yaw, kUnknownNames[3], kAnyAngle, 0.0, unknown(3), placement);
  read_component(reader.at("size"), kUnknownNames[4], kSize, 1.0, unknown(4), placement);
  return placement;
}

/// A hidden object without its placement.
HiddenObject read_object(const JsonReader& reader, const std::string& default_name) {
  HiddenObject hidden;
  hidden.name = default_name;
  if (!reader.is_object()) reader.fail("an object with \"shape\"");
  std::vector<std::string_view> fields = {"name", "shape"};
  for (const ShapeEntry& entry : kShapes) add_fields(fields, entry.dimensions);
  add_fields(fields, {"anchor", "material", "albedo", "position_m", "yaw_deg", "size"});
  reader.allow_only(fields);
  reader.attempt([&] { hidden.name = reader.at("name").text_or(default_name); });
  reader.attempt([&] {
    hidden.shape = read_hidden_shape(reader);
    check_winding(reader, hidden.shape);
  });
  hidden.anchor = default_anchor(hidden.shape);
  reader.attempt([&] { hidden.material = read_material(reader.at("material")); });
  hidden.albedo = reader.at("albedo").number_or(0.5, kPositiveShare);
  if (const JsonReader anchor = reader.at("anchor"); anchor.present()) {
    hidden.anchor = anchor.word({"base", "center"}) == "base" ? Anchor::base : Anchor::center;
  }
  return hidden;
}

/// Names tell objects apart on the command line and in results: "front.x_m=0.3,back.x_m=...".
void check_name(const JsonReader& reader, const std::vector<HiddenObject>& earlier,
                const std::string& name) {
  const JsonReader field = reader.at("name");
  if (name.empty() || name.find_first_of(".,= \t\n") != std::string::npos) {
    field.fail("a name without spaces and any of . , =");
  }
  const bool taken = std::any_of(earlier.begin(), earlier.end(),
                                 [&](const HiddenObject& other) { return other.name == name; });
  if (taken) field.fail("the name of another object", "a name of its own for each object");
}

void read_hidden(const JsonReader& reader, const JsonReader& unknowns, Scene& scene) {
  std::vector<HiddenObject> objects;
  std::vector<JsonReader> places;
  if (reader.is_array()) {
    for (const JsonReader& object : reader.elements(1)) {
      const auto number = objects.size() + 1;
      HiddenObject hidden = read_object(object, "object" + std::to_string(number));
      object.attempt([&] { check_name(object, objects, hidden.name); });
      objects.push_back(std::move(hidden));
      places.push_back(object);
    }
  } else {
    objects.push_back(read_object(reader, "object"));
    places.push_back(reader);
  }
  for (std::size_t i = 0; i < objects.size() && objects.size() > 1; ++i) {
    if (!std::holds_alternative<MeasuredLawMaterial>(objects[i].material)) continue;
    places[i]
        .at("material")
        .fail("a measured law beside other objects", "a measured law for the only object");
  }
  const std::size_t before = unknowns.noted();
  unknowns.attempt([&] { scene.unknowns = read_unknowns(unknowns, objects); });
  const bool known = unknowns.noted() == before;
  for (std::size_t i = 0; i < objects.size() && known; ++i) {
    places[i].attempt([&] {
      objects[i].placement =
          read_placement(places[i], objects[i].shape, scene.unknowns, static_cast<int>(i));
    });
  }
  scene.hidden = objects.front();
  scene.further_hidden.assign(objects.begin() + 1, objects.end());
}

// --- Linear unknowns -----------------------------------------------------------------------------

LinearMode linear_mode(const std::string& word) {
  return word == "shared"     ? LinearMode::shared
         : word == "per_zone" ? LinearMode::per_zone
                              : LinearMode::fixed;
}

void read_amplitude(const JsonReader& reader, LinearUnknowns& linear) {
  reader.allow_only({"mode", "value", "prior"});
  linear.amplitude =
      linear_mode(reader.at("mode").deciding_word_or("shared", {"shared", "per_zone", "fixed"}));
  linear.fixed_amplitude = reader.at("value").number_or(1, kPositive);
  linear.amplitude_prior.median = linear.fixed_amplitude;
  if (linear.amplitude == LinearMode::fixed) {
    reader.exclude("prior", "no prior with mode \"fixed\"");
  }
  if (const JsonReader prior = reader.at("prior"); prior.present()) {
    prior.allow_only({"median", "sigma_log"});
    AmplitudePrior& p = linear.amplitude_prior;
    p.median = prior.at("median").number_or(p.median, kMedian);
    p.sigma_log = prior.at("sigma_log").number_or(p.sigma_log, kSigmaLog);
  }
}

void read_direct(const JsonReader& reader, LinearUnknowns& linear) {
  reader.allow_only({"mode", "scale"});
  const std::string mode =
      reader.at("mode").deciding_word_or("fixed", {"fixed", "per_zone", "absent"});
  linear.direct = linear_mode(mode);
  linear.fixed_direct = reader.at("scale").number_or(1, kNotNegative);
  if (mode != "absent") return;
  reader.exclude("scale", "no scale with mode \"absent\"");
  linear.fixed_direct = 0;
}

/// {"mean": ..., "sigma": ...}, each one number or one per zone.
void read_ambient_prior(const JsonReader& reader, std::size_t zones, LinearUnknowns& linear) {
  if (!reader.present()) return;
  reader.allow_only({"mean", "sigma"});
  const auto values = [&](const char* key, const NumberRange& range) {
    const JsonReader field = reader.at(key);
    if (!field.is_array()) return std::vector<double>(zones, field.number(range));
    std::vector<double> list;
    for (const JsonReader& value : field.elements_exactly(zones, "numbers, one per zone")) {
      list.push_back(value.number(range));
    }
    return list;
  };
  const std::vector<double> means = values("mean", NumberRange{});
  const std::vector<double> sigmas = values("sigma", kPositive);
  for (std::size_t z = 0; z < zones; ++z) linear.ambient_prior.push_back({means[z], sigmas[z]});
}

void read_linear(const JsonReader& reader, std::size_t zones, LinearUnknowns& linear) {
  if (!reader.present()) return;
  reader.allow_only({"amplitude", "ambient", "direct"});
  reader.attempt([&] {
    if (reader.has("amplitude")) read_amplitude(reader.at("amplitude"), linear);
  });
  reader.attempt([&] {
    if (reader.has("direct")) read_direct(reader.at("direct"), linear);
  });
  if (const JsonReader ambient = reader.at("ambient"); ambient.present()) {
    ambient.allow_only({"mode", "counts_per_bin", "prior"});
    linear.ambient =
        linear_mode(ambient.at("mode").deciding_word_or("per_zone", {"per_zone", "fixed"}));
    if (linear.ambient == LinearMode::fixed) {
      ambient.exclude("prior", "no prior with mode \"fixed\"");
    }
    linear.fixed_ambient = ambient.at("counts_per_bin").number_or(0, kNotNegative);
    if (zones > 0) read_ambient_prior(ambient.at("prior"), zones, linear);
  }
}

// --- Motion --------------------------------------------------------------------------------------

Motion read_motion_object(const JsonReader& reader) {
  Motion motion;
  if (!reader.present()) return motion;
  reader.allow_only({"frame_interval_s", "acceleration_density_m2_per_s3", "initial_speed_m_per_s",
                     "height_drift_m_per_sqrt_s", "yaw_drift_deg_per_sqrt_s",
                     "size_drift_per_sqrt_s", "brightness_drift_per_sqrt_s", "position_error_m"});
  const NumberRange positive{.lower = 0, .upper = 1e6, .above_lower = true};
  const NumberRange not_negative{.lower = 0, .upper = 1e6};
  const auto read = [&](const char* field, double& value, const NumberRange& range) {
    value = reader.at(field).number_or(value, range);
  };
  read("frame_interval_s", motion.frame_interval, positive);
  read("acceleration_density_m2_per_s3", motion.acceleration_density, positive);
  read("initial_speed_m_per_s", motion.initial_speed, positive);
  read("height_drift_m_per_sqrt_s", motion.height_drift, not_negative);
  double yaw_deg = motion.yaw_drift / kDegree;
  read("yaw_drift_deg_per_sqrt_s", yaw_deg, not_negative);
  motion.yaw_drift = yaw_deg * kDegree;
  read("size_drift_per_sqrt_s", motion.size_drift, not_negative);
  read("brightness_drift_per_sqrt_s", motion.brightness_drift, not_negative);
  read("position_error_m", motion.position_error, not_negative);
  return motion;
}

/// Throws the collected errors, one per line.
void raise(const std::vector<std::string>& errors) {
  if (errors.empty()) return;
  std::string lines = errors.front();
  for (std::size_t i = 1; i < errors.size(); ++i) lines += '\n' + errors[i];
  throw Error(lines);
}

Scene read_document(const Json& json, const std::string& path) {
  std::vector<std::string> errors;
  const JsonReader reader = JsonReader(json, path.empty() ? "scene" : path).noting(errors);
  if (!reader.is_object()) reader.fail("an object");
  reader.allow_only({"name", "description", "sensor", "sensor_pose", "surfaces", "hidden",
                     "unknowns", "linear", "presence_prior", "outlier_probability", "motion"});
  Scene scene;
  scene.path = path;
  scene.name = std::filesystem::path(path).stem().string();
  const auto part = [&](const char* key, const auto& read) {
    reader.attempt([&] { read(reader.at(key)); });
  };
  part("name", [&](const JsonReader& r) { scene.name = r.text_or(scene.name); });
  part("description", [](const JsonReader& r) { r.text_or(""); });
  part("sensor", [&](const JsonReader& r) { scene.sensor = read_sensor(r); });
  part("sensor_pose", [&](const JsonReader& r) { read_sensor_pose(r, scene); });
  part("surfaces", [&](const JsonReader& r) { scene.surfaces = read_surfaces(r); });
  part("hidden", [&](const JsonReader& r) { read_hidden(r, reader.at("unknowns"), scene); });
  part("linear",
       [&](const JsonReader& r) { read_linear(r, scene.sensor.zones.size(), scene.linear); });
  scene.presence_prior = reader.at("presence_prior").number_or(0.5, kInside01);
  scene.outlier_probability = reader.at("outlier_probability").number_or(0, kProperShare);
  part("motion", [](const JsonReader& r) { read_motion_object(r); });  // an error in any command
  raise(errors);
  const JsonReader linear = reader.at("linear");
  const JsonReader ambient = linear.present() ? linear.at("ambient") : linear;
  apply_link(scene, ambient.present() && ambient.has("counts_per_bin"));
  validate(scene);
  return scene;
}

/// A scene file with the fields of an instrument file put over its own.
Json patched(const std::string& path, const std::string& instrument) {
  Json document = parse_file_kind(FileKind::scene, read_bytes(path), path);
  const Json file = parse_file_kind(FileKind::instrument, read_bytes(instrument), instrument);
  const JsonReader reader(file, instrument);
  if (!reader.is_object()) reader.fail("an object with \"format\" and \"patch\"");
  reader.at("format").word({"blindcorner.instrument/1"});
  if (!reader.at("patch").is_object()) reader.at("patch").fail("an object");
  document.merge_patch(file["patch"]);
  return document;
}

}  // namespace

Scene read_scene(const std::string& path) {
  return read_document(parse_file_kind(FileKind::scene, read_bytes(path), path), path);
}

Scene read_scene(const std::string& path, const std::string& instrument) {
  if (instrument.empty()) return read_scene(path);
  const Json document = patched(path, instrument);
  try {
    return read_document(document, path);
  } catch (const Error& error) {
    throw Error(instrument, std::string("does not suit the scene: ") + error.what());
  }
}

std::string scene_text(const std::string& path, const std::string& instrument) {
  if (instrument.empty()) return read_bytes(path);
  return patched(path, instrument).dump(1) + "\n";
}

Scene parse_scene_text(const std::string& text, const std::string& path) {
  return read_document(JsonReader::parse(text, path.empty() ? "scene" : path), path);
}

Motion read_motion(const std::string& path) { return parse_motion_text(read_bytes(path), path); }

Motion parse_motion_text(const std::string& text, const std::string& path) {
  const std::string place = path.empty() ? "scene" : path;
  const Json document = JsonReader::parse(text, place);
  return read_motion_object(JsonReader(document, place).at("motion"));
}

Scene parse_scene(const nlohmann::json& json, const std::string& path) {
  Json document = json;
  // This kind of JSON does not keep the order of fields, so the unknowns get the usual order.
  if (document.is_object() && document.contains("unknowns") && document["unknowns"].is_object()) {
    const Json given = document["unknowns"];
    Json ordered = Json::object();
    std::vector<std::string> prefixes{""};
    if (document.contains("hidden") && document["hidden"].is_array()) {
      for (const Json& object : document["hidden"]) {
        if (object.is_object() && object.contains("name") && object["name"].is_string()) {
          prefixes.push_back(object["name"].get<std::string>() + ".");
        }
      }
    }
    for (const std::string& prefix : prefixes) {
      for (const UnknownName& name : kUnknownNames) {
        const std::string key = prefix + name.key;
        if (given.contains(key)) ordered[key] = given[key];
      }
    }
    for (const auto& item : given.items()) ordered[item.key()] = item.value();
    document["unknowns"] = ordered;
  }
  return read_document(document, path);
}

}  // namespace blindcorner
