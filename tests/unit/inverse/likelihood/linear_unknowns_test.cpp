// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/linear_unknowns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

constexpr int kModelBins = 60;

/// Counts of two zones with a bump of object light each, a direct return at the start, ambient
/// light below; all drawn from their law.
struct Problem {
  Scene scene;
  std::vector<Capture> captures;
  std::vector<std::vector<double>> object, direct;  ///< [zone][bin]
  Observation observation;
  std::vector<ZoneShapes> shapes;

  Problem(const NoiseModel& law, double amplitude, double ambient, bool with_direct,
          unsigned seed = 5, int zones = 2) {
    scene.sensor.rows = 1;
    scene.sensor.columns = zones;
    scene.sensor.bins = kModelBins;
    scene.sensor.noise = law;
    scene.sensor.zones.resize(static_cast<std::size_t>(zones));
    Capture capture;
    capture.counts = HistogramCube(1, zones, kModelBins);
    std::mt19937 random(seed);
    for (int z = 0; z < zones; ++z) {
      std::vector<double> s(kModelBins), t(kModelBins);
      for (int k = 0; k < kModelBins; ++k) {
        s[static_cast<std::size_t>(k)] =
            (2 + z) * std::exp(-0.5 * std::pow((k - 35 - 4 * z) / 3.0, 2));
        t[static_cast<std::size_t>(k)] = 30 * std::exp(-0.3 * std::abs(k - 8));
        const double mean = amplitude * s[static_cast<std::size_t>(k)] +
                            (with_direct ? 1.2 * t[static_cast<std::size_t>(k)] : 0) + ambient;
        double& count = capture.counts.zone(z)[k];
        if (const auto* g = std::get_if<GaussianNoise>(&law)) {
          count = mean + std::sqrt(g->variance_floor + g->variance_per_count * mean) *
                             std::normal_distribution<double>()(random);
          if (g->censored_at_zero) count = std::max(count, 0.0);
        } else {
          count = mean > 0 ? std::poisson_distribution<int>(mean)(random) : 0;
        }
      }
      object.push_back(s);
      direct.push_back(t);
    }
    captures.push_back(capture);
    look({0, kModelBins}, with_direct);
  }

  /// Cuts the captures to a gate and lines the shapes up with it.
  void look(TimeGate gate, bool with_direct) {
    observation =
        observe(scene, captures,
                {std::vector<TimeGate>(static_cast<std::size_t>(scene.sensor.columns), gate)});
    shapes.clear();
    for (std::size_t z = 0; z < object.size(); ++z) {
      ZoneShapes shape;
      shape.object = object[z].data() + gate.first;
      shape.direct = with_direct ? direct[z].data() + gate.first : nullptr;
      shape.object_end = gate.end - gate.first;
      shape.direct_end = shape.direct != nullptr ? shape.object_end : 0;
      shapes.push_back(shape);
    }
  }
};

/// Negative log posterior, term by term from the definition.
double loss(const Problem& p, const LinearUnknowns& u, const std::vector<double>& a,
            const std::vector<double>& c, const std::vector<double>& b) {
  double total = 0;
  for (std::size_t z = 0; z < p.observation.zones.size(); ++z) {
    const ObservedZone& zone = p.observation.zones[z];
    const BinLikelihood& noise_model = p.observation.noise_model(zone);
    const auto excess = [&](double n, double m) {
      return n > 0 || !noise_model.counts_photons()
                 ? noise_model.value(n, m) - noise_model.saturated(n)
                 : noise_model.scale() * m;
    };
    for (int k = 0; k < zone.bins(); ++k) {
      const double m = a[z] * p.shapes[z].object[k] + c[z] +
                       (p.shapes[z].direct != nullptr ? b[z] * p.shapes[z].direct[k] : 0.0);
      total += zone.weight_of(k) * excess(zone.counts[static_cast<std::size_t>(k)], m);
    }
    if (zone.outside_bins > 0) {
      total += excess(zone.outside_count, zone.outside_bins * c[z]);
    }
  }
  const auto prior = [&](double value) {
    const double x = std::log(value / u.amplitude_prior.median) / u.amplitude_prior.sigma_log;
    return 0.5 * x * x;
  };
  if (u.amplitude == LinearMode::shared) total += prior(a[0]);
  if (u.amplitude == LinearMode::per_zone) {
    for (const double value : a) total += prior(value);
  }
  return total;
}

