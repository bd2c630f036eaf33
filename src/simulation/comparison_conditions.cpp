// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/comparison_conditions.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/sensor_path.h"
#include "blindcorner/simulation/simulated_sensor.h"
#include "blindcorner/simulation/synthetic.h"
#include "forward/relay/ray_scene.h"
#include "forward/relay/relay.h"
#include "forward/support/comma_list.h"
#include "forward/support/parallel.h"
#include "simulation/scene_changes.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

/// How far an unknown of the grid goes beyond its range, as a share of the range.
constexpr double kBeyond = 0.25;
/// Unseen poses of the sensor are drawn within so many times the data set's spread.
constexpr double kFartherSensors = 2;
/// Places that are tried before a condition is given up.
constexpr int kAttempts = 2000;

/// Where object and sensor stand in one capture.
struct Stand {
  PoseVector object;
  Transform sensor;
};

/// A condition with the scene that its light follows, and with the poses in it.
struct Staged {
  Condition condition;
  std::optional<Scene> truth;  ///< empty: left out
  std::vector<Stand> stands{};
  int exposures = 1;
};

class Stage {
 public:
  Stage(const Scene& scene, const ComparisonOptions& options)
      : scene_(scene), options_(options), plan_(plan_dataset(scene, options.dataset)) {
    std::mt19937_64 random(options.seed);
    trained_ = trained_stands(random);
  }

  std::vector<Staged> all() const {
    std::vector<Staged> staged;
    staged.push_back(unchanged("trained positions",
                               "Places of the data set's grid seen from its poses of the sensor; "
                               "photons drawn anew.",
                               trained_));
    staged.push_back(between());
    staged.push_back(outside());
    staged.push_back(unseen_sensors());
    for (const SceneChange& change : scene_changes(scene_)) staged.push_back(changed(change));
    staged.push_back(fewer_photons());
    staged.push_back(second_object());
    return staged;
  }

 private:
  std::vector<Stand> trained_stands(std::mt19937_64& random) const {
    const std::size_t sensors = plan_.sensors.size();
    std::vector<std::size_t> order(plan_.objects.size() * sensors);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::shuffle(order, random);
    std::vector<Stand> stands;
    for (std::size_t i = 0; i < count(); ++i) {
      const std::size_t k = order[i % order.size()];
      stands.push_back({plan_.objects[k / sensors], plan_.sensors[k % sensors]});
    }
    return stands;
  }

  std::size_t count() const { return static_cast<std::size_t>(options_.captures); }

  /// Random numbers of one condition, whatever the others draw.
  std::mt19937_64 random_of(std::uint64_t condition) const {
    return std::mt19937_64(options_.seed + 7919 * condition);
  }

  Staged unchanged(std::string name, std::string description, std::vector<Stand> stands) const {
    return {{std::move(name), std::move(description), "", ""},
            scene_,
            std::move(stands),
            options_.dataset.exposures};
  }

  Transform sensor_of(std::size_t i) const { return plan_.sensors[i % plan_.sensors.size()]; }

