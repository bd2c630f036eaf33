// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/ros_map.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "io/file_bytes.h"
#include "io/grey_image.h"

namespace blindcorner {
namespace {

constexpr std::array<const char*, 3> kModeNames{"trinary", "scale", "raw"};

/// Grey of unknown and of free cells in a trinary image (map_saver).
constexpr int kUnknownGrey = 205, kFreeGrey = 254;

// --- Pixels and cells
// -----------------------------------------------------------------------------

/// Value of the cell that a pixel stands for. `shade` is the mean of the colour channels, 0..1.
std::int8_t cell_of(double shade, std::optional<double> alpha, const RosMapOptions& rules) {
  if (rules.mode == MapMode::raw) {
    const double value = std::round(shade * 255);
    return value <= RosMap::kOccupied ? static_cast<std::int8_t>(value) : RosMap::kUnknown;
  }
  // map_server counts alpha as a fourth channel here, and has done so from the beginning.
  if (rules.mode == MapMode::trinary && alpha) shade = (3 * shade + *alpha) / 4;
  if (rules.mode == MapMode::scale && alpha && *alpha < 1) return RosMap::kUnknown;
  const double occupied = rules.negate ? shade : 1 - shade;
  if (occupied > rules.occupied_thresh) return RosMap::kOccupied;
  if (occupied < rules.free_thresh) return RosMap::kFree;
  if (rules.mode == MapMode::trinary) return RosMap::kUnknown;
  const double share = (occupied - rules.free_thresh) / (rules.occupied_thresh - rules.free_thresh);
  return static_cast<std::int8_t>(std::rint(100 * share));
}

/// The first of the candidate greys, or of their neighbours, that cell_of() reads as `cell`.
std::uint8_t grey_that_says(std::int8_t cell, std::initializer_list<double> candidates,
                            const RosMapOptions& rules) {
  for (const double candidate : candidates) {
    for (const int off : {0, -1, 1}) {
      const int dark = std::clamp(static_cast<int>(std::lround(candidate)) + off, 0, 255);
      const int grey = rules.negate && rules.mode != MapMode::raw ? 255 - dark : dark;
      if (cell_of(grey / 255.0, std::nullopt, rules) == cell)
        return static_cast<std::uint8_t>(grey);
    }
  }
  throw Error("RosMapOptions.occupied_thresh, free_thresh",
              "no grey between them says " + std::to_string(cell) +
                  "; accepted: thresholds farther apart (100 steps of 1/255 in mode scale)");
}

/// The cell as the mode can express it.
std::int8_t expressed(std::int8_t cell, const RosMapOptions& rules) {
  if (cell == RosMap::kUnknown || rules.mode != MapMode::trinary) return cell;
  if (cell <= std::rint(100 * rules.free_thresh)) return RosMap::kFree;
  return cell >= std::rint(100 * rules.occupied_thresh) ? RosMap::kOccupied : RosMap::kUnknown;
}

std::uint8_t grey_of(std::int8_t cell, const RosMapOptions& rules) {
  const std::int8_t value = expressed(cell, rules);
  if (rules.mode == MapMode::raw)
    return value == RosMap::kUnknown ? 255 : static_cast<std::uint8_t>(value);
  if (value == RosMap::kOccupied) return grey_that_says(value, {0.0}, rules);
  const double middle = 255 * (1 - (rules.free_thresh + rules.occupied_thresh) / 2);
  if (value == RosMap::kUnknown) {
    return rules.mode == MapMode::scale ? std::uint8_t{128}  // transparent, whatever its shade
                                        : grey_that_says(value, {kUnknownGrey, middle}, rules);
  }
  if (value == RosMap::kFree) return grey_that_says(value, {kFreeGrey, 255.0}, rules);
  const double share = value / 100.0;
  const double occupied = rules.free_thresh + share * (rules.occupied_thresh - rules.free_thresh);
  return grey_that_says(value, {255 * (1 - occupied)}, rules);
}

/// Index of the cell for pixel (column, row from the top). The rows of cells go up.
std::size_t cell_index(const GridGeometry& geometry, int column, int row_from_top) {
  return geometry.index({column, geometry.rows - 1 - row_from_top});
}

// --- The yaml file
// --------------------------------------------------------------------------------

/// One key of the yaml file.
class YamlField {
 public:
  YamlField(const YAML::Node& document, const std::string& file, const char* key)
      : node_(document[key]), file_(file), key_(key) {}

