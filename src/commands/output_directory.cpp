// SPDX-License-Identifier: Apache-2.0
#include "commands/output_directory.h"

#include <filesystem>

#include "blindcorner/forward/error.h"
#include "blindcorner/report/index_page.h"

namespace blindcorner {

void make_directory(const std::string& path) {
  std::error_code code;
  std::filesystem::create_directories(path, code);
  if (code || !std::filesystem::is_directory(path)) {
    throw OutputError(path, "cannot be made a directory" + (code ? ": " + code.message() : ""));
  }
}

void index_output(const CLI::App& program) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  const CLI::Option* option = command->get_option_no_throw("--output");
  const std::string path = option == nullptr ? "" : option->as<std::string>();
  if (path.empty()) return;
  if (std::filesystem::is_directory(path)) {
    write_index(path);
  } else {
    refresh_index(std::filesystem::absolute(path).parent_path().string());
  }
}

}  // namespace blindcorner
