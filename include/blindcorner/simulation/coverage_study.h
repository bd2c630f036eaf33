// SPDX-License-Identifier: Apache-2.0
/// Tests whether the fit's stated uncertainty is right. In some captures, poses and brightness come
/// from the priors that the fit is told. Other captures show scenes that differ from the scene that
/// the fit is told.
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

  int wrong_captures = 200;  ///< captures of each wrong assumption; 0: none
  /// Uses the coarsest sampling from 0.5 to 1.4 times `sampling` whose own error adds less than
  /// 0.05 to the mean squared normalised error at the brightest level of light. If none does, uses
  /// 1.4 times `sampling`.
  bool dense_truth = false;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// The weight that a fit gives to one mode, and whether the truth belongs to that mode.
struct ModeClaim {
  double weight = 0;
  bool right = false;
};

/// The claims of a fit about one capture.
struct ClaimTrial {
  std::string error;             ///< why there is no answer; empty: there is one
  double level = 1;              ///< result of credible_level()
  double normalised_square = 0;  ///< d' C^-1 d of the whole posterior
  double distance = 0;           ///< m, from the truth to the posterior's mean
  double claimed = 0;            ///< m, root of the trace of the position covariance
  PoseVector truth, mean;        ///< values of the unknowns; the posterior's mean
  double photons = 0;            ///< expected photons of the object; 0: not known
  std::vector<ModeClaim> modes;  ///< heaviest first
  std::vector<std::string> flags;
  double deviance_excess = 0;  ///< in standard deviations
  /// Distance of the expected counts from all counts that the scene can explain, in standard
  /// deviations of the photon noise, as from unexplained_distance(). 0: not computed.
  double unexplained_distance = 0;

  bool has(const std::string& flag) const;
  /// Whether there is an error, or any flag except "sampled", which only says how the posterior was
  /// computed.
  bool warned() const;
};

/// Judges a fit by the truth. Only a mode whose 99.9 % region holds the truth can be the right one.
/// Of these modes, the right one is the most likely source of the truth. There may be no right
/// mode. Regions use Student's t of five degrees of freedom, because modes need not be normal.
ClaimTrial judge_fit(const Scene& scene, const FitResult& result, const PoseVector& truth,
                     std::uint64_t seed);

/// Fits a capture of each object. The results are the same at any number of threads.
std::vector<ClaimTrial> claim_trials(const Fitter& fitter, std::span<const DrawnObject> objects,
                                     const Exposure& exposure, std::uint64_t seed,
                                     const std::function<void()>& advance = {});

/// Root of the deviance that the best fit leaves on a capture without noise. Any test of whether
/// the scene is right sees at most a shift of a normal variable by so many standard deviations.
/// Only a test that knows how the scene is wrong, and where the object is, sees the whole shift.
double unexplained_distance(const Fitter& fitter, const DrawnObject& object,
                            const Exposure& exposure);

/// Share of the captures at an unexplained distance that the best test flags, if the test flags one
/// in a hundred captures of a right scene.
double power_of_best_test(double distance);

/// Claims that trials with a right model must meet: the 50, 90 and 95 % regions, the mean squared
/// normalised error, and the modes' weights in bins of a tenth. The claims are not judged yet.
/// Captures without an answer count as outside the regions.
std::vector<ClaimTest> claims_of(std::span<const ClaimTrial> trials, int unknowns);

/// Shares of trials with each warning.
struct WarningShares {
  double multimodal = 0, undetermined = 0, misfit = 0, unexplained = 0, at_bound = 0, warned = 0;
  /// Share of trials whose truth is outside the 95 % region, without a warning.
  double unwarned = 0;
};
WarningShares warnings_of(std::span<const ClaimTrial> trials);

/// Figures of a wrong assumption beside the right one, on the same objects.
struct WrongFigures {
  WrongAssumption assumption;
  int captures = 0, failures = 0;
  int held[3] = {0, 0, 0};    ///< captures with the truth in the 50, 90 and 95 % regions
  double claimed_growth = 1;  ///< median ratio of the claimed uncertainties, wrong to right
  double median_error = 0, right_median_error = 0;  ///< m
  WarningShares warnings;
  int unwarned = 0;
  double best_warned = 0;    ///< share that a test would flag if it knew what is wrong
  double best_unwarned = 0;  ///< share outside the 95 % region that this test would miss
  /// At most 5 % of the captures are wrong without a warning, as far as these captures tell.
  bool holds = false;
};
WrongFigures wrong_figures(const WrongAssumption& assumption, std::span<const ClaimTrial> wrong,
                           std::span<const ClaimTrial> right);

/// Example of a posterior with several explanations or an open direction, to look at.
struct AmbiguousExample {
  PoseVector truth;
  PoseMixture posterior;
  std::vector<std::string> flags;
};

/// One scene at one level of light.
struct CoverageLevel : ClaimLevel {
  double median_photons = 0;  ///< expected photons, median of the drawn objects
  double sampling = 1;        ///< sampling of the truth, as in DrawOptions::sampling
  std::vector<ClaimTrial> trials;
  WarningShares warnings;
  double median_error = 0, median_claimed = 0;  ///< m
  /// Student's 95 % interval of the mean squared normalised error.
  double mean_square_low = 0, mean_square_high = 0;
  /// Upper limit of the mean squared normalised error that the reference renderer's own sampling
  /// makes: the error of answers to light without noise at half the sampling, against answers at
  /// the whole sampling. Empty: another light, or no coarser sampling.
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
