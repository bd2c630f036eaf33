// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/scoring.h"

#include <tbb/blocked_range.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "forward/support/multiversion.h"
#include "forward/support/parallel.h"

namespace blindcorner {
namespace {

/// Number of poses scored exactly: this many times the wanted starts, but at least `kMinExact`. By
/// judgement: neighbours of a local maximum score nearly as well, and only one of them becomes a
/// start.
constexpr int kExactPerStart = 8;
constexpr int kMinExact = 64;
/// An object is faint below this gain in log likelihood over the empty scene. This is about a
/// hundred photons on a background of as many, with a signal-to-noise ratio of sqrt(2 * 100) = 14.
constexpr double kFaint = 100;
/// Most poses that the model scores again where the closed form is too rough. The model costs a
/// hundred times as much, so these poses cost ten times as much as the closed form's 600.
constexpr std::size_t kMaxByModel = 64;
/// Accuracy of a template's log posterior, far below the effect of half a grid step.
constexpr double kAccuracy = 1e-2;
/// Templates that are scored exactly at a time. By judgement: some for each core, and few enough to
/// stop in time.
constexpr std::size_t kTogether = 8;
/// Starts that are refined even if the grid has fewer local maxima, because ridges run between the
/// grid points. By judgement: as many as are followed at a time.
constexpr std::size_t kMinStarts = 4;

/// Least variance. Its inverse still fits into a weight of single precision, which ends at 1e38.
constexpr double kNoVariance = 1e-30;

/// Gain in log likelihood at the best non-negative amplitude.
float gain(float projection, float norm) {
  const float positive = std::max(projection, 0.0F);
  return 0.5F * positive * positive / std::max(norm, 1e-30F);
}

/// Floats in the widest vector register (512 bits).
constexpr int kLanes = 16;

/// sum t a
BLINDCORNER_MULTIVERSION float dot(const float* t, const float* a, int count) {
  float lanes[kLanes] = {};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (int k = 0; k < kLanes; ++k) lanes[k] += t[i + k] * a[i + k];
  }
  for (int k = 0; i < count; ++i, ++k) lanes[k] += t[i] * a[i];
  return std::accumulate(lanes, lanes + kLanes, 0.0F);
}

/// out += sum t a for several a, whose elements lie side by side: [count][sets].
BLINDCORNER_MULTIVERSION void add_dots(const float* t, const float* a, int count, int sets,
                                       float* out) {
  for (int i = 0; i < count; ++i) {
    if (t[i] == 0) continue;
    for (int set = 0; set < sets; ++set) out[set] += t[i] * a[i * sets + set];
  }
}

/// sum t^2 w
BLINDCORNER_MULTIVERSION float weighted_square(const float* t, const float* w, int count) {
  float lanes[kLanes] = {};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (int k = 0; k < kLanes; ++k) lanes[k] += t[i + k] * (t[i + k] * w[i + k]);
  }
  for (int k = 0; i < count; ++i, ++k) lanes[k] += t[i] * (t[i] * w[i]);
  return std::accumulate(lanes, lanes + kLanes, 0.0F);
}

/// The first `most` elements of a list (best first) that are not next to an element taken before.
/// `next_to` compares two elements.
template <typename Element>
std::vector<Element> apart(const std::vector<Element>& list, std::size_t most,
                           const auto& next_to) {
  std::vector<Element> taken;
  for (const Element& element : list) {
    if (taken.size() == most) break;
    const auto close = [&](const Element& other) { return next_to(other, element); };
    if (std::ranges::none_of(taken, close)) taken.push_back(element);
  }
  return taken;
}

/// The poses with the `count` highest scores, best first.
std::vector<int> best_first(const Eigen::VectorXf& scores, std::size_t count) {
  std::vector<int> order(static_cast<std::size_t>(scores.size()));
  std::iota(order.begin(), order.end(), 0);
  count = std::min(count, order.size());
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
      [&](int a, int b) { return scores[a] != scores[b] ? scores[a] > scores[b] : a < b; });
  order.resize(count);
  return order;
}

}  // namespace

