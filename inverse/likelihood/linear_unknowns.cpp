// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/linear_unknowns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

/// Most Newton steps, by judgement far more than are needed: full steps double the digits. The
/// solution notes if it has not converged by then.
constexpr int kMaxIterations = 100;
/// Below this Newton decrement, one more full step reaches machine precision.
constexpr double kQuadratic = 1e-6;
/// The ambient light of a whole zone counts as none at this number of expected photons.
constexpr double kAmbientFloor = 1e-6;
/// Below this number of expected photons, a residual is a root of the mean and bends within a
/// difference step. Its slope is therefore taken over a change of this many photons. By judgement:
/// a bin with so few photons, and without a count, adds 0.02 to the deviance.
constexpr double kFewPhotons = 1e-2;
/// Share of an unknown's column that must remain to tell this unknown from the ones before it.
/// Light as even as the ambient light leaves only rounding: 1e-16 per bin, and 1e-12 with room for
/// thousands of bins.
constexpr double kNothingNew = 1e-12;
constexpr double kDoubleMax = std::numeric_limits<double>::max();
/// Below this size, a residual's slope comes from the quadratic about the best mean, because the
/// residual's square is then a difference of rounding errors.
constexpr double kSmallResidual = 1e-6;

/// Counts and weights of the bins [begin, end) of a zone.
CountRow row_of(const ObservedZone& zone, int begin, int end) {
  thread_local std::vector<int> censored;
  censored.clear();
  for (auto it = std::lower_bound(zone.censored.begin(), zone.censored.end(), begin);
       it != zone.censored.end() && *it < end; ++it) {
    censored.push_back(*it - begin);
  }
  return {zone.counts.data() + begin, zone.counted.data() + begin, censored, end - begin,
          zone.weight.empty() ? nullptr : zone.weight.data() + begin};
}

/// Expected light of the bins from `begin` on.
LinearLight light_of(const ZoneShapes& shapes, int begin, double amplitude, double ambient,
                     double direct) {
  return {shapes.object != nullptr ? shapes.object + begin : nullptr,
          shapes.direct != nullptr ? shapes.direct + begin : nullptr, amplitude, ambient, direct};
}

/// Logarithm of the integral over x >= 0 of exp(-gradient x - curvature x^2 / 2), gradient > 0.
double log_half_line(double gradient, double curvature) {
  constexpr double kSteep = 20;  // beyond it, the square changes less than 1 / kSteep^2
  if (!(curvature > 0) || gradient > kSteep * std::sqrt(curvature)) return -std::log(gradient);
  const double z = gradient / std::sqrt(curvature);
  return 0.5 * (std::log(kPi / (2 * curvature)) + z * z) + std::log(std::erfc(z / std::sqrt(2.0)));
}

/// Logarithm of the share above zero of a normal distribution with a mean >= 0.
double log_share_above(double mean, double variance) {
  if (!(variance > 0)) return 0;
  return std::log(0.5 * std::erfc(-mean / std::sqrt(2 * variance)));
}

double log_normal_prior(double log_a, const AmplitudePrior& prior) {
  const double u = (log_a - std::log(prior.median)) / prior.sigma_log;
  return -0.5 * u * u - std::log(prior.sigma_log * std::sqrt(2 * kPi));
}

}  // namespace

