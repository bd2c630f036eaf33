// SPDX-License-Identifier: Apache-2.0
/// The family `blindcorner benchmark ...`.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "commands/commands.h"
#include "commands/printout.h"
#include "report/chart.h"
#include "report/table.h"

namespace blindcorner {

void add_solver_benchmark(CLI::App& benchmark, int& exit_code);
void add_forward_benchmark(CLI::App& benchmark, int& exit_code);
void add_derivatives_benchmark(CLI::App& benchmark, int& exit_code);
void add_light_benchmark(CLI::App& benchmark, int& exit_code);
void add_moving_benchmark(CLI::App& benchmark, int& exit_code);
void add_planner_benchmark(CLI::App& benchmark, int& exit_code);
void add_vehicles_benchmark(CLI::App& benchmark, int& exit_code);
void add_drives_benchmark(CLI::App& benchmark, int& exit_code);
void add_coverage_benchmark(CLI::App& benchmark, int& exit_code);
void add_detection_benchmark(CLI::App& benchmark, int& exit_code);

/// Arguments that the studies have in common.
struct StudyArguments {
  std::vector<std::string> scenes;  ///< files; none: those of the folder `scenes` here
  std::string output = "out/benchmark";
  int poses = 2;  ///< per scene
  std::uint64_t seed = 1;
  Printout out;
};
void add_study_options(CLI::App& command, StudyArguments& arguments, int most_poses);

FastModelOptions at_tolerance(double tolerance);

/// The files asked for. If there are none, the scene files of the folder `scenes` here, sorted.
/// Throws Error when there is none either.
std::vector<std::string> scene_files(const std::vector<std::string>& asked);

/// Calls `study` with each scene and its own sensor placement. Scenes whose relay points come with
/// each capture are named on standard output and left out. Throws Error when there is no scene.
void for_each_scene(const StudyArguments& arguments,
                    const std::function<void(const Scene&, const SensorPlacement&)>& study);

/// A study: the name of its files, the text of its page above table and charts, and what is told of
/// its units. A unit is a scene, a level of light or a way to plan.
template <class Unit>
struct Study {
  std::string name;  ///< of the files, without extension
  std::string title, text;
  TableRow (*row)(const Unit&);
  std::vector<Chart> (*charts)(const std::vector<Unit>&);
  std::string (*csv)(const std::vector<Unit>&) = nullptr;  ///< none: CSV of the rows
};

/// Writes NAME.csv and NAME.html, each completely or not at all.
void write_study(const StudyArguments& arguments, const std::string& name, const std::string& csv,
                 const std::string& page);
/// Text, table and charts.
std::string study_page(const std::string& title, const std::string& text,
                       const std::vector<TableRow>& rows, const std::vector<Chart>& charts);
/// Says on standard output where the study's files are; with --json it prints the table instead.
void print_study_files(const StudyArguments& arguments, const std::string& name);

/// Takes the units of a study one by one. It prints each, and writes the files anew with all units
/// so far.
template <class Unit>
class StudyRun {
 public:
  StudyRun(const Study<Unit>& study, const StudyArguments& arguments)
      : study_(study), arguments_(arguments) {}

  void add(Unit unit) {
    units_.push_back(std::move(unit));
    rows_.push_back(study_.row(units_.back()));
    if (units_.size() == 1) arguments_.out.text("%s", table_head(rows_.back()).c_str());
    arguments_.out.text("%s", table_line(rows_.back()).c_str());
    write_study(arguments_, study_.name,
                study_.csv == nullptr ? table_csv(rows_) : study_.csv(units_),
                study_page(study_.title, study_.text, rows_, study_.charts(units_)));
  }
  const std::vector<Unit>& units() const { return units_; }
  void end() const { print_study_files(arguments_, study_.name); }

 private:
  const Study<Unit>& study_;
  const StudyArguments& arguments_;
  std::vector<Unit> units_;
  std::vector<TableRow> rows_;
};

}  // namespace blindcorner
