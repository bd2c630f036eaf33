// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/trial_journal.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

constexpr const char* kHeader =
    "perception,zone,seed,speed_m_per_s,error_m,outcome,clearance_m,time_s,length_m,run_time_s,"
    "statements:occupied:probability in ten bins,mean_speed_m_per_s near a "
    "corner,risk,present,impact_m_per_s,"
    "hardest_braking_m_per_s2,program\n";
/// Column of tables of studies with a corner. Only the costs come after it.
constexpr const char* kCornerColumn = ",mean_speed_m_per_s";
/// Last columns of the tables.
constexpr const char* kCostColumns = ",risk,present,impact_m_per_s,hardest_braking_m_per_s2";
/// Stands in the journal for the drive file's risk.
constexpr const char* kOwnRisk = "-";

/// Digits that give the same number back.
std::string exact(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.17g", value);
  return text.data();
}

std::string fixed(double value, int digits) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", digits, value);
  return text.data();
}

/// Risk, whether somebody was there, speed of the impact, hardest braking.
void parse_costs(std::span<const std::string> cells, TrialResult& result) {
  result.with_costs = true;
  if (cells[0] != kOwnRisk) result.trial.risk = std::stod(cells[0]);
  result.present = std::stoi(cells[1]) != 0;
  result.impact_speed = std::stod(cells[2]);
  result.hardest_braking = std::stod(cells[3]);
}

/// Throws std::exception for a line that is no result.
TrialResult parse(const std::string& line) {
  std::vector<std::string> cells;
  std::stringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  TrialResult result;
  // The program's name begins with a letter, numbers do not. Journals of earlier versions do not
  // name it.
  if (!cells.empty() && !cells.back().empty() &&
      std::isalpha(static_cast<unsigned char>(cells.back().front())) != 0) {
    result.program = cells.back();
    cells.pop_back();
  }
  constexpr std::size_t kFirstBin = 10;
  std::vector<ReliabilityCount> counts(kMapBins);
  const std::size_t after_bins = kFirstBin + counts.size(), with_costs = after_bins + 5;
  if (cells.size() != after_bins && cells.size() != after_bins + 1 && cells.size() != with_costs) {
    throw Error("another length");
  }
  if (cells.size() > after_bins) result.corner_speed = std::stod(cells[after_bins]);
  result.trial = {cells[0],
                  std::stoi(cells[1]),
                  std::stoull(cells[2]),
                  std::stod(cells[3]),
                  std::stod(cells[4]),
                  {}};
  if (cells.size() == with_costs) parse_costs(std::span(cells).subspan(after_bins + 1), result);
  result.outcome = cells[5];
  result.clearance = std::stod(cells[6]);
  result.time = std::stod(cells[7]);
  result.length = std::stod(cells[8]);
  result.run_time = std::stod(cells[9]);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    std::stringstream bin(cells[kFirstBin + i]);
    char colon = 0;
    bin >> counts[i].statements >> colon >> counts[i].happened >> colon >> counts[i].sum;
    if (!bin) throw Error("not three numbers");
  }
  result.map = ReliabilityDiagram(std::move(counts));
  return result;
}

void write_all(int descriptor, const std::string& bytes, const std::string& path) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t written = ::write(descriptor, bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw Error(path, std::string("cannot be written: ") + std::strerror(errno));
    done += static_cast<std::size_t>(written);
  }
  if (::fsync(descriptor) != 0) {
    throw Error(path, std::string("cannot be written: ") + std::strerror(errno));
  }
}

/// Which fields differ between two studies.
std::string differing(const std::string& there, const std::string& wanted) {
  const auto a = nlohmann::json::parse(there, nullptr, false);
  const auto b = nlohmann::json::parse(wanted, nullptr, false);
  if (!a.is_object() || !b.is_object()) return "everything";
  std::string names;
  for (const auto& [key, value] : b.items()) {
    if (!a.contains(key) || a[key] != value) names += (names.empty() ? "" : ", ") + key;
  }
  return names.empty() ? "unknown fields" : names;
}

void check_study(const std::string& path, const std::string& study) {
  if (!std::filesystem::exists(path)) return write_atomically(path, study);
  const std::string there = read_bytes(path);
  if (there == study) return;
  throw Error(path, "holds another study (" + differing(there, study) +
                        " differ); accepted: the same one, or another directory");
}

/// Cells of kCostColumns. All are empty if nothing was measured, and the risk also if it is the
/// drive file's.
std::string costs(const TrialResult& result) {
  if (!result.with_costs) return ",,,,";
  std::array<char, 32> risk{};
  if (result.trial.risk) std::snprintf(risk.data(), risk.size(), "%g", *result.trial.risk);
  return std::string(",") + risk.data() + (result.present ? ",1," : ",0,") +
         fixed(result.impact_speed, 3) + "," + fixed(result.hardest_braking, 3);
}

