// SPDX-License-Identifier: Apache-2.0
#include "live/illustrator.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/planner/grid/pose_spread.h"
#include "blindcorner/report/result_file.h"
#include "live/background_thread.h"
#include "report/html.h"
#include "report/page_data.h"

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

/// Time between two pictures of light and grid: as fast as an eye reads them.
constexpr auto kInterval = 200ms;
constexpr std::size_t kHistory = 600;
constexpr int kMaxZones = 64;
constexpr int kCellsAside = 60;

/// Bounds of an unknown of the first object; nothing where it is known.
std::optional<std::pair<double, double>> bounds_of(const Scene& scene, Component component) {
  for (const Unknown& unknown : scene.unknowns) {
    if (unknown.component == component) return std::pair(unknown.lower, unknown.upper);
  }
  return std::nullopt;
}

/// How far the objects reach from their positions, m.
double reach_of(const Scene& scene) {
  double reach = 0.05;
  for (int i = 0; i < object_count(scene); ++i) {
    const HiddenObject& object = hidden_object(scene, i);
    for (const auto& corner : footprint(object.shape, object.anchor, Placement{})) {
      reach = std::max(reach, corner.norm());
    }
  }
  return reach;
}

json grid_json(const GridGeometry& grid, const std::vector<double>& probabilities) {
  // Per cent of presence in each cell, which is finer than a colour shows.
  json cells = json::array();
  for (const double p : probabilities) cells.push_back(static_cast<int>(std::lround(100 * p)));
  return {{"columns", grid.columns},
          {"rows", grid.rows},
          {"cell_size_m", grid.cell_size},
          {"origin_m", {grid.origin.x(), grid.origin.y()}},
          {"occupied_percent", std::move(cells)}};
}

/// The part of an answer that the page's curve and trail need.
std::string history_entry(const Answer& answer) {
  const PoseMixture& posterior = answer.result.posterior;
  json pose = nullptr;
  if (!posterior.modes.empty()) {
    const PoseVector& heaviest = posterior.modes.front().pose;
    pose = std::vector<double>(heaviest.begin(), heaviest.end());
  }
  return dump_json({{"time_s", answer.time},
                    {"presence_probability", number_or_null(posterior.presence_probability)},
                    {"pose", std::move(pose)}},
                   -1);
}

}  // namespace

GridGeometry region_grid(const Scene& scene) {
  const HiddenObject& object = hidden_object(scene, 0);
  const Eigen::Vector3d at = object.placement.position;
  const auto x = bounds_of(scene, Component::x).value_or(std::pair(at.x(), at.x()));
  const auto y = bounds_of(scene, Component::y).value_or(std::pair(at.y(), at.y()));
  const double reach = reach_of(scene);
  const Eigen::Vector2d low(x.first - reach, y.first - reach);
  const Eigen::Vector2d size(x.second - x.first + 2 * reach, y.second - y.first + 2 * reach);
  GridGeometry grid;
  grid.cell_size = size.maxCoeff() / kCellsAside;
  grid.columns = std::max(1, static_cast<int>(std::ceil(size.x() / grid.cell_size - 1e-9)));
  grid.rows = std::max(1, static_cast<int>(std::ceil(size.y() / grid.cell_size - 1e-9)));
  grid.origin = low;
  return grid;
}

std::string live_page(const Scene& scene, const std::string& input) {
  const json data = {{"scene", page_scene(scene)},
                     {"view", page_view(scene)},
                     {"unknowns", unknown_names(scene)},
                     {"input", input}};
  const std::string name = scene.name.empty() ? "scene" : scene.name;
  return script_page(name + " live", "", dump_json(data, -1),
                     {.styles = {"live_page.css"},
                      .libraries = {"d3.js", "poses.js", "scene_parts.js"},
                      .script = "live_page.js"});
}

Illustrator::Illustrator(EventHub& hub, const Tally& tally)
    : hub_(hub), tally_(tally), thread_([this] { run(); }) {}

Illustrator::~Illustrator() {
  end_ = true;
  newest_.close();
  thread_.join();
}

void Illustrator::show(std::shared_ptr<const Answer> answer) {
  rate_ = answer->rate;
  {
    std::string entry = history_entry(*answer);
    const std::lock_guard lock(mutex_);
    history_.push_back(std::move(entry));
    if (history_.size() > kHistory) history_.pop_front();
  }
  newest_.put(std::move(answer));
}

void Illustrator::tell(const std::string& state) {
  {
    const std::lock_guard lock(mutex_);
    state_ = state;
  }
  hub_.publish("status", status());
}

std::string Illustrator::greeting() const {
  std::string list;
  {
    const std::lock_guard lock(mutex_);
    for (const std::string& entry : history_) list += (list.empty() ? "" : ",") + entry;
  }
  return event_text("history", "[" + list + "]") + event_text("status", status());
}

std::string Illustrator::status() const {
  json status = {{"counts", tally_.all()}, {"answers_per_s", rate_.load()}};
  const std::lock_guard lock(mutex_);
  status["state"] = state_;
  return dump_json(status, -1);
}

void Illustrator::run() {
  give_way();
  while (!end_) {
    const auto answer = newest_.take(kInterval);
    if (!answer || hub_.clients() == 0) continue;
    const auto begun = Clock::now();
    try {
      draw(**answer);
    } catch (const std::exception&) {  // one picture is missing; the answer was given
    }
    hub_.publish("status", status());
    std::this_thread::sleep_until(begun + kInterval);
  }
}

void Illustrator::draw(const Answer& answer) {
  const Scene& scene = *answer.scene;
  json light = {{"frame", answer.frame}, {"histograms", nullptr}, {"grid", nullptr}};
  if (!answer.result.histograms.empty()) {
    light["histograms"] = page_histograms(scene, answer.result.histograms.front(), kMaxZones);
  }
  if (answer.result.error.empty()) {
    const GridGeometry grid = region_grid(scene);
    light["grid"] = grid_json(grid, PoseSpread(scene, grid).occupied(answer.result.posterior));
  }
  hub_.publish("light", dump_json(light, -1));
}

}  // namespace blindcorner::live