// max over u of p e^u - n e^2u / 2 - (u - mu)^2 / 2 s^2, by Newton's method from both sides: there
// may be one maximum near the data's amplitude and another near the prior's.
Eigen::VectorXf gain_under_prior(const GainOfAmplitude& gains, const AmplitudePrior& prior) {
  // From starts on the right side, each step at least doubles the digits. This is enough to compare
  // poses.
  constexpr int kSteps = 3;
  using Array = Eigen::ArrayXf;
  const Array p = gains.projection.array();
  const Array n = gains.norm.array().max(1e-30F);
  const auto mu = static_cast<float>(std::log(prior.median));
  const auto precision = static_cast<float>(std::pow(prior.sigma_log, -2));
  const auto climb = [&](Array u) -> Array {
    for (int k = 0; k < kSteps; ++k) {
      const Array a = u.exp();
      const Array curvature = (a * (2 * n * a - p)).max(0) + precision;
      u += ((a * (p - n * a) - precision * (u - mu)) / curvature).max(-1).min(1);
    }
    const Array a = u.exp();
    return a * (p - 0.5F * n * a) - 0.5F * precision * (u - mu).square();
  };
  // With the quadratic term alone, the maximum is at mu - W(2 s^2 n e^2mu) / 2. With a negative
  // linear term alone, it is at mu - W(-s^2 p e^mu). W is Lambert's function.
  const auto lambert = [](const Array& x) -> Array {
    const Array w = x.log1p();
    return w * (1 - w.log1p() / (2 + w));
  };
  const auto median = static_cast<float>(prior.median);
  const Array dark = mu - (0.5F * lambert(n * (2 * median * median / precision)))
                              .max(lambert((-p).max(0) * (median / precision)));
  const Array peak = (p / n).max(1e-30F).log();
  return climb(dark.max(peak.min(mu))).max(climb(dark.max(peak)));
}

MatchedFilter::MatchedFilter(const PoseObjective& objective, const LinearSolution& empty,
                             Weights weights, Priors priors)
    : objective_(objective), priors_(priors) {
  const Observation& observation = objective.solver().observation();
  ShapeBuffer buffer;
  objective.empty_shapes(buffer);
  mean_.resize(objective.rows());
  counts_.resize(objective.rows());
  weight_.resize(objective.rows());
  basis_ = Eigen::MatrixXf::Zero(objective.rows(), 2);
  pull_ = Eigen::MatrixXf::Zero(static_cast<Eigen::Index>(observation.zones.size()), 2);
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  std::vector<double> mean;
  int row = 0;
  for (std::size_t z = 0; z < observation.zones.size(); ++z) {
    const ObservedZone& zone = observation.zones[z];
    const BinLikelihood& noise_model = observation.noise_model(zone);
    const int bins = zone.bins();
    zone_begin_.push_back(row);
    mean.resize(static_cast<std::size_t>(bins));
    objective.solver().expected(zone, buffer.shapes[z], empty.amplitude[z], empty.ambient[z],
                                empty.direct[z], mean.data());
    for (int k = 0; k < bins; ++k) {
      const auto i = static_cast<std::size_t>(k);
      double level = noise_model.lit(mean[i]);
      if (weights == Weights::observed) {
        const double before = zone.counts[static_cast<std::size_t>(std::max(k - 1, 0))];
        const double after = zone.counts[static_cast<std::size_t>(std::min(k + 1, bins - 1))];
        level = std::max(level, 0.25 * before + 0.5 * zone.counts[i] + 0.25 * after);
      }
      mean_[row + k] = static_cast<float>(mean[i]);
      counts_[row + k] = static_cast<float>(zone.counts[i]);
      weight_[row + k] = static_cast<float>(zone.weight_of(k) /
                                            std::max(noise_model.variance(level), kNoVariance));
    }
    // Nuisance directions: first the ambient light, for which its prior and the bins outside the
    // gate count as well, then the direct return. They are orthogonal in the weighted inner
    // product.
    const auto w = weight_.segment(row, bins);
    const auto zone_index = static_cast<Eigen::Index>(z);
    double beyond = 0;  // information about the ambient light from elsewhere
    double slope = 0;   // of the log posterior in the ambient light, from there
    if (unknowns.ambient == LinearMode::per_zone) {
      const double c = empty.ambient[z];
      const double weight = 1 / std::max(noise_model.variance(noise_model.lit(c)), kNoVariance);
      beyond = zone.outside_bins * weight;
      if (priors == Priors::used) {
        slope = (zone.outside_count - zone.outside_bins * c) * weight;
        if (!unknowns.ambient_prior.empty()) {
          const NormalPrior& prior = unknowns.ambient_prior[static_cast<std::size_t>(zone.zone)];
          const double precision = std::pow(prior.sigma, -2);
          beyond += precision;
          slope += (prior.mean - c) * precision;
        }
      }
      const auto norm = static_cast<float>(static_cast<double>(w.sum()) + beyond);
      basis_.block(row, 0, bins, 1).setConstant(1 / std::sqrt(norm));
      pull_(zone_index, 0) = static_cast<float>(slope) / std::sqrt(norm);
    }
    if (unknowns.direct == LinearMode::per_zone && buffer.shapes[z].direct != nullptr) {
      Eigen::VectorXf t(bins);
      for (int k = 0; k < bins; ++k) t[k] = static_cast<float>(buffer.shapes[z].direct[k]);
      const Eigen::VectorXf e = basis_.block(row, 0, bins, 1);
      const float before = (t.array() * t.array() * w.array()).sum();
      const float along = (t.array() * e.array() * w.array()).sum();
      t -= e * along;
      const float norm = (t.array() * t.array() * w.array()).sum();
      if (norm > 1e-6F * before) {
        basis_.block(row, 1, bins, 1) = t / std::sqrt(norm);
        pull_(zone_index, 1) = -along * pull_(zone_index, 0) / std::sqrt(norm);
      }
    }
    row += bins;
  }
  zone_begin_.push_back(row);
}

