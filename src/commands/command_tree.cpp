// SPDX-License-Identifier: Apache-2.0
#include "commands/command_tree.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <vector>

namespace blindcorner {
namespace {

/// One option as the command line takes it.
struct OptionText {
  std::vector<std::string> names;  ///< "--output", "-o"; empty: a positional
  std::string value;               ///< what follows it; empty: a flag
  std::string description;
};

/// One command; the program itself has no words.
struct CommandText {
  std::vector<std::string> words;  ///< "benchmark", "solver"
  std::string description, footer;
  std::vector<OptionText> options, positionals;
  std::vector<std::pair<std::string, std::string>> commands;  ///< name, description

  std::string path() const {
    std::string text;
    for (const std::string& word : words) text += " " + word;
    return text;
  }
};

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_name().empty(); });
}

void collect(const CLI::App& app, std::vector<std::string> words,
             std::vector<CommandText>& commands) {
  CommandText command{std::move(words), app.get_description(), app.get_footer(), {}, {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    OptionText text{{}, "", option->get_description()};
    for (const std::string& name : option->get_lnames()) text.names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) text.names.push_back("-" + name);
    if (option->get_items_expected_max() > 0) {
      text.value = option->get_type_name().empty() ? "VALUE" : option->get_type_name();
    }
    if (text.names.empty()) {
      text.value = option->get_name(true);
      command.positionals.push_back(std::move(text));
    } else {
      command.options.push_back(std::move(text));
    }
  }
  for (const CLI::App* below : commands_of(app)) {
    command.commands.emplace_back(below->get_name(), below->get_description());
  }
  const std::vector<std::string> path = command.words;
  commands.push_back(std::move(command));
  for (const CLI::App* below : commands_of(app)) {
    std::vector<std::string> longer = path;
    longer.push_back(below->get_name());
    collect(*below, longer, commands);
  }
}

std::vector<CommandText> all_commands(const CLI::App& app) {
  std::vector<CommandText> commands;
  collect(app, {}, commands);
  return commands;
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size()) {
    text.replace(at, what.size(), with);
  }
  return text;
}

/// The text in single quotes, for bash and zsh.
std::string in_quotes(const std::string& text) { return "'" + replaced(text, "'", "'\\''") + "'"; }

std::string bash_script(const std::vector<CommandText>& commands) {
  std::string known;
  std::string words;
  for (const CommandText& command : commands) {
    std::string names;
    for (const auto& [name, description] : command.commands) {
      names += " " + name;
      known += (known.empty() ? "" : " | ") + in_quotes(command.path() + " " + name);
    }
    for (const OptionText& option : command.options) {
      for (const std::string& name : option.names) names += " " + name;
    }
    words += "    " + in_quotes(command.path()) + ") words=" + in_quotes(names) + " ;;\n";
  }
  return "# Completion of blindcorner for bash; written by `blindcorner completion bash`.\n"
         "_blindcorner() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} path= words= i\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    case \"$path ${COMP_WORDS[i]}\" in\n"
         "    " +
         known +
         ") path+=\" ${COMP_WORDS[i]}\" ;;\n"
         "    esac\n"
         "  done\n"
         "  case $path in\n" +
         words +
         "  esac\n"
         "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")\n"
         "}\n"
         "complete -o default -F _blindcorner blindcorner\n";
}

std::string zsh_script(const std::vector<CommandText>& commands) {
  const auto entry = [](const std::string& name, const std::string& description) {
    return " " + in_quotes(replaced(name, ":", "\\:") + ":" + description);
  };
  std::string known;
  std::string words;
  for (const CommandText& command : commands) {
    std::string names, options;
    for (const auto& [name, description] : command.commands) {
      names += entry(name, description);
      known += (known.empty() ? "" : "|") + in_quotes(command.path() + " " + name);
    }
    for (const OptionText& option : command.options) {
      for (const std::string& name : option.names) options += entry(name, option.description);
    }
    words += "    " + in_quotes(command.path()) + ") commands=(" + names + " ); options=(" +
             options + " ) ;;\n";
  }
  return "#compdef blindcorner\n"
         "# Completion of blindcorner for zsh; written by `blindcorner completion zsh`.\n"
         "_blindcorner() {\n"
         "  local path_= i\n"
         "  local -a commands options\n"
         "  for ((i = 2; i < CURRENT; ++i)); do\n"
         "    case \"$path_ $words[i]\" in\n"
         "    (" +
         known +
         ") path_+=\" $words[i]\" ;;\n"
         "    esac\n"
         "  done\n"
         "  case $path_ in\n" +
         words +
         "  esac\n"
         "  if [[ $words[CURRENT] == -* ]]; then\n"
         "    _describe -o option options\n"
         "  elif (($#commands)); then\n"
         "    _describe command commands\n"
         "  else\n"
         "    _files\n"
         "  fi\n"
         "}\n"
         "_blindcorner \"$@\"\n";
}

