// SPDX-License-Identifier: Apache-2.0
#include "app/options.hpp"

#include <array>
#include <charconv>
#include <string_view>

#include <toml++/toml.h>

#include "app/program.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"
#include "palpate/methods/methods.hpp"

namespace palpate::app {
namespace {

// A configuration file: `method = "paper"` and a table [parameters] with one line a parameter.
void apply_config(const std::string& path, std::string& method, Parameters& parameters) {
  toml::table config;
  try {
    config = toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    const toml::source_position at = error.source().begin;
    const std::string where = at.line > 0 ? ":" + std::to_string(at.line) : "";
    throw Error(path + where, std::string(error.description()),
                "give a TOML file with `method = \"...\"` and a [parameters] table");
  }
  for (const auto& [key, value] : config) {
    if (key == "method") {
      const auto name = value.value<std::string>();
      if (!name) throw Error(path, "`method` is not a text", "write method = \"paper\"");
      method = *name;
    } else if (key == "parameters" && value.is_table()) {
      for (const auto& [name, number] : *value.as_table()) {
        const auto given = number.value<double>();
        if (!given || !number.is_number())
          throw Error(path, "parameter '" + std::string(name.str()) + "' is not a number",
                      "write " + std::string(name.str()) + " = 1.0");
        set_parameter(parameters, name.str(), *given);
      }
    } else {
      constexpr std::array<std::string_view, 2> known = {"method", "parameters"};
      const std::string_view near = nearest_name(key.str(), known);
      throw Error(path, "there is no setting '" + std::string(key.str()) + "'",
                  near.empty() ? "the settings are method and [parameters]"
                               : "did you mean '" + std::string(near) + "'?");
    }
  }
}

}  // namespace

void check_method(const MethodRegistry& methods, const std::string& name) {
  try {
    static_cast<void>(methods.find(name));
  } catch (const Error& error) {
    throw UnknownMethod(error);
  }
}

double parse_number(const std::string& subject, const std::string& text) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || rest != end)
    throw Error(subject, "'" + text + "' is not a number", "give a number such as 0.005");
  return value;
}

void MethodOptions::add_to(CLI::App& command) {
  command.add_option("--method", method_,
                     "sight (the default), paper, or any other that `palpate methods` lists");
  add_parameters_to(command);
}

void MethodOptions::add_parameters_to(CLI::App& command) {
  command
      .add_option("--set", assignments_,
                  "set a parameter, NAME=VALUE in SI units; see `palpate parameters`")
      ->allow_extra_args(false);
  command.add_option("--config", config_, "read the method and parameters from a TOML file");
}

MethodChoice MethodOptions::choice(const MethodRegistry& methods) const {
  MethodChoice choice{std::string(default_method), {}};
  if (config_) {
    apply_config(*config_, choice.name, choice.parameters);
    check_method(methods, choice.name);
  }
  if (method_) choice.name = *method_;
  check_method(methods, choice.name);
  for (const std::string& assignment : assignments_) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos)
      throw Error("--set " + assignment, "there is no '='", "write --set NAME=VALUE");
    const std::string name = assignment.substr(0, equals);
    set_parameter(choice.parameters, name,
                  parse_number("--set " + name, assignment.substr(equals + 1)));
  }
  validate(choice.parameters);
  return choice;
}

}  // namespace palpate::app
