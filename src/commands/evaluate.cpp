// SPDX-License-Identifier: Apache-2.0
/// `blindcorner evaluate RESULT [TRUTH]`.
#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/posterior/evaluation.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/report/index_page.h"
#include "commands/commands.h"
#include "commands/printout.h"
#include "commands/truth_table.h"
#include "forward/support/comma_list.h"
#include "io/file_bytes.h"
#include "io/file_kind.h"
#include "io/json_reader.h"
#include "report/evaluation_page.h"

namespace blindcorner {

namespace {

using Json = JsonReader::Json;

struct EvaluateArguments {
  std::string result;
  std::string truth;
  std::string page;
  std::string estimator = "mean";
  Printout out;
  EvaluationOptions options;
};

/// True values of the unknowns, by the place of the capture in the result. NaN: not known.
using Truth = std::map<std::size_t, Eigen::VectorXd>;

Eigen::VectorXd vector_of(const std::map<std::string, double>& values,
                          const std::vector<std::string>& names) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(names.size()));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto known = values.find(names[i]);
    v[static_cast<Eigen::Index>(i)] = known == values.end() ? std::nan("") : known->second;
  }
  return v;
}

Truth read_csv(const std::string& path, const std::vector<std::string>& names) {
  std::set<std::string> found;
  const TruthTable table = read_truth_table(path, [&](const std::string& name) {
    found.insert(name);
    return std::ranges::find(names, name) != names.end();
  });
  for (const std::string& name : names) {
    if (!found.contains(name)) {
      throw Error(path, "column " + name + " is missing, accepted: a header that names it");
    }
  }
  Truth truth;
  for (const auto& [place, values] : table.truths) truth[place] = vector_of(values, names);
  return truth;
}

Truth read_truth(const std::string& path, const std::vector<std::string>& names) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".csv") return read_csv(path, names);
  if (extension != ".exr") throw Error(path, "accepted: a capture file (.exr) or a table (.csv)");
  Truth truth;
  const CaptureFile file = read_captures(path);
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    truth[i] = vector_of(file.captures[i].truth, names);
  }
  return truth;
}

Eigen::VectorXd numbers(const Json& list, Eigen::Index size, const std::string& where) {
  if (!list.is_array() || static_cast<Eigen::Index>(list.size()) != size) {
    throw Error(where, "found " +
                           (list.is_array() ? std::to_string(list.size()) + " values"
                                            : std::string("no list")) +
                           ", accepted: " + std::to_string(size) + " numbers");
  }
  Eigen::VectorXd v(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Json& value = list[static_cast<std::size_t>(i)];
    v[i] = value.is_number() ? value.get<double>() : std::nan("");
  }
  return v;
}

/// A field of an object. Throws Error where there is none.
const Json& field(const Json& object, const char* name, const std::string& where) {
  if (!object.is_object() || !object.contains(name)) {
    throw Error(where + "." + name, "found nothing, accepted: what blindcorner fit writes");
  }
  return object[name];
}

Eigen::MatrixXd covariance_of(const Json& rows, Eigen::Index n, const std::string& where) {
  if (!rows.is_array() || static_cast<Eigen::Index>(rows.size()) != n) {
    throw Error(where, "found " +
                           (rows.is_array() ? std::to_string(rows.size()) + " rows"
                                            : std::string("no rows")) +
                           ", accepted: a matrix of the " + std::to_string(n) + " unknowns");
  }
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index r = 0; r < n; ++r) {
    covariance.row(r) = numbers(rows[static_cast<std::size_t>(r)], n, where).transpose();
  }
  if (covariance.allFinite() && !covariance.isApprox(covariance.transpose(), 1e-6)) {
    throw Error(where, "found a matrix that is not symmetric, accepted: a covariance");
  }
  if (!covariance.allFinite() || Eigen::LLT<Eigen::MatrixXd>(covariance).info() != Eigen::Success) {
    throw Error(where, "found no positive definite matrix, accepted: a covariance");
  }
  return covariance;
}

