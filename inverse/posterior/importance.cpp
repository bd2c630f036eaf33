// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/importance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/special_functions/erf.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/random/sobol.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <random>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "forward/support/parallel.h"
#include "inverse/likelihood/light_slope.h"
#include "inverse/likelihood/local_model.h"
#include "inverse/posterior/fisher_information.h"

namespace blindcorner {
namespace {

/// Degrees of freedom of the proposal's Student t. Its tails are heavier than any posterior's, and
/// this is the fewest whole degrees that leave a fourth moment.
constexpr double kTailFreedom = 5;
/// Share of the first samples that are drawn over the scored grid's cells, and least and largest
/// share later on, all by judgement. With the least share, no weight within the grid is more than
/// ten times its weight under the grid alone (Hesterberg 1995).
constexpr double kGridShare = 0.4;
constexpr double kMinGridShare = 0.1, kMaxGridShare = 0.9;
/// Share of a new component, share that is divided evenly among all components, and least first
/// weight of a peak against the heaviest. By judgement: no component must be starved.
constexpr double kNewShare = 0.15;
constexpr double kSharedOut = 0.1;
constexpr double kMinEvidence = 1e-2;
/// Factor on the variance of the samples' own moments. The proposal is 14 % wider than the samples,
/// because a proposal that is too narrow costs more than one that is too wide. By judgement.
constexpr double kWiden = 1.3;
/// Power that flattens the grid's scores before they are sampled. The closed form is some log units
/// off, and poses that it scores too low must still be drawn. Ten units count as four, by
/// judgement.
constexpr double kGridTemper = 0.4;
/// Accuracy of a sample's log posterior. The sample's weight is then right to a per cent, while 256
/// samples of equal weight give a share to 6 %.
constexpr double kAccuracy = 1e-2;
/// Growth of a standard deviation, and move of the mean in standard deviations, that the later half
/// of the samples may still bring. A comparison with the previous stage takes ridges for settled
/// that grow by less at each stage. On a ridge with two arms (mirror_wall, 1000 captures), it had
/// 0.927 of the truths in the 95 % region instead of 0.936, and a mean squared normalised error of
/// 1.15 instead of 1.05.
constexpr double kGrowth = 1.2;
constexpr double kShift = 0.4;
/// Number of samples about the heaviest one that make up a component: some twice the 21 moments of
/// six unknowns.
constexpr std::size_t kNeighbours = 40;
/// Largest LocalModel::error() of the samples' light. Log posteriors are then off by 0.55 at
/// random, and the weights of 256 samples are as uncertain as those of 190 independent ones.
constexpr double kLightTolerance = 0.15;
/// A local model's region follows from the samples' moments once this many samples per unknown are
/// effective. It is set anew once the number of nodes has grown by the second factor.
constexpr double kEffectiveEach = 4, kMoreNodes = 1.5;
/// Number of draws from the answer that are checked with exact light, and root mean square
/// difference in log posterior above which local light is given up: twice its allowed error.
constexpr double kChecks = 4, kMaxOff = 0.7;
/// By judgement: they bound the time.
constexpr int kStages = 6;      ///< least number of stages that make up the samples asked for
constexpr int kMaxAtOnce = 40;  ///< samples per stage: the earlier it learns, the fewer it needs
constexpr int kMaxTimes = 4;    ///< times the samples asked for, if few are effective

double log_student(const Peak& peak, double distance2) {
  const auto n = static_cast<double>(peak.center.size());
  return std::lgamma((kTailFreedom + n) / 2) - std::lgamma(kTailFreedom / 2) -
         0.5 * n * std::log(kTailFreedom * kPi) - 0.5 * peak.log_det -
         0.5 * (kTailFreedom + n) * std::log1p(distance2 / kTailFreedom);
}

/// Draws cells of the scored grid in proportion to a power of their pose's expected gain.
class GridProposal {
 public:
  GridProposal(const CompiledScene& compiled, const Scored& scored, double inflation)
      : compiled_(compiled), density_(compiled.poses.size()), cumulative_(compiled.poses.size()) {
    // The filter's gains, shifted to the level of the known exact values.
    Eigen::VectorXd gain = scored.scores.cast<double>();
    std::vector<double> shifts;
    for (const Candidate& c : scored.exact) {
      shifts.push_back(c.log_posterior - scored.empty - gain[c.index]);
    }
    const auto middle = shifts.begin() + static_cast<std::ptrdiff_t>(shifts.size() / 2);
    std::nth_element(shifts.begin(), middle, shifts.end());
    gain.array() += *middle;
    for (const Candidate& c : scored.exact) gain[c.index] = c.log_posterior - scored.empty;
    const double best = gain.maxCoeff();
    double sum = 0;
    for (std::size_t i = 0; i < density_.size(); ++i) {
      const double p =
          std::exp(kGridTemper * (gain[static_cast<Eigen::Index>(i)] - best) / inflation);
      density_[i] = p;
      cumulative_[i] = sum += p;
    }
    const double volume = compiled.spacing.prod();
    for (std::size_t i = 0; i < density_.size(); ++i) {
      density_[i] /= sum * volume;
      cumulative_[i] /= sum;
    }
  }