Eigen::MatrixXf MatchedFilter::scores_of(const Templates& templates, const Eigen::MatrixXf& counts,
                                         GainOfAmplitude* gains) const {
  const Eigen::Index sets = counts.cols();
  const bool shared = objective_.solver().unknowns().amplitude != LinearMode::per_zone;
  const bool nuisance = (basis_.array() != 0).any();

  // Weighted counts that the nuisance directions do not explain, [sets, rows].
  const Eigen::MatrixXf weighted_basis = weight_.asDiagonal() * basis_;
  Eigen::MatrixXf residual = (counts.colwise() - mean_).transpose();
  for (std::size_t z = 0; z + 1 < zone_begin_.size() && nuisance; ++z) {
    const int begin = zone_begin_[z];
    const int bins = zone_begin_[z + 1] - begin;
    auto r = residual.middleCols(begin, bins);
    Eigen::MatrixXf along = r * weighted_basis.middleRows(begin, bins);
    along.rowwise() += pull_.row(static_cast<Eigen::Index>(z));
    r -= along * basis_.middleRows(begin, bins).transpose();
  }
  residual = residual * weight_.asDiagonal();

  const auto poses = static_cast<Eigen::Index>(templates.poses());
  Eigen::MatrixXf scores(poses, sets);
  if (gains != nullptr) {
    gains->projection.resize(poses);
    gains->norm.resize(poses);
  }
  const auto score = [&](Eigen::Index pose, Eigen::VectorXf& along, Eigen::VectorXf& projection,
                         Eigen::VectorXf& total) {
    projection.setZero();
    total.setZero();
    float norm = 0;
    const Templates::Column& column = templates.column(static_cast<std::size_t>(pose));
    for (const Templates::Piece& piece : column.pieces) {
      if (piece.count == 0) continue;
      const float* t = column.counts.data() + piece.from;
      float square = weighted_square(t, weight_.data() + piece.row, piece.count);
      for (Eigen::Index k = 0; k < basis_.cols() && nuisance; ++k) {
        const float explained = dot(t, weighted_basis.col(k).data() + piece.row, piece.count);
        square -= explained * explained;
      }
      if (sets == 1) {
        along[0] = dot(t, residual.data() + piece.row, piece.count);
      } else {
        along.setZero();
        add_dots(t, residual.col(piece.row).data(), piece.count, static_cast<int>(sets),
                 along.data());
      }
      norm += square;
      projection += along;
      if (!shared) total += along.unaryExpr([&](float a) { return gain(a, square); });
    }
    if (shared) total = projection.unaryExpr([&](float p) { return gain(p, norm); });
    scores.row(pose) = total;
    if (gains != nullptr) {
      gains->projection[pose] = projection[0];
      gains->norm[pose] = norm;
    }
  };
  parallel_for(tbb::blocked_range<Eigen::Index>(0, poses, 64), [&](const auto& part) {
    Eigen::VectorXf along = Eigen::VectorXf::Zero(sets), projection = along, total = along;
    for (Eigen::Index pose = part.begin(); pose != part.end(); ++pose) {
      score(pose, along, projection, total);
    }
  });
  return scores;
}