double log_prior(const LinearUnknowns& u, double a) {
  const double s = u.amplitude_prior.sigma_log;
  const double x = std::log(a / u.amplitude_prior.median) / s;
  return -0.5 * x * x - std::log(s * std::sqrt(2 * kPi));
}

/// Smallest value of a function of one variable: a scan, then golden section.
double minimise(const std::function<double(double)>& f, double low, double high) {
  constexpr int kScan = 24;
  int best = 0;
  double value = 1e300;
  for (int i = 0; i <= kScan; ++i) {
    const double now = f(low + (high - low) * i / kScan);
    if (now < value) {
      value = now;
      best = i;
    }
  }
  double a = low + (high - low) * std::max(best - 1, 0) / kScan;
  double b = low + (high - low) * std::min(best + 1, kScan) / kScan;
  const double g = (std::sqrt(5.0) - 1) / 2;
  for (int i = 0; i < 45; ++i) {
    const double x = b - g * (b - a), y = a + g * (b - a);
    (f(x) < f(y) ? b : a) = f(x) < f(y) ? y : x;
  }
  return std::min(value, f(0.5 * (a + b)));
}

struct LinearCase {
  std::string name;
  NoiseModel law;
  LinearMode amplitude, ambient;
  double true_amplitude, true_ambient;
  bool weighted = false;
};
void PrintTo(const LinearCase& c, std::ostream* out) { *out << c.name; }

class EveryLinearCase : public testing::TestWithParam<LinearCase> {
 protected:
  LinearUnknowns unknowns(bool with_direct) const {
    LinearUnknowns u;
    u.amplitude = GetParam().amplitude;
    u.fixed_amplitude = GetParam().true_amplitude;
    u.amplitude_prior = {GetParam().true_amplitude, 1.5};
    u.ambient = GetParam().ambient;
    u.fixed_ambient = GetParam().true_ambient;
    u.direct = with_direct ? LinearMode::per_zone : LinearMode::fixed;
    return u;
  }
  Problem problem(bool with_direct, unsigned seed = 5) const {
    Problem p(GetParam().law, GetParam().true_amplitude, GetParam().true_ambient, with_direct,
              seed);
    for (std::size_t z = 0; z < 2 && GetParam().weighted; ++z) {
      for (int k = 0; k < kModelBins; ++k) {
        p.observation.zones[z].weight.push_back(0.1 + 0.01 * ((13 * k) % 90));
      }
    }
    return p;
  }
};

std::vector<LinearCase> linear_cases() {
  const PoissonNoise poisson;
  const GaussianNoise gaussian{9, 0, false};
  const GaussianNoise shot{9, 0.5, false};
  return {{"poisson_shared", poisson, LinearMode::shared, LinearMode::per_zone, 8, 5},
          {"poisson_per_zone", poisson, LinearMode::per_zone, LinearMode::per_zone, 8, 5},
          {"poisson_fixed_ambient", poisson, LinearMode::shared, LinearMode::fixed, 8, 5},
          {"poisson_sparse", poisson, LinearMode::shared, LinearMode::per_zone, 0.3, 0.05},
          {"poisson_bright", poisson, LinearMode::shared, LinearMode::per_zone, 3000, 900},
          {"gaussian", gaussian, LinearMode::shared, LinearMode::per_zone, 8, 5},
          {"gaussian_shot", shot, LinearMode::per_zone, LinearMode::per_zone, 8, 5},
          {"poisson_weighted", poisson, LinearMode::shared, LinearMode::per_zone, 8, 5, true},
          {"poisson_fixed_weighted", poisson, LinearMode::shared, LinearMode::fixed, 8, 5, true},
          {"gaussian_weighted", shot, LinearMode::per_zone, LinearMode::per_zone, 8, 5, true}};
}