LinearSolver::LinearSolver(const Observation& observation, const LinearUnknowns& unknowns)
    : observation_(observation),
      unknowns_(unknowns),
      has_direct_(unknowns.direct == LinearMode::per_zone) {
  for (const ObservedZone& zone : observation_.zones) {
    const BinLikelihood& noise_model = observation_.noise_model(zone);
    const double all_bins = zone.bins() + zone.outside_bins;
    ambient_floor_.push_back(
        noise_model.counts_photons() ? kAmbientFloor / (all_bins * noise_model.scale()) : -1e300);
    residual_count_ += zone.bins() + (zone.outside_bins > 0 ? 1 : 0);
    std::vector<Prefix> prefix(1);
    for (std::size_t k = 0; k < zone.counts.size(); ++k) {
      const double n = zone.counts[k];
      const double weight = zone.weight_of(static_cast<int>(k));
      Prefix next = prefix.back();
      next.bins += weight;
      next.count += weight * n;
      next.square += weight * n * n;
      next.saturated += weight * zone.saturated[k];
      if (unknowns_.ambient == LinearMode::fixed) {
        next.fixed +=
            weight * noise_model.half_deviance(n, unknowns_.fixed_ambient, zone.saturated[k]);
      }
      prefix.push_back(next);
    }
    prefix_.push_back(std::move(prefix));
    // The ambient level is the mean of the lower half of the counts, because the object and the
    // direct return only add light.
    std::vector<double> sorted = zone.counts;
    const std::size_t half = std::max<std::size_t>(1, sorted.size() / 2);
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(half);
    std::nth_element(sorted.begin(), middle - 1, sorted.end());
    double level = std::accumulate(sorted.begin(), middle, 0.0) / static_cast<double>(half);
    if (zone.outside_bins > 0) level = std::max(level, zone.outside_count / zone.outside_bins);
    lower_half_.push_back(level);
  }
  unknowns_.fixed_direct = 1;  // the shape already includes a fixed direct return
  if (unknowns_.ambient != LinearMode::per_zone) unknowns_.ambient_prior.clear();
  if (!unknowns_.ambient_prior.empty()) {
    residual_count_ += static_cast<int>(observation_.zones.size());
  }
  const std::size_t amplitudes =
      unknowns_.amplitude == LinearMode::shared
          ? 1
          : (unknowns_.amplitude == LinearMode::per_zone ? observation_.zones.size() : 0);
  residual_count_ += static_cast<int>(amplitudes);
}

bool LinearSolver::summable(const ObservedZone& zone) const {
  return unknowns_.ambient == LinearMode::fixed || !observation_.noise_model(zone).censored();
}

LinearSolver::Lit LinearSolver::lit(std::size_t zone, const ZoneShapes& shapes) const {
  Lit result;
  const ObservedZone& observed = observation_.zones[zone];
  if (!summable(observed)) {
    result.ranges[0] = {0, observed.bins()};
    result.count = 1;
    return result;
  }
  std::pair<int, int> first{shapes.object_first, shapes.object_end};
  std::pair<int, int> second{shapes.direct_first, shapes.direct_end};
  if (first > second) std::swap(first, second);
  if (first.first < first.second) result.ranges[result.count++] = first;
  if (second.first < second.second) {
    if (result.count > 0 && second.first <= first.second) {
      result.ranges[0].second = std::max(first.second, second.second);
    } else {
      result.ranges[result.count++] = second;
    }
  }
  const std::vector<Prefix>& prefix = prefix_[zone];
  result.rest = prefix.back();
  for (std::size_t r = 0; r < result.count; ++r) {
    const Prefix& begin = prefix[static_cast<std::size_t>(result.ranges[r].first)];
    const Prefix& end = prefix[static_cast<std::size_t>(result.ranges[r].second)];
    result.rest.bins -= end.bins - begin.bins;
    result.rest.count -= end.count - begin.count;
    result.rest.square -= end.square - begin.square;
    result.rest.saturated -= end.saturated - begin.saturated;
    result.rest.fixed -= end.fixed - begin.fixed;
  }
  return result;
}

LinearTerms LinearSolver::local(std::size_t z, const ZoneShapes& shapes, double amplitude,
                                double ambient, double direct) const {
  LinearTerms h;
  const ObservedZone& zone = observation_.zones[z];
  const BinLikelihood& noise_model = observation_.noise_model(zone);
  const Lit bins = lit(z, shapes);
  for (std::size_t r = 0; r < bins.count; ++r) {
    const auto [begin, end] = bins.ranges[r];
    noise_model.add_linear_terms(row_of(zone, begin, end),
                                 light_of(shapes, begin, amplitude, ambient, direct), h);
  }
  const double dark_bins = zone.outside_bins + bins.rest.bins;
  if (dark_bins > 0 && unknowns_.ambient == LinearMode::per_zone) {
    const BinLikelihood::Terms dark = noise_model.equal_bins(
        dark_bins, zone.outside_count + bins.rest.count, bins.rest.square, ambient);
    h.gc += dark.first;
    h.hcc += dark.second;
  }
  return h;
}