Eigen::VectorXf MatchedFilter::scores() const {
  return scores(objective_.compiled().templates(), counts_);
}

Eigen::VectorXf MatchedFilter::scores(const Templates& templates,
                                      const Eigen::VectorXf& counts) const {
  const LinearUnknowns& unknowns = objective_.solver().unknowns();
  if (priors_ == Priors::ignored || unknowns.amplitude == LinearMode::per_zone) {
    return scores_of(templates, counts).col(0);
  }
  GainOfAmplitude gains;
  scores_of(templates, counts, &gains);
  if (unknowns.amplitude == LinearMode::fixed) {
    const auto a = static_cast<float>(unknowns.fixed_amplitude);
    return a * (gains.projection - 0.5F * a * gains.norm);
  }
  return gain_under_prior(gains, unknowns.amplitude_prior);
}

Eigen::VectorXf MatchedFilter::largest_scores(const Eigen::MatrixXf& counts) const {
  return scores_of(objective_.compiled().templates(), counts).colwise().maxCoeff().transpose();
}

namespace {

/// Places of some of the objects, the light of these objects, and how well it explains the counts.
struct Arrangement {
  std::vector<int> place;  // [objects] index into the object's grid; -1: not placed
  Eigen::VectorXf light;   // [rows]
  double log_posterior = 0;
};

/// Whether two places of an object are neighbours on its grid.
struct NextTo {
  const CompiledScene::ObjectGrid& grid;

  bool operator()(int a, int b) const {
    const PoseVector difference =
        grid.poses[static_cast<std::size_t>(a)] - grid.poses[static_cast<std::size_t>(b)];
    return (difference.array().abs() < kNextOnGrid * grid.spacing.array()).all();
  }
};

/// Moves one object of `pose` to a place on that object's grid.
void put(const CompiledScene& compiled, std::size_t object, int place, PoseVector& pose) {
  const PoseVector& own = compiled.objects()[object].poses[static_cast<std::size_t>(place)];
  const auto& unknowns = compiled.scene.unknowns;
  Eigen::Index used = 0;
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    if (unknowns[i].object != static_cast<int>(object)) continue;
    pose[static_cast<Eigen::Index>(i)] = own[used++];
  }
}

/// Finds places for the objects one after the other.
class Arranger {
 public:
  Arranger(const PoseObjective& objective, const LinearSolution& empty)
      : objective_(objective),
        grids_(objective.compiled().objects()),
        filter_(objective, empty, MatchedFilter::Weights::observed, MatchedFilter::Priors::used) {}

  Arrangement nothing() const {
    return {std::vector<int>(grids_.size(), -1), Eigen::VectorXf::Zero(objective_.rows()), 0};
  }

  /// `from` with the object at each of its `most` best places, none of them next to a better one.
  std::vector<Arrangement> placed(Arrangement from, std::size_t object, std::size_t most) const {
    const CompiledScene::ObjectGrid& grid = grids_[object];
    if (from.place[object] >= 0) {
      grid.templates.add(static_cast<std::size_t>(from.place[object]), -1, from.light);
    }
    const bool any = std::ranges::any_of(
        from.place, [&](const int& p) { return p >= 0 && &p != &from.place[object]; });
    Eigen::VectorXf left = filter_.counts();
    if (any) left -= amplitude_of(from) * from.light;
    const Eigen::VectorXf scores = filter_.scores(grid.templates, left);
    const std::vector<int> order = best_first(scores, static_cast<std::size_t>(scores.size()) / 4);
    std::vector<Arrangement> result;
    for (const int i : apart(order, most, NextTo{grid})) {
      Arrangement next = from;
      next.place[object] = i;
      grid.templates.add(static_cast<std::size_t>(i), 1, next.light);
      next.log_posterior = value_of(next);
      result.push_back(std::move(next));
    }
    return result;
  }

