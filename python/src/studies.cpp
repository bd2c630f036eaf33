// SPDX-License-Identifier: Apache-2.0
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <nlohmann/json.hpp>

#include "arrays.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/link_budget.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/bound/error_bound.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/inverse/hints.h"
#include "blindcorner/report/instrument_file.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/simulation/synthetic.h"
#include "interrupt.h"
#include "module.h"

namespace blindcorner::python {
namespace {

using nlohmann::json;

// --- Calibration ---------------------------------------------------------------------------------

std::string calibrate_text(const ScenePointer& scene, const Input<3>& counts,
                           const std::string& metadata, const std::vector<std::string>& sources,
                           const std::vector<int>& indices, bool no_object, bool assignments,
                           bool wraps, bool background, bool variance_scale, nb::object progress) {
  CalibrationOptions options;
  options.permutations = assignments;
  options.wraps = wraps;
  options.background = background;
  options.variance_scale = variance_scale;
  const auto file =
      std::make_shared<const CaptureFile>(captures_of({counts, metadata, sources, indices}));
  const StopFlag flag;
  const Callback callback(std::move(progress));
  return interruptible(
      [=] {
        const auto advance = [&](double share) {
          flag.check();
          if (callback) callback(share);
        };
        const Calibration found =
            calibrate(scene->scene, file->captures, options, no_object, advance);
        return instrument_json(scene->scene, found).dump(1) + "\n";
      },
      [flag] { flag.ask(); });
}

// --- Explanation ---------------------------------------------------------------------------------

const char* kernel_word(Kernel kernel) {
  switch (kernel) {
    case Kernel::lambertian:
      return "lambertian";
    case Kernel::brdf_pairs:
      return "brdf_pairs";
    case Kernel::retro_single:
      return "retro_single";
    case Kernel::retro_pairs:
      return "retro_pairs";
  }
  return "";
}

json terms_json(const TransportPlan& plan) {
  json terms = json::array();
  for (const PlanDecision& decision : plan.decisions) {
    terms.push_back({{"name", decision.name},
                     {"used", decision.used},
                     {"reason", decision.reason},
                     {"bound", number_or_null(decision.bound)}});
  }
  return terms;
}

json zones_json(const std::vector<ZoneBudget>& zones) {
  json list = json::array();
  for (const ZoneBudget& zone : zones) {
    list.push_back({{"direct", number_or_null(zone.direct)},
                    {"three_bounce", number_or_null(zone.three_bounce)},
                    {"peak", number_or_null(zone.peak)},
                    {"gate_bins", number_or_null(zone.gate_bins)},
                    {"background_per_bin", number_or_null(zone.background)},
                    {"signal_to_noise", number_or_null(zone.signal_to_noise)}});
  }
  return list;
}

SensorPlacement checked_placement(const Scene& scene) {
  SensorPlacement sensor = sensor_placement(scene);
  for (const Eigen::Vector3d& point : sensor.relay_points) {
    if (point.allFinite()) continue;
    throw Error(scene_place(scene) + ": sensor.zones",
                "found \"from_capture\", accepted: a scene that says where its zones look");
  }
  return sensor;
}

std::string explanation(const Scene& scene, const PoseVector& pose, double tolerance) {
  const SensorPlacement sensor = checked_placement(scene);
  FastModelOptions options;
  options.tolerance = tolerance;
  const auto model = make_fast_model(scene, sensor, options);
  const std::vector<ZoneBudget> zones = link_budget(scene, *model, pose);
  TransportPlan plan = model->plan();
  decide_pile_up(plan, scene, zones);
  const std::vector<Placement> placements = placements_at(scene, pose);
  json document = {{"kernel", kernel_word(plan.kernel)},
                   {"terms", terms_json(plan)},
                   {"zones", zones_json(zones)},
                   {"hints", scene_hints(scene, sensor)},
                   {"pose_hints", placement_hints(scene, sensor, placements)}};
  if (const auto size = model->size()) {
    document["sampling"] = {{"lit_points", size->lit_points},
                            {"seen_points", size->seen_points},
                            {"object_points", size->object_points}};
  }
  const DistanceExponents e = distance_exponents(scene, sensor, placements.front());
  document["exponents"] = {{"direct_relay", number_or_null(e.direct_relay)},
                           {"three_bounce_relay", number_or_null(e.three_bounce_relay)},
                           {"three_bounce_object", number_or_null(e.three_bounce_object)}};
  return dump_json(document);
}

std::string explain(const ScenePointer& scene, const PoseVector& pose, double tolerance) {
  return interruptible([=] { return explanation(scene->scene, pose, tolerance); }, [] {});
}

// --- Bound ---------------------------------------------------------------------------------------

struct BoundState {
  ScenePointer scene;
  std::unique_ptr<ErrorBound> bound;
  BoundOptions options;
};

std::shared_ptr<BoundState> make_bound(const ScenePointer& scene, double photons,
                                       std::optional<double> exposures,
                                       std::optional<double> ambient, int test_poses, bool prior,
                                       double tolerance, std::uint64_t seed, nb::object progress) {
  BoundOptions options;
  options.test_poses = test_poses;
  options.prior = prior;
  options.model_tolerance = tolerance;
  options.seed = seed;
  options.validate();
  const StopFlag flag;
  const Callback callback(std::move(progress));
  return interruptible(
      [=] {
        const Scene& own = scene->scene;
        const SensorPlacement sensor = checked_placement(own);
        auto state = std::make_shared<BoundState>(BoundState{scene, nullptr, options});
        Exposure exposure = own_exposure(own);
        if (photons > 0) {
          FastModelOptions fast;
          fast.tolerance = tolerance;
          exposure = exposure_for(own, *make_fast_model(own, sensor, fast), photons, seed);
        }
        state->options.exposures = exposures.value_or(exposure.exposures);
        state->options.ambient = ambient.value_or(exposure.ambient);
        state->options.validate();
        std::atomic<int> done{0};
        state->bound = std::make_unique<ErrorBound>(own, sensor, state->options, [&] {
          flag.check();
          if (callback) callback(++done, test_poses);
        });
        return state;
      },
      [flag] { flag.ask(); });
}

nb::dict bound_at(const std::shared_ptr<BoundState>& state, const PoseVector& pose,
                  double brightness) {
  const auto expected = static_cast<Eigen::Index>(state->scene->scene.unknowns.size());
  if (pose.size() != expected) {
    throw Error("pose", "found " + std::to_string(pose.size()) + " numbers, accepted: " +
                            std::to_string(expected) + ", one for each unknown");
  }
  const PoseBound found = interruptible([=] { return state->bound->at(pose, brightness); }, [] {});
  nb::dict entry;
  entry["pose"] = found.pose;
  entry["photons"] = found.photons;
  entry["cramer_rao"] = found.cramer_rao;
  entry["with_prior"] = found.with_prior;
  entry["ambiguity"] = found.ambiguity;
  entry["position_error_m"] = found.position_error;
  entry["ambiguous"] = found.ambiguous;
  entry["detection_probability"] = found.detection_probability;
  return entry;
}

}  // namespace

void add_studies(nb::module_& m) {
  m.def("calibrate", &calibrate_text, nb::arg("scene"), nb::arg("counts"), nb::arg("metadata"),
        nb::arg("sources"), nb::arg("indices"), nb::arg("no_object"), nb::arg("assignments"),
        nb::arg("wraps"), nb::arg("background"), nb::arg("variance_scale"),
        nb::arg("progress").none(), "Text of the instrument file.");
  m.def("explain", &explain, nb::arg("scene"), nb::arg("pose"), nb::arg("tolerance"),
        "JSON of what the forward model does for a scene.");
  nb::class_<BoundState>(m, "Bound", "Bounds of one scene.")
      .def_static("make", &make_bound, nb::arg("scene"), nb::arg("photons"),
                  nb::arg("exposures").none(), nb::arg("ambient").none(), nb::arg("test_poses"),
                  nb::arg("prior"), nb::arg("tolerance"), nb::arg("seed"),
                  nb::arg("progress").none(), "What belongs to the scene, computed once.")
      .def_prop_ro("exposures", [](const BoundState& s) { return s.options.exposures; })
      .def_prop_ro("ambient", [](const BoundState& s) { return s.options.ambient; })
      .def_prop_ro("prior_error_m", [](const BoundState& s) { return s.bound->prior_error(); })
      .def("at", &bound_at, nb::arg("pose"), nb::arg("brightness"), "The bounds at one pose.");
}

}  // namespace blindcorner::python
