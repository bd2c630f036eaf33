// SPDX-License-Identifier: Apache-2.0
/// `blindcorner stability`: the table of stiff and extreme cases.
#include "commands/stability.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "commands/commands.h"
#include "commands/notice.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "commands/progress.h"
#include "io/json_reader.h"
#include "report/stability_page.h"
#include "stability/stability.h"

namespace blindcorner {
namespace {

struct StabilityArguments {
  std::string output;
  std::vector<std::string> rows;
  Printout out;
};

/// The rows with these names, in the table's order. Without names, all rows.
std::vector<const StabilityRow*> wanted_rows(const std::vector<std::string>& names) {
  const std::vector<StabilityRow>& all = stability_rows();
  for (const std::string& name : names) {
    if (std::ranges::find(all, name, &StabilityRow::name) != all.end()) continue;
    std::vector<std::string> known;
    for (const StabilityRow& row : all) known.push_back(row.name);
    const std::string near = nearest_word(name, known);
    throw Error("--rows", "found " + name + (near.empty() ? "" : " (did you mean " + near + "?)") +
                              ", accepted: names that `blindcorner stability` prints");
  }
  std::vector<const StabilityRow*> wanted;
  for (const StabilityRow& row : all) {
    if (names.empty() || std::ranges::find(names, row.name) != names.end()) wanted.push_back(&row);
  }
  return wanted;
}

void print(const Printout& out, const StabilityResult& result) {
  const StabilityRow& row = *result.row;
  out.text("%-30s %12.4g %12.4g  %-10s %-5s %6.2f  %s\n", row.name.c_str(), result.measured.value,
           row.limit, limit_origin_name(row.origin).c_str(), result.holds ? "holds" : "FAILS",
           result.seconds, result.holds ? "" : result.measured.detail.c_str());
}

int run_stability(const StabilityArguments& arguments) {
  const auto rows = wanted_rows(arguments.rows);
  if (!arguments.output.empty()) make_directory(arguments.output);
  tell_begun(std::to_string(rows.size()) + " case" + (rows.size() == 1 ? "" : "s") +
             ", one after the other; all of them take minutes");
  const Printout& out = arguments.out;
  out.text("%-30s %12s %12s  %-10s %-5s %6s\n", "case", "measured", "limit", "limit from", "",
           "cpu s");
  std::vector<StabilityResult> results;
  for (const StabilityRow* row : rows) {
    {
      const StageProgress stage(row->name);
      results.push_back(run_stability_row(*row));
    }
    print(out, results.back());
  }
  const auto holding = std::ranges::count_if(results, &StabilityResult::holds);
  out.text("%d of %d hold\n", static_cast<int>(holding), static_cast<int>(results.size()));
  out.document(stability_json(results));
  if (!arguments.output.empty()) {
    const std::filesystem::path directory(arguments.output);
    write_atomically((directory / "stability.json").string(), stability_json(results));
    write_atomically((directory / "stability.html").string(), stability_page(results));
    out.text("%s\n", (directory / "stability.html").string().c_str());
  }
  return holding == static_cast<std::ptrdiff_t>(results.size()) ? kAllWell : kSomeFailed;
}

}  // namespace

void add_stability_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "stability", "stiff and extreme cases: what is measured, its limit, and whether it holds");
  const auto arguments = std::make_shared<StabilityArguments>();
  command.add_option("-o,--output", arguments->output,
                     "directory for stability.json and a page; default: the table alone");
  command.add_option("--rows", arguments->rows, "only these cases, separated by commas")
      ->delimiter(',')
      ->type_name("NAME,...");
  arguments->out.add_option(command, "stability.json");
  command.callback([arguments, &exit_code] { exit_code = run_stability(*arguments); });
}

}  // namespace blindcorner