/// Distance of an entry's heaviest mode from the truth, m: what the page of the fit states.
std::optional<double> mode_distance(const Json& entry, const Eigen::VectorXd& truth,
                                    const std::vector<std::string>& names,
                                    const std::string& where) {
  if (!entry.contains("modes") || !entry["modes"].is_array() || entry["modes"].empty()) return {};
  const Json& mode = entry["modes"][0];
  if (!mode.is_object() || !mode.contains("pose") || !mode["pose"].is_array()) return {};
  if (std::ranges::none_of(names, is_position)) return {};
  const double distance =
      distance_of(numbers(mode["pose"], truth.size(), where + ".modes[0].pose") - truth, names);
  return std::isfinite(distance) ? std::optional(distance) : std::nullopt;
}

/// The error of one entry of the result. Empty: its estimate or its truth is missing. Adds the
/// distance of the heaviest mode from the truth to `distances`.
std::optional<EstimateError> error_of(const Json& entry, const Truth* truth,
                                      const std::vector<std::string>& names,
                                      const Eigen::VectorXd& periods, bool mean, std::size_t place,
                                      const std::string& where, std::vector<double>& distances) {
  const Eigen::Index n = periods.size();
  const Json* pose = nullptr;
  const Json* covariance = nullptr;
  if (!entry.is_object()) throw Error(where, "found no object, accepted: a capture's result");
  if (mean && entry.contains("mean") && entry["mean"].is_array()) {
    pose = &entry["mean"];
    covariance = &field(entry, "covariance", where);
  } else if (!mean && entry.contains("modes") && entry["modes"].is_array() &&
             !entry["modes"].empty()) {
    pose = &field(entry["modes"][0], "optimum", where + ".modes[0]");
    covariance = &field(entry["modes"][0], "covariance", where + ".modes[0]");
  }
  if (pose == nullptr) return std::nullopt;
  Eigen::VectorXd known;
  if (truth != nullptr) {
    const auto found = truth->find(place);
    if (found == truth->end()) return std::nullopt;
    known = found->second;
  } else {
    if (!entry.contains("truth") || !entry["truth"].is_array()) return std::nullopt;
    known = numbers(entry["truth"], n, where + ".truth");
  }
  if (!known.allFinite()) return std::nullopt;
  EstimateError e;
  e.error = numbers(*pose, n, where + (mean ? ".mean" : ".optimum")) - known;
  if (!e.error.allFinite()) throw Error(where, "found a pose without numbers, accepted: numbers");
  for (Eigen::Index i = 0; i < n; ++i) {
    if (periods[i] > 0) e.error[i] = std::remainder(e.error[i], periods[i]);
  }
  e.covariance = covariance_of(*covariance, n, where + ".covariance");
  if (const auto distance = mode_distance(entry, known, names, where))
    distances.push_back(*distance);
  std::ostringstream group;
  group << known.transpose();
  e.group = group.str();
  return e;
}

/// The page to write. Its figures go to a .json file beside it, which must not be the result that
/// is read.
std::filesystem::path page_of(const EvaluateArguments& arguments) {
  if (arguments.page.empty()) {
    return std::filesystem::path(arguments.result).replace_filename("evaluation.html");
  }
  std::filesystem::path page = arguments.page;
  if (page.extension() != ".html") {
    throw Error("--page", "found \"" + arguments.page + "\", accepted: a name that ends in .html");
  }
  std::error_code missing;
  const std::filesystem::path figures = std::filesystem::path(page).replace_extension(".json");
  if (std::filesystem::equivalent(figures, arguments.result, missing)) {
    throw Error("--page", "found \"" + arguments.page + "\", whose figures would be written over " +
                              arguments.result + "; accepted: another name");
  }
  return page;
}

