// SPDX-License-Identifier: Apache-2.0
#include "commands/unknown_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <vector>

#include "io/json_reader.h"

namespace blindcorner {
namespace {

/// The name that an unknown word may stand for or, if it resembles none, all names.
std::string suggestion(const std::string& word, const std::vector<std::string>& names) {
  const auto resemblance = [&](const std::string& name) {
    return name.starts_with(word) ? 0 : edit_distance(word, name);
  };
  const auto best = std::ranges::min_element(names, {}, resemblance);
  // With more than half of the letters wrong, it is another word.
  if (2 * resemblance(*best) <= best->size()) return "; did you mean '" + *best + "'?";
  std::string text = "; accepted: ";
  for (const std::string& name : names) text += (name == names.front() ? "" : ", ") + name;
  return text;
}

std::string describe_command(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return "'" + word + "' is not a command of " + app.get_name() + suggestion(word, names);
}

/// A line about the first word that looks like an option and is none of the command's.
std::optional<std::string> unknown_option(const CLI::App& app, int argc, const char* const* argv) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const std::string name = word.substr(0, word.find('='));
    if (!name.starts_with("--") || name == "--" || std::ranges::count(names, name) > 0) continue;
    return "'" + name + "' is not an option of " + app.get_name() + suggestion(name, names);
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> unknown_word(const CLI::App& app, int argc, const char* const* argv) {
  const CLI::App* at = &app;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto commands = at->get_subcommands([](const CLI::App*) { return true; });
    if (commands.empty() || word.starts_with("-")) return unknown_option(*at, argc, argv);
    const auto found =
        std::ranges::find(commands, word, [](const CLI::App* c) { return c->get_name(); });
    if (found == commands.end()) return describe_command(*at, word);
    at = *found;
  }
  return std::nullopt;
}

}  // namespace blindcorner
