// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <csignal>
#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/signals.hpp"

namespace palpate::app {
namespace test_signals {

constexpr int good = 42;  // exit status of a child that saw what it should

// The exit status of a child process that runs `body`; -1 if a signal ended it.
int status_of_child(const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);  // ends a child that hangs
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

class EndingSignal : public testing::TestWithParam<int> {};

TEST_P(EndingSignal, EndsAProcessByTheCallbackAlone) {
  EXPECT_EQ(status_of_child([] {
              std::array<int, 2> called{};
              if (pipe(called.data()) != 0) return 1;
              const EndingSignals signals([&] {
                const char byte = 'x';
                if (write(called[1], &byte, 1) != 1) _exit(2);
              });
              kill(getpid(), GetParam());
              char byte = 0;
              return read(called[0], &byte, 1) == 1 ? good : 3;
            }),
            good);
}

INSTANTIATE_TEST_SUITE_P(Each, EndingSignal,
                         testing::Values(SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP),
                         [](const auto& signal) {
                           return std::string(sigabbrev_np(signal.param));
                         });

TEST(EndingSignals, ASecondOneEndsTheProcessAtOnce) {
  EXPECT_EQ(status_of_child([] {
              const EndingSignals signals([] { kill(getpid(), SIGTERM); });
              kill(getpid(), SIGINT);
              for (;;) pause();  // not reached by any signal: all are waited for elsewhere
              return 1;
            }),
            128 + SIGTERM);
}

TEST(EndingSignals, AWriteToAClosedPipeFailsAndEndsNothing) {
  EXPECT_EQ(status_of_child([] {
              std::array<int, 2> ends{};
              if (pipe(ends.data()) != 0) return 1;
              bool called = false;
              {
                const EndingSignals signals([&] { called = true; });
                close(ends[0]);
                const char byte = 'x';
                if (write(ends[1], &byte, 1) != -1 || errno != EPIPE) return 2;
              }
              // Gone with the signals' object: it does not end the process afterwards, either.
              return called ? 3 : good;
            }),
            good);
}

TEST(Interruption, IsNotedOnceAndASecondSignalOfItsKindEndsTheProcess) {
  EXPECT_EQ(status_of_child([] {
              const Interruption interruption;
              if (interruption.signal() != 0) return 1;
              kill(getpid(), SIGTERM);
              kill(getpid(), SIGHUP);
              return interruption.signal() == SIGTERM ? good : 2;
            }),
            good);
  EXPECT_EQ(status_of_child([] {
              const Interruption interruption;
              kill(getpid(), SIGTERM);
              kill(getpid(), SIGTERM);
              return good;
            }),
            -1);
}

TEST(Interruption, LeavesASignalIgnoredThatWas) {
  EXPECT_EQ(status_of_child([] {
              static_cast<void>(std::signal(SIGINT, SIG_IGN));
              {
                const Interruption interruption;
                kill(getpid(), SIGINT);
                if (interruption.signal() != 0) return 1;
              }
              kill(getpid(), SIGINT);
              return good;
            }),
            good);
}

TEST(EndingSignals, LeaveTheSignalsAsTheyWere) {
  sigset_t before{};
  sigset_t after{};
  pthread_sigmask(SIG_SETMASK, nullptr, &before);
  {
    const EndingSignals signals([] {});
  }
  pthread_sigmask(SIG_SETMASK, nullptr, &after);
  for (int signal = 1; signal < 32; ++signal)
    EXPECT_EQ(sigismember(&before, signal), sigismember(&after, signal)) << signal;
}

}  // namespace test_signals
}  // namespace palpate::app