  /// `u` is a point of the unit cube: [unknowns] give the place in the cell, the last one the cell.
  PoseVector draw(const Eigen::VectorXd& u) const {
    const auto it = std::lower_bound(cumulative_.begin(), cumulative_.end(), u[u.size() - 1]);
    const auto cell =
        std::min(static_cast<std::size_t>(it - cumulative_.begin()), cumulative_.size() - 1);
    PoseVector pose = compiled_.poses[cell];
    for (Eigen::Index k = 0; k < pose.size(); ++k) {
      pose[k] += (u[k] - 0.5) * compiled_.spacing[k];
    }
    return pose;
  }

  double density(const PoseVector& pose) const {
    std::size_t index = 0;
    for (std::size_t i = 0; i < compiled_.axes.size(); ++i) {
      const GridAxis& axis = compiled_.axes[i];
      const double x = (pose[static_cast<Eigen::Index>(i)] - axis.first) / axis.spacing;
      int at = static_cast<int>(std::floor(x + 0.5));
      if (axis.periodic) at = (at % axis.count + axis.count) % axis.count;
      if (at < 0 || at >= axis.count) return 0;
      index = index * static_cast<std::size_t>(axis.count) + static_cast<std::size_t>(at);
    }
    return density_[index];
  }

 private:
  const CompiledScene& compiled_;
  std::vector<double> density_;
  std::vector<double> cumulative_;
};

/// Points that fill the unit cube more evenly than independent ones (Sobol 1967). A random shift
/// modulo one makes each point uniform (Cranley and Patterson 1976).
class EvenPoints {
 public:
  EvenPoints(std::size_t dimensions, std::uint64_t seed)
      : sequence_(dimensions), shift_(static_cast<Eigen::Index>(dimensions)) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform;
    for (double& shift : shift_) shift = uniform(random);
  }

  Eigen::VectorXd next() {
    Eigen::VectorXd point = shift_;
    for (double& u : point) {
      u += static_cast<double>(sequence_()) * 0x1p-64;
      u -= std::floor(u);
    }
    return point;
  }

 private:
  boost::random::sobol sequence_;
  Eigen::VectorXd shift_;
};

/// Draws from a peak's Student t. `u` is a point of the unit cube: [unknowns] give the direction,
/// the last one the tail.
PoseVector draw_student(const Peak& peak, const Eigen::VectorXd& u) {
  constexpr double kEdge = 1e-12;  // quantiles are infinite at 0 and 1
  PoseVector z(peak.center.size());
  for (Eigen::Index k = 0; k < z.size(); ++k) {
    const double p = std::clamp(u[k], kEdge, 1 - kEdge);
    z[k] = std::sqrt(2.0) * boost::math::erf_inv(2 * p - 1);
  }
  const double tail = std::clamp(u[u.size() - 1], kEdge, 1 - kEdge);
  const double gamma = boost::math::gamma_p_inv(kTailFreedom / 2, tail) * 2 / kTailFreedom;
  return peak.center + peak.root * z / std::sqrt(gamma);
}

/// The state of one run.
class Sampler {
 public:
  Sampler(const PoseObjective& objective, const SampleLights& lights,
          const std::vector<Peak>& peaks, const std::vector<Peak>& ridges,
          const std::vector<const Refined*>& optima, const Scored& scored,
          const SamplingOptions& options)
      : objective_(objective),
        scene_(objective.compiled().scene),
        lights_(lights),
        peaks_(peaks),
        optima_(optima),
        inflation_(options.inflation),
        points_(scene_.unknowns.size() + 2, options.seed),
        grid_(objective.compiled(), scored, options.inflation),
        components_(peaks),
        around_(peaks.size()) {
    components_.insert(components_.end(), ridges.begin(), ridges.end());
    double best = -std::numeric_limits<double>::infinity();
    for (const Peak& peak : components_) best = std::max(best, peak.log_evidence);
    double total = 0;
    shares_.push_back(0);
    for (const Peak& peak : components_) {
      // No mode is starved, because its Laplace evidence may be far off.
      shares_.push_back(std::max(std::exp(peak.log_evidence - best), kMinEvidence));
      total += shares_.back();
    }
    for (double& share : shares_) share *= (1 - kGridShare) / total;
    shares_[0] = kGridShare;
    drawn_.assign(shares_.size(), 0.0);
  }

