// SPDX-License-Identifier: Apache-2.0
/// Whether the fit's uncertainty is what it says: on captures whose poses and brightness come from
/// the priors that it is told, and on captures of scenes that are not what it is told.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/simulation/claim_study.h"

namespace blindcorner {

struct CoverageOptions : ClaimStudyOptions {
  CoverageOptions() { captures = 2000; }

  int wrong_captures = 200;  ///< of each wrong assumption; 0: none is tried
  /// Takes the coarsest sampling from half of `sampling` to 1.4 times that adds less than 0.05 to
  /// the mean squared normalised error of the brightest level of light by an error of its own.
  bool dense_truth = false;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// What a fit says of one mode, and whether that is the one that the truth belongs to.
struct ModeClaim {
  double weight = 0;
  bool right = false;
};

/// What a fit claimed of one capture.
struct ClaimTrial {
  std::string error;             ///< why there is no answer; empty: there is
  double level = 1;              ///< as of credible_level()
  double normalised_square = 0;  ///< d' C^-1 d of the whole posterior
  double distance = 0;           ///< m, of the posterior's mean from the truth
  double claimed = 0;            ///< m, root of the trace of the positions' covariance
  PoseVector truth, mean;        ///< of the unknowns; the posterior's mean
  double photons = 0;            ///< expected of the object; 0 where nobody has said it
  std::vector<ModeClaim> modes;  ///< heaviest first
  std::vector<std::string> flags;
  double deviance_excess = 0;  ///< in standard deviations
  /// How far what is expected is from all that the scene can explain, in standard deviations of
  /// the photon noise, as of unexplained_distance(); 0: nobody has looked.
  double unexplained_distance = 0;

  bool has(const std::string& flag) const;
  /// Any flag but the one that only says how the posterior was computed.
  bool warned() const;
};

/// Judges a fit by the truth. A mode is the right one where the truth most likely comes from it and
/// lies in its 99.9 % region, by Student's t of five degrees of freedom: modes need not be normal.
/// It may be that none is.
ClaimTrial judge_fit(const Scene& scene, const FitResult& result, const PoseVector& truth,
                     std::uint64_t seed);

/// Fits captures of all objects. The same at any number of threads.
std::vector<ClaimTrial> claim_trials(const Fitter& fitter, std::span<const DrawnObject> objects,
                                     const Exposure& exposure, std::uint64_t seed,
                                     const std::function<void()>& advance = {});

/// Root of the deviance that the best fit leaves of a capture without noise. Any test of whether
/// the scene is right sees at most a shift of a normal variable by so many standard deviations, and
/// only a test that knows in which way the scene is wrong, and where the object is, sees all of it.
double unexplained_distance(const Fitter& fitter, const DrawnObject& object,
                            const Exposure& exposure);

/// The share of captures that a test which does sees, of which it flags one in a hundred where the
/// scene is right.
double power_of_best_test(double distance);

/// Claims that trials with a right model must meet: the 50, 90 and 95 % regions, the mean squared
/// normalised error, and the modes' weights in bins of a tenth. Not judged yet. Captures without an
/// answer count as not held.
std::vector<ClaimTest> claims_of(std::span<const ClaimTrial> trials, int unknowns);

/// Shares of trials.
struct WarningShares {
  double multimodal = 0, undetermined = 0, misfit = 0, unexplained = 0, at_bound = 0, warned = 0;
  /// Outside of the 95 % region, and nothing warns of it.
  double unwarned = 0;
};
WarningShares warnings_of(std::span<const ClaimTrial> trials);

/// A wrong assumption beside the right one, on the same objects.
struct WrongFigures {
  WrongAssumption assumption;
  int captures = 0, failures = 0;
  int held[3] = {0, 0, 0};    ///< in the 50, 90 and 95 % regions
  double claimed_growth = 1;  ///< median of the ratio of claimed uncertainties, wrong to right
  double median_error = 0, right_median_error = 0;  ///< m
  WarningShares warnings;
  int unwarned = 0;
  double best_warned = 0;    ///< share that a test which knows what is wrong would see
  double best_unwarned = 0;  ///< share outside of the 95 % region that it would not see
  /// Not more captures are wrong without a warning than 5 %, as far as these captures tell.
  bool holds = false;
};
WrongFigures wrong_figures(const WrongAssumption& assumption, std::span<const ClaimTrial> wrong,
                           std::span<const ClaimTrial> right);

/// A posterior with several explanations or an open direction, for looking at.
struct AmbiguousExample {
  PoseVector truth;
  PoseMixture posterior;
  std::vector<std::string> flags;
};

/// One scene at one level of light.
struct CoverageLevel : ClaimLevel {
  double median_photons = 0;  ///< expected of the objects drawn
  double sampling = 1;        ///< of the truth, as DrawOptions::sampling
  std::vector<ClaimTrial> trials;
  WarningShares warnings;
  double median_error = 0, median_claimed = 0;       ///< m
  double mean_square_low = 0, mean_square_high = 0;  ///< Student's 95 % interval of that mean
  /// Mean squared normalised error that the reference renderer's own sampling makes, at most: that
  /// of answers to light without noise at half the sampling, from those at the whole. Empty: other
  /// light, or no coarser sampling.
  std::optional<double> truth_error;
  std::vector<WrongFigures> wrong;
  std::optional<AmbiguousExample> example;
};

using CoverageScene = StudyScene<CoverageLevel>;
using CoverageReport = StudyReport<CoverageOptions, CoverageLevel>;

/// Runs the study on one scene; claims are judged by judge_study() over all scenes.
CoverageScene study_coverage(const Scene& scene, const CoverageOptions& options,
                             const std::function<void()>& advance = {});

}  // namespace blindcorner
