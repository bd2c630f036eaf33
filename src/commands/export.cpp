// SPDX-License-Identifier: Apache-2.0
/// `blindcorner export CAPTURE -o FILE.npz|FILE.csv|FILE.log`.
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
  };
  CLI::App& command =
      *app.add_subcommand("export", "write a capture file as .npz (NumPy), .csv or .log (TMF8828)");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("CAPTURE", arguments->capture, "capture file")->required();
  command.add_option("-o,--output", arguments->output, "file to write, .npz, .csv or .log")
      ->required()
      ->type_name("FILE");
  command.callback([arguments, &exit_code] {
    const CaptureFile file = read_captures(arguments->capture);
    export_captures(arguments->output, file);
    std::printf("%s: %zu capture%s\n", arguments->output.c_str(), file.captures.size(),
                file.captures.size() == 1 ? "" : "s");
    exit_code = kAllWell;
  });
}

}  // namespace blindcorner