  void stage(int count) {
    const std::size_t first = samples_.size();
    for (int i = 0; i < count; ++i) draw();
    evaluate_from(first);
    for (std::size_t c = 0; c < shares_.size(); ++c) drawn_[c] += count * shares_[c];
    weigh();
  }

  /// Sets new shares: the part of the posterior that each component stands for, by the samples so
  /// far.
  void adapt() {
    extend();
    std::vector<double> next(shares_.size(), 0.0);
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      double density = 0;
      for (std::size_t c = 0; c < drawn_.size(); ++c) density += drawn_[c] * densities_[i][c];
      if (!(density > 0)) continue;
      for (std::size_t c = 0; c < next.size(); ++c) {
        // A component without any draws yet counts as if it had been drawn at its present share.
        const double amount = drawn_[c] > 0 ? drawn_[c] : shares_[c] * total_drawn();
        next[c] += samples_[i].weight * amount * densities_[i][c] / density;
      }
    }
    double sum = 0;
    for (double& share : next) {
      share = std::max(share, 1e-12);
      sum += share;
    }
    const double floor = kSharedOut / static_cast<double>(next.size());
    double rest = 0;
    for (std::size_t c = 1; c < next.size(); ++c) {
      next[c] = floor + next[c] / sum;
      rest += next[c];
    }
    next[0] = std::clamp(next[0] / sum, kMinGridShare, kMaxGridShare);
    for (std::size_t c = 1; c < next.size(); ++c) next[c] *= (1 - next[0]) / rest;
    shares_ = std::move(next);
  }

  double effective() const { return effective_; }

  /// Fits local models of the light about the peaks to the samples so far.
  void learn() {
    if (lights_.far.models == nullptr) return;  // the present light costs no more
    const auto n = static_cast<double>(scene_.unknowns.size());
    for (std::size_t j = 0; j < peaks_.size(); ++j) {
      Around& about = around_[j];
      const auto nodes = static_cast<double>(about.nodes.size());
      if (nodes < kMoreNodes * static_cast<double>(about.fitted_to) || nodes == 0) continue;
      std::vector<const PosteriorSample*> own;
      double weight = 0;
      double squares = 0;
      for (const PosteriorSample& sample : samples_) {
        if (sample.peak != j || !(sample.weight > 0)) continue;
        own.push_back(&sample);
        weight += sample.weight;
        squares += sample.weight * sample.weight;
      }
      if (!(weight * weight > kEffectiveEach * n * squares)) continue;
      about.fitted_to = about.nodes.size();
      LocalRegion region;
      Eigen::MatrixXd covariance;
      moments(scene_, own, peaks_[j].center, region.center, covariance);
      const Eigen::LLT<Eigen::MatrixXd> root(covariance);
      if (root.info() != Eigen::Success) continue;
      region.root = root.matrixL();
      if (auto model = LocalModel::fit(scene_, std::move(region), about.nodes, worth_of(j),
                                       kLightTolerance * inflation_)) {
        about.model = std::move(*model);
      }
    }
  }

