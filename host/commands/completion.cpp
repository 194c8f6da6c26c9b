// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "commands/commands.hpp"

namespace flexcomp::host {
namespace {

/// The words that an option's value may be, by its check; empty where they are not a few.
std::vector<std::string> choices_of(CLI::Option& option) {
  std::vector<std::string> out;
  try {
    for (int k = 0;; ++k) {
      // CLI11 tells the members of a set in its description alone: {a,b,c}.
      const std::string text = option.get_validator(k)->get_description();
      if (!text.starts_with('{') || !text.ends_with('}')) continue;
      std::string word;
      for (const char c : text.substr(1)) {
        if (c != ',' && c != '}') {
          word += c;
        } else {
          // "," and ";" have names as well, which mean nothing to the shell.
          if (std::any_of(word.begin(), word.end(), [](unsigned char l) { return std::isalnum(l) != 0; }))
            out.push_back(word);
          word.clear();
        }
      }
    }
  } catch (const CLI::OptionNotFound&) {
    // After the last one.
  }
  return out;
}

/// What stands in for file names, by what the help calls the value: the ending of ROBOT.yaml.
std::string files_of(const CLI::Option& option) {
  std::set<std::string> endings;
  const std::string type = option.get_type_name();
  for (const char* ending : {"yaml", "csv", "html", "urdf", "pub"}) {
    if (type.find(fmt::format(".{}", ending)) != std::string::npos) endings.insert(ending);
  }
  if (endings.empty())
    return type.find("FILE") != std::string::npos || type == "KEY" ? "_flexcomp_files '*'" : "";
  if (endings.size() > 1) return fmt::format("_flexcomp_files '*.@({})'", fmt::join(endings, "|"));
  return fmt::format("_flexcomp_files '*.{}'", *endings.begin());
}

std::string offer(CLI::Option& option) {
  const std::vector<std::string> choices = choices_of(option);
  if (!choices.empty()) return fmt::format("_flexcomp_words \"{}\"", fmt::join(choices, " "));
  return files_of(option);
}

/// In the word of a shell's case.
std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> out;
  for (const std::string& name : option.get_snames()) out.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.push_back("--" + name);
  return out;
}

std::string bash_script(CLI::App& app) {
  std::vector<std::string> commands;
  std::string cases;
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    commands.push_back(command->get_name());
    std::vector<std::string> options;
    std::string values;
    std::string positional;
    for (CLI::Option* option : command->get_options()) {
      const std::vector<std::string> names = names_of(*option);
      if (names.empty()) {
        const std::string what = offer(*option);
        if (!what.empty() && positional.empty()) positional = what;
        continue;
      }
      options.insert(options.end(), names.begin(), names.end());
      if (option->get_type_size() == 0 || option->get_expected_max() == 0) continue;
      const std::string what = offer(*option);
      values +=
          fmt::format("        {}) {}return ;;\n", fmt::join(names, "|"), what.empty() ? "" : what + "; ");
    }
    cases += fmt::format("    {})\n", command->get_name());
    if (!values.empty()) cases += fmt::format("      case $prev in\n{}      esac\n", values);
    cases += fmt::format("      if [[ $cur == -* ]]; then _flexcomp_words \"{}\"; return; fi\n",
                         fmt::join(options, " "));
    if (!positional.empty()) cases += fmt::format("      {}\n", positional);
    cases += "      ;;\n";
  }
  return fmt::format(
      R"(# Completion of bash for flexcomp, as "flexcomp completion bash" writes it from its own options.
_flexcomp_words() {{ mapfile -t COMPREPLY < <(compgen -P "$before" -W "$1" -- "$cur"); }}
_flexcomp_files() {{
  local extended=0
  compopt -o filenames 2>/dev/null
  shopt -q extglob || {{ extended=1; shopt -s extglob; }}
  mapfile -t COMPREPLY < <(compgen -P "$before" -f -X "!$1" -- "$cur"
    [[ $1 == '*' ]] || compgen -P "$before" -d -- "$cur")
  [[ $extended -eq 0 ]] || shopt -u extglob
}}
_flexcomp() {{
  local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} before=
  COMPREPLY=()
  # --option=value comes as three words where "=" is in COMP_WORDBREAKS, as it is by default, else as one.
  if [[ $cur == = ]]; then cur=
  elif [[ $prev == = && $COMP_CWORD -gt 2 ]]; then prev=${{COMP_WORDS[COMP_CWORD-2]}}
  elif [[ $cur == --*=* ]]; then prev=${{cur%%=*}} before=${{cur%%=*}}= cur=${{cur#*=}}
  fi
  if [[ $COMP_CWORD -eq 1 ]]; then _flexcomp_words "{0} --help --version"; return; fi
  case ${{COMP_WORDS[1]}} in
{1}  esac
}}
complete -F _flexcomp flexcomp
)",
      fmt::join(commands, " "), cases);
}

}  // namespace

void add_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "completion", "A script that lets the shell complete commands, options, choices and file names");
  command->add_option("shell", *shell, "Which shell")->check(CLI::IsMember({"bash"}))->required();
  command->footer(
      "Examples:\n"
      "  source <(flexcomp completion bash)\n"
      "  flexcomp completion bash >/etc/bash_completion.d/flexcomp");
  command->callback([shell, &app] { fmt::print("{}", bash_script(app)); });
}

}  // namespace flexcomp::host
