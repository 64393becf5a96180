// SPDX-License-Identifier: Apache-2.0
#include "lab/pipe_method.hpp"

#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <limits>
#include <span>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"

extern char** environ;

namespace palpate::lab {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the numbers of the pipe are little-endian");

constexpr std::string_view scheme = "pipe:";
constexpr int version = 1;
constexpr std::uint32_t longest_name = 1024;  // [bytes] of the program's answer to INIT

// A message as it is put together: four letters, the length of what follows, and that.
class Message {
 public:
  explicit Message(std::string_view letters) : bytes_(letters) { bytes_.resize(8); }

  template <class Number>
  Message& add(Number value) {
    std::array<char, sizeof(Number)> bytes{};
    std::memcpy(bytes.data(), &value, sizeof value);
    bytes_.append(bytes.data(), bytes.size());
    return *this;
  }
  Message& add(const Vec3& v) { return add(v.x()).add(v.y()).add(v.z()); }
  Message& add(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  void reserve(std::size_t bytes) { bytes_.reserve(bytes_.size() + bytes); }

  [[nodiscard]] const std::string& bytes() {
    const auto length = static_cast<std::uint32_t>(bytes_.size() - 8);
    std::memcpy(bytes_.data() + 4, &length, sizeof length);
    return bytes_;
  }

 private:
  std::string bytes_;
};

// A program with its standard input and output at our end of a socket.
class Program {
 public:
  Program(std::string name, std::chrono::milliseconds patience)
      : name_(std::move(name)), patience_(patience) {
    const std::string command = name_.substr(scheme.size());
    if (command.empty())
      throw Error(name_, "it names no command", "write for example 'pipe:python3 my_method.py'");
    std::array<int, 2> ends{};
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) fail_to_start(errno);
    socket_ = ends[0];
    const timeval limit{static_cast<time_t>(patience.count() / 1000),
                        static_cast<suseconds_t>(patience.count() % 1000 * 1000)};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    // A group of its own, so that what the shell starts ends with it.
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setpgroup(&attributes, 0);
    std::string shell = "/bin/sh";
    std::string option = "-c";
    std::string text = command;
    const std::array<char*, 4> arguments = {shell.data(), option.data(), text.data(), nullptr};
    const int trouble =
        posix_spawn(&process_, shell.c_str(), &actions, &attributes, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    close(ends[1]);
    if (trouble != 0) {
      close(socket_);
      fail_to_start(trouble);
    }
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    close(socket_);
    end();
  }

  void send(Message message) {
    std::string_view left = message.bytes();
    while (!left.empty()) {
      const ssize_t sent = ::send(socket_, left.data(), left.size(), MSG_NOSIGNAL);
      if (sent > 0) {
        left.remove_prefix(static_cast<std::size_t>(sent));
      } else if (errno == EPIPE || errno == ECONNRESET) {
        return;  // what it said before it ended, its next answer tells
      } else if (errno != EINTR) {
        give_up(errno, "reads");
      }
    }
  }

  // What follows the next message's head.
  // @param shortest, longest  [bytes] that it may have
  std::string answer(std::string_view letters, std::uint32_t shortest, std::uint32_t longest) {
    std::array<char, 8> head{};
    read(head);
    std::uint32_t length = 0;
    std::memcpy(&length, head.data() + 4, sizeof length);
    if (std::string_view(head.data(), 4) != letters || length < shortest || length > longest)
      throw Error(
          name_,
          fmt::format("its answer to {} begins with the bytes {:02x}", letters,
                      fmt::join(std::span(reinterpret_cast<unsigned char*>(head.data()), 8), " ")),
          fmt::format("answer with the letters {}, a length of {} and that many bytes; "
                      "print nothing else to standard output",
                      letters,
                      shortest == longest ? fmt::format("{}", shortest)
                                          : fmt::format("up to {}", longest)));
    std::string bytes(length, '\0');
    read(bytes);
    return bytes;
  }

 private:
  [[noreturn]] void fail_to_start(int trouble) const {
    throw Error(name_, std::string("it cannot be started: ") + std::strerror(trouble),
                "end other programs, then try again");
  }

  void read(std::span<char> bytes) {
    while (!bytes.empty()) {
      const ssize_t count = recv(socket_, bytes.data(), bytes.size(), 0);
      if (count > 0) {
        bytes = bytes.subspan(static_cast<std::size_t>(count));
      } else if (count == 0) {
        give_up(EPIPE, "writes");
      } else if (errno != EINTR) {
        give_up(errno, "writes");
      }
    }
  }

  // Kills what is left of the program and returns its status, as waitpid has it: its own if it had
  // ended by itself.
  int end() {
    if (process_ <= 0) return 0;
    kill(-process_, SIGKILL);
    int status = 0;
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    process_ = -1;
    return status;
  }

