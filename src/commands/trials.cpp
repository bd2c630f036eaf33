// SPDX-License-Identifier: Apache-2.0
/// `blindcorner trials DRIVE -n N -o DIR`: many drives, and how often they end well.
#include "blindcorner/simulation/trials.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "blindcorner/report/trial_study.h"
#include "blindcorner/simulation/credible_level.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/number_check.h"
#include "commands/printout.h"
#include "commands/progress.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

struct TrialsArguments {
  std::string drive;
  std::string output;
  double light = 0;
  int replays = 4;
  int pairs = 3;
  std::vector<std::string> weights;
  Printout out;
  TrialsOptions options;
};

void print_summary(const Printout& out, const Drive& drive,
                   const std::vector<TrialResult>& results) {
  std::map<std::pair<std::string, int>, std::pair<int, int>> shares;
  for (const TrialResult& result : results) {
    if (result.trial.error > 0 || result.trial.risk) continue;
    auto& [reached, trials] = shares[{result.trial.perception, result.trial.zone}];
    reached += result.reached() ? 1 : 0;
    ++trials;
  }
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  out.text("%-8s %14s   %s\n", "", "speed, m/s", "goal reached (95 % interval)");
  for (const std::string& name : perceptions_of(results)) {
    for (int zone = 0; zone < drive.trials.zones; ++zone) {
      const auto [reached, trials] = shares[{name, zone}];
      if (trials == 0) continue;
      const ShareInterval interval = wilson_interval(reached, trials);
      const double lower = zone_lower(drive.trials, zone);
      const double upper = zone_lower(drive.trials, zone + 1);
      const double share = static_cast<double>(reached) / trials;
      out.text("%-8s %6.4g to %5.4g   %d/%d = %.3f (%.3f to %.3f)\n", name.c_str(), lower, upper,
               reached, trials, share, interval.low, interval.high);
      rows.push_back({{"perception", name},
                      {"speed_m_per_s", {lower, upper}},
                      {"reached", reached},
                      {"trials", trials},
                      {"share", share},
                      {"interval_95", {interval.low, interval.high}}});
    }
  }
  out.document(rows.dump(1));
}

/// Thrown by a trial that is not begun.
struct TrialsInterrupted {};

/// Runs the trials that have no result in the journal yet. Returns whether all of them were run.
bool run_open_trials(const TrialsArguments& arguments, TrialStudy& study) {
  const std::vector<Trial> open = study.open();
  Progress progress("trials", open.size());
  const Interruptible interruptible;
  std::size_t done = 0;
  try {
    run_trials(
        open, arguments.options.threads,
        [&](const Trial& trial) {
          if (Interruptible::asked()) throw TrialsInterrupted{};
          return study.run(trial);
        },
        [&](const TrialResult& result) {
          study.add(result);
          study.write_tables();
          progress.advance();
          ++done;
        });
  } catch (const TrialsInterrupted&) {
    progress.finish();
    tell_interrupted(done, open.size(), "open trials", "the same command goes on from there");
    return false;
  }
  return true;
}

int run(const TrialsArguments& arguments) {
  TrialStudy study({arguments.drive, arguments.light, arguments.weights, arguments.options},
                   arguments.output);
  const bool complete = run_open_trials(arguments, study);
  study.write_tables();
  if (complete) {
    study.write_limits();
    const std::vector<Trial> wanted = study.missing_replays(arguments.replays);
    Progress progress("replays", wanted.size());
    for (const Trial& trial : wanted) {
      study.write_replay(trial);
      progress.advance();
    }
    const std::vector<Trial> beside = study.missing_pairs(arguments.pairs);
    Progress pairs("drives to play side by side", beside.size());
    for (const Trial& trial : beside) {
      study.keep_for_pair(trial);
      pairs.advance();
    }
  }
  study.write_page();
  print_summary(arguments.out, study.drive(), study.results());
  const fs::path directory = arguments.output;
  arguments.out.text("%s\n%s\n", (directory / "trials.csv").c_str(),
                     (directory / "trials.html").c_str());
  return complete ? kAllWell : kSomeFailed;
}

}  // namespace

void add_trials_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "trials",
      "many drives at random speeds and hidden places; writes DIR/trials.csv and DIR/trials.html; "
      "goes on where it was interrupted");
  const auto arguments = std::make_shared<TrialsArguments>();
  command.add_option("DRIVE", arguments->drive, "drive file")->required();
  command
      .add_option("-o,--output", arguments->output, "directory for the results; made if missing")
      ->required()
      ->type_name("DIR");
  command
      .add_option("-n,--trials", arguments->options.trials,
                  "trials of each perception, spread evenly over the speed zones")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      .add_option("--perception", arguments->options.perceptions,
                  "los, los_cautious, solver, cnn, cnn_wide, oracle, with commas between them")
      ->delimiter(',')
      ->capture_default_str();
  command.add_option("--weights", arguments->weights,
                     "weights.pt of cnn train, for perceptions that are networks; default: the "
                     "drive file's");
  command.add_option("--seed", arguments->options.seed, "of the first trial; the others count on")
      ->capture_default_str();
  command
      .add_option("--error-trials", arguments->options.error_trials,
                  "trials with injected localisation errors of 0 to 7 m, for each of the two "
                  "misled oracles; writes errors.csv")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  command
      .add_option("--risk", arguments->options.risks,
                  "risks of each decision to drive all perceptions with beside the drive file's, "
                  "with commas between them")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 1.0));
  command
      .add_option("--light", arguments->light,
                  "factor on the laser's light; daylight stays; default: the drive file's")
      ->check(positive_number());
  command
      .add_option("--replays", arguments->replays,
                  "failed trials of each perception to write pages of")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  command
      .add_option("--pairs", arguments->pairs,
                  "seeds whose drives with two perceptions the page plays side by side")
      ->check(CLI::Range(0, 6))
      ->capture_default_str();
  command
      .add_option("--threads", arguments->options.threads, "trials at a time; 0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  arguments->out.add_option(command, "how often each perception reaches its goal, by speed,");
  command.callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace blindcorner