  PoseVector pose_of(const Arrangement& arrangement) const {
    PoseVector pose(objective_.compiled().unknown_count());
    for (std::size_t object = 0; object < grids_.size(); ++object) {
      put(objective_.compiled(), object, arrangement.place[object], pose);
    }
    return pose;
  }

 private:
  /// The log posterior. Once all objects are placed, it includes their shadows on each other.
  double value_of(const Arrangement& arrangement) const {
    LinearSolution solution;
    if (std::ranges::any_of(arrangement.place, [](int place) { return place < 0; })) {
      return objective_.evaluate_light(arrangement.light, solution, kAccuracy);
    }
    return objective_
        .evaluate(LightSource(objective_.compiled().coarse), pose_of(arrangement), solution, false,
                  kAccuracy)
        .log_posterior;
  }
  float amplitude_of(const Arrangement& arrangement) const {
    LinearSolution solution;
    objective_.evaluate_light(arrangement.light, solution, kAccuracy);
    return static_cast<float>(solution.amplitude.front());
  }

  const PoseObjective& objective_;
  const std::vector<CompiledScene::ObjectGrid>& grids_;
  MatchedFilter filter_;
};

}  // namespace

std::vector<Candidate> object_starts(const PoseObjective& objective, const LinearSolution& empty,
                                     std::size_t count) {
  // Places for the first object, places for each further object beside it, and arrangements that
  // are swept afterwards. By judgement: they bound the time.
  constexpr std::size_t kFirst = 12, kNext = 6, kSwept = 8;
  const std::size_t objects = objective.compiled().objects().size();
  const Arranger arranger(objective, empty);
  const auto better = [](const Arrangement& a, const Arrangement& b) {
    return a.log_posterior != b.log_posterior ? a.log_posterior > b.log_posterior
                                              : a.place < b.place;
  };
  std::vector<Arrangement> found;
  for (std::size_t first = 0; first < objects; ++first) {
    std::vector<Arrangement> beam{arranger.nothing()};
    for (std::size_t step = 0; step < objects; ++step) {
      std::vector<Arrangement> next;
      for (const Arrangement& from : beam) {
        std::ranges::move(
            arranger.placed(from, (first + step) % objects, step == 0 ? kFirst : kNext),
            std::back_inserter(next));
      }
      std::ranges::sort(next, better);
      if (next.size() > kFirst * kNext) next.resize(kFirst * kNext);
      beam = std::move(next);
    }
    std::ranges::move(beam, std::back_inserter(found));
  }
  const auto unique = [&] {
    std::ranges::sort(found, better);
    found.erase(std::unique(found.begin(), found.end(),
                            [](const auto& a, const auto& b) { return a.place == b.place; }),
                found.end());
  };
  unique();
  for (std::size_t i = 0, swept = std::min(kSwept, found.size()); i < swept; ++i) {
    Arrangement at = found[i];
    for (std::size_t object = 0; object < objects; ++object) {
      const Arrangement moved = arranger.placed(at, object, 1).front();
      if (moved.log_posterior > at.log_posterior) at = moved;
    }
    found.push_back(std::move(at));
  }
  unique();
  std::vector<Candidate> starts;
  for (const Arrangement& arrangement : found) {
    if (starts.size() == count) break;
    starts.push_back({-1, arrangement.log_posterior, arranger.pose_of(arrangement)});
  }
  return starts;
}

