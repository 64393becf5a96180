// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <optional>
#include <string>
#include <utility>

#include "tests/support/sanitized.hpp"

namespace palpate::test {

/// A variable of the environment, for as long as this lives. Only before other threads begin.
class Environment {
 public:
  Environment(std::string name, const std::string& value) : name_(std::move(name)) {
    if (const char* before = std::getenv(name_.c_str())) before_ = before;
    setenv(name_.c_str(), value.c_str(), 1);
  }
  ~Environment() {
    if (before_)
      setenv(name_.c_str(), before_->c_str(), 1);
    else
      unsetenv(name_.c_str());
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  std::string name_;
  std::optional<std::string> before_;
};

/// Under a sanitizer, hides the libraries of cameras that this machine may have: what those leak
/// would count as ours.
class NoVendorsUnderASanitizer {
  Environment openni2_{"PALPATE_OPENNI2", path("PALPATE_OPENNI2")};
  Environment freenect_{"PALPATE_LIBFREENECT", path("PALPATE_LIBFREENECT")};

  static std::string path(const char* variable) {
    const char* given = std::getenv(variable);
    return sanitized ? "/no/such/library" : given == nullptr ? "" : given;
  }
};

}  // namespace palpate::test