  bool present() const { return node_.IsDefined() && !node_.IsNull(); }

  [[noreturn]] void fail(const std::string& accepted) const {
    constexpr std::size_t kLongestQuote = 60;
    std::string found = present() ? one_line(YAML::Dump(node_)) : "nothing";
    if (found.size() > kLongestQuote) found = found.substr(0, kLongestQuote - 3) + "...";
    throw Error(file_ + ": " + key_, "found " + found + ", accepted: " + accepted);
  }

  template <typename T>
  std::optional<T> as() const {
    if (!present()) return std::nullopt;
    try {
      return node_.as<T>();
    } catch (const YAML::Exception&) {
      return std::nullopt;
    }
  }

  double number(double lower, double upper, const std::string& accepted) const {
    const std::optional<double> value = as<double>();
    if (!value || !(*value >= lower && *value <= upper)) fail(accepted);
    return *value;
  }

 private:
  YAML::Node node_;
  std::string file_, key_;
};

YAML::Node parse(const std::string& path) {
  const std::string text = read_bytes(path);
  try {
    YAML::Node document = YAML::Load(text);
    if (document.IsMap()) return document;
  } catch (const YAML::Exception& error) {
    throw Error(path, "line " + std::to_string(error.mark.line + 1) +
                          ": is no yaml: " + one_line(error.msg));
  }
  throw Error(path, "found no keys, accepted: the yaml file of a ROS map");
}

MapMode mode_of(const YamlField& field) {
  if (!field.present()) return MapMode::trinary;
  std::string name = field.as<std::string>().value_or("");
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  const auto* const place = std::ranges::find(kModeNames, name);
  if (place == kModeNames.end()) field.fail("trinary, scale or raw");
  return static_cast<MapMode>(place - kModeNames.begin());
}

bool negate_of(const YamlField& field) {
  const std::optional<int> number = field.as<int>();
  if (number && (*number == 0 || *number == 1)) return *number == 1;
  const std::optional<bool> word = number ? std::nullopt : field.as<bool>();
  if (!word) field.fail("0 or 1");
  return *word;
}

/// Where the lower left corner of the image lies, and how far the image is turned about it, rad.
struct Origin {
  Eigen::Vector2d corner;
  double yaw = 0;
};

Origin origin_of(const YamlField& field) {
  const auto values = field.as<std::vector<double>>();
  if (!values || values->size() != 3 ||
      !std::ranges::all_of(*values, [](double v) { return std::isfinite(v); })) {
    field.fail("[x, y, yaw], m and rad");
  }
  return {{(*values)[0], (*values)[1]}, (*values)[2]};
}

/// The map turned counter-clockwise about its lower left corner, on cells along the axes. Each cell
/// takes the largest value at nine places within it, so that thin walls stay closed. Cells that the
/// image does not cover are unknown.
RosMap turned(const RosMap& map, double yaw, const YamlField& field) {
  const GridGeometry& from = map.geometry;
  const double size = from.cell_size;
  const Eigen::Rotation2Dd turn(yaw);
  Eigen::AlignedBox2d box;
  for (const int column : {0, from.columns}) {
    for (const int row : {0, from.rows}) {
      box.extend(from.origin + turn * Eigen::Vector2d(size * column, size * row));
    }
  }
  // A quarter turn maps cells exactly onto cells, except for rounding.
  constexpr double kRounding = 1e-6;
  RosMap out;
  out.geometry.cell_size = size;
  out.geometry.origin = box.min();
  const Eigen::Vector2d extent = box.sizes() / size;
  constexpr double kMostCells = 1 << 27;
  if (extent.prod() > kMostCells) field.fail("a map that has at most 2^27 cells when it is turned");
  out.geometry.columns = static_cast<int>(std::ceil(extent.x() - kRounding));
  out.geometry.rows = static_cast<int>(std::ceil(extent.y() - kRounding));
  out.cells.assign(out.geometry.cells(), RosMap::kUnknown);
  for (std::size_t i = 0; i < out.cells.size(); ++i) {
    const Eigen::Vector2d centre = out.geometry.center(out.geometry.cell(i));
    for (const double x : {-size / 3, 0.0, size / 3}) {
      for (const double y : {-size / 3, 0.0, size / 3}) {
        const Eigen::Vector2d place =
            turn.inverse() * (centre + Eigen::Vector2d(x, y) - from.origin) / size;
        const Cell cell{static_cast<int>(std::floor(place.x())),
                        static_cast<int>(std::floor(place.y()))};
        if (from.contains(cell)) out.cells[i] = std::max(out.cells[i], map.cells[from.index(cell)]);
      }
    }
  }
  return out;
}

/// The shortest text that reads as the same number.
std::string text_of(double value) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), result.ptr};
}