// No direction improves the solution: every derivative of the posterior, by central differences
// scaled to the unknown's own standard deviation, is zero, unless the unknown sits at its bound.
TEST_P(EveryLinearCase, GradientIsZeroAtTheSolution) {
  for (const bool with_direct : {false, true}) {
    const Problem p = problem(with_direct);
    const LinearUnknowns u = unknowns(with_direct);
    const LinearSolver solver(p.observation, u);
    LinearSolution solution;
    solver.solve(p.shapes, solution, false);
    ASSERT_TRUE(solution.converged);
    const auto check = [&](const std::function<double(double)>& f, double step, const char* name) {
      const double middle = f(0), up = f(step), down = f(-step);
      const double curvature = (up - 2 * middle + down) / (step * step);
      ASSERT_GT(curvature, 0) << name;
      // A distance from the optimum in standard deviations; the differences of a loss of some
      // hundred lose their digits at 1e-13 / step in these units.
      EXPECT_NEAR((up - down) / (2 * step) / std::sqrt(curvature), 0, 2e-4) << name;
    };
    if (u.amplitude == LinearMode::shared) {
      check(
          [&](double d) {
            auto a = solution.amplitude;
            for (double& value : a) value *= std::exp(d);
            return loss(p, u, a, solution.ambient, solution.direct);
          },
          1e-3, "log amplitude");
    }
    for (std::size_t z = 0; z < 2; ++z) {
      if (u.amplitude == LinearMode::per_zone) {
        check(
            [&](double d) {
              auto a = solution.amplitude;
              a[z] *= std::exp(d);
              return loss(p, u, a, solution.ambient, solution.direct);
            },
            1e-3, "log amplitude of a zone");
      }
      if (u.ambient == LinearMode::per_zone && solution.ambient[z] > 1e-3) {
        check(
            [&](double d) {
              auto c = solution.ambient;
              c[z] += d;
              return loss(p, u, solution.amplitude, c, solution.direct);
            },
            1e-3 * std::abs(solution.ambient[z]), "ambient");
      }
      if (with_direct && solution.direct[z] > 1e-3) {
        check(
            [&](double d) {
              auto b = solution.direct;
              b[z] += d;
              return loss(p, u, solution.amplitude, solution.ambient, b);
            },
            1e-3 * solution.direct[z], "direct");
      }
    }
  }
}

// The same minimum by nested one-dimensional searches, which know nothing of derivatives.
TEST_P(EveryLinearCase, AgreesWithBruteForce) {
  const Problem p = problem(false);
  const LinearUnknowns u = unknowns(false);
  const LinearSolver solver(p.observation, u);
  LinearSolution solution;
  solver.solve(p.shapes, solution, false);
  const double top = 4 * GetParam().true_ambient + 5;
  const double bottom = std::holds_alternative<PoissonNoise>(GetParam().law) ? 1e-9 : -top;
  // For given amplitudes the zones are independent.
  const auto zone_part = [&](std::size_t z, double a) {
    const auto at = [&](double c) {
      std::vector<double> as(2, 1.0), cs(2, 1.0);
      LinearUnknowns flat = u;
      flat.amplitude = LinearMode::fixed;
      Problem only = p;
      only.observation.zones = {p.observation.zones[z]};
      only.shapes = {p.shapes[z]};
      as[0] = a;
      cs[0] = c;
      return loss(only, flat, as, cs, {0, 0});
    };
    if (u.ambient == LinearMode::fixed) return at(u.fixed_ambient);
    return minimise(at, bottom, top);
  };
  const double low = std::log(GetParam().true_amplitude) - 3;
  const double high = std::log(GetParam().true_amplitude) + 2;
  const auto prior = [&](double log_a) {
    const double x = (log_a - std::log(u.amplitude_prior.median)) / u.amplitude_prior.sigma_log;
    return 0.5 * x * x;
  };
  double least = 0;
  double priors = 0;
  if (u.amplitude == LinearMode::shared) {
    least = minimise(
        [&](double l) { return zone_part(0, std::exp(l)) + zone_part(1, std::exp(l)) + prior(l); },
        low, high);
    priors = 1;
  } else {
    for (std::size_t z = 0; z < 2; ++z) {
      least += minimise([&](double l) { return zone_part(z, std::exp(l)) + prior(l); }, low, high);
    }
    priors = 2;
  }
  const double normalisation = -priors * std::log(u.amplitude_prior.sigma_log * std::sqrt(2 * kPi));
  // Golden section stops at half the digits in each unknown, all of them in the value.
  EXPECT_NEAR(solution.log_likelihood + solution.log_prior, -least + normalisation,
              1e-7 * (1 + least));
  EXPECT_NEAR(-loss(p, u, solution.amplitude, solution.ambient, {0, 0}) + normalisation,
              solution.log_likelihood + solution.log_prior, 1e-9 * (1 + least));
}

