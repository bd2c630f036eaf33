// SPDX-License-Identifier: Apache-2.0
/// `blindcorner replay CAPTURES|LOG... [--listen tcp://host:port | --stdout]`.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <memory>
#include <thread>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/scene_file.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/live.h"
#include "commands/number_check.h"
#include "live/recording.h"
#include "live/replay_port.h"

namespace blindcorner {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Frames per second if neither an option nor the scene states them: Motion's default.
constexpr double kUsualRate = 10;

struct ReplayArguments {
  std::vector<std::string> files;
  std::string scene, format = "auto", listen;
  ImportOptions options;
  double pace = 1;
  double rate = 0;
  bool to_stdout = false;
  bool loop = false;
};

std::unique_ptr<live::ReplayPort> open_port(const ReplayArguments& arguments) {
  if (arguments.to_stdout) return live::standard_output();
  if (!arguments.listen.empty()) return live::tcp_port(arguments.listen);
  return live::pseudo_terminal();
}

/// Time between frames, s; 0: as fast as possible.
double interval_of(const ReplayArguments& arguments) {
  double rate = arguments.rate;
  if (rate == 0 && !arguments.scene.empty()) rate = 1 / read_motion(arguments.scene).frame_interval;
  if (rate == 0) rate = kUsualRate;
  return arguments.pace > 0 ? 1 / (rate * arguments.pace) : 0;
}

/// Waits in short naps, so that Ctrl-C ends it.
void wait_until(Clock::time_point time) {
  while (!Interruptible::asked() && Clock::now() < time) {
    std::this_thread::sleep_until(std::min(time, Clock::now() + 100ms));
  }
}

int run_replay(const ReplayArguments& arguments) {
  std::signal(SIGPIPE, SIG_IGN);  // a reader that is gone is noticed when it is written to
  std::vector<std::unique_ptr<live::Recording>> recordings;
  for (const std::string& file : arguments.files) {
    recordings.push_back(live::open_recording(file, arguments.format, arguments.options));
  }
  const std::chrono::duration<double> interval(interval_of(arguments));
  const auto port = open_port(arguments);
  const Interruptible interruptible;
  if (!arguments.to_stdout) {
    std::printf("%s\n", port->name().c_str());
    std::fflush(stdout);
  }
  while (!port->has_reader() && !Interruptible::asked()) std::this_thread::sleep_for(20ms);
  long frames = 0;
  Clock::time_point next = Clock::now();
  bool readable = true;
  do {
    for (const auto& recording : recordings) {
      for (std::size_t i = 0; readable && i < recording->frames(); ++i) {
        wait_until(next);
        if (Interruptible::asked()) break;
        readable = port->write(recording->text(i), Interruptible::asked);
        frames += readable ? 1 : 0;
        // A slow reader holds up the clock: a delay beyond 100 ms is not made up for.
        next = std::max(next, Clock::now() - 100ms) +
               std::chrono::duration_cast<Clock::duration>(interval);
      }
    }
  } while (arguments.loop && readable && !Interruptible::asked());
  if (arguments.to_stdout || Interruptible::asked()) return kAllWell;
  std::printf("%ld frames\n", frames);
  // When a terminal is closed, it forgets what was not read.
  const Clock::time_point patience = Clock::now() + 2s;
  while (port->has_reader() && Clock::now() < patience && !Interruptible::asked()) {
    std::this_thread::sleep_for(50ms);
  }
  return kAllWell;
}

}  // namespace

void add_replay_command(CLI::App& app, int& exit_code) {
  CLI::App& command =
      *app.add_subcommand("replay", "play recordings as the sensor sends them, for `live` to read");
  const auto arguments = std::make_shared<ReplayArguments>();
  command
      .add_option("FILES", arguments->files, "capture files or sensor logs, one after the other")
      ->required();
  CLI::Option* listen =
      command
          .add_option("--listen", arguments->listen,
                      "a TCP port in place of a pseudo-terminal, tcp://127.0.0.1:PORT; 0: any")
          ->type_name("ADDRESS");
  command.add_flag("--stdout", arguments->to_stdout, "standard output in place of a terminal")
      ->excludes(listen);
  command.add_option("--pace", arguments->pace, "times as fast as the sensor; 0: no waiting")
      ->check(number_from_zero())
      ->capture_default_str();
  command
      .add_option("--rate", arguments->rate,
                  "frames in a second at pace 1; default: the scene's, else 10")
      ->check(number_from_zero());
  command.add_option("--scene", arguments->scene, "scene file that states the frame interval");
  command.add_flag("--loop", arguments->loop, "begin anew at the end");
  command
      .add_option("--format", arguments->format,
                  "format to print captures in, tmf8828, vl53l8ch, tmf8829 or json_lines; of a "
                  "log: its own; auto: as the sensor is called")
      ->type_name("NAME")
      ->capture_default_str();
  command.add_option("--rows", arguments->options.rows, "rows of zones, of a TMF8828 log");
  command.add_option("--columns", arguments->options.columns, "columns of zones");
  command.add_option("--i2c-address", arguments->options.i2c_address,
                     "sensor of a TMF8828 log with several; 0: the first");
  command.callback([arguments, &exit_code] { exit_code = run_replay(*arguments); });
}

}  // namespace blindcorner