std::string yaml_text(const std::string& image, const GridGeometry& geometry,
                      const RosMapOptions& options) {
  YAML::Emitter name;  // quotes what needs it
  name << image;
  return "image: " + std::string(name.c_str()) +
         "\nmode: " + kModeNames[static_cast<std::size_t>(options.mode)] +
         "\nresolution: " + text_of(geometry.cell_size) + "\norigin: [" +
         text_of(geometry.origin.x()) + ", " + text_of(geometry.origin.y()) +
         ", 0]\nnegate: " + (options.negate ? "1" : "0") +
         "\noccupied_thresh: " + text_of(options.occupied_thresh) +
         "\nfree_thresh: " + text_of(options.free_thresh) + "\n";
}

}  // namespace

void RosMapOptions::validate() const {
  const auto refuse = [](const char* field, double found, const char* accepted) {
    throw Error("RosMapOptions." + std::string(field) + " = " + text_of(found) +
                "; accepted: " + accepted);
  };
  if (!(occupied_thresh > 0 && occupied_thresh < 1)) {
    refuse("occupied_thresh", occupied_thresh, "more than 0, less than 1");
  }
  if (!(free_thresh > 0 && free_thresh < occupied_thresh)) {
    refuse("free_thresh", free_thresh, "more than 0, less than occupied_thresh");
  }
}

RosMap read_ros_map(const std::string& yaml_path) {
  const YAML::Node document = parse(yaml_path);
  const auto field = [&](const char* key) { return YamlField(document, yaml_path, key); };
  RosMapOptions rules;
  rules.mode = mode_of(field("mode"));
  rules.negate = negate_of(field("negate"));
  rules.occupied_thresh = field("occupied_thresh").number(0, 1, "a number from 0 to 1");
  rules.free_thresh = field("free_thresh").number(0, 1, "a number from 0 to 1");
  if (rules.free_thresh >= rules.occupied_thresh) {
    field("free_thresh").fail("less than occupied_thresh, " + text_of(rules.occupied_thresh));
  }
  RosMap map;
  map.geometry.cell_size = field("resolution").number(1e-6, 1e6, "metres > 0");
  const Origin origin = origin_of(field("origin"));
  map.geometry.origin = origin.corner;
  const std::string name = field("image").as<std::string>().value_or("");
  if (name.empty()) field("image").fail("the name of a pgm, png or bmp file");

  // An absolute name stands for itself.
  const auto folder = std::filesystem::path(yaml_path).parent_path();
  const GreyImage image = read_grey_image((folder / name).string());
  map.geometry.columns = image.width;
  map.geometry.rows = image.height;
  map.cells.resize(image.pixels());
  std::size_t pixel = 0;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column, ++pixel) {
      const std::optional<double> alpha =
          image.alpha.empty() ? std::nullopt : std::optional(image.alpha[pixel]);
      map.cells[cell_index(map.geometry, column, row)] = cell_of(image.shade[pixel], alpha, rules);
    }
  }
  return origin.yaw == 0 ? map : turned(map, origin.yaw, field("origin"));
}

