// SPDX-License-Identifier: Apache-2.0
/// `blindcorner export CAPTURE -o FILE.npz|FILE.csv|FILE.log|FILE.hdf5`.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/export_file.h"
#include "commands/commands.h"

namespace blindcorner {

void add_export_command(CLI::App& app, int& exit_code) {
  struct Arguments {
    std::string capture, output;
    ExportOptions options;
    double time_zero_ps = 0.0;
  };
  CLI::App& command = *app.add_subcommand(
      "export", "write a capture file as .npz (NumPy), .csv, .log (TMF8828) or .hdf5 (tal)");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("CAPTURE", arguments->capture, "capture file")->required();
  command.add_option("-o,--output", arguments->output, "file to write, .npz, .csv, .log or .hdf5")
      ->required()
      ->type_name("FILE");
  command.add_option("--capture", arguments->options.capture, "tal: which capture, from 0")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  command.add_flag("--confocal", arguments->options.confocal,
                   "tal: the laser lights the point that each zone looks at");
  command.add_option("--time-zero-ps", arguments->time_zero_ps,
                     "tal: when light of zero path length arrives, ps");
  command.callback([arguments, &exit_code] {
    const CaptureFile file = read_captures(arguments->capture);
    arguments->options.time_zero = arguments->time_zero_ps * 1e-12;
    export_captures(arguments->output, file, arguments->options);
    std::printf("%s: %zu capture%s\n", arguments->output.c_str(), file.captures.size(),
                file.captures.size() == 1 ? "" : "s");
    exit_code = kAllWell;
  });
}

}  // namespace blindcorner
