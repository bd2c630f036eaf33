// SPDX-License-Identifier: Apache-2.0
#include "commands/fit_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "blindcorner/report/result_file.h"
#include "forward/support/quantile.h"
#include "report/reading_units.h"

namespace blindcorner {

namespace {

using Row = std::vector<std::string>;

std::string number(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string probability(std::optional<double> known) {
  if (!known) return "-";
  const double value = *known;
  if (value > 0.0 && value < 1e-6) return "<1e-6";
  if (!(value > 0.0 && value < 1e-3)) return number(value, 3);
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", value);
  return text;
}

/// Decimals that show two digits of `sigma`.
int decimals_for(double sigma) {
  if (!(sigma > 0.0) || !std::isfinite(sigma)) return 3;
  return std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 7);
}

std::string with_sigma(double value, double sigma, bool open) {
  const int decimals = decimals_for(sigma);
  return number(value, decimals) + " ± " + number(sigma, decimals) + (open ? " open" : "");
}

std::string capture_name(const FitResult& result) {
  if (is_joint(result)) return std::to_string(result.sources.size()) + " jointly";
  const std::string file = result.sources.empty()
                               ? "capture"
                               : std::filesystem::path(result.sources.front()).filename().string();
  return result.indices.empty() ? file : file + " [" + std::to_string(result.indices.front()) + "]";
}

Row row_of(const Scene& scene, const FitResult& result, bool truth_known) {
  Row row = {capture_name(result)};
  if (!result.error.empty() || result.posterior.modes.empty()) {
    row.emplace_back(result.error.empty() ? "no mode" : "failed");
    return row;
  }
  const PoseMode& mode = result.posterior.modes.front();
  const std::vector<std::string> names = unknown_names(scene);
  for (int i = 0; i < static_cast<int>(scene.unknowns.size()); ++i) {
    const bool open = std::ranges::count(mode.undetermined, i) > 0;
    const double unit = reading_unit(names[static_cast<std::size_t>(i)]);
    row.push_back(with_sigma(unit * mode.pose[i], unit * std::sqrt(mode.covariance(i, i)), open));
  }
  row.push_back(number(mode.weight, 3));
  row.push_back(number(result.posterior.presence_probability, 3));
  row.push_back(probability(result.false_alarm_probability));
  if (truth_known) row.push_back(number(position_error(scene, result), 4));
  std::string flags;
  for (const std::string& flag : result.flags) flags += (flags.empty() ? "" : " ") + flag;
  row.push_back(flags);
  return row;
}

/// Characters on screen: bytes that are not continuations of UTF-8.
std::size_t width(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string aligned(const std::vector<Row>& rows) {
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (const Row& row : rows) {
    if (row.size() < widths.size()) continue;  // a failure's text may run on
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], width(row[c]));
  }
  for (const Row& row : rows) widths[0] = std::max(widths[0], width(row[0]));
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      line += (c == 0 ? "" : "  ") + row[c];
      line.append(widths[c] - std::min(widths[c], width(row[c])), ' ');
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

std::string summary(const Scene& scene, const std::vector<FitResult>& results) {
  std::vector<double> errors, times;
  std::size_t failed = 0;
  for (const FitResult& result : results) {
    if (!result.error.empty()) {
      ++failed;
      continue;
    }
    times.push_back(result.time_ms.total);
    const double error = position_error(scene, result);
    if (std::isfinite(error)) errors.push_back(error);
  }
  std::string text = std::to_string(results.size()) + (results.size() == 1 ? " fit" : " fits");
  if (failed > 0) text += ", " + std::to_string(failed) + " failed";
  if (!times.empty()) {
    text += "; median time " + number(quantile(times, 0.5), 1) + " ms";
  }
  if (!errors.empty()) {
    text += "; heaviest mode to truth: ";
    text += errors.size() == 1
                ? number(errors.front(), 4) + " m"
                : "median " + number(quantile(errors, 0.5), 4) + " m, 90th percentile " +
                      number(quantile(errors, 0.9), 4) + " m";
  }
  return text + "\n";
}

}  // namespace

std::string fit_table(const Scene& scene, const std::vector<FitResult>& results,
                      std::size_t max_rows) {
  const bool truth_known = std::ranges::any_of(results, [&scene](const FitResult& result) {
    return std::isfinite(position_error(scene, result));
  });
  Row titles = {"capture"};
  for (const std::string& name : unknown_names(scene)) titles.push_back(reading_name(name));
  titles.insert(titles.end(), {"weight", "present", "false alarm"});
  if (truth_known) titles.emplace_back("error_m");
  titles.emplace_back("flags");
  std::vector<Row> rows = {titles};
  for (std::size_t i = 0; i < std::min(results.size(), max_rows); ++i) {
    rows.push_back(row_of(scene, results[i], truth_known));
  }
  std::string text = aligned(rows);
  if (results.size() > max_rows) {
    text += "... and " + std::to_string(results.size() - max_rows) + " more in result.json\n";
  }
  return text + summary(scene, results);
}

std::string failure_lines(const std::vector<FitResult>& results, std::size_t max_lines) {
  std::string text;
  std::size_t failed = 0;
  for (const FitResult& result : results) {
    if (result.error.empty() || ++failed > max_lines) continue;
    std::string reason = result.error;
    // The reason may begin with the file's name already.
    const std::string prefix = result.sources.empty() ? "" : result.sources.front() + ": ";
    if (!prefix.empty() && reason.starts_with(prefix)) reason.erase(0, prefix.size());
    std::ranges::replace(reason, '\n', ' ');
    const std::string name =
        is_joint(result)         ? capture_name(result)
        : result.sources.empty() ? "capture"
        : result.indices.empty()
            ? result.sources.front()
            : result.sources.front() + " [" + std::to_string(result.indices.front()) + "]";
    text += "blindcorner: " + name + ": " + reason + "\n";
  }
  if (failed > max_lines) {
    text += "blindcorner: " + std::to_string(failed - max_lines) +
            " more captures failed, named in result.json\n";
  }
  return text;
}

}  // namespace blindcorner
