// SPDX-License-Identifier: Apache-2.0
/// Rows about what is learnt from captures of known objects: calibration and the network.
#include <cmath>
#include <limits>

#include "blindcorner/inverse/baseline/cnn_training.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kCalibration = "Calibration";
const char* const kTraining = "Training of the network";
/// Bright enough that one capture says something about every parameter that it can tell.
constexpr double kPhotons = 30'000;

/// Captures of the scene's own pose, which differ by their photons.
std::vector<Capture> captures_of_one_pose(const Scene& scene, int count) {
  std::vector<Capture> captures;
  for (int i = 0; i < count; ++i) {
    captures.push_back(photon_capture(scene, kPhotons, 1, static_cast<std::uint64_t>(i) + 1));
    captures.back().index = i;
  }
  return captures;
}

/// Largest distance of a parameter from the truth, which the scene states, in standard errors.
/// Infinite if a value or an error is not finite, or an error is larger than what was known before.
StabilityMeasurement calibrated(int count) {
  const Scene scene = nine_zone_scene();
  CalibrationOptions options;
  options.permutations = options.wraps = false;  // there are no spots, and nothing wraps
  const Calibration found = calibrate(scene, captures_of_one_pose(scene, count), options);
  double worst = 0;
  std::string which;
  for (const CalibratedParameter& p : found.parameters) {
    const double off = p.logarithmic ? std::log(p.value / p.prior) : p.value - p.prior;
    const double errors = std::abs(off) / p.standard_error;
    const bool number = std::isfinite(errors) && p.standard_error <= 1.001 * p.prior_sigma;
    if (number && errors <= worst) continue;
    worst = number ? errors : std::numeric_limits<double>::infinity();
    which = p.name;
    if (!number) break;
  }
  return {worst, which};
}

StabilityRow calibration_row(const std::string& name, const std::string& what, int count) {
  return {name,
          kCalibration,
          what +
              " of nine zones: largest distance of a parameter from the truth, in its standard "
              "errors; none may be wider than what was known before",
          4.5,
          "standard errors",
          LimitOrigin::physics,
          "Errors are normal; of some twenty parameters one is beyond 4.5 once in 7000 "
          "calibrations. What one position cannot tell keeps what was known.",
          [=] { return calibrated(count); }};
}

/// Number of a network's answers that are outside of the ranges of the unknowns. The network is
/// trained on `copies` copies of one capture, and answers for that capture and for one of another
/// place. 0 if this build cannot train.
StabilityMeasurement trained(int copies, double learning_rate) {
  if (!CnnBaseline::available()) return {0, "built without libtorch"};
  Scene scene = wall_scene();
  const Capture one = photon_capture(scene, kPhotons, 1, 1);
  const std::vector<Capture> captures(static_cast<std::size_t>(copies), one);
  CnnTrainingOptions options;
  options.epochs = 20;
  options.learning_rate = learning_rate;
  const auto network = CnnBaseline::parse(train_cnn(scene, captures, options).weights, "trained");
  scene.hidden.placement.position = Eigen::Vector3d(0.25, 0.6, 0.1);
  double bad = 0;
  for (const Capture& capture : {one, photon_capture(scene, kPhotons, 1, 2)}) {
    const PoseVector pose = network.predict(capture, scene.T_world_sensor);
    for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
      const double value = pose[static_cast<Eigen::Index>(i)];
      const Unknown& unknown = scene.unknowns[i];
      bad += value >= unknown.lower && value <= unknown.upper ? 0 : 1;
    }
  }
  return {bad, ""};
}

StabilityMeasurement diverges() {
  if (!CnnBaseline::available()) return {0, "built without libtorch"};
  return refusal([] { trained(17, 1e6); });
}

StabilityRow training_row(const std::string& name, const std::string& what, int copies,
                          double learning_rate) {
  return {name,
          kTraining,
          what + ", 20 epochs: answers that are no number or outside of the search region",
          0,
          "1",
          LimitOrigin::arithmetic,
          "No bin varies, so that nothing may be divided by its spread; answers are clipped to the "
          "ranges of the unknowns.",
          [=] { return trained(copies, learning_rate); }};
}

}  // namespace

std::vector<StabilityRow> learning_rows() {
  return {
      calibration_row("calibration_one_capture", "One capture", 1),
      calibration_row("calibration_repeated_position", "Eight captures of one position", 8),
      training_row("training_two_captures", "A network learns two copies of one capture", 2, 1e-3),
      training_row("training_repeated_position",
                   "A network learns 17 copies of one capture, a last step of a single one", 17,
                   1e-3),
      {"training_rate_1e6", kTraining,
       "A network learns 17 copies of one capture in steps of 10^6: 0 for a clear refusal", 0, "1",
       LimitOrigin::arithmetic, "Weights grow beyond all numbers, and no file may come of them.",
       diverges},
  };
}

}  // namespace blindcorner
