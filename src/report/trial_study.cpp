// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/trial_study.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/report/drive_report.h"
#include "blindcorner/report/result_file.h"
#include "blindcorner/report/side_by_side.h"
#include "blindcorner/report/trials_page.h"
#include "blindcorner/simulation/drive_limits.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/lit_drive.h"
#include "blindcorner/simulation/perception.h"
#include "io/file_bytes.h"
#include "io/json_reader.h"
#include "simulation/solver_perception.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

void check_perceptions(const std::vector<std::string>& names) {
  // Trials of misled oracles are those of --error-trials.
  std::vector<std::string> accepted = perception_names();
  std::erase_if(accepted, [](const std::string& name) { return name.starts_with("oracle_"); });
  for (const std::string& name : names) check_perception(name, "--perception", accepted);
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    throw Error("--perception", "a perception is named twice");
  }
}

/// The scene's own bytes, which a drive file only names.
std::string scene_bytes(const std::string& drive_path) {
  const auto drive = JsonReader::parse(read_bytes(drive_path), drive_path);
  return read_bytes(
      (fs::path(drive_path).parent_path() / drive.at("scene").get<std::string>()).string());
}

/// Notes which weights each network's trials are driven with. One study must not mix two trainings.
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

void make_study_directory(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (code || !fs::is_directory(directory)) {
    throw OutputError(directory.string(),
                      "cannot be made a directory" + (code ? ": " + code.message() : ""));
  }
}

/// The file that the page plays for a trial, relative to the study's directory.
fs::path kept_replay(const Trial& trial) {
  return replay_page(trial).parent_path() / "replay.json";
}

/// Makes the directory and returns it.
const std::string& made(const std::string& directory) {
  make_study_directory(directory);
  return directory;
}

Drive checked_drive(const TrialRequest& request) {
  check_perceptions(request.options.perceptions);
  Drive drive = read_lit_drive(request.drive, request.light);
  request.options.validate();
  return drive;
}

}  // namespace

TrialRunner::TrialRunner(const TrialRequest& request)
    : drive_(checked_drive(request)),
      files_(blindcorner::weight_files(drive_, request.weights, request.options.perceptions)),
      networks_(load_networks(drive_, files_)),
      study_(trial_study(drive_, scene_bytes(request.drive), request.options.seed)),
      sensor_(drive_.scene),
      // What the solver computes once for a scene is computed once for all drives.
      fitter_(make_timely_fitter(drive_.scene)) {}

TrialResult TrialRunner::run(const Trial& trial) const {
  return run_trial(drive_, sensor_, trial, fitter_, networks_);
}

TrialStudy::TrialStudy(const TrialRequest& request, const std::string& directory)
    : directory_(directory),
      request_(request),
      runner_(request),
      journal_(made(directory), runner_.study()) {
  keep_weights(directory_, runner_.weight_files());
  for (const TrialResult& result : journal_.results()) known_.insert(trial_key(result.trial));
}

std::vector<Trial> TrialStudy::open() const {
  return open_trials(plan_trials(drive(), request_.options), journal_.results());
}

void TrialStudy::add(const TrialResult& result) {
  if (known_.contains(trial_key(result.trial))) return;
  journal_.add(result);
  known_.insert(trial_key(result.trial));
}

std::vector<TrialResult> TrialStudy::results() const {
  std::vector<TrialResult> results = journal_.results();
  sort_trials(results);
  return results;
}

void TrialStudy::write_limits() const {
  const std::string path = (fs::path(directory_) / "limits.json").string();
  if (fs::exists(path) || !states_who_is_met(drive())) return;
  write_atomically(path, limits_json(drive_limits(drive(), runner_.sensor())));
}

void TrialStudy::write_tables() const {
  const std::filesystem::path directory = directory_;
  const std::vector<TrialResult> all = results();
  write_atomically((directory / "trials.csv").string(), trials_csv(drive().trials, all));
  if (std::ranges::any_of(all, [](const TrialResult& r) { return r.trial.error > 0; })) {
    write_atomically((directory / "errors.csv").string(), errors_csv(drive().trials, all));
  }
}