  /// Compares local light with exact light at some draws from the answer. If their log posteriors
  /// differ by more than kMaxOff, all samples get exact light.
  void check() {
    std::vector<std::size_t> draws;
    double cumulative = 0;
    double local = 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) local += local_[i] ? samples_[i].weight : 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      if (!local_[i]) continue;
      cumulative += samples_[i].weight;
      if (cumulative > local * (static_cast<double>(draws.size()) + 0.5) / kChecks) {
        draws.push_back(i);
      }
    }
    if (draws.size() < 2) return;
    std::vector<double> off;
    for (const std::size_t i : draws) off.push_back(samples_[i].log_target);
    forget(draws);
    double mean = 0;
    for (std::size_t k = 0; k < draws.size(); ++k) {
      off[k] -= samples_[draws[k]].log_target;
      mean += off[k] / static_cast<double>(draws.size());
    }
    double square = 0;
    for (const double difference : off) square += std::pow(difference - mean, 2);
    if (square > kMaxOff * kMaxOff * static_cast<double>(draws.size())) {
      std::vector<std::size_t> all;
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        if (local_[i]) all.push_back(i);
      }
      forget(all);
    }
    weigh();
  }

  /// Notes the samples' moments, and returns whether they have hardly changed since there were half
  /// as many samples. If they still grow, a part of the posterior has no sample yet: for example
  /// the end of a ridge that bends away from its peak.
  bool settled() {
    std::vector<const PosteriorSample*> weighty;
    for (const PosteriorSample& sample : samples_) {
      if (sample.weight > 0) weighty.push_back(&sample);
    }
    if (weighty.empty()) return false;
    past_.push_back({samples_.size(), peak_of(weighty)});
    const auto half = std::find_if(past_.rbegin(), past_.rend(), [&](const Past& past) {
      return 2 * past.samples <= samples_.size();
    });
    if (half == past_.rend()) return false;
    const Peak& before = half->moments;
    const Eigen::MatrixXd change = before.root.triangularView<Eigen::Lower>().solve(own().root);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> growth(change * change.transpose(),
                                                                Eigen::EigenvaluesOnly);
    return growth.eigenvalues().maxCoeff() < kGrowth * kGrowth &&
           mahalanobis2(scene_, before, own().center) < kShift * kShift;
  }
  int count() const { return static_cast<int>(samples_.size()); }

  PosteriorSamples result() && { return {std::move(samples_), log_evidence_, effective_}; }

 private:
  /// The samples' moments at the end of the last stage.
  const Peak& own() const { return past_.back().moments; }

  double total_drawn() const { return static_cast<double>(samples_.size()); }

  void draw() {
    const Eigen::VectorXd point = points_.next();
    const Eigen::VectorXd u = point.tail(point.size() - 1);
    double pick = point[0];
    std::size_t c = 0;
    while (c + 1 < shares_.size() && pick > shares_[c]) pick -= shares_[c++];
    PosteriorSample sample;
    sample.pose = c == 0 ? grid_.draw(u) : draw_student(components_[c - 1], u);
    wrap_pose(scene_, sample.pose);
    sample.log_target = -std::numeric_limits<double>::infinity();
    sample.log_posterior = sample.log_target;
    std::vector<double> densities{grid_.density(sample.pose)};
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < components_.size(); ++j) {
      const double distance2 = mahalanobis2(scene_, components_[j], sample.pose);
      densities.push_back(std::exp(log_student(components_[j], distance2)));
      if (j < peaks_.size() && distance2 < nearest) {
        nearest = distance2;
        sample.peak = j;
      }
    }
    near_.push_back(nearest < lights_.reach * lights_.reach);
    samples_.push_back(std::move(sample));
    densities_.push_back(std::move(densities));
  }

  /// The known light about a peak.
  struct Around {
    std::vector<LightNode> nodes;  ///< exact light of samples near it
    std::size_t fitted_to = 0;     ///< number of nodes at the last fit
    std::optional<LocalModel> model;
  };

  /// Evaluates all samples from `first` on.
  void evaluate_from(std::size_t first) {
    std::vector<std::size_t> which(samples_.size() - first);
    std::iota(which.begin(), which.end(), first);
    local_.resize(samples_.size(), 0);
    evaluate(which);
  }

  /// Drops all local models and evaluates samples again with exact light.
  void forget(const std::vector<std::size_t>& which) {
    for (Around& about : around_) about.model.reset();
    evaluate(which);
  }

  void evaluate(const std::vector<std::size_t>& which) {
    std::vector<Eigen::VectorXd> exact(which.size());
    parallel_for(std::size_t{0}, which.size(),
                 [&](std::size_t k) { evaluate(which[k], exact[k]); });
    if (lights_.far.models == nullptr) return;
    for (std::size_t k = 0; k < which.size(); ++k) {
      const PosteriorSample& sample = samples_[which[k]];
      if (exact[k].size() > 0) {
        around_[sample.peak].nodes.push_back({sample.pose, std::move(exact[k])});
      }
    }
  }

  /// Evaluates sample `i`. `exact` receives the light if it is exact and the peak is near.
  void evaluate(std::size_t i, Eigen::VectorXd& exact) {
    PosteriorSample& sample = samples_[i];
    local_[i] = 0;
    if (!std::isfinite(log_pose_prior(scene_, sample.pose))) return;
    LinearSolution linear = optima_[sample.peak]->linear;  // warm start
    thread_local ShapeBuffer buffer;
    const std::optional<LocalModel>& model = around_[sample.peak].model;
    if (near_[i] && model && model->covers(scene_, sample.pose)) {
      local_[i] = 1;
      objective_.shapes(*model, sample.pose, buffer);
    } else {
      objective_.shapes(near_[i] ? lights_.near[sample.peak] : lights_.far, sample.pose, buffer);
      if (near_[i]) exact = light_of(buffer);
    }
    const PoseValue value = objective_.evaluate(buffer, sample.pose, linear, true, kAccuracy);
    sample.log_posterior = value.log_posterior;
    sample.log_target = tempered(value, inflation_);
  }

  /// Information of each row about its light, at the mean of the nodes' light. A single node's
  /// light would claim too much in bins that are dark at this node and lit at others.
  Eigen::VectorXd worth_of(std::size_t peak) const {
    const std::vector<LightNode>& nodes = around_[peak].nodes;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(nodes.front().light.size());
    for (const LightNode& node : nodes) mean += node.light / static_cast<double>(nodes.size());
    ShapeBuffer light;
    objective_.shapes_of({mean.data(), static_cast<std::size_t>(mean.size())}, light);
    LinearSolution linear = optima_[peak]->linear;
    objective_.evaluate(light, optima_[peak]->pose, linear, true, kAccuracy);
    return row_information(objective_.solver(), light.shapes, linear);
  }

  void weigh() {
    std::vector<double> logs(samples_.size());
    double top = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      double density = 0;
      for (std::size_t c = 0; c < drawn_.size(); ++c) density += drawn_[c] * densities_[i][c];
      logs[i] = samples_[i].log_target - std::log(density / total_drawn());
      top = std::max(top, logs[i]);
    }
    double sum = 0;
    double squares = 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const double weight = std::isfinite(logs[i]) ? std::exp(logs[i] - top) : 0.0;
      samples_[i].weight = weight;
      sum += weight;
      squares += weight * weight;
    }
    if (!(sum > 0)) return;
    log_evidence_ = top + std::log(sum / total_drawn());
    effective_ = squares > 0 ? sum * sum / squares : 0;
    for (PosteriorSample& sample : samples_) sample.weight /= sum;
  }

  /// A component with the samples' own moments, widened a little.
  Peak peak_of(const std::vector<const PosteriorSample*>& weighty) const {
    const PoseVector reference =
        (*std::ranges::max_element(weighty, {}, &PosteriorSample::weight))->pose;
    Peak peak;
    moments(scene_, weighty, reference, peak.center, peak.covariance);
    peak.covariance *= kWiden;
    finish_peak(peak);
    return peak;
  }

  /// Root and determinant of a component's covariance. The covariance cannot vanish: a standard
  /// deviation is at least a hundredth of the grid's spacing.
  void finish_peak(Peak& peak) const {
    for (Eigen::Index i = 0; i < peak.center.size(); ++i) {
      peak.covariance(i, i) += 1e-4 * std::pow(objective_.compiled().spacing[i], 2);
    }
    peak.root = peak.covariance.llt().matrixL();
    peak.log_det = 2 * peak.root.diagonal().array().log().sum();
  }

  /// Adds two components: one with the moments of the samples so far, and one about the heaviest
  /// sample, where the mixture falls short of the posterior most (Raftery and Bao 2010).
  void extend() {
    if (effective_ < 2.0 * static_cast<double>(scene_.unknowns.size() + 1)) return;
    add_component(own());
    add_component(about_heaviest());
  }

  void add_component(const Peak& peak) {
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      densities_[i].push_back(
          std::exp(log_student(peak, mahalanobis2(scene_, peak, samples_[i].pose))));
    }
    components_.push_back(peak);
    for (double& share : shares_) share *= 1 - kNewShare;
    shares_.push_back(kNewShare);
    drawn_.push_back(0);
  }

  /// A component about the heaviest sample, with the moments of its neighbours. Each neighbour
  /// counts by the sum of its own weight and the mean weight.
  Peak about_heaviest() const {
    const PosteriorSample& heaviest =
        *std::ranges::max_element(samples_, {}, &PosteriorSample::weight);
    Peak here = own();
    here.center = heaviest.pose;
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      if (!std::isfinite(samples_[i].log_target)) continue;
      order.emplace_back(mahalanobis2(scene_, here, samples_[i].pose), i);
    }
    const std::size_t count = std::min(order.size(), kNeighbours);
    std::ranges::partial_sort(order, order.begin() + static_cast<std::ptrdiff_t>(count));
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(here.center.size(), here.center.size());
    double total = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const PosteriorSample& sample = samples_[order[k].second];
      const double weight = sample.weight + 1 / total_drawn();
      const PoseVector d = pose_difference(scene_, here.center, sample.pose);
      covariance += weight * d * d.transpose();
      total += weight;
    }
    here.covariance = covariance / total;
    finish_peak(here);
    return here;
  }

  /// The moments of the first `samples` samples.
  struct Past {
    std::size_t samples;
    Peak moments;
  };

  const PoseObjective& objective_;
  const Scene& scene_;
  const SampleLights& lights_;
  const std::vector<Peak>& peaks_;
  const std::vector<const Refined*>& optima_;
  double inflation_;
  EvenPoints points_;
  GridProposal grid_;
  std::vector<Peak> components_;  // Student t: the peaks, their ridges, then extend()'s
  std::vector<double> shares_;    // of the grid, then of the components; they sum to one
  std::vector<double> drawn_;     // expected number of samples from each so far
  std::vector<PosteriorSample> samples_;
  std::vector<bool> near_;                      // [sample] whether a peak is near
  std::vector<char> local_;                     // [sample] whether evaluated with local light
  std::vector<Around> around_;                  // [peak] known light
  std::vector<std::vector<double>> densities_;  // [sample][grid, components]
  std::vector<Past> past_;                      // at the end of each stage
  double log_evidence_ = 0;
  double effective_ = 0;
};

}  // namespace