void write_ros_map(const std::string& yaml_path, const RosMap& map, const RosMapOptions& options) {
  // With another ending, the path may be the image's own, and the yaml file would overwrite the
  // image.
  const std::filesystem::path path(yaml_path);
  if (path.extension() != ".yaml" && path.extension() != ".yml") {
    throw Error(yaml_path, "accepted: a path that ends in .yaml or .yml");
  }
  options.validate();
  map.geometry.validate();
  if (map.cells.size() != map.geometry.cells()) {
    throw Error("RosMap.cells", std::to_string(map.cells.size()) +
                                    " values; accepted: " + std::to_string(map.geometry.cells()));
  }
  std::vector<std::uint8_t> grey, alpha;
  std::array<std::optional<std::uint8_t>, 102> known_greys;  // -1 to 100
  for (int row = 0; row < map.geometry.rows; ++row) {
    for (int column = 0; column < map.geometry.columns; ++column) {
      const std::int8_t cell = map.cells[cell_index(map.geometry, column, row)];
      if (cell < RosMap::kUnknown || cell > RosMap::kOccupied) {
        throw Error("RosMap.cells", "found " + std::to_string(cell) + ", accepted: -1 to 100");
      }
      auto& known = known_greys[static_cast<std::size_t>(cell + 1)];
      if (!known) known = grey_of(cell, options);
      grey.push_back(*known);
      if (options.mode == MapMode::scale) alpha.push_back(cell == RosMap::kUnknown ? 0 : 255);
    }
  }
  const bool png = options.png || options.mode == MapMode::scale;
  const auto image = std::filesystem::path(path).replace_extension(png ? ".png" : ".pgm");
  const int width = map.geometry.columns;
  const int height = map.geometry.rows;
  write_atomically(image.string(),
                   png ? png_bytes(width, height, grey, alpha) : pgm_bytes(width, height, grey));
  write_atomically(yaml_path, yaml_text(image.filename().string(), map.geometry, options));
}

RosMap ros_map(const OccupancyGrid& grid) {
  RosMap map{grid.geometry(), {}};
  for (std::size_t i = 0; i < map.geometry.cells(); ++i) {
    const Cell cell = map.geometry.cell(i);
    map.cells.push_back(grid.known(cell)
                            ? static_cast<std::int8_t>(std::lround(100 * grid.probability(cell)))
                            : RosMap::kUnknown);
  }
  return map;
}

OccupancyGrid occupancy_grid(const RosMap& map, const OccupancyOptions& options) {
  OccupancyGrid grid(map.geometry, options);
  for (std::size_t i = 0; i < map.cells.size(); ++i) {
    if (map.cells[i] == RosMap::kUnknown) continue;
    // Takes off the moving objects, which the grid assumes everywhere: 1 - p = (1 - static) (1 -
    // moving).
    const double occupied = 1 - (1 - map.cells[i] / 100.0) / (1 - options.moving_prior);
    const double probability = std::clamp(occupied, 1e-9, 1 - 1e-9);  // the grid bounds it tighter
    grid.add_static_evidence(map.geometry.cell(i),
                             std::log(probability / (1 - probability) * (1 - options.unseen_prior) /
                                      options.unseen_prior));
  }
  return grid;
}

}  // namespace blindcorner