void LinearSolver::start(std::span<const ZoneShapes> shapes, LinearSolution& solution) const {
  const std::size_t zones = observation_.zones.size();
  solution.ambient.assign(zones, unknowns_.fixed_ambient);
  solution.direct.assign(zones, unknowns_.direct == LinearMode::fixed ? unknowns_.fixed_direct : 1);
  solution.amplitude.assign(zones, unknowns_.amplitude == LinearMode::fixed
                                       ? unknowns_.fixed_amplitude
                                       : unknowns_.amplitude_prior.median);
  double numerator = 0;
  double denominator = 0;
  for (std::size_t z = 0; z < zones; ++z) {
    const ObservedZone& zone = observation_.zones[z];
    if (unknowns_.ambient == LinearMode::per_zone) {
      const double all = zone.bins() + zone.outside_bins;
      const double level = lower_half_[z];
      solution.ambient[z] =
          std::max({level, 0.5 / (all * std::max(observation_.noise_model(zone).scale(), 1e-12)),
                    ambient_floor_[z]});
      if (!observation_.noise_model(zone).counts_photons()) solution.ambient[z] = level;
    }
    if (shapes[z].object == nullptr || unknowns_.amplitude == LinearMode::fixed) continue;
    double zone_numerator = 0;
    double zone_denominator = 0;
    const double* t = shapes[z].direct;
    for (int i = shapes[z].object_first; i < shapes[z].object_end; ++i) {
      const double s = shapes[z].object[i];
      const double n = zone.counts[static_cast<std::size_t>(i)];
      const double base = solution.ambient[z] + (t != nullptr ? solution.direct[z] * t[i] : 0.0);
      const double weight =
          1 / std::max(observation_.noise_model(zone).variance(std::max(base, n)), 1e-30);
      zone_numerator += s * (n - base) * weight;
      zone_denominator += s * s * weight;
    }
    if (unknowns_.amplitude == LinearMode::per_zone && zone_numerator > 0) {
      solution.amplitude[z] = zone_numerator / zone_denominator;
    }
    numerator += zone_numerator;
    denominator += zone_denominator;
  }
  if (unknowns_.amplitude == LinearMode::shared && denominator > 0) {
    const double low =
        unknowns_.amplitude_prior.median * std::exp(-3 * unknowns_.amplitude_prior.sigma_log);
    std::fill(solution.amplitude.begin(), solution.amplitude.end(),
              std::max(numerator / denominator, low));
  }
}