// Half the squared residuals are minus the log posterior up to a constant: least squares on them
// is maximum a posteriori.
TEST_P(EveryLinearCase, ResidualsAreThePosterior) {
  for (const bool with_direct : {false, true}) {
    Problem p = problem(with_direct);
    const LinearSolver solver(p.observation, unknowns(with_direct));
    std::vector<double> constants;
    for (const int shift : {0, 2, 5}) {
      Problem moved = p;
      for (auto& s : moved.object) std::rotate(s.begin(), s.begin() + shift, s.end());
      for (std::size_t z = 0; z < 2; ++z) {
        moved.shapes[z].object = moved.object[z].data();
        if (with_direct) moved.shapes[z].direct = moved.direct[z].data();
      }
      LinearSolution solution;
      solver.solve(moved.shapes, solution, false);
      std::vector<double> r(static_cast<std::size_t>(solver.residual_count()));
      solver.residuals(moved.shapes, solution, r.data());
      double half = 0;
      for (const double value : r) half += 0.5 * value * value;
      constants.push_back(half + solution.log_likelihood + solution.log_prior);
    }
    EXPECT_NEAR(constants[1], constants[0], 1e-8 * (1 + std::abs(constants[0])));
    EXPECT_NEAR(constants[2], constants[0], 1e-8 * (1 + std::abs(constants[0])));
  }
}

// The Jacobian times the residuals is the posterior's gradient with the linear unknowns following,
// here by central differences of the solution: light that moves, and light that gets wider.
TEST_P(EveryLinearCase, JacobianHasThePosteriorsGradient) {
  for (const bool with_direct : {false, true}) {
    const Problem p = problem(with_direct);
    const LinearUnknowns u = unknowns(with_direct);
    const LinearSolver solver(p.observation, u);
    Eigen::MatrixXd slope(2 * kModelBins, 2);
    for (int z = 0; z < 2; ++z) {
      for (int k = 0; k < kModelBins; ++k) {
        const double x = (k - 35 - 4 * z) / 3.0;
        const double light = p.object[static_cast<std::size_t>(z)][static_cast<std::size_t>(k)];
        slope(z * kModelBins + k, 0) = light * x / 3;
        slope(z * kModelBins + k, 1) = light * x * x;
      }
    }
    LinearSolution solution;
    solver.solve(p.shapes, solution, false);
    std::vector<double> r(static_cast<std::size_t>(solver.residual_count()));
    solver.residuals(p.shapes, solution, r.data());
    Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor> jacobian(solver.residual_count(), 2);
    solver.jacobian(p.shapes, solution, slope, r.data(), jacobian.data());
    const Eigen::Vector2d gradient =
        jacobian.transpose() * Eigen::Map<const Eigen::VectorXd>(r.data(), jacobian.rows());
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double step = 1e-4;
      std::array<double, 2> value{};
      for (std::size_t side = 0; side < 2; ++side) {
        Problem moved = p;
        for (std::size_t z = 0; z < 2; ++z) {
          for (std::size_t k = 0; k < kModelBins; ++k) {
            const auto row = static_cast<Eigen::Index>(z * kModelBins + k);
            moved.object[z][k] += (side == 0 ? -step : step) * slope(row, i);
          }
          moved.shapes[z].object = moved.object[z].data();
          if (with_direct) moved.shapes[z].direct = moved.direct[z].data();
        }
        LinearSolution at;
        solver.solve(moved.shapes, at, false);
        value[side] = -(at.log_likelihood + at.log_prior);
      }
      // In units of what one standard deviation changes; few photons bend the residuals.
      const double unit = jacobian.col(i).norm();
      ASSERT_GT(unit, 0);
      EXPECT_NEAR(gradient[i] / unit, (value[1] - value[0]) / (2 * step) / unit,
                  GetParam().true_ambient < 1 ? 0.02 : 1e-4)
          << i;
    }
  }
}