std::string fish_script(const std::vector<CommandText>& commands) {
  const auto text = [](const std::string& words) {
    return "'" + replaced(replaced(words, "\\", "\\\\"), "'", "\\'") + "'";
  };
  std::string script =
      "# Completion of blindcorner for fish; written by `blindcorner completion fish`.\n";
  for (const CommandText& command : commands) {
    std::string here;
    for (const std::string& word : command.words) {
      here += (here.empty() ? "" : "; and ") + ("__fish_seen_subcommand_from " + word);
    }
    std::string below;
    for (const auto& [name, description] : command.commands) below += " " + name;
    if (!below.empty()) {
      here += (here.empty() ? "" : "; and ") + ("not __fish_seen_subcommand_from" + below);
    }
    const std::string begin = "complete -c blindcorner -n " + text(here);
    for (const auto& [name, description] : command.commands) {
      script += begin + " -f -a " + name + " -d " + text(description) + "\n";
    }
    for (const OptionText& option : command.options) {
      script += begin;
      for (const std::string& name : option.names) {
        script += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      script += (option.value.empty() ? "" : " -r") + (" -d " + text(option.description)) + "\n";
    }
  }
  return script;
}

/// The text escaped for roff, so that none of its lines is taken for a request.
std::string roff(const std::string& text) {
  std::string escaped = replaced(replaced(text, "\\", "\\e"), "-", "\\-");
  escaped = replaced(escaped, "\n", "\n.br\n");
  if (escaped.starts_with('.') || escaped.starts_with('\'')) escaped.insert(0, "\\&");
  return replaced(replaced(escaped, "\n'", "\n\\&'"), "\n.br\n.", "\n.br\n\\&.");
}

std::string roff_option(const OptionText& option) {
  std::string names;
  for (const std::string& name : option.names) {
    names += (names.empty() ? "" : ", ") + ("\\fB" + roff(name) + "\\fR");
  }
  if (!option.value.empty()) {
    names += (names.empty() ? "" : " ") + ("\\fI" + roff(option.value) + "\\fR");
  }
  return ".TP\n" + names + "\n" + roff(option.description) + "\n";
}

}  // namespace

void show_defaults(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    const std::string& description = option->get_description();
    const bool told = description.find("default:") != std::string::npos;
    if (told || option->get_required() || option->get_items_expected_max() == 0) continue;
    option->capture_default_str();
    const std::string value = option->get_default_str();
    // No default is shown for an empty list, nor for -1 and 0, which stand for "none". A 0 is shown
    // if the description says what it means.
    const bool zero = value == "0" && description.find("0:") == std::string::npos;
    if (value == "[]" || value == "-1" || zero) option->default_str("");
  }
  for (CLI::App* command : app.get_subcommands({})) show_defaults(*command);
}

std::string completion_script(const CLI::App& app, const std::string& shell) {
  const std::vector<CommandText> commands = all_commands(app);
  if (shell == "zsh") return zsh_script(commands);
  return shell == "fish" ? fish_script(commands) : bash_script(commands);
}

std::string manual_page(const CLI::App& app, const std::string& version) {
  const std::vector<CommandText> commands = all_commands(app);
  std::string page = ".TH BLINDCORNER 1 \"\" \"blindcorner " + version + "\" \"User Commands\"\n";
  page += ".SH NAME\nblindcorner \\- see around corners with single\\-photon LiDAR\n";
  page += ".SH SYNOPSIS\n.B blindcorner\n.I COMMAND\n[\\fIARGUMENTS\\fR]\n";
  page += ".SH DESCRIPTION\n" + roff(app.get_description()) +
          "\nA scene file (JSON) says what is known of the scene, a capture file (OpenEXR) holds "
          "histograms.\n.B blindcorner init\nwrites a scene to begin with.\n.SH COMMANDS\n";
  for (const CommandText& command : commands) {
    if (command.words.empty()) continue;
    page +=
        ".SS \"" + roff("blindcorner" + command.path()) + "\"\n" + roff(command.description) + "\n";
    for (const OptionText& positional : command.positionals) page += roff_option(positional);
    for (const OptionText& option : command.options) page += roff_option(option);
    if (!command.footer.empty()) page += ".PP\n" + roff(command.footer) + "\n";
  }
  return page +
         ".SH EXIT STATUS\n.TP\n.B 0\nAll is well.\n.TP\n.B 1\nSome captures failed, or output was "
         "not written; they are named on standard error.\n.TP\n.B 2\nArguments or scene are wrong, "
         "or nothing could be read; nothing was written.\n";
}

void add_command_tree_commands(CLI::App& app, const std::string& version) {
  CLI::App& completion =
      *app.add_subcommand("completion", "print what completes commands and options in a shell");
  const auto shell = std::make_shared<std::string>();
  completion.add_option("SHELL", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}).description(""));
  completion.callback(
      [&app, shell] { std::fputs(completion_script(app, *shell).c_str(), stdout); });
  CLI::App& man = *app.add_subcommand("man", "print the manual page, as for `man -l -`");
  man.callback([&app, version] { std::fputs(manual_page(app, version).c_str(), stdout); });
}

}  // namespace blindcorner