/// Newton's method for zones [begin, end) that share one amplitude. The unknowns are u = log a and
/// (c, b) of each zone. The zones' blocks are eliminated (the Hessian is an arrow).
void LinearSolver::solve_shared(std::span<const ZoneShapes> shapes, std::size_t begin,
                                std::size_t end, LinearSolution& solution, double accuracy) const {
  const bool ambient_free = unknowns_.ambient == LinearMode::per_zone;
  bool object = false;
  for (std::size_t z = begin; z < end; ++z) object = object || shapes[z].object != nullptr;
  const bool amplitude_free = object && unknowns_.amplitude != LinearMode::fixed;
  const double prior_mean = std::log(unknowns_.amplitude_prior.median);
  const double prior_weight = std::pow(unknowns_.amplitude_prior.sigma_log, -2);

  struct Block {
    double gc, gb, hcc, hcb, hbb, hac, hab;  // inverse of the local block in hcc, hcb, hbb
    double own_cc, own_bb;                   // the local block's diagonal
    bool c_free, b_free;
    bool c_held, b_held;  // held at zero, because the slope leads below zero
  };
  thread_local std::vector<Block> blocks;
  blocks.resize(end - begin);
  double u = amplitude_free ? std::log(solution.amplitude[begin]) : 0.0;
  double log_det = 0;
  int dimension = 0;
  bool last = false;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const double a = amplitude_free ? std::exp(u) : solution.amplitude[begin];
    double gradient = amplitude_free ? (u - prior_mean) * prior_weight : 0.0;
    double hessian = amplitude_free ? prior_weight : 1.0;
    double positive = hessian;  // without the sign-indefinite part
    double schur = 0;
    double reduced = 0;
    double decrement = 0;
    log_det = 0;
    dimension = 0;
    for (std::size_t z = begin; z < end; ++z) {
      LinearTerms h = local(z, shapes[z], a, solution.ambient[z], solution.direct[z]);
      if (const NormalPrior* prior = ambient_prior(z)) {
        h.gc += (solution.ambient[z] - prior->mean) / (prior->sigma * prior->sigma);
        h.hcc += 1 / (prior->sigma * prior->sigma);
      }
      Block& block = blocks[z - begin];
      block.c_held =
          ambient_free && solution.ambient[z] <= ambient_floor_[z] * (1 + 1e-9) && h.gc > 0;
      block.c_free = ambient_free && !block.c_held;
      const bool direct_free = has_direct_ && shapes[z].direct != nullptr;
      block.b_held = direct_free && solution.direct[z] <= 0 && h.gb > 0;
      block.b_free = direct_free && !block.b_held;
      block.own_cc = h.hcc;
      block.own_bb = h.hbb;
      block.gc = h.gc;
      block.gb = h.gb;
      block.hac = a * h.hac;
      block.hab = a * h.hab;
      double i_cc = 0, i_cb = 0, i_bb = 0;
      if (block.c_free && block.b_free) {
        const double det = h.hcc * h.hbb - h.hcb * h.hcb;
        if (det > 1e-14 * h.hcc * h.hbb) {  // else it is rounding, and c and b cannot be told apart
          i_cc = h.hbb / det;
          i_cb = -h.hcb / det;
          i_bb = h.hcc / det;
          log_det += std::log(det);
        } else {
          block.b_free = false;
        }
      }
      if (block.c_free && !block.b_free) {
        i_cc = h.hcc > 0 ? 1 / h.hcc : 0;
        if (h.hcc > 0) log_det += std::log(h.hcc);
      } else if (!block.c_free && block.b_free) {
        i_bb = h.hbb > 0 ? 1 / h.hbb : 0;
        if (h.hbb > 0) log_det += std::log(h.hbb);
      }
      dimension += (block.c_free ? 1 : 0) + (block.b_free ? 1 : 0);
      block.hcc = i_cc;
      block.hcb = i_cb;
      block.hbb = i_bb;
      // H_z^-1 g and H_z^-1 h.
      const double xc = i_cc * h.gc + i_cb * h.gb;
      const double xb = i_cb * h.gc + i_bb * h.gb;
      decrement += h.gc * xc + h.gb * xb;
      if (amplitude_free) {
        gradient += a * h.ga;
        hessian += a * a * h.haa + a * h.ga;
        positive += a * a * h.haa;
        const double yc = i_cc * block.hac + i_cb * block.hab;
        const double yb = i_cb * block.hac + i_bb * block.hab;
        schur += block.hac * yc + block.hab * yb;
        reduced += block.hac * xc + block.hab * xb;
      }
    }
    double du = 0;
    if (amplitude_free) {
      double curvature = hessian - schur;
      // In the logarithm of the amplitude the loss is not convex everywhere. If the prior does not
      // make up for this (to a tenth, by judgement), the part that is never negative is used.
      if (!(curvature > 0.1 * prior_weight)) curvature = std::max(positive - schur, prior_weight);
      const double force = gradient - reduced;
      du = -force / curvature;
      decrement += force * force / curvature;
      log_det += std::log(curvature);
      dimension += 1;
    }
    if (last) break;
    // The log posterior still lacks half the squared decrement.
    const double lambda = std::sqrt(std::max(decrement, 0.0));
    if (0.5 * lambda * lambda < accuracy) {
      last = true;
      break;
    }
    last = lambda < kQuadratic;
    // Damped Newton steps converge from anywhere. Full steps converge once the decrement is below a
    // quarter (Nesterov and Nemirovskii 1994, self-concordant functions).
    double step = lambda > 0.25 ? 1 / (1 + lambda) : 1.0;
    // Far from the optimum, damping by the decrement alone is slow for bright data. Half of a
    // change by a factor of three, up (logarithm 1.1) or down (share 0.7), is safe as well.
    double largest = std::abs(du) / 1.1;
    for (std::size_t z = begin; z < end; ++z) {
      const Block& block = blocks[z - begin];
      const double rc = block.c_free ? block.gc + block.hac * du : 0;
      const double rb = block.b_free ? block.gb + block.hab * du : 0;
      const double dc = -(block.hcc * rc + block.hcb * rb);
      const double db = -(block.hcb * rc + block.hbb * rb);
      if (observation_.noise_model(observation_.zones[z]).counts_photons()) {
        if (block.c_free) largest = std::max(largest, std::abs(dc) / (0.7 * solution.ambient[z]));
        if (block.b_free)
          largest = std::max(largest, std::abs(db) / (0.7 * std::max(solution.direct[z], 1e-3)));
      }
    }
    step = std::max(step, std::min(1.0, 0.5 / largest));
    for (std::size_t z = begin; z < end; ++z) {
      const Block& block = blocks[z - begin];
      const double rc = block.c_free ? block.gc + block.hac * du : 0;
      const double rb = block.b_free ? block.gb + block.hab * du : 0;
      if (block.c_free) {
        const double moved = solution.ambient[z] - step * (block.hcc * rc + block.hcb * rb);
        const bool positive_only = observation_.noise_model(observation_.zones[z]).counts_photons();
        solution.ambient[z] =
            positive_only ? std::max({moved, 0.1 * solution.ambient[z], ambient_floor_[z]}) : moved;
        if (positive_only && solution.ambient[z] < 4 * ambient_floor_[z] && moved < 0) {
          solution.ambient[z] = ambient_floor_[z];
        }
      }
      if (block.b_free) {
        const double moved = solution.direct[z] - step * (block.hcb * rc + block.hbb * rb);
        solution.direct[z] =
            moved > 0 ? moved : (solution.direct[z] > 1e-9 ? 0.1 * solution.direct[z] : 0);
      }
    }
    if (amplitude_free) u += std::clamp(step * du, -2.0, 2.0);
  }
  solution.converged = solution.converged && last;
  if (amplitude_free) {
    const double a = std::exp(u);
    std::fill(solution.amplitude.begin() + static_cast<std::ptrdiff_t>(begin),
              solution.amplitude.begin() + static_cast<std::ptrdiff_t>(end), a);
    solution.log_prior += log_normal_prior(u, unknowns_.amplitude_prior);
  }
  solution.log_volume += -0.5 * log_det + 0.5 * dimension * std::log(2 * kPi);
  // The volume of an unknown that cannot be negative ends at zero. Otherwise, a photon that the
  // object explains instead of the ambient light would free the whole volume of the ambient light:
  // 23 log units at 1e8 exposures.
  for (std::size_t z = begin; z < end; ++z) {
    const Block& block = blocks[z - begin];
    if (observation_.noise_model(observation_.zones[z]).counts_photons()) {
      const double ambient = solution.ambient[z];
      if (block.c_held) solution.log_volume += log_half_line(block.gc, block.own_cc);
      if (block.c_free && block.own_cc > 0) {
        solution.log_volume += log_share_above(ambient, block.hcc);
      } else if (block.c_free && block.gc > 0) {
        // Without a photon, the likelihood falls exponentially from zero on. Newton's steps then
        // have no curvature and stay where they began.
        solution.log_volume += block.gc * ambient - std::log(block.gc) - 0.5 * std::log(2 * kPi);
      }
    }
    if (block.b_held) solution.log_volume += log_half_line(block.gb, block.own_bb);
    if (block.b_free) solution.log_volume += log_share_above(solution.direct[z], block.hbb);
  }
}

