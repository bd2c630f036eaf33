// SPDX-License-Identifier: Apache-2.0
/// The subcommands. Each adds itself to the program; when it is chosen it runs inside
/// `app.parse()`, sets `exit_code` or throws Error, which means exit code 2.
#pragma once

namespace CLI {
class App;
}

namespace blindcorner {

/// Exit codes, the same for all commands.
inline constexpr int kAllWell = 0;
inline constexpr int kSomeFailed = 1;  ///< some captures failed, or output was not written; named
inline constexpr int kUnusable = 2;    ///< arguments or scene wrong, or nothing readable: no output

void add_fit_command(CLI::App& app, int& exit_code);
void add_render_command(CLI::App& app, int& exit_code);
void add_benchmark_command(CLI::App& app, int& exit_code);
void add_import_command(CLI::App& app, int& exit_code);
void add_export_command(CLI::App& app, int& exit_code);
void add_calibrate_command(CLI::App& app, int& exit_code);
void add_evaluate_command(CLI::App& app, int& exit_code);
void add_crossvalidate_command(CLI::App& app, int& exit_code);
void add_info_command(CLI::App& app, int& exit_code);
void add_explain_command(CLI::App& app, int& exit_code);
void add_drive_command(CLI::App& app, int& exit_code);
void add_trials_command(CLI::App& app, int& exit_code);
void add_plan_command(CLI::App& app, int& exit_code);
void add_bound_command(CLI::App& app, int& exit_code);

}  // namespace blindcorner
