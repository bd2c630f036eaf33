// SPDX-License-Identifier: Apache-2.0
/// `blindcorner trials DRIVE -n N -o DIR`: many drives, and how often they end well.
#include "blindcorner/simulation/trials.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/drive_file.h"
#include "blindcorner/report/drive_report.h"
#include "blindcorner/simulation/credible_level.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/trial_journal.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/lit_drive.h"
#include "commands/number_check.h"
#include "commands/output_directory.h"
#include "commands/progress.h"
#include "io/file_bytes.h"
#include "io/json_reader.h"
#include "report/trials_page.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

struct TrialsArguments {
  std::string drive;
  std::string output;
  double light = 0;
  int replays = 4;
  std::vector<std::string> weights;
  TrialsOptions options;
};

void check_perceptions(const std::vector<std::string>& names) {
  // Oracles that are misled are driven by --error-trials.
  std::vector<std::string> accepted = perception_names();
  std::erase_if(accepted, [](const std::string& name) { return name.starts_with("oracle_"); });
  for (const std::string& name : names) check_perception(name, "--perception", accepted);
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    throw Error("--perception", "a perception is named twice");
  }
}

/// The scene's own bytes, which a drive file only names.
std::string scene_bytes(const std::string& drive_path) {
  const auto json = JsonReader::parse(read_bytes(drive_path), drive_path);
  return read_bytes(
      (fs::path(drive_path).parent_path() / json.at("scene").get<std::string>()).string());
}

/// Which weights each network's trials are driven with: one study does not mix two trainings.
void keep_weights(const fs::path& directory, const std::map<std::string, std::string>& files) {
  if (files.empty()) return;
  const std::string path = (directory / "weights.json").string();
  JsonReader::Json known = JsonReader::Json::object();
  if (fs::exists(path)) known = JsonReader::parse(read_bytes(path), path);
  if (!known.is_object()) throw Error(path, "found no object, accepted: what this command writes");
  for (const auto& [name, file] : files) {
    const std::string hash = content_hash(read_bytes(file));
    if (known.contains(name) && known[name] != hash) {
      throw Error(path, "holds trials of other weights of " + name + " than " + file +
                            ", accepted: the same weights, or another directory");
    }
    known[name] = hash;
  }
  write_atomically(path, known.dump(1) + "\n");
}

std::vector<TrialResult> sorted(const TrialJournal& journal) {
  std::vector<TrialResult> results = journal.results();
  sort_trials(results);
  return results;
}

void write_tables(const fs::path& directory, const Drive& drive,
                  const std::vector<TrialResult>& results) {
  write_atomically((directory / "trials.csv").string(), trials_csv(drive.trials, results));
  if (std::ranges::any_of(results, [](const TrialResult& r) { return r.trial.error > 0; })) {
    write_atomically((directory / "errors.csv").string(), errors_csv(drive.trials, results));
  }
}

/// Pages of failed trials, the first few of each perception; those that are there stay.
void write_replays(const fs::path& directory, const Drive& drive, const SimulatedSensor& sensor,
                   const std::shared_ptr<const Fitter>& fitter, const PerceptionNetworks& networks,
                   const std::vector<TrialResult>& results, int most) {
  std::vector<Trial> wanted;
  std::map<std::string, int> count;
  for (const TrialResult& result : results) {
    const std::string& name = result.trial.perception;
    if (result.reached() || (is_network(name) && !networks.contains(name))) continue;
    if (count[name]++ >= most) continue;
    if (!fs::exists(directory / replay_page(result.trial))) wanted.push_back(result.trial);
  }
  Progress progress("replays", wanted.size());
  for (const Trial& trial : wanted) {
    DriveOptions options = options_of(trial);
    options.fitter = fitter;
    options.networks = networks;
    const DriveResult driven = drive_through(drive, sensor, options);
    const fs::path page = directory / replay_page(trial);
    make_directory(page.parent_path().string());
    write_atomically(page.string(), drive_page(drive, options, driven));
    progress.advance();
  }
}