std::vector<PoseVector> other_places(const PoseObjective& objective, const PoseVector& optimum,
                                     const LinearSolution& linear, std::size_t most) {
  const CompiledScene& compiled = objective.compiled();
  ShapeBuffer right;
  ShapeBuffer closed;
  objective.shapes(objective.rough_models(), optimum, right);
  objective.shapes(LightSource(compiled.coarse), optimum, closed);
  const Correction correction = objective.correction(right, closed);
  const LightSource light = LightSource(compiled.coarse).corrected(correction);
  std::vector<PoseVector> chosen;
  for (std::size_t object = 0; object < compiled.objects().size(); ++object) {
    const CompiledScene::ObjectGrid& grid = compiled.objects()[object];
    const auto with = [&](int place) {
      PoseVector pose = optimum;
      put(compiled, object, place, pose);
      return pose;
    };
    Eigen::VectorXf scores(std::ssize(grid.poses));
    parallel_for(Eigen::Index{0}, scores.size(), [&](Eigen::Index i) {
      LinearSolution solution = linear;
      scores[i] = static_cast<float>(
          objective.evaluate(light, with(static_cast<int>(i)), solution, true, kAccuracy)
              .log_posterior);
    });
    for (const int i : apart(best_first(scores, grid.poses.size()), most, NextTo{grid})) {
      chosen.push_back(with(i));
    }
  }
  return chosen;
}

Scored score(const PoseObjective& objective, const LinearSolution& empty, int count,
             double negligible) {
  const CompiledScene& compiled = objective.compiled();
  const LinearUnknowns& unknowns = objective.solver().unknowns();
  Scored result;
  result.empty = empty.log_likelihood + empty.log_prior;
  if (unknowns.amplitude != LinearMode::fixed) {
    const double amplitudes =
        unknowns.amplitude == LinearMode::shared ? 1.0 : static_cast<double>(empty.ambient.size());
    result.empty -= amplitudes * std::log(unknowns.amplitude_prior.sigma_log * std::sqrt(2 * kPi));
  }
  const Eigen::Map<const Eigen::VectorXf> prior(compiled.log_prior.data(),
                                                std::ssize(compiled.log_prior));
  const auto scores_with = [&](MatchedFilter::Weights weights) -> Eigen::VectorXf {
    return MatchedFilter(objective, empty, weights, MatchedFilter::Priors::used).scores() + prior;
  };
  std::vector<Candidate>& scored = result.exact;
  const auto gain_of = [&](const Candidate& c) {
    return c.log_posterior - result.empty - static_cast<double>(prior[c.index]);
  };
  const auto wanted = static_cast<std::size_t>(std::max(kMinExact, kExactPerStart * count));
  std::vector<bool> known(compiled.poses.size());
  double best = -std::numeric_limits<double>::infinity();
  double gain = 0;  // of the best pose, over the empty scene
  // A template half a grid step off keeps at least 0.8 of its gain over the empty scene (kGridStep:
  // 0.91 squared). It therefore lacks at most 0.25 of the gain that it keeps.
  const auto cut = [&] { return best - negligible - 0.25 * gain; };
  // Computes exact scores of the poses that the filter puts first. The filter's score approximates
  // the gain over the empty scene. If even half as much again is too little for a start, the
  // remaining poses are too low as well.
  const auto evaluate_best = [&](const Eigen::VectorXf& scores, const std::vector<int>& order,
                                 std::size_t end) {
    for (std::size_t i = 0; i < order.size() && scored.size() < end;) {
      // The number scored at a time is fixed, so that answers do not depend on threads.
      const std::size_t first = scored.size();
      bool hopeless = false;
      for (; i < order.size() && scored.size() < std::min(end, first + kTogether); ++i) {
        const int pose = order[i];
        if (known[static_cast<std::size_t>(pose)]) continue;
        const auto score = static_cast<double>(scores[pose]);
        const double doubt = 0.5 * std::abs(score - static_cast<double>(prior[pose]));
        hopeless = i >= kMinExact / 2 && result.empty + score + doubt < cut();
        if (hopeless) break;
        known[static_cast<std::size_t>(pose)] = true;
        scored.push_back({pose, 0, compiled.poses[static_cast<std::size_t>(pose)]});
      }
      parallel_for(first, scored.size(), [&](std::size_t k) {
        LinearSolution solution;
        scored[k].log_posterior =
            objective.evaluate_template(scored[k].index, solution, false, kAccuracy).log_posterior;
      });
      for (std::size_t k = first; k < scored.size(); ++k) {
        if (scored[k].log_posterior <= best) continue;
        best = scored[k].log_posterior;
        gain = std::max(gain_of(scored[k]), 0.0);
      }
      if (hopeless) break;
    }
  };
  // The photons of a bright object raise the variance of their bins. If a few photons lie on a
  // faint background, treating each as a bright object's would take its weight away.
  using Weights = MatchedFilter::Weights;
  result.scores = scores_with(Weights::observed);
  const std::vector<int> order = best_first(result.scores, wanted);
  evaluate_best(result.scores, order, wanted / 2);
  if (gain < kFaint) {
    const Eigen::VectorXf faint = scores_with(Weights::expected);
    evaluate_best(faint, best_first(faint, wanted), wanted);
  } else {
    evaluate_best(result.scores, order, wanted);
  }
  std::sort(scored.begin(), scored.end(), [](const Candidate& a, const Candidate& b) {
    return a.log_posterior != b.log_posterior ? a.log_posterior > b.log_posterior
                                              : a.index < b.index;
  });
  const auto near = [&](const Candidate& a, const Candidate& b) {
    return within_spacings(compiled, compiled.poses[static_cast<std::size_t>(a.index)],
                           compiled.poses[static_cast<std::size_t>(b.index)], kNextOnGrid);
  };
  // The grid's local maxima come first. The best poses on slopes follow, in case a ridge runs
  // between the grid points.
  std::vector<Candidate>& chosen = result.starts;
  std::vector<Candidate> slopes;
  for (std::size_t i = 0; i < scored.size(); ++i) {
    if (scored[i].log_posterior < cut()) break;
    const auto better = scored.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::none_of(scored.begin(), better, [&](const auto& c) { return near(c, scored[i]); })) {
      if (static_cast<int>(chosen.size()) < count) chosen.push_back(scored[i]);
    } else if (slopes.size() < kMinStarts * 8) {
      slopes.push_back(scored[i]);
    }
  }
  for (const Candidate& slope : slopes) {
    if (chosen.size() >= std::min<std::size_t>(kMinStarts, static_cast<std::size_t>(count))) break;
    if (std::none_of(chosen.begin(), chosen.end(), [&](const auto& c) { return near(c, slope); })) {
      chosen.push_back(slope);
    }
  }
  if (!compiled.objects().empty()) {
    std::vector<Candidate> starts =
        object_starts(objective, empty, static_cast<std::size_t>(count));
    std::ranges::move(chosen, std::back_inserter(starts));
    chosen = std::move(starts);
  }
  return result;
}