std::string table(const DriveTrials& trials, const std::vector<TrialResult>& results,
                  bool with_error) {
  std::string text = "perception,zone,seed,speed_m_per_s,outcome,clearance_m,time_s,length_m";
  const bool with_corner = trials.corner_radius > 0;
  if (with_error) text += ",error_m";
  if (with_corner) text += kCornerColumn;
  text += std::string(kCostColumns) + "\n";
  for (const TrialResult& result : results) {
    const Trial& trial = result.trial;
    if ((trial.error > 0) != with_error) continue;
    std::array<char, 32> zone{};
    std::snprintf(zone.data(), zone.size(), "%g-%g", zone_lower(trials, trial.zone),
                  zone_lower(trials, trial.zone + 1));
    text += trial.perception + "," + zone.data() + "," + std::to_string(trial.seed) + "," +
            fixed(trial.speed, 3) + "," + result.outcome + "," + fixed(result.clearance, 4) + "," +
            fixed(result.time, 2) + "," + fixed(result.length, 3) +
            (with_error ? "," + fixed(trial.error, 3) : "") +
            (with_corner ? "," + fixed(result.corner_speed, 3) : "") + costs(result) + "\n";
  }
  return text;
}

}  // namespace

TrialJournal::TrialJournal(const std::string& directory, const std::string& study)
    : path_((std::filesystem::path(directory) / "journal.csv").string()) {
  check_study((std::filesystem::path(directory) / "trials.json").string(), study);
  descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (descriptor_ < 0) {
    throw Error(path_, std::string("cannot be written: ") + std::strerror(errno));
  }
  try {
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
      throw Error(path_, "another run works on this study");
    }
    std::ifstream file(path_, std::ios::binary);
    read({std::istreambuf_iterator<char>(file), {}});
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

TrialJournal::~TrialJournal() { ::close(descriptor_); }

/// Whole lines are results; what follows the last line's end is cut off.
void TrialJournal::read(const std::string& bytes) {
  const std::size_t whole = bytes.rfind('\n') == std::string::npos ? 0 : bytes.rfind('\n') + 1;
  if (whole < bytes.size() && ::ftruncate(descriptor_, static_cast<off_t>(whole)) != 0) {
    throw Error(path_, std::string("cannot be written: ") + std::strerror(errno));
  }
  if (whole == 0) return write_all(descriptor_, kHeader, path_);
  std::stringstream stream(bytes.substr(0, whole));
  std::string line;
  std::getline(stream, line);
  for (int row = 1; std::getline(stream, line); ++row) {
    try {
      results_.push_back(parse(line));
    } catch (const std::exception& /*error*/) {
      throw Error(path_, "row " + std::to_string(row) + " is no result of a trial");
    }
  }
}

void TrialJournal::add(const TrialResult& result) {
  write_all(descriptor_, journal_line(result), path_);
  results_.push_back(result);
}

namespace {

/// A line of the journal without the program.
std::string measured_line(const TrialResult& result) {
  const Trial& trial = result.trial;
  std::string line = trial.perception + "," + std::to_string(trial.zone) + "," +
                     std::to_string(trial.seed) + "," + exact(trial.speed) + "," +
                     exact(trial.error) + "," + result.outcome + "," + exact(result.clearance) +
                     "," + exact(result.time) + "," + exact(result.length) + "," +
                     exact(result.run_time);
  for (const ReliabilityCount& bin : result.map.counts()) {
    line += "," + std::to_string(bin.statements) + ":" + std::to_string(bin.happened) + ":" +
            exact(bin.sum);
  }
  if (result.with_costs) {
    line += "," + exact(result.corner_speed) + "," +
            (trial.risk ? exact(*trial.risk) : std::string(kOwnRisk)) +
            (result.present ? ",1," : ",0,") + exact(result.impact_speed) + "," +
            exact(result.hardest_braking);
  } else if (result.corner_speed > 0) {
    line += "," + exact(result.corner_speed);
  }
  return line + "\n";
}

}  // namespace

std::string journal_line(const TrialResult& result) {
  std::string line = measured_line(result);
  if (!result.program.empty()) line.insert(line.size() - 1, "," + result.program);
  return line;
}

TrialResult parse_journal_line(const std::string& line) {
  try {
    return parse(line.substr(0, line.find('\n')));
  } catch (const std::exception& /*error*/) {
    throw Error("journal", "found \"" + line.substr(0, 80) + "\", accepted: a result of a trial");
  }
}

std::string content_hash(const std::string& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const char byte : bytes) {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3;
  }
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(hash));
  return text.data();
}

std::string trial_study(const Drive& drive, const std::string& scene_bytes, std::uint64_t seed) {
  nlohmann::ordered_json study;
  study["format"] = "blindcorner.trials/1";
  study["drive"] = drive.name;
  study["drive_file"] = content_hash(read_bytes(drive.path));
  study["scene_file"] = content_hash(scene_bytes);
  study["light"] = drive.sensor.light;
  study["seed"] = seed;
  return study.dump(1) + "\n";
}

std::string trials_csv(const DriveTrials& trials, const std::vector<TrialResult>& results) {
  return table(trials, results, false);
}

std::string errors_csv(const DriveTrials& trials, const std::vector<TrialResult>& results) {
  return table(trials, results, true);
}

}  // namespace blindcorner
