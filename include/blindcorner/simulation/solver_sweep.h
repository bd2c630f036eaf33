// SPDX-License-Identifier: Apache-2.0
/// Compares error and run time. Settings of the solver and other methods answer the same captures
/// at every level of light, beside the Cramer-Rao bound.
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

/// The solver with options other than the default ones.
struct SolverSetting {
  std::string name;    ///< "4 starts"
  std::string varies;  ///< "starts"; else "default" or "combination"
  FitOptions fit;
  int threads = 1;  ///< threads that one fit may use
};

/// The default first, then settings that change one option of the default, then combinations.
std::vector<SolverSetting> solver_settings();

/// A method's answer to one capture.
struct SweepAnswer {
  PoseVector pose;
  std::optional<PoseMixture> posterior{};  ///< posterior of a method that claims one
};
using SweepAnswerer = std::function<SweepAnswer(const Capture&)>;

struct SweptMethod {
  std::string name, varies;
  bool solver = false;  ///< whether the method is a setting of the solver; the default comes first
  int threads = 1;
  /// Prepares all that the method keeps from one capture to the next. Throws Error.
  std::function<SweepAnswerer()> make;
};

/// A setting of the solver as a method.
SweptMethod swept_setting(const Scene& scene, const SolverSetting& setting);
/// The best pose of a grid without refinement, back-projection, multilateration and the middle of
/// the prior.
std::vector<SweptMethod> swept_baselines(const Scene& scene);
SweptMethod swept_network(const Scene& scene, const CnnBaseline& cnn, const std::string& name);

struct SweepOptions {
  int captures = 30;  ///< captures of each scene at each level of light, of the same objects
  /// Photons of the third bounce, averaged over the search region, with an equal background.
  std::vector<double> photons = {10, 100, 1e3, 1e4, 1e5, 1e6};
  TrueLight light = TrueLight::reference;
  double sampling = 1.0;  ///< sampling of the reference renderer, as in DrawOptions::sampling
  std::string wrong;      ///< what is wrong in the scene, as in DrawOptions::wrong
  /// Archive of traced light (traced_scene.h). Its poses in turn replace the drawn poses. `light`,
  /// `sampling` and `wrong` are then ignored. Empty: no archive.
  std::string traced;
  std::uint64_t seed = 1;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Result of one capture.
struct SweepTrial {
  std::string error;         ///< why there is no answer; empty: there is one
  double distance = 0;       ///< m, from the truth to the answer
  double cpu = 0, wall = 0;  ///< s, processor time of all threads, and wall time
  /// The result of credible_level(), for a method that claims a posterior.
  std::optional<double> level{};
  bool right = false;      ///< the heaviest mode's 99 % region holds the truth
  double of_heaviest = 0;  ///< m, from the truth to the heaviest mode's mean
};

/// One method at one level of light.
struct SweepCell {
  std::vector<SweepTrial> trials;        ///< [captures]
  double first_cpu = 0, first_wall = 0;  ///< s, the first capture with all its preparation
};

/// Figures of a cell, over its captures.
struct SweepFigures {
  int answers = 0, failures = 0;
  double median = 0, p90 = 0, rms = 0;           ///< m, NaN without answers
  double following_cpu = 0, following_wall = 0;  ///< s, medians of captures after the first
  int claims = 0, held = 0;  ///< answers with a posterior; with the truth in its 95 % region
  int right = 0;
  double right_rms = 0;  ///< m, of the heaviest mode if that mode is right; NaN if it never is
  /// Root of the mean of squared error over squared bound. Only captures with a right heaviest mode
  /// and a bound below a quarter of the pulse length count. NaN without such captures.
  double efficiency = 0, efficiency_low = 0, efficiency_high = 0;  ///< with its bootstrap interval
  int efficiency_captures = 0;
};

/// One scene at one level of light.
struct SweepLevel {
  double photons = 0;
  Exposure exposure;
  std::vector<double> bound;  ///< [captures] m, root of the trace of the Cramer-Rao bound
  /// m, of normally distributed errors whose covariance is the bound.
  double bound_median = 0, bound_p90 = 0, bound_rms = 0;
  std::vector<SweepCell> cells;       ///< [methods]
  std::vector<SweepFigures> figures;  ///< [methods]
};

struct SweepScene {
  std::string name, file;
  double pulse = 0;  ///< m, path length of the impulse response's width at half maximum
  std::vector<SweptMethod> methods;
  std::vector<SweepLevel> levels;
};

/// A share of the pulse's length. A bound below this share says that the peak is found and refined.
inline constexpr double kFineBound = 0.25;

/// Draws the objects, takes the captures and asks all methods. The captures follow one after the
/// other. The methods answer each capture in turn, so that other load on the machine affects all
/// methods alike. Except for run times, the results are the same at any number of threads.
/// `advance` is called after each answer.
SweepScene sweep_scene(const Scene& scene, const std::vector<SweptMethod>& methods,
                       const SweepOptions& options, const std::function<void()>& advance = {});

/// Figures of a cell whose captures have these bounds (m).
SweepFigures figures_of(const SweepCell& cell, const std::vector<double>& bound, double pulse,
                        std::uint64_t seed);

/// Error and time of one method over those of the default. They are geometric means over all
/// captures, of all scenes and levels, that both methods answered. The intervals hold for the times
/// and errors of all methods together with 95 %. They are Student's intervals over the objects; an
/// object's captures at all levels go together.
struct SweepRatio {
  std::string name, varies;
  bool solver = false;
  double time = 1;  ///< processor time of a capture after the first
  double time_low = 1, time_high = 1;
  double first_time = 1;  ///< processor time of a first capture
  double error = 1;
  double error_low = 1, error_high = 1;
  double wall = 1;  ///< wall time of a capture after the first
  int captures = 0;
  /// Shares over the captures with a claim; NaN without claims.
  double coverage = 0, right = 0;
  /// Captures whose truth lies only in this method's 95 % region, or only in the default's.
  int held_alone = 0, default_alone = 0;

  /// Whether the method costs less, beyond what the captures leave open.
  bool cheaper() const { return time_high < 1; }
  /// Whether the method's error is smaller, or larger, beyond what the captures leave open.
  bool better() const { return error_high < 1; }
  bool worse() const { return error_low > 1; }
  /// Whether the method's regions hold the truth less often than the default's, beyond chance. This
  /// is a one-sided sign test, at 1 %, of the captures in which the two methods differ.
  bool holds_less() const;
};

/// The default's place among all methods, within the intervals.
struct SweepVerdict {
  std::vector<SweepRatio> ratios;  ///< [methods], the default first
  std::vector<std::size_t> front;  ///< methods on the front by time and error, without intervals
  /// Cheaper methods whose error is smaller beyond what the captures leave open. If there are any,
  /// the default is not on the front.
  std::vector<std::size_t> better;
  /// Cheaper methods whose error the captures cannot tell from the default's.
  std::vector<std::size_t> level;
  int pictures = 0;  ///< scenes times levels of light
  /// Pictures in which no method is cheaper with a smaller error, beyond the intervals of that
  /// picture.
  int on_front = 0;
  /// A sentence that says whether the default is on the front.
  std::string headline() const;
  /// One line for each method of `better` and of `level`: the method's cost and its loss.
  std::vector<std::string> remarks() const;
};
SweepVerdict verdict_of(const std::vector<SweepScene>& scenes);

}  // namespace blindcorner
