// SPDX-License-Identifier: Apache-2.0
/// `blindcorner explain SCENE`: what the forward model does for a scene and what it leaves out, and
/// how many photons to expect.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/link_budget.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/hints.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/simulation/synthetic.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/cpu_clock.h"
#include "commands/notice.h"
#include "commands/pose_text.h"
#include "commands/printout.h"
#include "forward/support/quantile.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {
namespace {

using Json = nlohmann::ordered_json;

/// Processor time that the measurement of one term may take, s; one pose is always measured.
constexpr double kTermSeconds = 0.3;
/// Poses whose peak is below this share of the brightest one's do not count: they are dark.
constexpr double kDark = 1e-3;
/// Expected counts below this are never seen at any exposure, and their exponents mean nothing.
constexpr double kNoPhoton = 1e-12;

struct ExplainArguments {
  std::string scene;
  std::string capture;
  std::string pose;
  double tolerance = kFirstTolerance;  ///< that of a fit's first models
  int poses = 12;
  Printout out;
  std::uint64_t seed = 1;
};

/// A model's light at as many of the first poses as the time allowed, and its processor time.
struct Measured {
  std::vector<HistogramCube> light;
  double microseconds = 0;  ///< median of an evaluation
};

Measured measure(const ForwardModel& model, const std::vector<PoseVector>& poses) {
  Measured measured;
  std::vector<double> times;
  HistogramCube warm;
  model.three_bounce(poses.front(), warm);
  const double start = cpu_seconds();
  for (const PoseVector& pose : poses) {
    measured.light.emplace_back();
    const double before = cpu_seconds();
    model.three_bounce(pose, measured.light.back());
    times.push_back(1e6 * (cpu_seconds() - before));
    if (cpu_seconds() - start > kTermSeconds) break;
  }
  measured.microseconds = median(times);
  return measured;
}

double peak(const HistogramCube& cube) {
  return *std::max_element(cube.values.begin(), cube.values.end());
}

/// Largest change of a bin, as a share of the pose's peak.
double largest_change(const Measured& plain, const Measured& switched) {
  const std::size_t count = std::min(plain.light.size(), switched.light.size());
  double brightest = 0;
  for (std::size_t i = 0; i < count; ++i) brightest = std::max(brightest, peak(plain.light[i]));
  double largest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double top = peak(plain.light[i]);
    if (top <= kDark * brightest) continue;
    for (std::size_t k = 0; k < plain.light[i].values.size(); ++k) {
      largest =
          std::max(largest, std::abs(switched.light[i].values[k] - plain.light[i].values[k]) / top);
    }
  }
  return largest;
}

bool can_be_switched(const PlanDecision& decision) {
  return decision.term != Term::object_in_view && decision.term != Term::direct_return &&
         decision.term != Term::pile_up && decision.term != Term::saturation;
}

std::string share_text(double share) {
  if (share == 0) return "none";
  if (!std::isfinite(share)) return "unknown";
  char text[32];
  std::snprintf(text, sizeof text, "%.2g %%", 100 * share);
  return text;
}

/// A scene's model, and what it was made of.
struct Planned {
  std::shared_ptr<const SceneTransport> transport;
  int objects;
  SensorPlacement sensor;
  FastModelOptions options;  ///< with the sampling that the model chose, for models without a term
  std::unique_ptr<ForwardModel> model;
  TransportPlan plan;
};

/// The effect of switching a term against the plan.
struct TermCost {
  std::optional<double> change;  ///< largest of a bin, as a share of the pose's peak
  double microseconds = 0;       ///< an evaluation with the term switched
};