// What a warm start leaves over would be noise in the finite differences of the fit.
TEST_P(EveryLinearCase, WarmStartFindsTheSameSolution) {
  const Problem p = problem(true);
  const LinearSolver solver(p.observation, unknowns(true));
  LinearSolution cold;
  solver.solve(p.shapes, cold, false);
  LinearSolution warm = cold;
  for (double& a : warm.amplitude) a *= 1.3;
  if (GetParam().ambient == LinearMode::per_zone) {
    for (double& c : warm.ambient) c *= 0.8;
  }
  solver.solve(p.shapes, warm, true);
  EXPECT_TRUE(warm.converged);
  EXPECT_NEAR(warm.log_likelihood + warm.log_prior, cold.log_likelihood + cold.log_prior,
              1e-6 + 1e-10 * std::abs(cold.log_likelihood))
      << "an ambient level at its bound is known to a millionth of a photon";
}

INSTANTIATE_TEST_SUITE_P(LinearUnknowns, EveryLinearCase, testing::ValuesIn(linear_cases()),
                         [](const auto& tested) { return tested.param.name; });

// Under a Poisson law the bins outside the gate hold only ambient light, and their sum is as good
// as they are one by one.
TEST(LinearUnknownsTest, WindowLosesNothingUnderAPoissonLaw) {
  Problem whole(PoissonNoise{}, 8, 5, false);
  for (auto& s : whole.object) {
    for (int k = 0; k < kModelBins; ++k) {
      if (k < 20 || k >= 55) s[static_cast<std::size_t>(k)] = 0;
    }
  }
  whole.look({0, kModelBins}, false);
  Problem cut = whole;
  cut.look({20, 55}, false);
  LinearUnknowns u;
  u.amplitude_prior = {8, 1.5};
  LinearSolution a, b;
  LinearSolver(whole.observation, u).solve(whole.shapes, a, false);
  LinearSolver(cut.observation, u).solve(cut.shapes, b, false);
  for (std::size_t z = 0; z < 2; ++z) {
    EXPECT_NEAR(a.ambient[z], b.ambient[z], 1e-8 * a.ambient[z]);
    EXPECT_NEAR(a.amplitude[z], b.amplitude[z], 1e-8 * a.amplitude[z]);
  }
}

// No counts beside the object: the ambient light goes to its bound, not below.
TEST(LinearUnknownsTest, AmbientStopsAtZero) {
  Problem p(PoissonNoise{}, 20, 0, false);
  LinearUnknowns u;
  u.amplitude_prior = {20, 1.5};
  LinearSolution solution;
  LinearSolver(p.observation, u).solve(p.shapes, solution, false);
  EXPECT_TRUE(solution.converged);
  for (const double c : solution.ambient) {
    EXPECT_GE(c, 0);
    EXPECT_LT(c * kModelBins, 1e-3) << "photons";
  }
  EXPECT_NEAR(solution.amplitude[0], 20, 20 * 5 / std::sqrt(20 * 2 * 2.5 * 3 * 2.5));
}