void LinearSolver::eliminate(std::span<const ZoneShapes> shapes, LinearSolution& solution,
                             bool warm, double accuracy) const {
  const std::size_t zones = observation_.zones.size();
  if (!warm || solution.ambient.size() != zones) start(shapes, solution);
  solution.log_prior = 0;
  solution.log_volume = 0;
  solution.converged = true;
  if (unknowns_.amplitude == LinearMode::shared) {
    solve_shared(shapes, 0, zones, solution, accuracy);
  } else {
    // No unknown is common to the zones: each converges by itself, most of them at once when the
    // start is warm.
    for (std::size_t z = 0; z < zones; ++z) {
      solve_shared(shapes, z, z + 1, solution, accuracy / static_cast<double>(zones));
    }
  }
}

void LinearSolver::solve(std::span<const ZoneShapes> shapes, LinearSolution& solution, bool warm,
                         double accuracy) const {
  eliminate(shapes, solution, warm, accuracy);
  double loss = 0;
  for (std::size_t z = 0; z < observation_.zones.size(); ++z) {
    if (const NormalPrior* prior = ambient_prior(z)) {
      const double u = (solution.ambient[z] - prior->mean) / prior->sigma;
      solution.log_prior -= 0.5 * u * u + std::log(prior->sigma * std::sqrt(2 * kPi));
    }
    const ObservedZone& zone = observation_.zones[z];
    const BinLikelihood& noise_model = observation_.noise_model(zone);
    const double a = solution.amplitude[z];
    const double b = solution.direct[z];
    const double c = solution.ambient[z];
    const Lit bins = lit(z, shapes[z]);
    for (std::size_t r = 0; r < bins.count; ++r) {
      const auto [begin, end] = bins.ranges[r];
      thread_local std::vector<double> mean;
      mean.resize(static_cast<std::size_t>(end - begin));
      light_of(shapes[z], begin, a, c, b).expected(end - begin, mean.data());
      const Prefix& before = prefix_[z][static_cast<std::size_t>(begin)];
      const Prefix& after = prefix_[z][static_cast<std::size_t>(end)];
      loss += noise_model.half_deviance(row_of(zone, begin, end), mean.data(),
                                        after.saturated - before.saturated);
    }
    if (bins.rest.bins > 0) {
      loss +=
          unknowns_.ambient == LinearMode::fixed
              ? bins.rest.fixed
              : noise_model.equal_bins(bins.rest.bins, bins.rest.count, bins.rest.square, c).value -
                    bins.rest.saturated;
    }
    if (zone.outside_bins > 0) {
      loss += noise_model.half_deviance(zone.outside_count, zone.outside_bins * c,
                                        noise_model.saturated(zone.outside_count));
    }
  }
  solution.log_likelihood = -loss;
}

