// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/validate.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/scene/limits.h"
#include "forward/support/overloaded.h"

namespace blindcorner {
namespace {

using namespace limits;
using Eigen::Vector3d;

constexpr double kPicosecond = 1e-12;
/// Largest deviation of R R' from the identity for a rotation R. It allows for the rounding of the
/// values from which R was computed.
constexpr double kRotationError = 1e-6;

/// What was found wrong, one line each.
class Problems {
 public:
  explicit Problems(std::string place) : place_(std::move(place)) {}

  void require(bool condition, const std::string& field, const std::string& found,
               const std::string& accepted) {
    if (condition) return;
    if (!lines_.empty()) lines_ += '\n';
    lines_ += place_ + ": " + field + ": found " + found + ", accepted: " + accepted;
  }
  void number(const std::string& field, double value, const NumberRange& range) {
    if (!range.contains(value)) require(false, field, number_text(value), range.text());
  }
  void vector(const std::string& field, const Vector3d& value, const NumberRange& range) {
    for (int i = 0; i < 3; ++i) number(field + indexed(i), value[i], range);
  }
  void interval(const std::string& field, double lower, double upper, const NumberRange& range) {
    number(field + "[0]", lower, range);
    number(field + "[1]", upper, range);
    // Rendering pins components by a range of one value; the reader of files wants lower < upper.
    const bool pinned = lower == upper && field.starts_with("unknowns");
    require(pinned || !(lower >= upper), field,
            "[" + number_text(lower) + "," + number_text(upper) + "]",
            "[lower, upper] with lower < upper");
  }
  void transform(const std::string& field, const Transform& T) {
    vector(field + ".position_m", T.translation(), kPosition);
    const Eigen::Matrix3d R = T.linear();
    const bool rotation =
        (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRotationError &&
        R.determinant() > 0;
    require(rotation, field, "a linear part that is no rotation", "a rotation and a translation");
  }
  void size(const std::string& field, std::size_t found, std::size_t accepted) {
    require(found == accepted, field, std::to_string(found) + " values",
            std::to_string(accepted) + " or none");
  }

  static std::string indexed(std::size_t i) { return "[" + std::to_string(i) + "]"; }
  static std::string indexed(int i) { return "[" + std::to_string(i) + "]"; }

  bool none() const { return lines_.empty(); }
  void raise() const {
    if (!none()) throw Error(lines_);
  }

 private:
  std::string place_;
  std::string lines_;
};

void check_edges(const AngularRectangle& r, const std::string& field, Problems& problems) {
  problems.interval(field + " (left, right)", r.left / kDegree, r.right / kDegree, kAngle);
  problems.interval(field + " (top, bottom)", r.top / kDegree, r.bottom / kDegree, kAngle);
}

void check_footprint(const Zone& zone, const std::string& field, Problems& problems) {
  if (const auto* point = std::get_if<Vector3d>(&zone.footprint)) {
    // Points that captures bring are not known here: all their coordinates are NaN.
    if (!point->array().isNaN().all()) {
      problems.vector(field + ".relay_point_m", *point, kPosition);
    }
    return;
  }
  check_edges(std::get<AngularRectangle>(zone.footprint), field + ".angles_deg", problems);
}

void check_zone(const Sensor& sensor, std::size_t z, Problems& problems) {
  const Zone& zone = sensor.zones[z];
  const std::string index = Problems::indexed(z);
  problems.require(zone.footprint.index() == sensor.zones.front().footprint.index(),
                   "sensor.zones" + index, "another kind of footprint than zones[0]",
                   "the same kind for all zones");
  check_footprint(zone, "sensor.zones" + index, problems);
  problems.number("sensor.time_zero_ps" + index, zone.time_zero / kPicosecond, kTime);
  problems.number("sensor.gain" + index, zone.gain, kPositive);
  const int last = sensor.valid_end(static_cast<int>(z)) - 1;
  problems.require(zone.first_valid_bin >= 0 && zone.first_valid_bin <= last && last < sensor.bins,
                   "sensor.valid_bins" + index,
                   "[" + std::to_string(zone.first_valid_bin) + "," + std::to_string(last) + "]",
                   "[first, last] with 0 <= first <= last < " + std::to_string(sensor.bins));
  problems.require(zone.wrap_bins <= sensor.bins, "sensor.wrap_bins" + index,
                   std::to_string(zone.wrap_bins),
                   "a whole number from 0 to " + std::to_string(sensor.bins));
  if (zone.background.empty()) return;
  const std::string background = "sensor.background_counts" + index;
  problems.size(background, zone.background.size(), static_cast<std::size_t>(sensor.bins));
  const NumberRange& range = sensor.noise.counts_photons() ? kPhotonBackground : kBackground;
  const auto wrong =
      std::ranges::find_if(zone.background, [&](double v) { return !range.contains(v); });
  if (wrong != zone.background.end()) {
    const auto bin = static_cast<std::size_t>(wrong - zone.background.begin());
    problems.number(background + Problems::indexed(bin), *wrong, range);
  }
}

void check_noise(const Sensor& sensor, Problems& problems) {
  std::visit(overloaded{[&](const PoissonNoise&) {
                          problems.number("sensor.noise.dispersion", sensor.dispersion, kPositive);
                        },
                        [&](const GaussianNoise& noise) {
                          problems.number("sensor.noise.variance_floor", noise.variance_floor,
                                          kPositive);
                          problems.number("sensor.noise.variance_per_count",
                                          noise.variance_per_count, kNotNegative);
                        }},
             static_cast<const NoiseModel::Base&>(sensor.noise));
  if (sensor.pile_up_cycles == 0) return;
  problems.number("sensor.pile_up_cycles", sensor.pile_up_cycles, kPileUpCycles);
  problems.require(sensor.noise.counts_photons(), "sensor.pile_up_cycles",
                   std::string("pile-up beside ") + sensor.noise.name() + " noise",
                   "pile-up of counted photons (\"poisson\")");
}

void check_illumination(const Sensor& sensor, Problems& problems) {
  problems.number("sensor.illumination.radiant_intensity_w_per_sr", sensor.radiant_intensity,
                  kPositive);
  problems.vector("sensor.illumination.offset_m", sensor.light_offset, kLightOffset);
  // Zones that are points, or that are lit one by one, need no field.
  const bool points = std::holds_alternative<Vector3d>(sensor.zones.front().footprint);
  if (points || sensor.illumination == Illumination::confocal) return;
  const std::string field = "sensor.illumination.field";
  if (const auto* cone = std::get_if<AngularCone>(&sensor.field)) {
    problems.number(field + ".cone_half_angle_deg", cone->half_angle / kDegree, kHalfAngle);
  } else {
    check_edges(std::get<AngularRectangle>(sensor.field), field, problems);
  }
}

/// Checks rows, columns, bins and zones. Returns false if the other checks of a sensor, which rely
/// on these, cannot be made.
bool check_layout(const Sensor& sensor, Problems& problems) {
  const auto whole = [&](const char* field, int value, int upper) {
    const bool good = value >= 1 && value <= upper;
    problems.require(good, std::string("sensor.") + field, std::to_string(value),
                     NumberRange::between(1, upper).text("a whole number"));
    return good;
  };
  const bool rows = whole("rows", sensor.rows, kMaxZonesPerSide);
  const bool columns = whole("columns", sensor.columns, kMaxZonesPerSide);
  if (!whole("bins", sensor.bins, kMaxBins) || !rows || !columns) return false;
  const int zones = sensor.zone_count();
  problems.require(zones <= kMaxZones, "sensor.rows",
                   std::to_string(zones) + " zones (rows * columns)",
                   "at most " + std::to_string(kMaxZones));
  problems.require(zones <= kMaxCounts / sensor.bins, "sensor.bins",
                   std::to_string(zones) + " zones of " + std::to_string(sensor.bins) + " bins",
                   "at most " + std::to_string(kMaxCounts) + " bins together");
  const bool all = sensor.zones.size() == static_cast<std::size_t>(zones);
  problems.require(all, "sensor.zones", "an array of " + std::to_string(sensor.zones.size()),
                   "an array of " + std::to_string(zones) + " zones (rows * columns)");
  return all;
}

void check_sensor(const Sensor& sensor, Problems& problems) {
  problems.number("sensor.bin_width_ps", sensor.bin_width / kPicosecond, kDuration);
  if (!check_layout(sensor, problems)) return;
  for (std::size_t z = 0; z < sensor.zones.size(); ++z) check_zone(sensor, z, problems);
  problems.require(sensor.wrap_bins >= 0 && sensor.wrap_bins <= sensor.bins, "sensor.wrap_bins",
                   std::to_string(sensor.wrap_bins),
                   "a whole number from 0 to " + std::to_string(sensor.bins));
  check_noise(sensor, problems);
  problems.number("sensor.saturation", sensor.saturation, kNotNegative);
  check_illumination(sensor, problems);
  if (sensor.crosstalk.empty()) return;
  problems.size("sensor.crosstalk", sensor.crosstalk.size(),
                sensor.zones.size() * sensor.zones.size());
  const auto wrong =
      std::ranges::find_if(sensor.crosstalk, [](double v) { return !kShare.contains(v); });
  if (wrong != sensor.crosstalk.end()) problems.number("sensor.crosstalk", *wrong, kShare);
}

void check_shape(const Shape& shape, const std::string& field, Problems& problems) {
  const auto length = overloaded{
      [&](const char* name, double value) { problems.number(field + "." + name, value, kLength); },
      [&](const char* name, const Vector3d& value) {
        problems.vector(field + "." + name, value, kLength);
      }};
  std::visit(overloaded{[&](const MeshShape& s) {
                          problems.require(s.mesh != nullptr, field + ".file", "no mesh",
                                           "a mesh made by make_mesh or read from a file");
                        },
                        [&](const auto& s) { std::decay_t<decltype(s)>::lengths(s, length); }},
             shape);
}

void check_surfaces(const std::vector<Surface>& surfaces, Problems& problems) {
  problems.require(!surfaces.empty(), "surfaces", "[]", "an array of at least 1 element");
  problems.require(surfaces.empty() || std::ranges::any_of(surfaces, &Surface::relay), "surfaces",
                   "no surface with \"relay\": true", "at least one relay surface");
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const std::string field = "surfaces" + Problems::indexed(i);
    const Surface& surface = surfaces[i];
    check_shape(surface.shape, field, problems);
    problems.transform(field, surface.T_world_surface);
    const bool round = std::holds_alternative<SphereShape>(surface.shape) ||
                       std::holds_alternative<CylinderShape>(surface.shape);
    problems.require(!round, field + ".shape", "a round shape",
                     R"("rectangle", "box" or "mesh" for a known surface)");
    problems.number(field + ".albedo", surface.albedo, surface.relay ? kPositiveShare : kShare);
  }
}

void check_material(const Material& material, const std::string& field, Problems& problems) {
  std::visit(
      overloaded{[](const LambertianMaterial&) {},
                 [&](const RetroreflectiveMaterial& m) {
                   problems.number(field + ".retroreflective.lobe_sigma_deg",
                                   m.lobe_sigma / kDegree, kLobe);
                 },
                 [&](const MeasuredLawMaterial& m) {
                   const std::string law = field + ".measured_law.";
                   problems.number(law + "cosine_exponent", m.cosine_exponent, kExponent);
                   problems.number(law + "distance_exponent", m.distance_exponent, kExponent);
                   problems.number(law + "axis_across", m.axis_across, kTangent);
                   problems.number(law + "axis_up", m.axis_up, kTangent);
                 },
                 [&](const BrdfMaterial& m) {
                   problems.require(m.brdf != nullptr, field, "no BRDF", "a BRDF");
                   problems.require(!m.name.empty(), field, "no name", "a name");
                   if (m.brdf == nullptr) return;
                   problems.number(field + ".narrowest_lobe", m.brdf->narrowest_lobe(), kPositive);
                 }},
      material);
}

/// Largest extent of an object, in units of the way of light while the sensor records. Parts beyond
/// that way send no light in that time, and the paths that a model holds grow with the extent.
constexpr double kMaxTimeAxes = 100;

void check_extent(const Scene& scene, const HiddenObject& object, const std::string& field,
                  Problems& problems) {
  const double axis = kSpeedOfLight * scene.sensor.bins * scene.sensor.bin_width;
  const double extent = 2 * object.placement.size * bounding_radius(object.shape, Anchor::center);
  if (!(axis > 0) || !std::isfinite(extent)) return;  // other checks report it
  problems.require(extent <= kMaxTimeAxes * axis, field,
                   "an object of " + number_text(extent) + " m",
                   "at most " + number_text(kMaxTimeAxes * axis) +
                       " m, a hundred times the way of light while the sensor records");
}

void check_objects(const Scene& scene, Problems& problems) {
  const int count = object_count(scene);
  std::set<std::string> names;
  for (int i = 0; i < count; ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    const std::string field = count == 1 ? "hidden" : "hidden" + Problems::indexed(i);
    check_shape(object.shape, field, problems);
    check_material(object.material, field + ".material", problems);
    problems.number(field + ".albedo", object.albedo, kPositiveShare);
    problems.vector(field + ".position_m", object.placement.position, kPosition);
    problems.number(field + ".yaw_deg", object.placement.yaw / kDegree, kAnyAngle);
    problems.number(field + ".size", object.placement.size, kSize);
    check_extent(scene, object, field, problems);
    problems.require(names.insert(object.name).second, field + ".name", '"' + object.name + '"',
                     "a name of its own for each object");
    problems.require(count == 1 || !std::holds_alternative<MeasuredLawMaterial>(object.material),
                     field + ".material", "a measured law beside other objects",
                     "a measured law for the only object");
  }
}

void check_unknown(const Scene& scene, const Unknown& unknown, Problems& problems) {
  if (unknown.object < 0 || unknown.object >= object_count(scene)) {
    problems.require(false, "unknowns", "one of object " + std::to_string(unknown.object),
                     "objects from 0 to " + std::to_string(object_count(scene) - 1));
    return;
  }
  const bool yaw = unknown.component == Component::yaw;
  const bool size = unknown.component == Component::size;
  const double unit = yaw ? kDegree : 1.0;
  std::string name = unknown_name(scene, unknown);
  if (yaw) name.replace(name.size() - 3, 3, "deg");
  const std::string field = "unknowns." + name;
  problems.interval(field, unknown.lower / unit, unknown.upper / unit,
                    size  ? kSize
                    : yaw ? kAnyAngle
                          : kPosition);
  if (yaw) {
    const double degrees = unknown.range() / unit;
    problems.require(!(degrees > 360 * (1 + 1e-12)), field, number_text(degrees) + " degrees",
                     "a range of at most 360 degrees");
  }
  if (!unknown.prior) return;
  problems.number(field + ".prior.mean", unknown.prior->mean / unit, kPosition);
  problems.number(field + ".prior.sigma", unknown.prior->sigma / unit, kPositive);
}

void check_unknowns(const Scene& scene, Problems& problems) {
  std::set<std::pair<int, Component>> seen;
  for (const Unknown& unknown : scene.unknowns) {
    check_unknown(scene, unknown, problems);
    problems.require(seen.emplace(unknown.object, unknown.component).second, "unknowns",
                     component_name(unknown.component) + " twice", "each component once");
  }
}

void check_linear(const LinearUnknowns& linear, std::size_t zones, Problems& problems) {
  problems.number("linear.amplitude.value", linear.fixed_amplitude, kPositive);
  problems.number("linear.amplitude.prior.median", linear.amplitude_prior.median, kMedian);
  problems.number("linear.amplitude.prior.sigma_log", linear.amplitude_prior.sigma_log, kSigmaLog);
  problems.number("linear.ambient.counts_per_bin", linear.fixed_ambient, kNotNegative);
  problems.number("linear.direct.scale", linear.fixed_direct, kNotNegative);
  problems.require(linear.ambient != LinearMode::shared, "linear.ambient.mode", "\"shared\"",
                   R"("per_zone" or "fixed")");
  problems.require(linear.direct != LinearMode::shared, "linear.direct.mode", "\"shared\"",
                   R"("fixed" or "per_zone")");
  if (linear.ambient_prior.empty()) return;
  problems.size("linear.ambient.prior", linear.ambient_prior.size(), zones);
  for (std::size_t z = 0; z < linear.ambient_prior.size(); ++z) {
    const std::string index = Problems::indexed(z);
    problems.number("linear.ambient.prior.mean" + index, linear.ambient_prior[z].mean, {});
    problems.number("linear.ambient.prior.sigma" + index, linear.ambient_prior[z].sigma, kPositive);
  }
}

}  // namespace

void validate(const Scene& scene) {
  const std::string place = scene_place(scene);
  Problems problems(place.empty() ? "scene" : place);
  check_sensor(scene.sensor, problems);
  problems.transform("sensor_pose", scene.T_world_sensor);
  problems.require(!scene.sensor_covariance || scene.sensor_covariance->allFinite(),
                   "sensor_pose.sigma_m", "a covariance that is not finite", "finite numbers");
  check_surfaces(scene.surfaces, problems);
  check_objects(scene, problems);
  check_unknowns(scene, problems);
  check_linear(scene.linear, scene.sensor.zones.size(), problems);
  problems.number("presence_prior", scene.presence_prior, kInside01);
  problems.number("outlier_probability", scene.outlier_probability, kProperShare);
  problems.raise();
}

}  // namespace blindcorner
