// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/posterior/evaluation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include "blindcorner/forward/error.h"
#include "forward/support/quantile.h"

namespace blindcorner {
namespace {

/// What the figures need of one estimate.
struct Summary {
  Eigen::VectorXd absolute;            ///< [unknowns] errors
  double distance = 0;                 ///< m
  int within_one = 0, within_two = 0;  ///< unknowns
  double normalised = 0;
};

/// Names of all figures, in their order.
std::vector<std::string> labels_of(const std::vector<std::string>& names) {
  std::vector<std::string> labels;
  for (const std::string& name : names) labels.push_back("rmse_" + name);
  if (std::ranges::any_of(names, is_position)) {
    for (const char* name : {"rmse_m", "median_distance_m", "p90_distance_m"}) {
      labels.emplace_back(name);
    }
  }
  for (const std::string& name : names) {
    if (is_position(name)) continue;
    labels.push_back("median_" + name);
    labels.push_back("p90_" + name);
  }
  for (const char* name : {"coverage_1sigma", "coverage_2sigma", "normalised_error"}) {
    labels.emplace_back(name);
  }
  return labels;
}

/// Values of all figures for a choice of summaries.
std::vector<double> figures_of(const std::vector<const Summary*>& chosen,
                               const std::vector<std::string>& names) {
  const auto count = static_cast<double>(chosen.size());
  std::vector<double> values;
  const auto all = [&](const auto& value) {
    std::vector<double> list;
    for (const Summary* s : chosen) list.push_back(value(*s));
    return list;
  };
  const auto mean = [&](const auto& value) {
    const std::vector<double> list = all(value);
    return std::reduce(list.begin(), list.end()) / count;
  };
  for (Eigen::Index i = 0; i < chosen.front()->absolute.size(); ++i) {
    values.push_back(
        std::sqrt(mean([i](const Summary& s) { return s.absolute[i] * s.absolute[i]; })));
  }
  const auto positions = static_cast<double>(std::ranges::count_if(names, is_position));
  if (positions > 0) {
    const double square = mean([](const Summary& s) { return s.distance * s.distance; });
    values.push_back(std::sqrt(square / positions));
    const std::vector<double> distances = all([](const Summary& s) { return s.distance; });
    values.push_back(quantile(distances, 0.5));
    values.push_back(quantile(distances, 0.9));
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (is_position(names[i])) continue;
    const auto k = static_cast<Eigen::Index>(i);
    const std::vector<double> errors = all([k](const Summary& s) { return s.absolute[k]; });
    values.push_back(quantile(errors, 0.5));
    values.push_back(quantile(errors, 0.9));
  }
  const auto unknowns = static_cast<double>(names.size());
  values.push_back(mean([](const Summary& s) { return s.within_one; }) / unknowns);
  values.push_back(mean([](const Summary& s) { return s.within_two; }) / unknowns);
  values.push_back(mean([](const Summary& s) { return s.normalised; }));
  return values;
}

Summary summarise(const EstimateError& e, const std::vector<std::string>& names,
                  std::size_t index) {
  const auto n = static_cast<Eigen::Index>(names.size());
  const Eigen::LLT<Eigen::MatrixXd> factor(e.covariance);
  if (e.error.size() != n || e.covariance.rows() != n || e.covariance.cols() != n ||
      !e.error.allFinite() || factor.info() != Eigen::Success) {
    throw Error("estimate " + std::to_string(index),
                "accepted: a finite error and a positive definite covariance of its size");
  }
  Summary s;
  s.absolute = e.error.cwiseAbs();
  s.distance = distance_of(e.error, names);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = std::abs(e.error[i]) / std::sqrt(e.covariance(i, i));
    s.within_one += u <= 1 ? 1 : 0;
    s.within_two += u <= 2 ? 1 : 0;
  }
  s.normalised = e.error.dot(factor.solve(e.error)) / static_cast<double>(n);
  return s;
}

}  // namespace

bool is_position(const std::string& unknown) { return unknown.ends_with("_m"); }

double distance_of(const Eigen::VectorXd& error, const std::vector<std::string>& names) {
  double squares = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (is_position(names[i])) squares += std::pow(error[static_cast<Eigen::Index>(i)], 2);
  }
  return std::sqrt(squares);
}

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
    summaries.push_back(summarise(errors[i], names, i));
    groups[errors[i].group.empty() ? "#" + std::to_string(i) : errors[i].group].push_back(i);
  }
  std::vector<const Summary*> all;
  for (const Summary& s : summaries) all.push_back(&s);
  const std::vector<double> values = figures_of(all, names);

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
    const std::vector<double> drawn = figures_of(chosen, names);
    for (std::size_t f = 0; f < drawn.size(); ++f) resampled[f].push_back(drawn[f]);
  }

  Evaluation evaluation;
  evaluation.estimates = static_cast<int>(errors.size());
  evaluation.groups = static_cast<int>(members.size());
  const std::vector<std::string> labels = labels_of(names);
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