PoseVector whitened(const Scene& scene, const Peak& peak, const PoseVector& pose) {
  const PoseVector d = pose_difference(scene, peak.center, pose);
  return peak.root.triangularView<Eigen::Lower>().solve(d);
}

double mahalanobis2(const Scene& scene, const Peak& peak, const PoseVector& pose) {
  return whitened(scene, peak, pose).squaredNorm();
}

double tempered(const PoseValue& value, double inflation) {
  return value.log_integrand - value.log_likelihood * (1 - 1 / inflation);
}

void moments(const Scene& scene, const std::vector<const PosteriorSample*>& samples,
             const PoseVector& reference, PoseVector& mean, Eigen::MatrixXd& covariance) {
  PoseVector shift = PoseVector::Zero(reference.size());
  double total = 0;
  for (const PosteriorSample* s : samples) {
    shift += s->weight * pose_difference(scene, reference, s->pose);
    total += s->weight;
  }
  shift /= total;
  covariance.setZero(reference.size(), reference.size());
  for (const PosteriorSample* s : samples) {
    const PoseVector d = pose_difference(scene, reference, s->pose) - shift;
    covariance += s->weight / total * d * d.transpose();
  }
  mean = reference + shift;
  wrap_pose(scene, mean);
}

PosteriorSamples sample_posterior(const PoseObjective& objective, const SampleLights& lights,
                                  const std::vector<Peak>& peaks, const std::vector<Peak>& ridges,
                                  const std::vector<const Refined*>& optima, const Scored& scored,
                                  const SamplingOptions& options) {
  Sampler sampler(objective, lights, peaks, ridges, optima, scored, options);
  const int stage = std::clamp(options.samples / kStages, 1, kMaxAtOnce);
  // The model itself is expensive, so a smaller number of effective samples is enough.
  const double enough = options.samples / (lights.far.models == nullptr ? 3.0 : 4.0);
  while (sampler.count() < kMaxTimes * options.samples) {
    sampler.stage(stage);
    if (options.local_light) sampler.learn();
    if (sampler.settled() && sampler.effective() >= enough) break;
    sampler.adapt();
  }
  sampler.check();
  return std::move(sampler).result();
}

}  // namespace blindcorner