TermCost cost_of(const PlanDecision& decision, const Planned& planned, const Measured& plain,
                 const std::vector<PoseVector>& poses) {
  if (!can_be_switched(decision)) return {};
  const bool needed = decision.term == Term::patch_pairs || decision.term == Term::dim_patches;
  if (needed && planned.plan.kernel == Kernel::brdf_pairs) return {};
  FastModelOptions switched = planned.options;
  // A lobe's pairs have a sampling of their own, which the model chooses. The model divides the
  // tolerance by the number of objects, but the pairs are compared at the whole tolerance.
  const bool lobe = planned.plan.kernel != Kernel::lambertian;
  if (decision.term == Term::patch_pairs && lobe) {
    switched.sampling_step.reset();
    switched.tolerance *= planned.objects;
  }
  (decision.used ? switched.overrides.off : switched.overrides.on) = {decision.term};
  const Measured other =
      measure(*make_fast_model(planned.transport, planned.sensor, switched), poses);
  return {largest_change(plain, other), other.microseconds};
}

/// A number that JSON can hold.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json plan_figures(const Planned& planned, const std::vector<PoseVector>& poses) {
  const Measured plain = measure(*planned.model, poses);
  Json json{{"tolerance", planned.options.tolerance},
            {"evaluation_us", plain.microseconds},
            {"terms", Json::array()}};
  for (const PlanDecision& decision : planned.plan.decisions) {
    const TermCost cost = cost_of(decision, planned, plain, poses);
    json["terms"].push_back(
        {{"name", decision.name},
         {"used", decision.used},
         {"reason", decision.reason},
         {"bound", decision.used ? Json(nullptr) : number(decision.bound)},
         {"measured", cost.change ? number(*cost.change) : Json(nullptr)},
         {"switched_us", cost.change ? Json(cost.microseconds) : Json(nullptr)}});
  }
  return json;
}

void print_plan(const Planned& planned, const std::vector<PoseVector>& poses) {
  const Measured plain = measure(*planned.model, poses);
  std::printf("\nTransport plan at a tolerance of %s of the peak: %.4g us an evaluation\n",
              share_text(planned.options.tolerance).c_str(), plain.microseconds);
  if (planned.options.tolerance == kFirstTolerance) {
    std::printf(
        "  This is the plan that fit begins with. Where the next better model moves the answer by "
        "a\n"
        "  noticeable part of its standard deviation, it goes on to 1 %%, 0.1 %% and 0.01 %%, or "
        "to\n"
        "  pairs of patches, ever finer, where the object is retroreflective.\n");
  }
  std::printf("  %-38s %-9s %10s %10s %12s\n", "term", "", "bound", "measured", "time");
  for (const PlanDecision& decision : planned.plan.decisions) {
    std::string change = "-";
    char time[48] = "-";
    const TermCost other = cost_of(decision, planned, plain, poses);
    if (other.change) {
      change = share_text(*other.change);
      const double difference = std::abs(other.microseconds - plain.microseconds);
      const bool dearer = (other.microseconds > plain.microseconds) != decision.used;
      std::snprintf(time, sizeof time, "%s %.3g us",
                    dearer ? (decision.used ? "costs" : "saves") : "within", difference);
    }
    std::printf("  %-38s %-9s %10s %10s %12s\n      %s\n", decision.name.c_str(),
                decision.used ? "used" : "left out",
                decision.used ? "-" : share_text(decision.bound).c_str(), change.c_str(), time,
                decision.reason.c_str());
    std::fflush(stdout);  // a large scene takes seconds for each
  }
  std::printf(
      "  bound: most that leaving out may change a bin, as a share of the pose's peak (pile-up: "
      "of\n"
      "  the bin itself); measured: largest change at %zu poses when the term is switched against\n"
      "  the plan; time: what an evaluation costs or saves by it, or within what the two cannot "
      "be\n"
      "  told apart.\n",
      plain.light.size());
}

