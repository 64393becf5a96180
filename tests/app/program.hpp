// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>

#include "tests/support/temporary_folder.hpp"

namespace palpate::test {

inline std::string read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline std::size_t lines_in(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

/// The program as a user meets it: what it writes and the code it ends with.
class Program : public ::testing::Test {
 protected:
  struct Outcome {
    int code;
    std::string out, err;
  };

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }

  std::string write(const std::string& name, const std::string& text) const {
    return folder_.write(name, text).string();
  }

  // Runs the program with arguments that need no quoting, after `before` in the same shell.
  [[nodiscard]] Outcome run(const std::string& arguments, const std::string& before = "",
                            const std::string& program = PALPATE_PROGRAM) const {
    const std::string command = before + program + " " + arguments + " >" + path("stdout") + " 2>" +
                                path("stderr") + " </dev/null";
    const int status = std::system(command.c_str());  // NOLINT(cert-env33-c): a shell is wanted
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(folder_.path() / "stdout"),
            read(folder_.path() / "stderr")};
  }

  // Wrong usage or input: exit 2 and one line that says what, why and what to do.
  void expect_refusal(const std::string& arguments, const std::vector<std::string>& words,
                      const std::string& before = "") const {
    const Outcome outcome = run(arguments, before);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_EQ(outcome.err.substr(0, 9), "palpate: ") << arguments;
    EXPECT_EQ(lines_in(outcome.err), 1U) << outcome.err;
    for (const std::string& word : words)
      EXPECT_NE(outcome.err.find(word), std::string::npos) << word << " is not in " << outcome.err;
  }

  // A press into the middle of the synthetic plane and a slide.
  std::string press() const {
    return write("press.csv", "t,x,y,z\n0,0,0,0.03\n0.3,0,0,-0.008\n1.0,0.02,0.01,-0.008\n");
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace palpate::test
