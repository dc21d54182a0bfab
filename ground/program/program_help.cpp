// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/program_help.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

namespace srfs::ground {
namespace {

std::string words_of_options(const CLI::App& app) {
  std::string words;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) words += (words.empty() ? "--" : " --") + name;
  }
  return words;
}

/// What may follow a subcommand: its options, its own subcommands and theirs.
std::string words_after(const CLI::App& sub) {
  std::string words = words_of_options(sub);
  for (const CLI::App* nested : sub.get_subcommands({}))
    words += " " + nested->get_name() + " " + words_of_options(*nested);
  return words;
}

/// In a manual page, a dash of an option and a backslash are escaped; a dot or quote begins no line.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\' || c == '-') out += '\\';
    out += c;
  }
  return !out.empty() && (out.front() == '.' || out.front() == '\'') ? "\\&" + out : out;
}

std::string man_options(const CLI::App& app) {
  std::string page;
  for (const CLI::Option* option : app.get_options()) {
    const std::string name =
        option->get_positional() ? option->get_name(true) : option->get_name(false, true);
    page += fmt::format(".TP\n.B {}\n{}\n", escaped(name), escaped(option->get_description()));
  }
  return page;
}

}  // namespace

std::string bash_completion(const CLI::App& app, const std::string& program) {
  const std::string function = "_" + [&] {
    std::string name = program;
    for (char& c : name) c = c == '-' ? '_' : c;
    return name;
  }();
  std::string names;
  std::string cases;
  for (const CLI::App* sub : app.get_subcommands({})) {
    names += (names.empty() ? "" : " ") + sub->get_name();
    cases += fmt::format("    {}) options=\"{}\" ;;\n", sub->get_name(), words_after(*sub));
  }
  return fmt::format(R"(# bash completion for {0}; made by '{0} completion'
{1}() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} verb= options= i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case " {2} " in *" ${{COMP_WORDS[i]}} "*) verb=${{COMP_WORDS[i]}}; break ;; esac
  done
  if [[ -z $verb ]]; then
    COMPREPLY=($(compgen -W "{2} {3}" -- "$word"))
    return
  fi
  case $verb in
{4}  esac
  if [[ $word != -* && $verb =~ ^(tc|arm|list)$ && ${{COMP_WORDS[COMP_CWORD-1]}} == "$verb" ]]; then
    options=$("${{COMP_WORDS[0]}}" list --names 2>/dev/null)
  elif [[ $word != -* && $verb == pass && ${{COMP_WORDS[COMP_CWORD-1]}} =~ ^(plan|run|report)$ ]]; then
    COMPREPLY=($(compgen -f -- "$word"))
    return
  elif [[ $word != -* && $verb =~ ^(put|script|package)$ ]]; then
    COMPREPLY=($(compgen -f -- "$word"))
    return
  fi
  COMPREPLY=($(compgen -W "$options" -- "$word"))
}}
complete -F {1} {0}
)",
                     program, function, names, words_of_options(app), cases);
}

std::string man_page(const CLI::App& app, const std::string& program, const std::string& version) {
  std::string page = fmt::format(".TH {} 1 \"\" \"SRFS {}\"\n.SH NAME\n{} \\- {}\n", program,
                                 escaped(version), escaped(program), escaped(app.get_description()));
  page += fmt::format(".SH SYNOPSIS\n.B {}\n[OPTIONS] SUBCOMMAND ...\n.SH OPTIONS\n", escaped(program));
  page += man_options(app) + ".SH SUBCOMMANDS\n";
  for (const CLI::App* sub : app.get_subcommands({})) {
    page += fmt::format(".SS {}\n{}\n", escaped(sub->get_name()), escaped(sub->get_description()));
    page += man_options(*sub);
    for (const CLI::App* nested : sub->get_subcommands({})) {
      page += fmt::format(".SS {} {}\n{}\n", escaped(sub->get_name()), escaped(nested->get_name()),
                          escaped(nested->get_description()));
      page += man_options(*nested);
    }
  }
  return page +
         ".SH EXIT STATUS\n0 done; 1 rejected, failed, unanswered or incomplete; 2 arguments, files or port "
         "unusable; 3 the link was closed; 4 not known whether it was sent: the server ended\n";
}

}  // namespace srfs::ground
