// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/posterior/evaluation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "blindcorner/forward/error.h"
#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

/// What the figures need of one estimate.
struct Summary {
  Eigen::VectorXd squares;  ///< of each coordinate's error
  double length = 0;
  int within_one = 0, within_two = 0;  ///< coordinates
  double normalised = 0;
};

/// Values of all figures for a choice of summaries.
std::vector<double> figures_of(const std::vector<const Summary*>& chosen) {
  const Eigen::Index n = chosen.front()->squares.size();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(n);
  std::vector<double> lengths;
  double one = 0, two = 0, normalised = 0;
  for (const Summary* s : chosen) {
    squares += s->squares;
    lengths.push_back(s->length);
    one += s->within_one;
    two += s->within_two;
    normalised += s->normalised;
  }
  const auto count = static_cast<double>(chosen.size());
  const double coordinates = count * static_cast<double>(n);
  std::vector<double> values;
  for (Eigen::Index i = 0; i < n; ++i) values.push_back(std::sqrt(squares[i] / count));
  values.push_back(std::sqrt(squares.sum() / coordinates));
  values.push_back(quantile(lengths, 0.5));
  values.push_back(quantile(lengths, 0.9));
  values.push_back(one / coordinates);
  values.push_back(two / coordinates);
  values.push_back(normalised / count);
  return values;
}

Summary summarise(const EstimateError& e, std::size_t index) {
  const Eigen::Index n = e.error.size();
  const Eigen::LLT<Eigen::MatrixXd> factor(e.covariance);
  if (e.covariance.rows() != n || e.covariance.cols() != n || !e.error.allFinite() ||
      factor.info() != Eigen::Success) {
    throw Error("estimate " + std::to_string(index),
                "accepted: a finite error and a positive definite covariance of its size");
  }
  Summary s;
  s.squares = e.error.cwiseAbs2();
  s.length = e.error.norm();
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = std::abs(e.error[i]) / std::sqrt(e.covariance(i, i));
    s.within_one += u <= 1 ? 1 : 0;
    s.within_two += u <= 2 ? 1 : 0;
  }
  s.normalised = e.error.dot(factor.solve(e.error)) / static_cast<double>(n);
  return s;
}

}  // namespace

void EvaluationOptions::validate() const {
  if (resamples < 0) throw Error("EvaluationOptions.resamples", "accepted: at least 0");
  if (!(interval > 0 && interval < 1)) {
    throw Error("EvaluationOptions.interval", "accepted: between 0 and 1");
  }
}

const Figure& Evaluation::figure(const std::string& name) const {
  const auto it =
      std::find_if(figures.begin(), figures.end(), [&](const Figure& f) { return f.name == name; });
  if (it == figures.end()) throw Error("figure", "found " + name + ", which is not evaluated");
  return *it;
}

Evaluation evaluate_errors(const std::vector<EstimateError>& errors,
                           const std::vector<std::string>& names,
                           const EvaluationOptions& options) {
  options.validate();
  if (errors.empty()) throw Error("evaluate", "found no estimate with a known truth");
  std::vector<Summary> summaries;
  std::map<std::string, std::vector<std::size_t>> groups;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    summaries.push_back(summarise(errors[i], i));
    groups[errors[i].group.empty() ? "#" + std::to_string(i) : errors[i].group].push_back(i);
  }
  std::vector<const Summary*> all;
  for (const Summary& s : summaries) all.push_back(&s);
  const std::vector<double> values = figures_of(all);

  std::vector<const std::vector<std::size_t>*> members;
  for (const auto& [name, list] : groups) members.push_back(&list);
  std::vector<std::vector<double>> resampled(values.size());
  std::mt19937_64 random(options.seed);
  std::uniform_int_distribution<std::size_t> pick(0, members.size() - 1);
  for (int r = 0; r < options.resamples; ++r) {
    std::vector<const Summary*> chosen;
    for (std::size_t g = 0; g < members.size(); ++g) {
      for (const std::size_t i : *members[pick(random)]) chosen.push_back(&summaries[i]);
    }
    const std::vector<double> drawn = figures_of(chosen);
    for (std::size_t f = 0; f < drawn.size(); ++f) resampled[f].push_back(drawn[f]);
  }

  Evaluation evaluation;
  evaluation.estimates = static_cast<int>(errors.size());
  evaluation.groups = static_cast<int>(members.size());
  std::vector<std::string> labels;
  for (const std::string& name : names) labels.push_back("rmse_" + name);
  for (const char* name : {"rmse", "median_error", "p90_error", "coverage_1sigma",
                           "coverage_2sigma", "normalised_error"}) {
    labels.emplace_back(name);
  }
  for (std::size_t f = 0; f < values.size(); ++f) {
    Figure figure{labels.at(f), values[f], values[f], values[f]};
    if (!resampled[f].empty()) {
      figure.low = quantile(resampled[f], 0.5 * (1 - options.interval));
      figure.high = quantile(resampled[f], 0.5 * (1 + options.interval));
    }
    evaluation.figures.push_back(figure);
  }
  return evaluation;
}

}  // namespace blindcorner