void print_zones(const Scene& scene, const std::vector<ZoneBudget>& zones) {
  std::printf("  %4s %12s %12s %12s %10s %14s %8s\n", "zone", "direct", "three-bounce",
              "brightest bin", "gate bins", "background/bin", "S/N");
  ZoneBudget all;
  double noise = 0;
  for (std::size_t z = 0; z < zones.size(); ++z) {
    const ZoneBudget& b = zones[z];
    if (scene.sensor.zones[z].dead) continue;
    all.direct += b.direct;
    all.three_bounce += b.three_bounce;
    noise += b.signal_to_noise * b.signal_to_noise;
    // With many zones, only those on the diagonal are printed.
    if (zones.size() > 16 && z % static_cast<std::size_t>(scene.sensor.columns + 1) != 0) continue;
    std::printf("  %4zu %12.4g %12.4g %12.4g %10.0f %14.4g %8.2g\n", z, b.direct, b.three_bounce,
                b.peak, b.gate_bins, b.background, b.signal_to_noise);
  }
  std::printf("  %4s %12.4g %12.4g %48s %8.2g\n", "all", all.direct, all.three_bounce, "",
              std::sqrt(noise));
}

Json zone_figures(const Scene& scene, const std::vector<ZoneBudget>& zones) {
  Json list = Json::array();
  for (std::size_t z = 0; z < zones.size(); ++z) {
    if (scene.sensor.zones[z].dead) continue;
    const ZoneBudget& b = zones[z];
    list.push_back({{"zone", z},
                    {"direct", b.direct},
                    {"three_bounce", b.three_bounce},
                    {"brightest_bin", b.peak},
                    {"gate_bins", b.gate_bins},
                    {"background_per_bin", b.background},
                    {"signal_to_noise", b.signal_to_noise}});
  }
  return list;
}

void print_link(const Scene& scene) {
  if (!scene.sensor.link) {
    std::printf("  gains and ambient light as the scene states them; it gives no link\n");
    return;
  }
  const Link& link = *scene.sensor.link;
  std::printf(
      "  gain = pi/4 D^2 * transmission * efficiency * exposure / (h c / lambda) = %.4g counts per "
      "W/m^2\n"
      "  radiant intensity = pulse energy * repetition rate / solid angle of the field = %.4g "
      "W/sr\n"
      "  daylight = %.3g lx = %.3g W/m^2/nm at %.0f nm (black body of 5778 K, 93 lm/W)\n"
      "  %.4g pulses a capture\n",
      link_gain(link), scene.sensor.radiant_intensity, link.ambient_illuminance,
      daylight_irradiance(link.wavelength, link.ambient_illuminance) * 1e-9, link.wavelength * 1e9,
      link.pulses());
}

void print_scaling(const Scene& scene, const SensorPlacement& sensor, const Placement& object) {
  const DistanceExponents e = distance_exponents(scene, sensor, object);
  const bool retro = std::holds_alternative<RetroreflectiveMaterial>(scene.hidden.material);
  std::printf(
      "  d: sensor - relay, r: relay - object; exponents here, by differences of 5 %%\n"
      "    direct        I rho/pi cos / d^2 dOmega                          d^%.2f\n",
      e.direct_relay);
  if (retro) {
    std::printf(
        "    three-bounce  radiance of the spot (d^-2) * rho_o A cos * rho/pi cos / r^2 dOmega;"
        " a lobe\n                  wide against the spot adds r^-2"
        "              d^%.2f r^%.2f\n",
        e.three_bounce_relay, e.three_bounce_object);
  } else {
    const bool brdf = std::holds_alternative<BrdfMaterial>(scene.hidden.material);
    std::printf(
        "    three-bounce  I dOmega rho/pi cos cos/r^2 * rho_o%s A * cos cos/r^2 rho/pi dOmega"
        "  d^%.2f r^%.2f\n",
        brdf ? " f" : "/pi", e.three_bounce_relay, e.three_bounce_object);
  }
  std::printf(
      "    background    E_sun dLambda rho/pi dOmega                         d^0\n"
      "  (three-bounce sum with factors constant over small spots: the exponents -2, 0 and -4 of "
      "a\n"
      "  Lambertian and -2, -2 and -2 of a retroreflective object are its limits)\n");
}

