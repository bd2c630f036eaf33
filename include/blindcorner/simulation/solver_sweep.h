// SPDX-License-Identifier: Apache-2.0
/// Error against run time: settings of the solver and other methods on the same captures, at every
/// level of light, beside the Cramer-Rao bound.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/comparison.h"
#include "blindcorner/simulation/drawn_objects.h"

namespace blindcorner {

/// The solver with other options than the default ones.
struct SolverSetting {
  std::string name;    ///< "4 starts"
  std::string varies;  ///< "starts"; of the default and of combinations what they are
  FitOptions fit;
  int threads = 1;  ///< that one fit may use
};

/// The default first, then one option at a time about it, then combinations.
std::vector<SolverSetting> solver_settings();

/// What a method says of one capture.
struct SweepAnswer {
  PoseVector pose;
  std::optional<PoseMixture> posterior{};  ///< of a method that claims one
};
using SweepAnswerer = std::function<SweepAnswer(const Capture&)>;

struct SweptMethod {
  std::string name, varies;
  bool solver = false;  ///< a setting of it, the default first
  int threads = 1;
  /// Prepares all that the method keeps from one capture to the next; throws Error.
  std::function<SweepAnswerer()> make;
};

/// A setting of the solver as a method.
SweptMethod swept_setting(const Scene& scene, const SolverSetting& setting);
/// The best pose of a grid without refinement, back-projection, multilateration and the middle of
/// the prior.
std::vector<SweptMethod> swept_baselines(const Scene& scene);
SweptMethod swept_network(const Scene& scene, const CnnBaseline& cnn, const std::string& name);

struct SweepOptions {
  int captures = 30;  ///< of each scene at each level of light; the objects are the same
  /// Photons of the third bounce, on average over the search region, over an equal background.
  std::vector<double> photons = {10, 100, 1e3, 1e4, 1e5, 1e6};
  TrueLight light = TrueLight::reference;
  double sampling = 1.0;  ///< of the reference renderer, as DrawOptions::sampling
  std::string wrong;      ///< what the scene is wrong about, as DrawOptions::wrong
  /// Archive of traced light (traced_scene.h), whose poses in turn take the place of drawn ones;
  /// empty: none. `light`, `sampling` and `wrong` are then not looked at.
  std::string traced;
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// What became of one capture.
struct SweepTrial {
  std::string error;         ///< why there is no answer; empty: there is
  double distance = 0;       ///< m, of the answer from the truth
  double cpu = 0, wall = 0;  ///< s, processor time of all threads, and on the wall
  /// Of a method that claims a posterior: as of credible_level().
  std::optional<double> level{};
  bool right = false;      ///< the heaviest mode's 99 % region holds the truth
  double of_heaviest = 0;  ///< m, of the heaviest mode's mean from the truth
};

/// One method at one level of light.
struct SweepCell {
  std::vector<SweepTrial> trials;        ///< [captures]
  double first_cpu = 0, first_wall = 0;  ///< s, the first capture with all that it prepares
};

/// What a cell says, over its captures.
struct SweepFigures {
  int answers = 0, failures = 0;
  double median = 0, p90 = 0, rms = 0;           ///< m, NaN without answers
  double following_cpu = 0, following_wall = 0;  ///< s, medians of captures after the first
  int claims = 0, held = 0;                      ///< with a posterior; in its 95 % region
  int right = 0;
  double right_rms = 0;  ///< m, of the heaviest mode where it is right; NaN where it never is
  /// Root of the mean of squared error over squared bound, where the mode is right and the bound
  /// below a quarter of the pulse length; NaN where there are none.
  double efficiency = 0, efficiency_low = 0, efficiency_high = 0;  ///< with its bootstrap interval
  int efficiency_captures = 0;
};

/// One scene at one level of light.
struct SweepLevel {
  double photons = 0;
  Exposure exposure;
  std::vector<double> bound;  ///< [captures] m, root of the trace of the Cramer-Rao bound
  /// m, of errors that are normal with the bound as their covariance.
  double bound_median = 0, bound_p90 = 0, bound_rms = 0;
  std::vector<SweepCell> cells;       ///< [methods]
  std::vector<SweepFigures> figures;  ///< [methods]
};

struct SweepScene {
  std::string name, file;
  double pulse = 0;  ///< m, width of the impulse response at half maximum as path
  std::vector<SweptMethod> methods;
  std::vector<SweepLevel> levels;
};

/// A share of the pulse's length below which a bound says that the peak is found and refined.
inline constexpr double kFineBound = 0.25;

/// Draws the objects, takes the captures and asks all methods, one capture after the other and the
/// methods of one capture in turn, so that what else the machine does meets all alike. Run times
/// excepted the same at any number of threads. `advance` is called after each answer.
SweepScene sweep_scene(const Scene& scene, const std::vector<SweptMethod>& methods,
                       const SweepOptions& options, const std::function<void()>& advance = {});

/// Figures of a cell whose captures have these bounds (m).
SweepFigures figures_of(const SweepCell& cell, const std::vector<double>& bound, double pulse,
                        std::uint64_t seed);

/// Error and time of one method over those of the default, geometric means over all captures of all
/// scenes and levels that both answered. The intervals hold for times and errors of all methods
/// together with 95 %: Student's over the objects, whose captures at all levels go together.
struct SweepRatio {
  std::string name, varies;
  bool solver = false;
  double time = 1;  ///< processor time of a following capture
  double time_low = 1, time_high = 1;
  double first_time = 1;  ///< processor time of a first capture
  double error = 1;
  double error_low = 1, error_high = 1;
  double wall = 1;  ///< of a following capture
  int captures = 0;
  /// Over all captures; NaN where none is claimed.
  double coverage = 0, right = 0;
  /// Captures whose truth only its own, or only the default's, 95 % region holds.
  int held_alone = 0, default_alone = 0;

  /// Costs less, beyond what the captures leave open.
  bool cheaper() const { return time_high < 1; }
  /// Its error is smaller, or larger, beyond what the captures leave open.
  bool better() const { return error_high < 1; }
  bool worse() const { return error_low > 1; }
  /// Its regions hold the truth less often than the default's beyond chance: a sign test of the
  /// captures in which the two differ, one-sided, at 1 %.
  bool holds_less() const;
};

/// Where the default stands among all methods, within the intervals.
struct SweepVerdict {
  std::vector<SweepRatio> ratios;  ///< [methods], the default first
  std::vector<std::size_t> front;  ///< by time and error of the ratios as they stand
  /// Cheaper ones whose error is smaller beyond what the captures leave open: the default is not on
  /// the front.
  std::vector<std::size_t> better;
  /// Cheaper ones whose error the captures do not tell from the default's.
  std::vector<std::size_t> level;
  int pictures = 0;  ///< scenes times levels of light
  /// Of these, where nothing is cheaper with a smaller error beyond the intervals of that picture.
  int on_front = 0;
  /// Whether it is on the front, in a sentence.
  std::string headline() const;
  /// One line for each method of `better` and of `level`: what it costs and what it loses.
  std::vector<std::string> remarks() const;
};
SweepVerdict verdict_of(const std::vector<SweepScene>& scenes);

}  // namespace blindcorner
