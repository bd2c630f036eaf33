// SPDX-License-Identifier: Apache-2.0
/// `blindcorner benchmark drives DRIVE...`: what perceptions claim of hidden objects, how early and
/// how honestly, over seeds and light.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/io/atomic_file.h"
#include "blindcorner/simulation/drive_claims.h"
#include "blindcorner/simulation/lit_drive.h"
#include "blindcorner/simulation/perception.h"
#include "commands/benchmark.h"
#include "commands/commands.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/printout.h"
#include "forward/support/quantile.h"
#include "report/formatted.h"

namespace blindcorner {
namespace {

struct DrivesArguments {
  std::vector<std::string> drives;
  std::vector<std::string> perceptions{"solver"};
  std::vector<std::string> weights;
  std::vector<double> light{0};  ///< 0: the drive file's
  std::string output = "out/drives";
  int seeds = 10;
  std::uint64_t seed = 1;
  Printout out;
};

/// One drive.
struct Run {
  std::uint64_t seed = 0;
  DriveOutcome outcome = DriveOutcome::timeout;
  double clearance = 0;
  DriveClaims claims;
};

/// All drives of one drive file at one light with one perception.
struct DrivesRow {
  std::string drive, perception;
  double light = 1;
  std::vector<Run> runs;
};

std::string or_dash(const std::optional<double>& value, const char* format) {
  return value ? formatted(format, *value) : "-";
}

/// Median over the drives that had a first correct claim.
std::optional<double> median_first(const DrivesRow& row, double DriveClaims::First::*what) {
  std::vector<double> values;
  for (const Run& run : row.runs) {
    if (run.claims.first) values.push_back((*run.claims.first).*what);
  }
  return values.empty() ? std::nullopt : std::optional(median(values));
}

DriveClaims sum_of(const DrivesRow& row) {
  DriveClaims sum;
  for (const Run& run : row.runs) {
    sum.outside += run.claims.outside;
    sum.answers += run.claims.answers;
    sum.sure += run.claims.sure;
    sum.covered += run.claims.covered;
    sum.covered_in_map += run.claims.covered_in_map;
    sum.wrong += run.claims.wrong;
    sum.wrong_flagged += run.claims.wrong_flagged;
    sum.lost += run.claims.lost;
    sum.at_capture.add(run.claims.at_capture);
    sum.in_map.add(run.claims.in_map);
  }
  return sum;
}

void print_head(const Printout& out) {
  out.text(
      "found: drives with a sure answer (presence > 0.9) that covers the truth before an object is "
      "in sight;\nlead, distance: medians of the first one, before sight and to the nearest "
      "object; "
      "error/sigma^2: mean\nnormalised squared error of x and y, at the capture and when the map "
      "gets "
      "it (honest: 1);\nwrong: sure answers whose 99.9 %% region misses the truth (of them "
      "flagged);\noutside: answers while an object was outside of the search region, which no "
      "other "
      "column counts\n");
  out.text("%-22s %6s %-8s %8s %7s %13s %9s %7s %13s %14s %9s %6s %8s\n", "drive", "light", "by",
           "reached", "found", "lead s, m", "distance", "error m", "error/sigma^2", "95 % covers",
           "wrong", "lost", "outside");
}

void print_row(const Printout& out, const DrivesRow& row) {
  const DriveClaims sum = sum_of(row);
  const auto n = static_cast<int>(row.runs.size());
  const auto reached = std::ranges::count(row.runs, DriveOutcome::reached, &Run::outcome);
  const auto found =
      std::ranges::count_if(row.runs, [](const Run& run) { return run.claims.first.has_value(); });
  using First = DriveClaims::First;
  out.text("%-22s %6g %-8s %8s %7s %13s %9s %7s %13s %14s %9s %6s %8s\n", row.drive.c_str(),
           row.light, row.perception.c_str(),
           formatted("%d/%d", static_cast<int>(reached), n).c_str(),
           formatted("%d/%d", static_cast<int>(found), n).c_str(),
           (or_dash(median_first(row, &First::lead_time), "%.1f") + ", " +
            or_dash(median_first(row, &First::lead), "%.1f"))
               .c_str(),
           or_dash(median_first(row, &First::distance), "%.1f").c_str(),
           or_dash(sum.at_capture.rms(), "%.2f").c_str(),
           (or_dash(sum.at_capture.ratio(), "%.2f") + ", " + or_dash(sum.in_map.ratio(), "%.2f"))
               .c_str(),
           formatted("%d, %d of %d", sum.covered, sum.covered_in_map, sum.sure).c_str(),
           formatted("%d (%d)", sum.wrong, sum.wrong_flagged).c_str(),
           formatted("%d", sum.lost).c_str(), formatted("%d", sum.outside).c_str());
}

std::string csv(const std::vector<DrivesRow>& rows) {
  std::string text =
      "drive,light,perception,seed,outcome,clearance_m,outside,answers,sure,covered,covered_in_map,"
      "wrong,"
      "wrong_flagged,"
      "lost,rms_error_m,normalised_at_capture,normalised_in_map,first_time_s,lead_s,lead_m,"
      "first_distance_m\n";
  for (const DrivesRow& row : rows) {
    for (const Run& run : row.runs) {
      const DriveClaims& c = run.claims;
      text +=
          formatted("%s,%g,%s,%llu,%s,%.3f,%d,%d,%d,%d,%d,%d,%d,%d,", row.drive.c_str(), row.light,
                    row.perception.c_str(), static_cast<unsigned long long>(run.seed),
                    outcome_word(run.outcome).c_str(), run.clearance, c.outside, c.answers, c.sure,
                    c.covered, c.covered_in_map, c.wrong, c.wrong_flagged, c.lost);
      const auto cell = [](const std::optional<double>& value) {
        return value ? formatted("%.4g", *value) : std::string();
      };
      text += cell(c.at_capture.rms()) + "," + cell(c.at_capture.ratio()) + "," +
              cell(c.in_map.ratio());
      text += c.first ? formatted(",%.3f,%.3f,%.3f,%.3f\n", c.first->time, c.first->lead_time,
                                  c.first->lead, c.first->distance)
                      : ",,,,\n";
    }
  }
  return text;
}

int run_drives(const DrivesArguments& arguments) {
  make_directory(arguments.output);
  const std::string path = (std::filesystem::path(arguments.output) / "drives.csv").string();
  std::vector<DrivesRow> rows;
  print_head(arguments.out);
  for (const std::string& file : arguments.drives) {
    for (const double light : arguments.light) {
      const Drive drive = read_lit_drive(file, light);
      const SimulatedSensor sensor(drive.scene);
      const PerceptionNetworks networks =
          load_networks(drive, weight_files(drive, arguments.weights, arguments.perceptions));
      for (const std::string& perception : arguments.perceptions) {
        rows.push_back({drive.name, perception, drive.sensor.light, {}});
        for (int i = 0; i < arguments.seeds; ++i) {
          DriveOptions options;
          options.perception = perception;
          options.seed = arguments.seed + static_cast<std::uint64_t>(i);
          options.keep_pictures = false;
          options.networks = networks;
          const DriveResult result = drive_through(drive, sensor, options);
          rows.back().runs.push_back(
              {options.seed, result.outcome, result.clearance, drive_claims(drive, result)});
          write_atomically(path, csv(rows));
        }
        print_row(arguments.out, rows.back());
      }
    }
  }
  arguments.out.file(path);
  arguments.out.text("%s\n", path.c_str());
  return kAllWell;
}

}  // namespace

void add_drives_benchmark(CLI::App& benchmark, int& exit_code) {
  CLI::App& command = *benchmark.add_subcommand(
      "drives",
      "how early and how honestly perceptions know of hidden objects on drives; writes drives.csv");
  const auto arguments = std::make_shared<DrivesArguments>();
  command.add_option("DRIVE", arguments->drives, "drive files")->required();
  command.add_option("-o,--output", arguments->output, "directory to write to");
  command.add_option("--perception", arguments->perceptions, "a list with commas")
      ->delimiter(',')
      ->check(CLI::IsMember(perception_names()));
  command.add_option("--weights", arguments->weights,
                     "weights.pt of cnn train, for perceptions that are networks");
  command.add_option("-n,--seeds", arguments->seeds, "drives of each")->check(positive_number());
  command.add_option("--seed", arguments->seed, "of the first drive; the next ones count on");
  command
      .add_option("--light", arguments->light,
                  "factors on the laser's light, a list with commas; default: the drive file's")
      ->delimiter(',')
      ->check(positive_number());
  arguments->out.add_option(command, "the rows of drives.csv");
  command.callback([arguments, &exit_code] { exit_code = run_drives(*arguments); });
}

}  // namespace blindcorner