void LinearSolver::expected(const ObservedZone& zone, const ZoneShapes& shapes, double amplitude,
                            double ambient, double direct, double* out) const {
  light_of(shapes, 0, amplitude, ambient, direct).expected(zone.bins(), out);
}

void LinearSolver::residuals(std::span<const ZoneShapes> shapes, const LinearSolution& solution,
                             double* out) const {
  thread_local std::vector<double> mean;
  const double prior_mean = std::log(unknowns_.amplitude_prior.median);
  const double sigma = unknowns_.amplitude_prior.sigma_log;
  for (std::size_t z = 0; z < observation_.zones.size(); ++z) {
    const ObservedZone& zone = observation_.zones[z];
    const BinLikelihood& noise_model = observation_.noise_model(zone);
    mean.resize(zone.counts.size());
    expected(zone, shapes[z], solution.amplitude[z], solution.ambient[z], solution.direct[z],
             mean.data());
    // Bins without object light keep their residual if nothing else is unknown.
    const bool known_dark = unknowns_.ambient == LinearMode::fixed && shapes[z].direct == nullptr;
    const std::size_t lit_first =
        shapes[z].object != nullptr ? static_cast<std::size_t>(shapes[z].object_first) : 0;
    const std::size_t lit_end =
        shapes[z].object != nullptr ? static_cast<std::size_t>(shapes[z].object_end) : 0;
    noise_model.residuals(row_of(zone, 0, zone.bins()), mean.data(), zone.saturated.data(),
                          zone.best.data(), out);
    for (std::size_t k = 0; k < zone.weight.size(); ++k) out[k] *= std::sqrt(zone.weight[k]);
    for (std::size_t k = 0; k < zone.counts.size() && known_dark; ++k) {
      if (k >= lit_first && k < lit_end) continue;
      const double half = prefix_[z][k + 1].fixed - prefix_[z][k].fixed;
      const double root = std::sqrt(std::max(2 * half, 0.0));
      out[k] = unknowns_.fixed_ambient >= zone.best[k] ? root : -root;
    }
    out += zone.bins();
    if (zone.outside_bins > 0) {
      const double n = zone.outside_count;
      *out++ = noise_model.residual(n, zone.outside_bins * solution.ambient[z],
                                    noise_model.saturated(n), noise_model.best(n));
    }
    if (const NormalPrior* prior = ambient_prior(z)) {
      *out++ = (solution.ambient[z] - prior->mean) / prior->sigma;
    }
    if (unknowns_.amplitude == LinearMode::per_zone) {
      *out++ = (std::log(solution.amplitude[z]) - prior_mean) / sigma;
    }
  }
  if (unknowns_.amplitude == LinearMode::shared) {
    *out++ = (std::log(solution.amplitude.front()) - prior_mean) / sigma;
  }
}