void print_summary(const Drive& drive, const std::vector<TrialResult>& results) {
  std::map<std::pair<std::string, int>, std::pair<int, int>> shares;
  for (const TrialResult& result : results) {
    if (result.trial.error > 0) continue;
    auto& [reached, trials] = shares[{result.trial.perception, result.trial.zone}];
    reached += result.reached() ? 1 : 0;
    ++trials;
  }
  std::printf("%-8s %14s   %s\n", "", "speed, m/s", "goal reached (95 % interval)");
  for (const std::string& name : perceptions_of(results)) {
    for (int zone = 0; zone < drive.trials.zones; ++zone) {
      const auto [reached, trials] = shares[{name, zone}];
      if (trials == 0) continue;
      const ShareInterval interval = wilson_interval(reached, trials);
      std::printf("%-8s %6.4g to %5.4g   %d/%d = %.3f (%.3f to %.3f)\n", name.c_str(),
                  zone_lower(drive.trials, zone), zone_lower(drive.trials, zone + 1), reached,
                  trials, static_cast<double>(reached) / trials, interval.low, interval.high);
    }
  }
}

/// Thrown by a trial that is not begun.
struct TrialsInterrupted {};

/// Runs what has no result in the journal yet; true: all of it.
bool run_open_trials(const TrialsArguments& arguments, const Drive& drive,
                     const SimulatedSensor& sensor, const std::shared_ptr<const Fitter>& fitter,
                     const PerceptionNetworks& networks, TrialJournal& journal) {
  const std::vector<Trial> open =
      open_trials(plan_trials(drive, arguments.options), journal.results());
  Progress progress("trials", open.size());
  const Interruptible interruptible;
  std::size_t done = 0;
  try {
    run_trials(
        open, arguments.options.threads,
        [&](const Trial& trial) {
          if (Interruptible::asked()) throw TrialsInterrupted{};
          return run_trial(drive, sensor, trial, fitter, networks);
        },
        [&](const TrialResult& result) {
          journal.add(result);
          write_tables(arguments.output, drive, sorted(journal));
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
  check_perceptions(arguments.options.perceptions);
  const Drive drive = read_lit_drive(arguments.drive, arguments.light);
  arguments.options.validate();
  const std::string study =
      trial_study(drive, scene_bytes(arguments.drive), arguments.options.seed);
  const auto files = weight_files(drive, arguments.weights, arguments.options.perceptions);
  const PerceptionNetworks networks = load_networks(drive, files);
  const SimulatedSensor sensor(drive.scene);
  // What the solver makes once for a scene is made once for all drives.
  const auto fitter = std::make_shared<const Fitter>(drive.scene);
  make_directory(arguments.output);
  const fs::path directory = arguments.output;
  TrialJournal journal(arguments.output, study);
  keep_weights(directory, files);
  const bool complete = run_open_trials(arguments, drive, sensor, fitter, networks, journal);
  const std::vector<TrialResult> results = sorted(journal);
  write_tables(directory, drive, results);
  if (complete)
    write_replays(directory, drive, sensor, fitter, networks, results, arguments.replays);
  const auto replayed = [&](const Trial& trial) {
    return fs::exists(directory / replay_page(trial));
  };
  write_atomically((directory / "index.html").string(), trials_page(drive, results, replayed));
  print_summary(drive, results);
  std::printf("%s\n%s\n", (directory / "trials.csv").c_str(), (directory / "index.html").c_str());
  return complete ? kAllWell : kSomeFailed;
}

}  // namespace

void add_trials_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "trials",
      "many drives at random speeds and hidden places; writes DIR/trials.csv and DIR/index.html; "
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
                  "los, solver, cnn, cnn_wide, oracle, with commas between them")
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
      .add_option("--light", arguments->light,
                  "factor on the laser's light; daylight stays; default: the drive file's")
      ->check(positive_number());
  command
      .add_option("--replays", arguments->replays,
                  "failed trials of each perception to write pages of")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str();
  command
      .add_option("--threads", arguments->options.threads, "trials at a time; 0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace blindcorner