  [[noreturn]] void give_up(int trouble, const char* verb) {
    if (trouble == EAGAIN || trouble == EWOULDBLOCK) {
      end();
      throw Error(name_,
                  fmt::format("it neither ends nor {} for {:g} s", verb,
                              1e-3 * static_cast<double>(patience_.count())),
                  "flush standard output after each answer, and read whole messages");
    }
    // Its end of the pipe is closed: it has ended, or is about to.
    bool ended = false;
    for (int i = 0; i < 100 && !ended; ++i) {
      siginfo_t info{};
      ended = waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
              info.si_pid == process_;
      if (!ended) usleep(1000);
    }
    const int status = end();
    const std::string how = !ended ? "it closed its end of the pipe"
                            : WIFSIGNALED(status)
                                ? fmt::format("it ended by signal {}", WTERMSIG(status))
                                : fmt::format("it ended with status {}", WEXITSTATUS(status));
    throw Error(name_, how + " before the benchmark had finished",
                "its output is above; run the command by itself to test it");
  }

  std::string name_;
  std::chrono::milliseconds patience_;
  int socket_ = -1;
  pid_t process_ = -1;
};

std::string text_of(const Parameters& parameters) {
  std::string text = fmt::format("{{\"version\":{}", version);
  for (const ParameterInfo& row : parameter_table())
    text += fmt::format(",\"{}\":{}", row.name, static_cast<double>(row.get(parameters)));
  return text + "}";
}

void add_point(Message& message, const Vec3& p) {
  for (const double c : {p.x(), p.y(), p.z()}) message.add(static_cast<float>(c));
}

// A frame as the program gets it: points in the order of pixels, where they have one.
Message message_of(const std::string& name, const Cloud& cloud, double stamp) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto head = [&](const Vec3& viewpoint, std::size_t width, std::size_t height,
                        std::size_t points) {
    Message message("FRAM");
    message.add(stamp).add(viewpoint);
    for (const std::size_t number : {width, height, points})
      message.add(static_cast<std::uint32_t>(number));
    message.reserve(12 * points);
    return message;
  };
  if (const DepthImage* image = cloud.image()) {
    const Intrinsics& k = image->intrinsics();
    const auto width = static_cast<std::size_t>(k.width);
    const auto height = static_cast<std::size_t>(k.height);
    Message message = head(image->world_from_camera().translation(), width, height, width * height);
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u)
        add_point(message, image->deproject(u, v).value_or(Vec3::Constant(nan)));
    }
    return message;
  }
  if (const PointCloud* points = cloud.point_cloud()) {
    Message message = head(points->viewpoint().value_or(Vec3::Constant(nan)), 0, 0, points->size());
    for (std::size_t i = 0; i < points->size(); ++i) add_point(message, points->point(i));
    return message;
  }
  throw Error(name, "a frame is neither a depth image nor points, so it cannot be sent",
              "use scenes with one camera");
}

class PipeMethod final : public LabMethod {
 public:
  PipeMethod(std::string_view name, const Parameters& parameters,
             std::chrono::milliseconds patience)
      : LabMethod(parameters), name_(name), program_(name_, patience) {
    begin();
  }

  void seat(const Vec3& proxy) noexcept override {
    if (!is_place(proxy)) return;
    attempt([&] { program_.send(Message("SEAT").add(proxy)); });
  }

  void frame(const Cloud& cloud, double stamp) noexcept override {
    attempt([&] { program_.send(message_of(name_, cloud, stamp)); });
  }

  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = free(hip, t);
    if (!hip.allFinite() || !std::isfinite(t)) return tick;
    attempt([&] {
      program_.send(Message("TICK").add(t).add(hip));
      std::array<double, 9> numbers{};
      const std::string bytes = program_.answer("TICK", sizeof numbers, sizeof numbers);
      std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
      const Vec3 proxy(numbers[0], numbers[1], numbers[2]);
      const Vec3 force(numbers[3], numbers[4], numbers[5]);
      const Vec3 normal(numbers[6], numbers[7], numbers[8]);
      if (!is_place(proxy) || !force.allFinite() || !normal.allFinite())
        throw Error(name_, fmt::format("its tick at {:g} s has a number that is not finite", t),
                    "answer with a proxy [m], a force [N] and a normal");
      tick.proxy = proxy;
      tick.force = force;
      if (force.squaredNorm() > 0.0) {
        tick.normal = normal.squaredNorm() > 0.0 ? normal : Vec3((proxy - hip).stableNormalized());
        tick.state = ContactState::contact;
      }
    });
    return tick;
  }

  void rethrow() const override {
    if (failure_) std::rethrow_exception(failure_);
  }

 protected:
  void parameters_changed() noexcept override { begin(); }

 private:
  void begin() {
    program_.send(Message("INIT").add(std::string_view(text_of(parameters()))));
    static_cast<void>(program_.answer("INIT", 0, longest_name));
  }

  // After the first failure the program is left alone, and there is no force.
  template <class Work>
  void attempt(const Work& work) noexcept {
    if (failure_) return;
    try {
      work();
    } catch (...) {
      failure_ = std::current_exception();
    }
  }

  std::string name_;
  Program program_;
  std::exception_ptr failure_;
};

}  // namespace

bool is_pipe(std::string_view name) { return name.starts_with(scheme); }

std::unique_ptr<Method> make_pipe_method(std::string_view name, const Parameters& parameters,
                                         std::chrono::milliseconds patience) {
  return std::make_unique<PipeMethod>(name, parameters, patience);
}

}  // namespace palpate::lab