  /// Sets x and y of the first object by a function of the unknown.
  template <class Value>
  void set_plane(PoseVector& pose, const Value& value) const {
    for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
      const Unknown& unknown = scene_.unknowns[i];
      if (unknown.component > Component::y) continue;
      pose[static_cast<Eigen::Index>(i)] = value(unknown);
    }
  }

  Staged between() const {
    std::mt19937_64 random = random_of(2);
    std::vector<Stand> stands;
    for (std::size_t i = 0; i < count(); ++i) {
      PoseVector pose = draw_pose(scene_, random);
      set_plane(pose, [&](const Unknown& unknown) {
        const int cells = std::max(1, plan_.side - 1);
        std::uniform_int_distribution<int> cell(0, cells - 1);
        return unknown.lower + unknown.range() * (cell(random) + 0.5) / cells;
      });
      stands.push_back({pose, sensor_of(i)});
    }
    return unchanged("positions between the grid",
                     "Middles of the grid's cells; other unknowns drawn from the prior.", stands);
  }

  Staged outside() const {
    Staged staged = unchanged(
        "positions outside of the grid",
        "x or y up to a quarter of its range beyond it, clear of the surfaces. The scene's ranges "
        "end where the grid does: the solver and the classical methods search within and cannot "
        "answer these places, as a prior that is wrong; a network may.",
        {});
    staged.condition.wrong = "the object stands outside of the ranges that the scene states";
    staged.truth = widened(scene_);
    std::mt19937_64 random = random_of(3);
    for (int attempt = 0; attempt < kAttempts && staged.stands.size() < count(); ++attempt) {
      PoseVector pose = draw_pose(scene_, random);
      bool beyond = false;
      set_plane(pose, [&](const Unknown& unknown) {
        const double margin = kBeyond * unknown.range();
        const double value = std::uniform_real_distribution<double>(unknown.lower - margin,
                                                                    unknown.upper + margin)(random);
        beyond = beyond || value < unknown.lower || value > unknown.upper;
        return value;
      });
      if (!beyond || !clear_of_surfaces(scene_, pose)) continue;
      staged.stands.push_back({pose, sensor_of(staged.stands.size())});
    }
    if (staged.stands.size() == count()) return staged;
    staged.truth.reset();
    staged.condition.left_out = "the surfaces leave no room outside of the ranges";
    return staged;
  }

  /// The scene with room for places outside of its ranges.
  static Scene widened(Scene scene) {
    for (Unknown& unknown : scene.unknowns) {
      if (unknown.component > Component::y) continue;
      const double margin = kBeyond * unknown.range();
      unknown.lower -= margin;
      unknown.upper += margin;
    }
    return scene;
  }

  Staged unseen_sensors() const {
    std::mt19937_64 random = random_of(4);
    std::vector<Stand> stands = trained_;
    for (Stand& stand : stands) stand.sensor = unseen_sensor(random);
    return unchanged("unseen sensor poses",
                     "The sensor's x, y and yaw drawn within twice the data set's spread, and its "
                     "pitch within the yaw's, a new pose for each capture.",
                     stands);
  }

  Transform unseen_sensor(std::mt19937_64& random) const {
    const double spread = kFartherSensors * plan_.sensor_spread;
    const double turn = kFartherSensors * options_.dataset.sensor_yaw_spread;
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int attempt = 0;; ++attempt) {
      Transform pose = scene_.T_world_sensor;
      pose.translation().x() += spread * unit(random);
      pose.translation().y() += spread * unit(random);
      const Eigen::AngleAxisd yaw(turn * unit(random), Vector3d::UnitZ());
      const Eigen::AngleAxisd pitch(turn * unit(random), Vector3d::UnitY());
      pose.linear() = yaw.toRotationMatrix() * pose.linear() * pitch.toRotationMatrix();
      try {
        seen_from(scene_, pose);
        return pose;
      } catch (const Error&) {
        if (attempt >= kAttempts) throw;
      }
    }
  }

  Staged changed(const SceneChange& change) const {
    Staged staged = unchanged(change.name, change.description, trained_);
    staged.condition.wrong = change.wrong;
    staged.condition.left_out = change.left_out;
    staged.truth = change.scene;
    return staged;
  }

  Staged fewer_photons() const {
    Staged staged = unchanged("a tenth of the photons", "", trained_);
    staged.exposures = std::max(1, options_.dataset.exposures / 10);
    staged.condition.description = "Captures of " + std::to_string(staged.exposures) +
                                   " exposures instead of " +
                                   std::to_string(options_.dataset.exposures) + ".";
    if (staged.exposures < options_.dataset.exposures) return staged;
    staged.truth.reset();
    staged.condition.left_out = "captures are single exposures already";
    return staged;
  }

  Staged second_object() const {
    Staged staged = changed(second_object_change(scene_));
    std::mt19937_64 random = random_of(5);
    for (Stand& stand : staged.stands) {
      stand.object = with_second_pose(scene_, stand.object, random);
    }
    return staged;
  }

  const Scene& scene_;
  const ComparisonOptions& options_;
  DatasetPlan plan_;
  std::vector<Stand> trained_;
};

