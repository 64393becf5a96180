// SPDX-License-Identifier: Apache-2.0
#include "app/options.hpp"

#include <charconv>

#include "app/program.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/kernel/methods/methods.hpp"

namespace palpate::app {

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

std::string with_material(const std::string& uri, const std::optional<std::string>& material) {
  if (!material || Uri(uri).has("material")) return uri;
  if (material->find_first_of("&?") != std::string::npos)
    throw Error("--material " + *material, "a name with & or ? cannot stand in a camera's URI",
                "rename the file");
  const bool begun = uri.find('?') != std::string::npos;
  return uri + (begun ? (uri.back() == '?' ? "" : "&") : "?") + "material=" + *material;
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
  command.add_option("--config", config_,
                     "read the method and parameters from a session's TOML file");
}

std::pair<std::string, double> parse_assignment(const std::string& option,
                                                const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos)
    throw Error(option + " " + text, "there is no '='", "write " + option + " NAME=VALUE");
  const std::string name = text.substr(0, equals);
  return {name, parse_number(option + " " + name, text.substr(equals + 1))};
}

SessionConfig MethodOptions::session(const MethodRegistry& methods) const {
  SessionConfig config;
  config.method = default_method;
  const auto check = [&methods](const std::string& name) { check_method(methods, name); };
  if (config_) config = read_session_config(*config_, config, check);
  if (method_) config.method = *method_;
  check(config.method);
  for (const std::string& assignment : assignments_) {
    const auto [name, value] = parse_assignment("--set", assignment);
    set_parameter(config.parameters, name, value);
    config.radii_chosen = config.radii_chosen || is_proxy_radius(name);
  }
  validate(config.parameters);
  return config;
}

MethodChoice MethodOptions::choice(const MethodRegistry& methods) const {
  SessionConfig config = session(methods);
  return {std::move(config.method), config.parameters};
}

}  // namespace palpate::app
