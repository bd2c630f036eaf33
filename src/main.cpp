// SPDX-License-Identifier: Apache-2.0
/// The program `blindcorner`: one subcommand per file in commands/.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <new>
#include <sstream>
#include <string>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/program_name.h"
#include "commands/cnn.h"
#include "commands/command_tree.h"
#include "commands/commands.h"
#include "commands/compare.h"
#include "commands/init.h"
#include "commands/live.h"
#include "commands/output_directory.h"
#include "commands/stability.h"
#include "commands/unknown_command.h"

namespace blindcorner {
const char* commit();  // cmake/GitCommit.cmake
}

namespace {

/// A line on standard error for each of the message's lines: a scene may have several problems.
int fail(const std::string& message, int code = blindcorner::kUnusable) {
  std::istringstream lines(message);
  for (std::string line; std::getline(lines, line);) {
    std::fprintf(stderr, "blindcorner: %s\n", line.c_str());
  }
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Locates objects around corners by fitting single-photon LiDAR histograms.",
               "blindcorner");
  app.require_subcommand(1);
  blindcorner::set_program_name(std::string("blindcorner " BLINDCORNER_VERSION " (") +
                                blindcorner::commit() + ")");
  app.set_version_flag("--version", blindcorner::program_name());
  int exit_code = blindcorner::kAllWell;
  blindcorner::add_fit_command(app, exit_code);
  blindcorner::add_render_command(app, exit_code);
  blindcorner::add_benchmark_command(app, exit_code);
  blindcorner::add_import_command(app, exit_code);
  blindcorner::add_export_command(app, exit_code);
  blindcorner::add_calibrate_command(app, exit_code);
  blindcorner::add_evaluate_command(app, exit_code);
  blindcorner::add_crossvalidate_command(app, exit_code);
  blindcorner::add_init_command(app, exit_code);
  blindcorner::add_info_command(app, exit_code);
  blindcorner::add_explain_command(app, exit_code);
  blindcorner::add_bound_command(app, exit_code);
  blindcorner::add_stability_command(app, exit_code);
  blindcorner::add_live_command(app, exit_code);
  blindcorner::add_replay_command(app, exit_code);
  blindcorner::add_drive_command(app, exit_code);
  blindcorner::add_trials_command(app, exit_code);
  blindcorner::add_plan_command(app, exit_code);
  blindcorner::add_compare_command(app, exit_code);
  blindcorner::add_cnn_command(app, exit_code);
  blindcorner::add_command_tree_commands(app, BLINDCORNER_VERSION);
  blindcorner::show_defaults(app);
  try {
    app.parse(argc, argv);
    blindcorner::index_output(app);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() != 0) {
      return fail(blindcorner::unknown_word(app, argc, argv).value_or(error.what()) +
                  " (see blindcorner --help)");
    }
    exit_code = app.exit(error);  // --help, --version
  } catch (const blindcorner::OutputError& error) {
    return fail(error.what(), blindcorner::kSomeFailed);
  } catch (const std::bad_alloc&) {
    return fail("out of memory");
  } catch (const std::exception& error) {
    return fail(error.what());
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    fail("standard output: could not be written");
    return std::max(exit_code, blindcorner::kSomeFailed);
  }
  return exit_code;
}