int run_explain(const ExplainArguments& arguments) {
  const Scene scene = read_scene(arguments.scene);
  const SensorPlacement sensor = known_placement(scene, arguments.capture);
  const std::vector<Placement> objects =
      arguments.pose.empty() ? stated_placements(scene) : parse_pose(scene, arguments.pose);
  const Placement& object = objects.front();
  const PoseVector pose = pose_of(objects, scene.unknowns);
  std::vector<PoseVector> poses{pose};
  std::mt19937_64 random(arguments.seed);
  while (static_cast<int>(poses.size()) < arguments.poses) {
    poses.push_back(draw_pose(scene, random));
  }
  tell_begun("choosing how finely to sample " + scene.name + ", then switching each term at " +
             std::to_string(arguments.poses) + " poses");
  Planned planned{make_scene_transport(scene), object_count(scene), sensor, {}, nullptr, {}};
  planned.options.tolerance = arguments.tolerance;
  planned.model = make_fast_model(planned.transport, sensor, planned.options);
  planned.options.sampling_step = planned.model->sampling_step();
  const std::vector<ZoneBudget> zones = link_budget(scene, *planned.model, pose);
  planned.plan = planned.model->plan();
  decide_pile_up(planned.plan, scene, zones);
  if (arguments.out.json()) {
    Json json{{"scene", scene.name},
              {"plan", plan_figures(planned, poses)},
              {"zones", zone_figures(scene, zones)},
              {"hints", scene_hints(scene, sensor)}};
    arguments.out.document(json.dump(1));
    return kAllWell;
  }
  std::printf("scene %s:", scene.name.c_str());
  for (int i = 0; i < object_count(scene); ++i) {
    const Material& material = hidden_object(scene, i).material;
    const bool law = std::holds_alternative<MeasuredLawMaterial>(material);
    std::printf("%s %s", i == 0 ? "" : ",",
                law ? "object with a measured law" : (material_name(material) + " object").c_str());
  }
  std::printf("\n");
  if (const auto size = planned.model->size()) {
    std::printf("  relay: %d lit points, %d seen ones; object: %d points\n", size->lit_points,
                size->seen_points, size->object_points);
  }

  print_plan(planned, poses);

  for (const std::string& hint : scene_hints(scene, sensor)) std::printf("\n%s\n", hint.c_str());
  if (!arguments.pose.empty()) {
    for (const std::string& hint : placement_hints(scene, sensor, objects)) {
      std::printf("\n%s\n", hint.c_str());
    }
  }

  std::printf("\nExpected counts of one capture at %s\n",
              arguments.pose.empty() ? "the scene's own pose" : arguments.pose.c_str());
  print_link(scene);
  print_zones(scene, zones);
  if (std::ranges::all_of(zones,
                          [](const ZoneBudget& b) { return !(b.three_bounce > kNoPhoton); })) {
    std::printf(
        "  No light of an object at this pose reaches a bin that is used: the pose is hidden from "
        "the\n  relay, or out of the sensor's time.\n");
    return kAllWell;
  }
  std::printf(
      "  three-bounce counts over the standard deviation of all counts in the gate (S/N): above 3\n"
      "  a zone shows the object by itself\n");
  std::printf("\nHow light falls with distance\n");
  print_scaling(scene, sensor, object);
  return kAllWell;
}

}  // namespace

void add_explain_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "explain", "what the model needs for a scene, what it leaves out, and how many photons come");
  const auto arguments = std::make_shared<ExplainArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command.add_option("--pose", arguments->pose,
                     "pose of the object for the photons, such as x_m=0.3,yaw_deg=20");
  command.add_option("--capture", arguments->capture,
                     "capture file whose first capture says where the sensor stood");
  command
      .add_option("--tolerance", arguments->tolerance,
                  "of the fast model; default: that of the models that fit begins with")
      ->capture_default_str();
  command.add_option("--poses", arguments->poses, "poses at which terms are switched and timed")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  arguments->out.add_option(command, "plan, expected counts of the zones and hints");
  command.add_option("--seed", arguments->seed, "of these poses")->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_explain(*arguments); });
}

}  // namespace blindcorner