int LinearSolver::residual_count(std::size_t zone) const {
  const ObservedZone& observed = observation_.zones[zone];
  return observed.bins() + (observed.outside_bins > 0 ? 1 : 0) +
         (ambient_prior(zone) != nullptr ? 1 : 0) +
         (unknowns_.amplitude == LinearMode::per_zone ? 1 : 0);
}

void LinearSolver::zone_jacobian(std::size_t z, const ZoneShapes& shapes,
                                 const LinearSolution& solution,
                                 const Eigen::Ref<const Eigen::MatrixXd>& slope,
                                 const double* residuals, Eigen::MatrixXd& out) const {
  const ObservedZone& zone = observation_.zones[z];
  const BinLikelihood& noise_model = observation_.noise_model(zone);
  const Eigen::Index bins = zone.bins();
  const Eigen::Index n = slope.cols();
  const double a = solution.amplitude[z];
  thread_local std::vector<double> mean, first, second;
  for (auto* v : {&mean, &first, &second}) v->resize(zone.counts.size());
  expected(zone, shapes, a, solution.ambient[z], solution.direct[z], mean.data());
  const CountRow row = row_of(zone, 0, zone.bins());
  noise_model.slopes(row, mean.data(), first.data(), second.data());

  // Derivative of each residual by its bin's mean, [bins].
  thread_local Eigen::ArrayXd rate;
  rate.resize(bins);
  const double few = noise_model.counts_photons() ? kFewPhotons / noise_model.scale() : -kDoubleMax;
  for (Eigen::Index k = 0; k < bins; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double root = zone.weight.empty() ? 1.0 : std::sqrt(zone.weight[i]);
    const double residual = residuals[k];
    if (mean[i] < few) {
      const double moved =
          noise_model.residual(zone.counts[i], mean[i] + few, zone.saturated[i], zone.best[i]);
      rate[k] = (root * moved - residual) / few;
    } else if (std::abs(residual) > kSmallResidual) {
      rate[k] = root * root * first[i] / residual;
    } else {
      rate[k] = root * std::sqrt(std::max(second[i], 0.0));
    }
  }

  out.setZero(residual_count(z), n + 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    out.col(i).head(bins).array() = a * rate * slope.col(i).array();
  }
  if (shapes.object != nullptr) {
    out.col(n).head(bins).array() =
        a * rate * Eigen::Map<const Eigen::ArrayXd>(shapes.object, bins);
  }
  // Columns of the zone's own unknowns, made orthonormal one after the other. The part of `out`
  // that they explain is removed.
  thread_local Eigen::MatrixXd own;
  own.setZero(out.rows(), 3);
  Eigen::Index count = 0;
  const auto take_off = [&] {
    auto column = own.col(count);
    const double before = column.squaredNorm();
    for (Eigen::Index j = 0; j < count; ++j) column -= own.col(j).dot(column) * own.col(j);
    const double norm = column.squaredNorm();
    if (!(norm > kNothingNew * before)) {
      column.setZero();
      return;
    }
    column /= std::sqrt(norm);
    for (Eigen::Index i = 0; i <= n; ++i) out.col(i) -= column.dot(out.col(i)) * column;
    ++count;
  };
  Eigen::Index next = bins;
  const bool ambient_free = unknowns_.ambient == LinearMode::per_zone &&
                            solution.ambient[z] > ambient_floor_[z] * (1 + 1e-9);
  if (ambient_free) own.col(0).head(bins) = rate;
  if (zone.outside_bins > 0) {
    const double m = zone.outside_bins * solution.ambient[z];
    if (ambient_free) own(next, 0) = zone.outside_bins * std::sqrt(noise_model.information(m));
    ++next;
  }
  if (const NormalPrior* prior = ambient_prior(z)) {
    if (ambient_free) own(next, 0) = 1 / prior->sigma;
    ++next;
  }
  if (ambient_free) take_off();
  if (has_direct_ && shapes.direct != nullptr && solution.direct[z] > 0) {
    own.col(count).head(bins).array() =
        rate * Eigen::Map<const Eigen::ArrayXd>(shapes.direct, bins);
    take_off();
  }
  if (unknowns_.amplitude == LinearMode::per_zone) {
    // The rest of the amplitude's column is removed from the other columns.
    out(next, n) = 1 / unknowns_.amplitude_prior.sigma_log;
    own.col(count) = out.col(n);
    take_off();
  }
}