std::vector<Trial> TrialStudy::missing_replays(int most) const {
  std::vector<Trial> wanted;
  std::map<std::string, int> count;
  for (const TrialResult& result : results()) {
    const std::string& name = result.trial.perception;
    if (result.reached() || (is_network(name) && !runner_.networks().contains(name))) continue;
    if (count[name]++ >= most) continue;
    if (!fs::exists(fs::path(directory_) / replay_page(result.trial)))
      wanted.push_back(result.trial);
  }
  return wanted;
}

void TrialStudy::write_replay(const Trial& trial) const {
  DriveOptions options = options_of(trial);
  options.fitter = runner_.fitter();
  options.networks = runner_.networks();
  const Drive driving = drive_of(drive(), trial);
  const DriveResult driven = drive_through(driving, runner_.sensor(), options);
  const fs::path page = fs::path(directory_) / replay_page(trial);
  make_study_directory(page.parent_path());
  write_atomically(page.string(), drive_page(driving, options, driven));
}

std::vector<Trial> TrialStudy::missing_pairs(int most) const {
  std::vector<Trial> wanted;
  const std::vector<TrialResult> all = results();
  const auto names = telling_perceptions(all);
  if (!names) return wanted;
  for (const std::uint64_t seed : telling_seeds(all, *names, most)) {
    for (const TrialResult& result : all) {
      const Trial& trial = result.trial;
      if (trial.risk || trial.error > 0) continue;
      const bool asked = trial.perception == names->first || trial.perception == names->second;
      if (trial.seed != seed || !asked) continue;
      if (is_network(trial.perception) && !runner_.networks().contains(trial.perception)) continue;
      if (!fs::exists(fs::path(directory_) / kept_replay(trial))) wanted.push_back(trial);
    }
  }
  return wanted;
}

void TrialStudy::keep_for_pair(const Trial& trial) const {
  DriveOptions options = options_of(trial);
  options.fitter = runner_.fitter();
  options.networks = runner_.networks();
  options.keep_pictures = false;
  const DriveResult driven = drive_through(drive(), runner_.sensor(), options);
  const fs::path file = fs::path(directory_) / kept_replay(trial);
  make_study_directory(file.parent_path());
  write_atomically(file.string(), dump_json(drive_replay(drive(), options, driven)) + "\n");
}

/// Pairs of drives with the same seed whose replays were kept, the most telling first, at most as
/// many as a page may hold.
nlohmann::json TrialStudy::kept_pairs() const {
  constexpr std::size_t kMost = 6;  // some 0.3 MB each
  nlohmann::json pairs = nlohmann::json::array();
  const std::vector<TrialResult> all = results();
  const auto names = telling_perceptions(all);
  if (!names) return pairs;
  const fs::path directory = directory_;
  const auto kept = [&](const std::string& name, std::uint64_t seed) {
    Trial trial;
    trial.perception = name, trial.seed = seed;
    return std::pair(directory / kept_replay(trial), replay_page(trial));
  };
  const auto linked = [&](const fs::path& page) {
    return fs::exists(directory / page) ? page.generic_string() : std::string();
  };
  for (const std::uint64_t seed : telling_seeds(all, *names, static_cast<int>(all.size()))) {
    const auto [first, first_page] = kept(names->first, seed);
    const auto [second, second_page] = kept(names->second, seed);
    if (pairs.size() == kMost || !fs::exists(first) || !fs::exists(second)) continue;
    pairs.push_back(replay_pair(JsonReader::parse(read_bytes(first.string()), first.string()),
                                JsonReader::parse(read_bytes(second.string()), second.string()),
                                {linked(first_page), linked(second_page)}));
  }
  return pairs;
}

/// What `limits.json` beside the tables says; null: there is none.
nlohmann::json TrialStudy::limits() const {
  const fs::path file = fs::path(directory_) / "limits.json";
  if (!fs::exists(file)) return nullptr;
  return JsonReader::parse(read_bytes(file.string()), file.string());
}

void TrialStudy::write_page() const {
  const fs::path directory = directory_;
  const auto replayed = [&](const Trial& trial) {
    return fs::exists(directory / replay_page(trial));
  };
  write_atomically((directory / "trials.html").string(),
                   trials_page(drive(), results(), replayed, {kept_pairs(), limits()}));
}

}  // namespace blindcorner
