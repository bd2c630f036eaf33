// SPDX-License-Identifier: Apache-2.0
/// The methods of a sweep, as tables.
#include <memory>

#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/inverse/baseline/matched_filter.h"
#include "blindcorner/inverse/baseline/multilateration.h"
#include "blindcorner/simulation/solver_sweep.h"

namespace blindcorner {
namespace {

/// Expected captures of a sensor pose: so many that tables of exact histograms are made.
constexpr int kManyCapturesExpected = 1000;

struct SettingRow {
  const char* varies;
  const char* name;
  void (*change)(SolverSetting&);
};

using Setting = SolverSetting;

const SettingRow kSettings[] = {
    {"default", "default", [](Setting&) {}},
    {"model tolerance", "tolerance 0.3", [](Setting& s) { s.fit.model_tolerance = 0.3; }},
    {"model tolerance", "tolerance 0.1", [](Setting& s) { s.fit.model_tolerance = 0.1; }},
    {"model tolerance", "tolerance 0.03", [](Setting& s) { s.fit.model_tolerance = 0.03; }},
    {"model tolerance", "tolerance 0.01", [](Setting& s) { s.fit.model_tolerance = 0.01; }},
    {"starts", "1 start", [](Setting& s) { s.fit.max_starts = 1; }},
    {"starts", "4 starts", [](Setting& s) { s.fit.max_starts = 4; }},
    {"starts", "8 starts", [](Setting& s) { s.fit.max_starts = 8; }},
    {"starts", "64 starts", [](Setting& s) { s.fit.max_starts = 64; }},
    {"scored poses", "75 poses", [](Setting& s) { s.fit.max_closed_form_poses = 75; }},
    {"scored poses", "200 poses", [](Setting& s) { s.fit.max_closed_form_poses = 200; }},
    {"scored poses", "2400 poses", [](Setting& s) { s.fit.max_closed_form_poses = 2400; }},
    {"exact tables", "2000 exact poses",
     [](Setting& s) {
       s.fit.captures_per_placement = kManyCapturesExpected;
       s.fit.max_scored_poses = 2000;
     }},
    {"exact tables", "20000 exact poses",
     [](Setting& s) { s.fit.captures_per_placement = kManyCapturesExpected; }},
    {"negligible modes", "negligible 4", [](Setting& s) { s.fit.negligible_log_posterior = 4; }},
    {"negligible modes", "negligible 24", [](Setting& s) { s.fit.negligible_log_posterior = 24; }},
    {"importance samples", "no samples", [](Setting& s) { s.fit.importance_samples = 0; }},
    {"importance samples", "64 samples", [](Setting& s) { s.fit.importance_samples = 64; }},
    {"importance samples", "1024 samples", [](Setting& s) { s.fit.importance_samples = 1024; }},
    {"empty captures", "no empty captures", [](Setting& s) { s.fit.empty_captures = 0; }},
    {"threads", "2 threads", [](Setting& s) { s.threads = 2; }},
    {"combination", "quick",
     [](Setting& s) {
       s.fit.model_tolerance = 0.1;
       s.fit.max_starts = 4;
       s.fit.max_closed_form_poses = 200;
       s.fit.importance_samples = 0;
       s.fit.empty_captures = 0;
     }},
    {"combination", "one descent",
     [](Setting& s) {
       s.fit.max_starts = 1;
       s.fit.importance_samples = 0;
       s.fit.empty_captures = 0;
     }},
    {"combination", "sparing",
     [](Setting& s) {
       s.fit.max_starts = 8;
       s.fit.importance_samples = 64;
     }},
    {"combination", "thorough",
     [](Setting& s) {
       s.fit.model_tolerance = 0.01;
       s.fit.max_starts = 64;
       s.fit.max_closed_form_poses = 2400;
       s.fit.importance_samples = 1024;
     }},
};

/// A method without a posterior, made from a class that predicts.
template <class Method, class... Options>
SweptMethod predicting(std::string name, const Scene& scene, const Options&... options) {
  return {std::move(name), "other methods", false, 1, [scene, options...]() -> SweepAnswerer {
            const auto method = std::make_shared<const Method>(scene, options...);
            return [method](const Capture& capture) {
              return SweepAnswer{method->predict(capture), std::nullopt};
            };
          }};
}

}  // namespace

std::vector<SolverSetting> solver_settings() {
  std::vector<SolverSetting> settings;
  for (const SettingRow& row : kSettings) {
    SolverSetting setting{row.name, row.varies, {}, 1};
    row.change(setting);
    settings.push_back(std::move(setting));
  }
  return settings;
}

SweptMethod swept_setting(const Scene& scene, const SolverSetting& setting) {
  return {setting.name, setting.varies, true, setting.threads,
          [scene, fit = setting.fit]() -> SweepAnswerer {
            const auto fitter = std::make_shared<const Fitter>(scene, fit);
            return [fitter](const Capture& capture) {
              PoseMixture posterior = fitter->fit(capture).posterior;
              PoseVector mean = posterior.mean;
              return SweepAnswer{std::move(mean), std::move(posterior)};
            };
          }};
}

std::vector<SweptMethod> swept_baselines(const Scene& scene) {
  const PoseVector middle = middle_of_prior(scene);
  return {
      predicting<MatchedFilterBaseline>("matched filter, 600 poses", scene,
                                        MatchedFilterOptions{600, true}),
      predicting<MatchedFilterBaseline>("matched filter, 20000 poses", scene,
                                        MatchedFilterOptions{20'000, true}),
      predicting<MatchedFilterBaseline>("matched filter, exact", scene,
                                        MatchedFilterOptions{20'000, false}),
      predicting<BackProjection>("back-projection", scene),
      predicting<Multilateration>("multilateration", scene),
      {"middle of the prior", "other methods", false, 1,
       [middle]() -> SweepAnswerer {
         return [middle](const Capture&) { return SweepAnswer{middle, std::nullopt}; };
       }},
  };
}

SweptMethod swept_network(const Scene& scene, const CnnBaseline& cnn, const std::string& name) {
  return {name, "other methods", false, 1, [scene, cnn]() -> SweepAnswerer {
            return [scene, cnn](const Capture& capture) {
              const Transform T = capture.T_world_sensor.value_or(scene.T_world_sensor);
              if (cnn.description().network != CnnArchitecture::wide) {
                return SweepAnswer{cnn.predict(capture, T), std::nullopt};
              }
              PoseMixture posterior = cnn.posterior(capture, T);
              PoseVector mean = posterior.mean;
              return SweepAnswer{std::move(mean), std::move(posterior)};
            };
          }};
}

}  // namespace blindcorner