void LinearSolver::jacobian(std::span<const ZoneShapes> shapes, const LinearSolution& solution,
                            const Eigen::MatrixXd& slope, const double* residuals,
                            double* out) const {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Index n = slope.cols();
  Eigen::Map<RowMajor> all(out, residual_count_, n);
  thread_local Eigen::MatrixXd zone;
  thread_local Eigen::VectorXd amplitude;  // column of the shared amplitude
  amplitude.resize(residual_count_);
  Eigen::Index row = 0, bin = 0;
  for (std::size_t z = 0; z < observation_.zones.size(); ++z) {
    const Eigen::Index bins = observation_.zones[z].bins();
    zone_jacobian(z, shapes[z], solution, slope.middleRows(bin, bins), residuals + row, zone);
    all.middleRows(row, zone.rows()) = zone.leftCols(n);
    amplitude.segment(row, zone.rows()) = zone.col(n);
    row += zone.rows();
    bin += bins;
  }
  if (unknowns_.amplitude != LinearMode::shared) return;
  all.row(row).setZero();
  amplitude[row] = 1 / unknowns_.amplitude_prior.sigma_log;
  thread_local std::vector<double> follow;
  follow.assign(static_cast<std::size_t>(n), 0.0);
  for (Eigen::Index r = 0; r < all.rows(); ++r) {
    for (Eigen::Index i = 0; i < n; ++i) {
      follow[static_cast<std::size_t>(i)] += amplitude[r] * all(r, i);
    }
  }
  const double square = amplitude.squaredNorm();
  for (double& f : follow) f /= square;
  for (Eigen::Index r = 0; r < all.rows(); ++r) {
    for (Eigen::Index i = 0; i < n; ++i) {
      all(r, i) -= amplitude[r] * follow[static_cast<std::size_t>(i)];
    }
  }
}

}  // namespace blindcorner