TEST(LinearUnknownsTest, DirectIsFoundPerZoneAndStopsAtZero) {
  Problem p(PoissonNoise{}, 8, 5, true);
  LinearUnknowns u;
  u.amplitude_prior = {8, 1.5};
  u.direct = LinearMode::per_zone;
  LinearSolution solution;
  LinearSolver(p.observation, u).solve(p.shapes, solution, false);
  // About 240 counts of direct light in a zone: 1.2 +- 0.08, five standard deviations.
  for (const double b : solution.direct) EXPECT_NEAR(b, 1.2, 0.45);

  // No direct light in the data, and a dip where it would be.
  Problem none(PoissonNoise{}, 8, 5, false);
  for (int z = 0; z < 2; ++z) {
    for (int k = 4; k < 13; ++k) none.captures[0].counts.zone(z)[k] = 0;
  }
  none.look({0, kModelBins}, true);
  LinearSolver(none.observation, u).solve(none.shapes, solution, false);
  EXPECT_TRUE(solution.converged);
  for (const double b : solution.direct) {
    EXPECT_GE(b, 0);
    EXPECT_LT(b, 1e-6);
  }
}

// The empty capture is the hardest for logarithms.
TEST(LinearUnknownsTest, ZeroCountsStayFinite) {
  for (const bool with_direct : {false, true}) {
    for (const LinearMode mode : {LinearMode::shared, LinearMode::per_zone, LinearMode::fixed}) {
      Problem p(PoissonNoise{}, 8, 5, with_direct);
      std::fill(p.captures[0].counts.values.begin(), p.captures[0].counts.values.end(), 0.0);
      for (const TimeGate gate : {TimeGate{0, kModelBins}, TimeGate{10, 50}}) {
        p.look(gate, with_direct);
        LinearUnknowns u;
        u.amplitude = mode;
        u.direct = with_direct ? LinearMode::per_zone : LinearMode::fixed;
        const LinearSolver solver(p.observation, u);
        LinearSolution solution;
        solver.solve(p.shapes, solution, false);
        EXPECT_TRUE(solution.converged);
        EXPECT_TRUE(std::isfinite(solution.log_likelihood + solution.log_prior));
        EXPECT_TRUE(std::isfinite(solution.log_volume));
        for (std::size_t z = 0; z < 2; ++z) {
          EXPECT_TRUE(std::isfinite(solution.amplitude[z]) && solution.amplitude[z] > 0);
          EXPECT_TRUE(std::isfinite(solution.ambient[z]) && solution.ambient[z] >= 0);
          EXPECT_TRUE(std::isfinite(solution.direct[z]) && solution.direct[z] >= 0);
        }
        std::vector<double> r(static_cast<std::size_t>(solver.residual_count()));
        solver.residuals(p.shapes, solution, r.data());
        for (const double value : r) EXPECT_TRUE(std::isfinite(value));
      }
    }
  }
}

// Without an object the amplitude is left out, and the ambient light is the mean count.
TEST(LinearUnknownsTest, WithoutAnObjectAmbientIsTheMean) {
  Problem p(PoissonNoise{}, 0, 5, false);
  for (ZoneShapes& shape : p.shapes) shape = {};
  LinearUnknowns u;
  LinearSolution solution;
  LinearSolver(p.observation, u).solve(p.shapes, solution, false);
  for (std::size_t z = 0; z < 2; ++z) {
    double mean = 0;
    for (const double n : p.observation.zones[z].counts) mean += n / kModelBins;
    EXPECT_NEAR(solution.ambient[z], mean, 1e-9 * mean);
  }
  EXPECT_EQ(solution.log_prior, 0);
}