/// Renders the captures of a condition. Their truth has the names of the scene that methods are
/// told.
void render(const Scene& told, Staged& staged, std::uint64_t seed,
            const std::function<void()>& advance) {
  if (!staged.truth) return;
  const SimulatedSensor sensor(*staged.truth);
  const std::vector<std::string> names = unknown_names(told);
  std::vector<Capture>& captures = staged.condition.captures;
  captures.resize(staged.stands.size());
  parallel_for(std::size_t{0}, captures.size(), [&](std::size_t i) {
    const Stand& stand = staged.stands[i];
    // Photons of neighbouring captures come from seeds far apart.
    captures[i] =
        sensor.sense(stand.sensor, stand.object, seed + 1'000'003 * (i + 1), staged.exposures)
            .capture;
    captures[i].truth.clear();
    for (std::size_t k = 0; k < names.size(); ++k) {
      captures[i].truth[names[k]] = stand.object[static_cast<Eigen::Index>(k)];
    }
    captures[i].source = staged.condition.name;
    captures[i].index = static_cast<int>(i);
    if (advance) advance();
  });
}

}  // namespace

void ComparisonOptions::validate() const {
  if (captures < 2) {
    throw Error("captures", "found " + std::to_string(captures) + ", accepted: >= 2");
  }
  for (const std::string& name : conditions) {
    if (condition_named(name) == name) continue;
    throw Error("conditions", "found \"" + name + "\", accepted: " + condition_named(name));
  }
  dataset.validate();
}

std::vector<std::string> condition_names() {
  return {"trained positions",
          "positions between the grid",
          "positions outside of the grid",
          "unseen sensor poses",
          "another albedo",
          "another size",
          "another material",
          "ten times the background",
          "time zero off by half a bin",
          "relay tilted by 2 degrees",
          "a tenth of the photons",
          "second object"};
}

std::string condition_named(const std::string& word) {
  const std::vector<std::string> known = condition_names();
  if (std::ranges::count(known, word) > 0) return word;
  std::vector<std::string> meant;
  for (const std::string& name : known) {
    if (!word.empty() && name.starts_with(word)) meant.push_back(name);
  }
  if (meant.size() == 1) return meant.front();
  throw Error("conditions",
              "found \"" + word + "\", accepted: " + comma_list(meant.empty() ? known : meant));
}

bool clear_of_surfaces(const Scene& scene, const PoseVector& pose) {
  constexpr double kTouch = 1e-3;
  const Placement placement = placements_at(scene, pose).front();
  const HiddenObject& object = scene.hidden;
  const Vector3d center = object_to_world(object.shape, object.anchor, placement).translation();
  const Vector3d half = placement.size * half_extents(object.shape, placement.yaw);
  return std::ranges::all_of(scene.surfaces, [&](const Surface& surface) {
    const Transform T_surface_world = surface.T_world_surface.inverse();
    const Vector3d at = T_surface_world * center;
    // Half extents of the object's box along the surface's own axes.
    const Vector3d reach = T_surface_world.linear().cwiseAbs() * half;
    const Vector3d own = half_extents(surface.shape, 0.0);
    return ((at.cwiseAbs() - reach - own).array() >= -kTouch).any();
  });
}

std::vector<Condition> render_conditions(const Scene& scene, const ComparisonOptions& options,
                                         const std::function<void()>& advance) {
  options.validate();
  if (object_count(scene) > 1) {
    throw Error(scene_place(scene) + ": hidden", "found " + std::to_string(object_count(scene)) +
                                                     " objects, accepted by a comparison: one");
  }
  std::vector<Condition> conditions;
  std::uint64_t seed = options.seed;
  for (Staged& staged : Stage(scene, options).all()) {
    seed += 1'000'000'007;  // also for conditions that are not wanted, so that they change no other
    const std::vector<std::string>& wanted = options.conditions;
    const bool is_wanted =
        wanted.empty() || std::ranges::find(wanted, staged.condition.name) != wanted.end();
    if (!is_wanted) continue;
    render(scene, staged, seed, advance);
    conditions.push_back(std::move(staged.condition));
  }
  return conditions;
}

}  // namespace blindcorner
