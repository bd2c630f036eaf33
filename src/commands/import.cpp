// SPDX-License-Identifier: Apache-2.0
/// `blindcorner import FILES... -o CAPTURE`.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/import_file.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/number_check.h"
#include "commands/truth_table.h"

namespace blindcorner {

namespace {

struct ImportArguments {
  std::vector<std::string> files;
  std::string output;
  std::string truth;
  ImportOptions options;
  double bin_width_ps = 0.0;
  double bin_width_ns = 0.0;
  double sensor_yaw_deg = 0.0;
  double sensor_yaw_rad = 0.0;
};

int run_import(const ImportArguments& arguments) {
  require_exr(arguments.output);
  ImportOptions options = arguments.options;
  if (arguments.bin_width_ps != 0.0) options.bin_width = arguments.bin_width_ps * 1e-12;
  if (arguments.bin_width_ns != 0.0) options.bin_width = arguments.bin_width_ns * 1e-9;
  const double yaw = arguments.sensor_yaw_rad + arguments.sensor_yaw_deg * kDegree;
  options.sensor_rotation = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
  options.validate();
  std::vector<std::string> warnings;
  CaptureFile file = import_captures(arguments.files, options, &warnings);
  if (!arguments.truth.empty()) add_truths(arguments.truth, file.captures);
  write_captures(arguments.output, file);
  for (const std::string& warning : warnings) {
    std::fprintf(stderr, "blindcorner: warning: %s\n", warning.c_str());
  }
  if (file.bin_width == 0.0) {
    std::fprintf(stderr,
                 "blindcorner: warning: %s: found no width of a bin, so that a fit assumes the "
                 "scene's; --bin-width-ps states it\n",
                 arguments.files.front().c_str());
  }
  const HistogramCube& first = file.captures.front().counts;
  std::printf("%s: %zu capture%s of %d x %d zones, %d bins\n", arguments.output.c_str(),
              file.captures.size(), file.captures.size() == 1 ? "" : "s", first.rows, first.columns,
              first.bins);
  return kAllWell;
}

void add_array_options(CLI::App& command, ImportOptions& options) {
  std::vector<std::string> formats = {"auto"};
  std::string readers = "Formats that are recognised by content:";
  for (const ImportReader& reader : import_readers()) {
    formats.push_back(reader.name);
    readers += "\n  " + reader.name + ": " + reader.recognises + "; assumes " + reader.assumes;
  }
  command.footer(readers);
  command.add_option("--format", options.format, "one of the formats below, or auto")
      ->check(CLI::IsMember(formats).description(""))
      ->type_name("NAME");
  command
      .add_option("--axes", options.axes,
                  "order of the array's axes, slowest first, as capture,row,column,bin; zone "
                  "stands for row and column (numpy, matlab)")
      ->delimiter('\0');
  command.add_option("--array", options.array,
                     "array of a file with several that holds the counts: of a .npz or .mat, "
                     "mp_histo_HA (tmf8829), HSHORT (tmf882x)");
  command
      .add_option(
          "--pattern", options.pattern,
          "columns of any text table: a list of capture, zone, row, column, bin, count, skip, "
          "'words' and, at its end, counts, as 'zone,skip,counts'")
      ->delimiter('\0')
      ->type_name("COLUMNS");
  command.add_option("--rows", options.rows,
                     "rows of zones; TMF8828 log: 3 (default), 4 or 8, with as many columns");
  command.add_option("--columns", options.columns, "columns of zones");
  command
      .add_option("--sensor-positions", options.sensor_positions,
                  "array of the .npz with the sensor's position in each capture, m")
      ->type_name("ARRAY");
  command.add_option(
      "--axes-world", options.axes_world,
      "world axes in terms of the positions' axes, as z,-x,y; write --axes-world=-x,y,z "
      "when it begins with a minus");
  const std::map<std::string, PublishedFilter> filters = {
      {"none", PublishedFilter::none},
      {"nomirrors", PublishedFilter::without_mirrors},
      {"mirrors", PublishedFilter::with_mirrors}};
  command.add_option("--repeats", options.repeats_per_sample,
                     "CheapSPAD: consecutive repeats averaged into one capture; 0: all");
  command
      .add_option("--published-filter", options.published_filter,
                  "CheapSPAD: keep the positions that the publication evaluates: none, nomirrors "
                  "or mirrors")
      ->transform(CLI::CheckedTransformer(filters, CLI::ignore_case).description(""))
      ->type_name("NAME");
  command.add_option("--i2c-address", options.i2c_address,
                     "sensor of a TMF8828 log with several; 0: the first");
}

void add_metadata_options(CLI::App& command, ImportArguments& arguments) {
  ImportOptions& options = arguments.options;
  auto* ps = command.add_option("--bin-width-ps", arguments.bin_width_ps, "width of a bin, ps")
                 ->check(positive_number());
  command.add_option("--bin-width-ns", arguments.bin_width_ns, "width of a bin, ns")
      ->check(positive_number())
      ->excludes(ps);
  command
      .add_option("--truth", arguments.truth,
                  "table (.csv) of what is known of the object, a row each capture: x_m, y_m, z_m, "
                  "yaw_deg, size, or index and these")
      ->type_name("FILE");
  command.add_option("--exposures", options.exposures, "exposures averaged in each capture");
  command.add_option("--dispersion", options.dispersion, "variance / mean of the counts");
  command.add_option("--sensor", options.sensor, "name of the sensor");
  command.add_option("--description", options.description, "free text");
  auto* degrees = command.add_option("--sensor-yaw-deg", arguments.sensor_yaw_deg,
                                     "direction of sight where positions are given, degrees");
  command.add_option("--sensor-yaw-rad", arguments.sensor_yaw_rad, "the same, radians")
      ->excludes(degrees);
}

}  // namespace

void add_import_command(CLI::App& app, int& exit_code) {
  CLI::App& command =
      *app.add_subcommand("import", "turn other programs' files into a capture file");
  const auto arguments = std::make_shared<ImportArguments>();
  command.add_option("FILES", arguments->files, "files or folders to read")->required();
  command.add_option("-o,--output", arguments->output, "capture file to write, .exr")
      ->required()
      ->type_name("CAPTURE");
  add_array_options(command, arguments->options);
  add_metadata_options(command, *arguments);
  command.callback([arguments, &exit_code] { exit_code = run_import(*arguments); });
}

}  // namespace blindcorner