// Laplace: the volume is that of the Gaussian with the Hessian of the loss in (log a, c).
TEST(LinearUnknownsTest, LogVolumeIsLaplaces) {
  Problem p(PoissonNoise{}, 8, 5, false, 5, 1);
  LinearUnknowns u;
  u.amplitude_prior = {8, 1.5};
  LinearSolution s;
  LinearSolver(p.observation, u).solve(p.shapes, s, false);
  const auto f = [&](double da, double dc) {
    return loss(p, u, {s.amplitude[0] * std::exp(da)}, {s.ambient[0] + dc}, {0});
  };
  const double h = 1e-3;
  const double aa = (f(h, 0) - 2 * f(0, 0) + f(-h, 0)) / (h * h);
  const double cc = (f(0, h) - 2 * f(0, 0) + f(0, -h)) / (h * h);
  const double ac = (f(h, h) - f(h, -h) - f(-h, h) + f(-h, -h)) / (4 * h * h);
  const double exact = -0.5 * std::log(aa * cc - ac * ac) + std::log(2 * kPi);
  EXPECT_NEAR(s.log_volume, exact, 1e-4);
  EXPECT_NEAR(s.log_prior, log_prior(u, s.amplitude[0]), 1e-12);
}

// The volume of what cannot be negative ends at zero, so that the evidence is the integral over the
// ambient light whoever explains the photons, however many exposures were averaged. The worst case
// is one photon that object and ambient light share: the exact integrand is that of a gamma
// distribution of shape two, of which a Gaussian lacks 0.25, and 0.37 at the edge.
TEST(LinearUnknownsTest, EvidenceIntegratesOverTheAmbientLightDownToZero) {
  for (const double exposures : {1.0, 1e8}) {
    for (const int photons : {0, 1, 3}) {
      for (const double light : {0.0, 1e-3, 0.01, 0.02, 0.05, 0.3, 2.0}) {
        Problem p(PoissonNoise{}, 1, 0, false, 5, 1);
        for (double& count : p.captures[0].counts.values) count = 0;
        p.captures[0].counts.zone(0)[35] = photons / exposures;
        p.captures[0].exposures = exposures;
        for (double& s : p.object[0]) s *= 0.5 * light / exposures;  // at its peak: light
        p.look({0, kModelBins}, false);
        LinearUnknowns u;
        u.amplitude = LinearMode::fixed;
        u.fixed_amplitude = 1;
        LinearSolution s;
        LinearSolver(p.observation, u).solve(p.shapes, s, false);
        const auto f = [&](double c) { return loss(p, u, {1}, {c}, {0}); };
        const double least = f(s.ambient[0]);
        constexpr int kSteps = 20'000;
        const double width = 30.0 * (1 + photons) / (kModelBins * exposures * kSteps);
        double sum = 0;
        for (int k = 0; k < kSteps; ++k) sum += width * std::exp(least - f((k + 0.5) * width));
        EXPECT_NEAR(s.log_volume, std::log(sum), 0.4)
            << exposures << " exposures, " << photons << " photons, light " << light;
      }
    }
  }
}

// Censored zeros pull less than zeros that were measured: the ambient light is found without bias.
TEST(LinearUnknownsTest, CensoringDoesNotBiasTheAmplitude) {
  const GaussianNoise law{9, 0, true};
  double mean = 0;
  double square = 0;
  constexpr int kTrials = 100;
  for (unsigned seed = 0; seed < kTrials; ++seed) {
    Problem p(law, 4, 0.5, false, 100 + seed);
    LinearUnknowns u;
    u.amplitude_prior = {4, 5};
    LinearSolution solution;
    LinearSolver(p.observation, u).solve(p.shapes, solution, false);
    EXPECT_TRUE(solution.converged);
    mean += solution.amplitude[0] / kTrials;
    square += std::pow(solution.amplitude[0], 2) / kTrials;
  }
  const double deviation = std::sqrt((square - mean * mean) / kTrials);
  // Five standard errors, and the second-order bias of a logarithm's prior and estimate.
  EXPECT_NEAR(mean, 4, 5 * deviation + 0.04);
}

}  // namespace
}  // namespace blindcorner