std::vector<PoseVector> best_by_model(const PoseObjective& objective, const Scored& scored,
                                      std::size_t count) {
  const CompiledScene& compiled = objective.compiled();
  struct Place {
    double log_posterior;
    PoseVector pose;
  };
  std::vector<Place> places;
  for (const Candidate& c : scored.starts) places.push_back({0, c.pose});
  // For several objects, the starts are arrangements: the scored poses of all objects together are
  // too far apart.
  if (compiled.objects().empty()) {
    for (const Candidate& c : scored.exact) {
      if (places.size() >= kMaxByModel) break;
      const bool start = std::ranges::any_of(
          scored.starts, [&](const Candidate& s) { return s.index == c.index; });
      if (!start) places.push_back({0, c.pose});
    }
  }
  parallel_for(std::size_t{0}, places.size(), [&](std::size_t i) {
    LinearSolution linear;
    places[i].log_posterior =
        objective.evaluate(objective.models(), places[i].pose, linear, false, kAccuracy)
            .log_posterior;
  });
  std::ranges::stable_sort(places, std::greater{}, &Place::log_posterior);
  const auto next_to = [&](const Place& a, const Place& b) {
    return within_spacings(compiled, a.pose, b.pose, kNextOnGrid);
  };
  std::vector<PoseVector> chosen;
  for (const Place& place : apart(places, count, next_to)) chosen.push_back(place.pose);
  return chosen;
}

}  // namespace blindcorner