int run_evaluate(const EvaluateArguments& arguments) {
  arguments.options.validate();
  const std::filesystem::path page = page_of(arguments);
  const Json result =
      parse_file_kind(FileKind::result, read_bytes(arguments.result), arguments.result);
  const auto is_text = [](const Json& value) { return value.is_string(); };
  if (!result.is_object() || !result.contains("format") ||
      result["format"] != "blindcorner.result/1" || !result.contains("captures") ||
      !result["captures"].is_array() || !result.contains("unknowns") ||
      !result["unknowns"].is_array() || !std::ranges::all_of(result["unknowns"], is_text)) {
    throw Error(arguments.result, "is no result of blindcorner fit");
  }
  const auto names = result["unknowns"].get<std::vector<std::string>>();
  if (!result.contains("periods")) throw Error(arguments.result + ": periods", "is missing");
  const Eigen::VectorXd periods = numbers(
      result["periods"], static_cast<Eigen::Index>(names.size()), arguments.result + ": periods");
  if (!(periods.array() >= 0).all()) {
    throw Error(arguments.result + ": periods", "found a number below 0, accepted: 0 or more");
  }
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    throw Error(arguments.result + ": unknowns", "found a name twice, accepted: each once");
  }
  std::optional<Truth> truth;
  if (!arguments.truth.empty()) truth = read_truth(arguments.truth, names);
  EvaluationRow row;
  row.name = std::filesystem::path(arguments.result).string();
  const bool mean = arguments.estimator == "mean";
  row.estimator = mean ? "errors of the posterior mean (all modes together)"
                       : "errors of the heaviest mode's optimum";
  int without = 0;
  for (std::size_t i = 0; i < result["captures"].size(); ++i) {
    const auto error =
        error_of(result["captures"][i], truth ? &*truth : nullptr, names, periods, mean, i,
                 arguments.result + ": captures[" + std::to_string(i) + "]", row.mode_distances);
    if (error) {
      row.errors.push_back(*error);
    } else {
      ++without;
    }
  }
  if (row.errors.empty()) {
    throw Error(arguments.result,
                "found no capture with both an estimate and a truth of " + comma_list(names));
  }
  row.evaluation = evaluate_errors(row.errors, names, arguments.options);
  write_atomically(page.string(), evaluation_page("Errors", {row}, names));
  write_atomically(std::filesystem::path(page).replace_extension(".json").string(),
                   evaluation_json({row}));
  refresh_index(std::filesystem::absolute(page).parent_path().string());
  arguments.out.document(evaluation_json({row}));
  arguments.out.text("%s", evaluation_text({row}).c_str());
  if (without > 0) {
    std::fprintf(stderr, "blindcorner: %d captures without an estimate or a truth\n", without);
  }
  return without > 0 ? kSomeFailed : kAllWell;
}

}  // namespace

void add_evaluate_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "evaluate", "errors of a fit against the truth, and how honest its covariances are");
  const auto arguments = std::make_shared<EvaluateArguments>();
  command.add_option("RESULT", arguments->result, "result.json of a fit")->required();
  command.add_option("TRUTH", arguments->truth,
                     "capture file (.exr) or table (.csv) with the true values; without it those "
                     "that the result holds");
  command
      .add_option(
          "--page", arguments->page,
          "page to write (.html; figures beside it as .json); evaluation.html beside RESULT "
          "if not given")
      ->type_name("FILE");
  command
      .add_option("--estimator", arguments->estimator,
                  "mean: posterior mean and covariance; mode: optimum and covariance of the "
                  "heaviest mode")
      ->check(CLI::IsMember({"mean", "mode"}));
  arguments->out.add_option(command, "the figures");
  command.add_option("--resamples", arguments->options.resamples, "of the bootstrap");
  command.add_option("--seed", arguments->options.seed, "seed of the bootstrap");
  command.callback([arguments, &exit_code] { exit_code = run_evaluate(*arguments); });
}

}  // namespace blindcorner
