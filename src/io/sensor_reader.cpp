// SPDX-License-Identifier: Apache-2.0
#include "io/sensor_reader.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "forward/scene/limits.h"
#include "forward/support/overloaded.h"

namespace blindcorner::embedded {

/// Text of a preset under src/io/presets, empty if no preset has that name.
std::string_view sensor_preset(std::string_view name);
std::vector<std::string_view> sensor_preset_names();

}  // namespace blindcorner::embedded

namespace blindcorner {
namespace {

using Json = JsonReader::Json;

using namespace limits;

constexpr double kPicosecond = 1e-12;

/// Fields that state the zones' directions. A given one replaces all of the preset's.
const std::initializer_list<std::string_view> kZoneFields = {"fov_deg", "zones", "zone_columns_deg",
                                                             "zone_rows_deg"};

/// The preset with the fields of `given` put over its own. Fields are replaced as a whole, except
/// that `illumination` is merged field by field.
Json merge_preset(const JsonReader& given) {
  const std::string name = given.at("preset").word(embedded::sensor_preset_names());
  Json merged = JsonReader::parse(std::string(embedded::sensor_preset(name)), "preset " + name);
  if (!merged.contains("name")) merged["name"] = name;
  const auto replaces_zones = [&](std::string_view field) { return given.has(field); };
  if (std::any_of(kZoneFields.begin(), kZoneFields.end(), replaces_zones)) {
    for (const std::string_view field : kZoneFields) merged.erase(std::string(field));
  }
  if (given.has("link")) {  // the link states what the preset's own figures stand for
    merged.erase("gain");
    if (merged.contains("illumination")) merged["illumination"].erase("radiant_intensity_w_per_sr");
  }
  for (const auto& [key, value] : given.fields()) {
    if (key == "preset") continue;
    if (key == "illumination" && value.is_object() && merged.contains(key)) {
      for (const auto& [inner, part] : value.fields()) merged[key][inner] = part.json();
    } else {
      merged[key] = value.json();
    }
  }
  return merged;
}

AngularRectangle even_rectangle(double horizontal_deg, double vertical_deg) {
  const double h = horizontal_deg / 2 * kDegree;
  const double v = vertical_deg / 2 * kDegree;
  return {.left = -h, .right = h, .top = -v, .bottom = v};
}

AngularRectangle read_rectangle(const JsonReader& reader, const char* left, const char* right,
                                const char* top, const char* bottom) {
  const AngularRectangle r{.left = reader.at(left).number(kAngle) * kDegree,
                           .right = reader.at(right).number(kAngle) * kDegree,
                           .top = reader.at(top).number(kAngle) * kDegree,
                           .bottom = reader.at(bottom).number(kAngle) * kDegree};
  if (r.left >= r.right) reader.at(left).fail(std::string("a number < ") + right);
  if (r.top >= r.bottom) reader.at(top).fail(std::string("a number < ") + bottom);
  return r;
}

AngularRectangle read_field_of_view(const JsonReader& reader) {
  const auto angles = reader.elements_exactly(2, "full angles (horizontal, vertical)");
  return even_rectangle(angles[0].number(kFullAngle), angles[1].number(kFullAngle));
}

/// Edges of `count` parts that are equally wide in the tangent, rad.
std::vector<std::pair<double, double>> even_edges(double low, double high, int count) {
  const auto edge = [&](int i) {
    return std::atan(std::tan(low) + (std::tan(high) - std::tan(low)) * i / count);
  };
  std::vector<std::pair<double, double>> edges;
  for (int i = 0; i < count; ++i) edges.emplace_back(edge(i), edge(i + 1));
  return edges;
}

std::vector<std::pair<double, double>> read_edges(const JsonReader& reader, int count,
                                                  const std::string& what) {
  std::vector<std::pair<double, double>> edges;
  for (const JsonReader& pair : reader.elements_exactly(static_cast<std::size_t>(count), what)) {
    const auto [low, high] = pair.interval(kAngle);
    edges.emplace_back(low * kDegree, high * kDegree);
  }
  return edges;
}

std::vector<ZoneFootprint> grid(const std::vector<std::pair<double, double>>& columns,
                                const std::vector<std::pair<double, double>>& rows) {
  std::vector<ZoneFootprint> footprints;
  for (const auto& [top, bottom] : rows) {
    for (const auto& [left, right] : columns) {
      footprints.emplace_back(AngularRectangle{left, right, top, bottom});
    }
  }
  return footprints;
}

/// "zones": a list of footprints, or "from_capture".
std::vector<ZoneFootprint> read_zone_list(const JsonReader& reader, std::size_t count) {
  if (reader.is_string()) {
    reader.word({"from_capture"});
    // The points come with each capture and are not known without one.
    const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(std::nan(""));
    return std::vector<ZoneFootprint>(count, unknown);
  }
  if (!reader.is_array()) {
    reader.fail("\"from_capture\" or an array of " + std::to_string(count) + " zones");
  }
  std::vector<ZoneFootprint> footprints;
  for (const JsonReader& zone : reader.elements_exactly(count, "zones (rows * columns)")) {
    zone.allow_only({"angles_deg", "relay_point_m"});
    if (zone.exactly_one_of({"angles_deg", "relay_point_m"}) == "relay_point_m") {
      footprints.emplace_back(zone.at("relay_point_m").vector(kPosition));
    } else {
      const JsonReader angles = zone.at("angles_deg");
      angles.allow_only({"left", "right", "top", "bottom"});
      footprints.emplace_back(read_rectangle(angles, "left", "right", "top", "bottom"));
    }
    if (footprints.back().index() != footprints.front().index()) {
      zone.fail("another kind of footprint than zones[0]", "the same kind for all zones");
    }
  }
  return footprints;
}

std::vector<ZoneFootprint> read_footprints(const JsonReader& reader, int rows, int columns) {
  const std::string_view way = reader.exactly_one_of({"fov_deg", "zones", "zone_columns_deg"});
  if (way == "zone_columns_deg") {
    return grid(read_edges(reader.at(way), columns, "pairs [left, right], one per column"),
                read_edges(reader.at("zone_rows_deg"), rows, "pairs [top, bottom], one per row"));
  }
  reader.exclude("zone_rows_deg", "no rows without zone_columns_deg");
  if (way == "fov_deg") {
    const AngularRectangle all = read_field_of_view(reader.at("fov_deg"));
    return grid(even_edges(all.left, all.right, columns), even_edges(all.top, all.bottom, rows));
  }
  return read_zone_list(reader.at("zones"),
                        static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns));
}

/// One number for all zones, or one number per zone.
std::vector<double> read_per_zone(const JsonReader& reader, std::size_t count, double absent,
                                  const NumberRange& range) {
  if (!reader.is_array()) return std::vector<double>(count, reader.number_or(absent, range));
  std::vector<double> values;
  for (const JsonReader& value : reader.elements_exactly(count, "numbers, one per zone")) {
    values.push_back(value.number(range));
  }
  return values;
}

void read_valid_pair(const JsonReader& reader, int bins, Zone& zone) {
  const auto ends = reader.elements_exactly(2, "bins (first, last)");
  zone.first_valid_bin = ends[0].integer(0, bins - 1);
  zone.last_valid_bin = ends[1].integer(zone.first_valid_bin, bins - 1);
}

/// [first, last] for all zones, or one such pair per zone.
void read_valid_bins(const JsonReader& reader, Sensor& sensor) {
  if (!reader.present()) return;
  const auto parts = reader.elements(1);
  if (!parts.front().is_array()) {
    for (Zone& zone : sensor.zones) read_valid_pair(reader, sensor.bins, zone);
    return;
  }
  const auto pairs =
      reader.elements_exactly(sensor.zones.size(), "pairs [first, last], one per zone");
  for (std::size_t z = 0; z < pairs.size(); ++z) {
    read_valid_pair(pairs[z], sensor.bins, sensor.zones[z]);
  }
}

void read_zones(const JsonReader& reader, Sensor& sensor) {
  const auto count = static_cast<std::size_t>(sensor.zone_count());
  sensor.zones.resize(count);
  reader.attempt([&] {
    const auto footprints = read_footprints(reader, sensor.rows, sensor.columns);
    for (std::size_t z = 0; z < count; ++z) sensor.zones[z].footprint = footprints[z];
  });
  reader.attempt([&] {
    const auto time_zero = read_per_zone(reader.at("time_zero_ps"), count, 0, kTime);
    for (std::size_t z = 0; z < count; ++z) sensor.zones[z].time_zero = time_zero[z] * kPicosecond;
  });
  reader.attempt([&] {
    const auto gain = read_per_zone(reader.at("gain"), count, 1, kPositive);
    for (std::size_t z = 0; z < count; ++z) sensor.zones[z].gain = gain[z];
  });
  reader.attempt([&] { read_valid_bins(reader.at("valid_bins"), sensor); });
  if (const JsonReader wrap = reader.at("wrap_bins"); wrap.is_array()) {
    const auto bins = wrap.elements_exactly(count, "bins, one number per zone");
    for (std::size_t z = 0; z < count; ++z) {
      sensor.zones[z].wrap_bins = bins[z].integer(0, sensor.bins);
    }
  }
  if (!reader.has("dead_zones")) return;
  for (const JsonReader& dead : reader.at("dead_zones").elements()) {
    sensor.zones[static_cast<std::size_t>(dead.integer(0, sensor.zone_count() - 1))].dead = true;
  }
}

/// A list of counts per zone. Each list has one count per bin, or is empty.
void read_background(const JsonReader& reader, Sensor& sensor) {
  if (!reader.present()) return;
  const bool photons = sensor.noise.counts_photons();
  const auto count = static_cast<std::size_t>(sensor.zone_count());
  const auto bins = static_cast<std::size_t>(sensor.bins);
  const auto rows = reader.elements_exactly(count, "lists, one per zone");
  for (std::size_t z = 0; z < count; ++z) {
    if (rows[z].elements(0).empty()) continue;
    for (const JsonReader& value : rows[z].elements_exactly(bins, "counts, one per bin")) {
      sensor.zones[z].background.push_back(value.number(photons ? kPhotonBackground : kBackground));
    }
  }
}

ResponseShape read_tails(const JsonReader& reader) {
  ExponentialTailResponse response;
  response.sigma = reader.at("fwhm_ps").number(kDuration) * kPicosecond / kGaussianFwhm;
  double total = 0;
  for (const JsonReader& tail : reader.at("tails").elements(1)) {
    tail.allow_only({"fraction", "decay_ps"});
    const double fraction = tail.at("fraction").number(NumberRange::inside(0, 1));
    response.tails.push_back({fraction, tail.at("decay_ps").number(kDuration) * kPicosecond});
    total += fraction;
  }
  if (total >= 1) reader.at("tails").fail("tails whose fractions have a sum < 1");
  return response;
}

ResponseShape read_table(const JsonReader& reader) {
  TableResponse response;
  for (const JsonReader& time : reader.at("times_ps").elements(2)) {
    const double t = time.number(kTime) * kPicosecond;
    if (!response.times.empty() && t <= response.times.back()) {
      time.fail("a number > the one before it");
    }
    response.times.push_back(t);
  }
  const JsonReader values = reader.at("values");
  for (const JsonReader& value :
       values.elements_exactly(response.times.size(), "numbers, as many as times_ps")) {
    response.values.push_back(value.number(NumberRange::between(0, 1e30)));
  }
  if (std::all_of(response.values.begin(), response.values.end(),
                  [](double v) { return v == 0; })) {
    values.fail("at least one number > 0");
  }
  return response;
}

ResponseShape read_response(const JsonReader& reader) {
  if (!reader.is_object()) reader.fail("an object with \"type\"");
  const std::string type =
      reader.at("type").deciding_word({"gaussian", "box_gaussian", "exponential_tail", "table"});
  const auto duration = [&](const char* key) {
    return reader.at(key).number(kDuration) * kPicosecond;
  };
  if (type == "gaussian") {
    reader.allow_only({"type", "fwhm_ps"});
    return GaussianResponse{duration("fwhm_ps") / kGaussianFwhm};
  }
  if (type == "box_gaussian") {
    reader.allow_only({"type", "box_ps", "sigma_ps"});
    return BoxGaussianResponse{duration("box_ps"), duration("sigma_ps")};
  }
  if (type == "exponential_tail") {
    reader.allow_only({"type", "fwhm_ps", "tails"});
    return read_tails(reader);
  }
  reader.allow_only({"type", "times_ps", "values"});
  return read_table(reader);
}

void read_noise(const JsonReader& reader, Sensor& sensor) {
  if (!reader.present()) return;
  if (!reader.is_object()) reader.fail("an object with \"law\"");
  if (reader.at("law").deciding_word_or("poisson", {"poisson", "gaussian"}) == "poisson") {
    reader.allow_only({"law", "dispersion"});
    sensor.noise = PoissonNoise{};
    sensor.dispersion = reader.at("dispersion").number_or(1, kPositive);
    return;
  }
  reader.allow_only({"law", "variance_floor", "variance_per_count", "censored_at_zero"});
  GaussianNoise noise;
  const JsonReader floor = reader.at("variance_floor");
  if (floor.is_array()) {
    const auto zones = static_cast<std::size_t>(sensor.zone_count());
    const auto floors = read_per_zone(floor, zones, 0, kPositive);
    for (std::size_t z = 0; z < zones; ++z) sensor.zones[z].variance_floor = floors[z];
    noise.variance_floor =
        std::accumulate(floors.begin(), floors.end(), 0.0) / static_cast<double>(zones);
  } else {
    noise.variance_floor = floor.number(kPositive);
  }
  noise.variance_per_count = reader.at("variance_per_count").number_or(0, kNotNegative);
  noise.censored_at_zero = reader.at("censored_at_zero").boolean_or(false);
  sensor.noise = noise;
}

/// Shares of light that zones spill into other zones: either one number for each of a zone's
/// neighbours above, below, left and right, or the whole matrix.
void read_crosstalk(const JsonReader& reader, Sensor& sensor) {
  if (!reader.present()) return;
  const auto zones = static_cast<std::size_t>(sensor.zone_count());
  sensor.crosstalk.assign(zones * zones, 0.0);
  if (reader.is_array()) {
    const auto rows = reader.elements_exactly(zones, "rows, one per receiving zone");
    for (std::size_t z = 0; z < zones; ++z) {
      const auto shares = rows[z].elements_exactly(zones, "numbers, one per zone that gives light");
      for (std::size_t from = 0; from < zones; ++from) {
        sensor.crosstalk[z * zones + from] = shares[from].number(kShare);
      }
    }
    return;
  }
  const double share = reader.number(NumberRange::between(0, 0.25));
  for (int row = 0; row < sensor.rows; ++row) {
    for (int column = 0; column < sensor.columns; ++column) {
      const auto from = static_cast<std::size_t>(row * sensor.columns + column);
      double kept = 1;
      const auto spill = [&](int r, int c) {
        if (r < 0 || r >= sensor.rows || c < 0 || c >= sensor.columns) return;
        sensor.crosstalk[static_cast<std::size_t>(r * sensor.columns + c) * zones + from] = share;
        kept -= share;
      };
      spill(row - 1, column);
      spill(row + 1, column);
      spill(row, column - 1);
      spill(row, column + 1);
      sensor.crosstalk[from * zones + from] = kept;
    }
  }
}

/// Smallest rectangle of directions around all zones. Zones that are relay points have no
/// rectangle, and get a default cone.
FieldOfIllumination around_zones(const std::vector<Zone>& zones) {
  if (!std::holds_alternative<AngularRectangle>(zones.front().footprint)) return AngularCone{};
  AngularRectangle all = std::get<AngularRectangle>(zones.front().footprint);
  for (const Zone& zone : zones) {
    const auto& r = std::get<AngularRectangle>(zone.footprint);
    all = {std::min(all.left, r.left), std::max(all.right, r.right), std::min(all.top, r.top),
           std::max(all.bottom, r.bottom)};
  }
  return all;
}

FieldOfIllumination read_field(const JsonReader& reader) {
  reader.allow_only(
      {"cone_half_angle_deg", "fov_deg", "left_deg", "right_deg", "top_deg", "bottom_deg"});
  const std::string_view way =
      reader.exactly_one_of({"cone_half_angle_deg", "fov_deg", "left_deg"});
  if (way == "left_deg") {
    return read_rectangle(reader, "left_deg", "right_deg", "top_deg", "bottom_deg");
  }
  for (const char* edge : {"right_deg", "top_deg", "bottom_deg"}) {
    reader.exclude(edge, "no edge beside \"" + std::string(way) + "\"");
  }
  if (way == "fov_deg") return read_field_of_view(reader.at("fov_deg"));
  return AngularCone{reader.at("cone_half_angle_deg").number(kHalfAngle) * kDegree};
}

void read_illumination(const JsonReader& reader, Sensor& sensor) {
  sensor.field = around_zones(sensor.zones);
  if (!reader.present()) return;
  reader.allow_only({"mode", "field", "radiant_intensity_w_per_sr", "offset_m"});
  const bool flash = reader.at("mode").word_or("flash", {"flash", "confocal"}) == "flash";
  sensor.illumination = flash ? Illumination::flash : Illumination::confocal;
  if (reader.has("field")) sensor.field = read_field(reader.at("field"));
  sensor.radiant_intensity = reader.at("radiant_intensity_w_per_sr").number_or(1, kPositive);
  if (reader.has("offset_m")) {
    sensor.light_offset = reader.at("offset_m").vector(kLightOffset);
  }
}

/// All quantities that the counts depend on. Required fields have no typical value.
Link read_link(const JsonReader& reader) {
  if (!reader.is_object()) reader.fail("an object with \"pulse_energy_nj\"");
  reader.allow_only({"pulse_energy_nj", "repetition_rate_hz", "exposure_s", "wavelength_nm",
                     "aperture_mm", "transmission", "detection_efficiency", "filter_width_nm",
                     "ambient_illuminance_lux", "dark_rate_hz", "detectors_per_zone"});
  const auto positive = [&](const char* key, double most) {
    return reader.at(key).number({.lower = 0, .upper = most, .above_lower = true});
  };
  const NumberRange share{.lower = 0, .upper = 1, .above_lower = true};
  Link link;
  link.pulse_energy = positive("pulse_energy_nj", 1e12) * 1e-9;
  link.repetition_rate = positive("repetition_rate_hz", 1e12);
  link.exposure = positive("exposure_s", 1e6);
  link.wavelength = reader.at("wavelength_nm").number(NumberRange::between(200, 3000)) * 1e-9;
  link.aperture = positive("aperture_mm", 1e4) * 1e-3;
  link.transmission = reader.at("transmission").number_or(1, share);
  link.detection_efficiency = reader.at("detection_efficiency").number(share);
  link.filter_width = positive("filter_width_nm", 1000) * 1e-9;
  link.ambient_illuminance =
      reader.at("ambient_illuminance_lux").number_or(0, NumberRange::between(0, 2e5));
  link.dark_rate = reader.at("dark_rate_hz").number_or(0, NumberRange::between(0, 1e12));
  link.detectors =
      reader.has("detectors_per_zone") ? reader.at("detectors_per_zone").integer(1, 1'000'000) : 1;
  return link;
}

/// Reads the link. It replaces gain and radiant intensity, so neither may be given beside it.
void read_link_of(const JsonReader& reader, Sensor& sensor) {
  if (!reader.decided_by("link")) return;
  const JsonReader link = reader.at("link");
  sensor.link = read_link(link);
  reader.exclude("gain", "no gain beside \"link\", which states it");
  const JsonReader intensity = reader.has("illumination")
                                   ? reader.at("illumination").at("radiant_intensity_w_per_sr")
                                   : reader.at("illumination");
  if (intensity.present()) intensity.fail("no radiant intensity beside \"link\"");
  if (!std::holds_alternative<AngularRectangle>(sensor.zones.front().footprint)) {
    link.fail("no link, because zones are points whose size is not known");
  }
}

void read_time_axis(const JsonReader& reader, Sensor& sensor) {
  sensor.bins = reader.at("bins").integer(1, kMaxBins);
  sensor.bin_width = reader.at("bin_width_ps").number(kDuration) * kPicosecond;
  if (const JsonReader wrap = reader.at("wrap_bins"); wrap.present() && !wrap.is_array()) {
    sensor.wrap_bins = wrap.integer(0, sensor.bins);
  }
  reader.attempt([&] {
    const std::size_t before = reader.noted();
    ResponseShape shape = read_response(reader.at("impulse_response"));
    if (reader.noted() == before) sensor.response = ImpulseResponse(std::move(shape));
  });
}

void read_detector(const JsonReader& reader, Sensor& sensor) {
  const JsonReader cycles = reader.at("pile_up_cycles");
  sensor.pile_up_cycles = cycles.number_or(0, kPileUpCycles);
  if (sensor.pile_up_cycles > 0 && !sensor.noise.counts_photons()) {
    cycles.fail(std::string("pile-up beside ") + sensor.noise.name() + " noise",
                "pile-up of counted photons (\"poisson\")");
  }
  sensor.saturation = reader.at("saturation").number_or(0, kPositive);
  read_crosstalk(reader.at("crosstalk"), sensor);
}

Sensor read_explicit(const JsonReader& reader) {
  reader.allow_only({"name",
                     "description",
                     "preset",
                     "rows",
                     "columns",
                     "fov_deg",
                     "zones",
                     "zone_columns_deg",
                     "zone_rows_deg",
                     "bins",
                     "bin_width_ps",
                     "time_zero_ps",
                     "gain",
                     "impulse_response",
                     "wrap_bins",
                     "valid_bins",
                     "dead_zones",
                     "noise",
                     "illumination",
                     "path_origin",
                     "link",
                     "pile_up_cycles",
                     "saturation",
                     "crosstalk",
                     "background_counts"});
  Sensor sensor;
  sensor.name = reader.at("name").text_or("custom");
  reader.at("description").text_or("");
  sensor.rows = reader.at("rows").integer(1, kMaxZonesPerSide);
  sensor.columns = reader.at("columns").integer(1, kMaxZonesPerSide);
  if (sensor.zone_count() > kMaxZones) {
    reader.at("rows").fail(std::to_string(sensor.zone_count()) + " zones (rows * columns)",
                           "at most " + std::to_string(kMaxZones));
  }
  read_time_axis(reader, sensor);
  if (sensor.zone_count() > kMaxCounts / sensor.bins) {
    reader.at("bins").fail(
        std::to_string(sensor.zone_count()) + " zones of " + std::to_string(sensor.bins) + " bins",
        "at most " + std::to_string(kMaxCounts) + " bins together");
  }
  reader.attempt([&] { read_zones(reader, sensor); });
  reader.attempt([&] { read_noise(reader.at("noise"), sensor); });
  reader.attempt([&] { read_background(reader.at("background_counts"), sensor); });
  reader.attempt([&] { read_detector(reader, sensor); });
  reader.attempt([&] { read_illumination(reader.at("illumination"), sensor); });
  reader.attempt([&] {
    const bool relay = reader.at("path_origin").word_or("sensor", {"sensor", "relay"}) == "relay";
    sensor.path_origin = relay ? PathOrigin::relay : PathOrigin::sensor;
  });
  reader.attempt([&] { read_link_of(reader, sensor); });
  return sensor;
}

}  // namespace

Sensor read_sensor(const JsonReader& reader) {
  if (!reader.is_object()) reader.fail("an object with \"preset\" or an explicit sensor");
  if (!reader.decided_by("preset")) return read_explicit(reader);
  const Json merged = merge_preset(reader);
  return read_explicit(reader.with_value(merged));
}

nlohmann::ordered_json noise_json(const Sensor& sensor) {
  return sensor.noise.visit(
      overloaded{[&](const PoissonNoise&) -> Json {
                   return {{"law", "poisson"}, {"dispersion", sensor.dispersion}};
                 },
                 [&](const GaussianNoise& noise) -> Json {
                   Json floor = noise.variance_floor;
                   if (sensor.zones_have_noise_floors()) {
                     floor = Json::array();
                     for (int z = 0; z < sensor.zone_count(); ++z) {
                       floor.push_back(sensor.noise_of(z).stated_line()->floor);
                     }
                   }
                   return {{"law", "gaussian"},
                           {"variance_floor", std::move(floor)},
                           {"variance_per_count", noise.variance_per_count},
                           {"censored_at_zero", noise.censored_at_zero}};
                 }});
}

}  // namespace blindcorner
