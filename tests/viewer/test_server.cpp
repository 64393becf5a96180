// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <random>
#include <thread>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/net/viewer/server.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/viewer/client.hpp"

namespace palpate {
namespace test_server {

// Remembers what pages asked of it.
class FakeHost final : public ViewerHost {
 public:
  nlohmann::json hello() override { return {{"version", "test"}}; }
  nlohmann::json state() override { return {{"method", "paper"}}; }
  nlohmann::json robot() override { return {}; }
  nlohmann::json more_hands() override { return {}; }
  std::optional<TickBatch> ticks() override {
    waits_ = true;
    const std::lock_guard gate(gate_);
    waits_ = false;
    TickBatch batch;
    batch.newest.tick.t = ++beats_;
    return batch;
  }
  void hand(const HandMessage& hand) override {
    const std::lock_guard lock(mutex_);
    hands_.push_back(hand.held ? hand.target : std::nullopt);
    last_ = hand;
    changed_.notify_all();
  }
  bool takes_hand() override { return takes_hand_; }
  void command(const Command& command, Role role) override {
    static_cast<void>(role);
    if (const auto* set = std::get_if<SetParameter>(&command); set != nullptr && set->value < 0.0)
      throw Error("parameter '" + set->name + "'", "it is negative");
    ++commands_;
  }

  std::vector<Body::DrawnGaussian> gaussians() override { return drawn; }
  std::filesystem::path begin_file(const std::string& name, std::uint64_t size) override {
    static_cast<void>(size);
    if (name == "song.mp3") throw Error(name, "cannot be opened");
    return folder_.path() / name;
  }
  void end_file(const std::filesystem::path& file, bool whole) override {
    const std::lock_guard lock(mutex_);
    files_.push_back((whole ? "whole " : "part of ") + file.filename().string());
    changed_.notify_all();
  }
  // Waits for the next file's end.
  std::string next_file() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::minutes(1), [&] { return !files_.empty(); });
    if (files_.empty()) return "none";
    const std::string file = files_.front();
    files_.pop_front();
    return file;
  }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_.path(); }
  std::vector<Body::DrawnGaussian> drawn;

  // The hand's place when it has been told `count` times; waits for it.
  std::optional<Vec3> hand_number(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::minutes(1), [&] { return hands_.size() >= count; });
    return hands_.size() >= count ? hands_[count - 1] : Vec3(Vec3::Constant(1e9));
  }
  std::size_t hands() {
    const std::lock_guard lock(mutex_);
    return hands_.size();
  }
  HandMessage last_hand() {
    const std::lock_guard lock(mutex_);
    return last_;
  }
  [[nodiscard]] int commands() const { return commands_; }
  // Holds the server's thread up, from the return on and as long as the lock lives.
  std::unique_lock<std::mutex> hold() {
    std::unique_lock lock(gate_);
    while (!waits_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return lock;
  }
  void have_another_device() { takes_hand_ = false; }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::optional<Vec3>> hands_;
  std::deque<std::string> files_;
  test::TemporaryFolder folder_;
  HandMessage last_;
  std::atomic<int> commands_{0};
  std::atomic<bool> takes_hand_{true};
  std::mutex gate_;
  std::atomic<bool> waits_{false};
  double beats_ = 0.0;
};

constexpr const char* as_operator = "/session?token=operator-123";

class ViewerServerTest : public ::testing::Test {
 protected:
  FakeHost host;
  ViewerServer server{{.operator_token = "operator-123"}, host};
};

// What a page has to know after `token=` in the address that the server gives.
std::string target_of(const std::string& url) { return "/session" + url.substr(url.find('?')); }

ViewerMessage frame(std::uint32_t number, std::uint8_t camera = 0) {
  static const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 640, .height = 480, .fx = 570, .fy = 570});
  const std::vector<std::uint16_t> depth(640 * 480, 700);
  return frame_message(camera, number,
                       {.cloud = std::make_shared<const DepthImage>(rays, depth, 1000.0)});
}

std::uint32_t number_of(const std::string& message) {
  std::uint32_t number = 0;
  std::memcpy(&number, message.data() + 4, sizeof number);
  return number;
}

TEST_F(ViewerServerTest, ServesThePageToThisMachine) {
  for (const PageFile& file : page_files()) {
    const auto answer = ask(server.port(), std::string(file.path), "localhost:1234");
    EXPECT_EQ(answer.result(), http::status::ok) << file.path;
    EXPECT_EQ(answer.body(), file.content) << file.path;
    EXPECT_EQ(answer[http::field::content_type], std::string(file.type));
    EXPECT_EQ(answer["X-Content-Type-Options"], "nosniff");
    const auto head = ask(server.port(), std::string(file.path), "127.0.0.1", {}, http::verb::head);
    EXPECT_EQ(head.result(), http::status::ok);
    EXPECT_TRUE(head.body().empty());
  }
  EXPECT_EQ(ask(server.port(), "/?token=x", "[::1]:80").result(), http::status::ok);
}

TEST_F(ViewerServerTest, RefusesWhatItDoesNotServe) {
  EXPECT_EQ(ask(server.port(), "/etc/passwd", "localhost").result(), http::status::not_found);
  EXPECT_EQ(ask(server.port(), "/../../x", "localhost").result(), http::status::not_found);
  EXPECT_EQ(ask(server.port(), "/", "localhost", {}, http::verb::post).result(),
            http::status::method_not_allowed);
  EXPECT_EQ(Page(server.port(), "/other").refusal(), http::status::not_found);
}

TEST_F(ViewerServerTest, RefusesHostsThatAreNotThisMachine) {
  for (const char* name : {"example.com", "localhost.example.com", "10.0.0.1:80", "", "127.0.0.1.x",
                           "[::2]:80", "localhost@example.com"}) {
    EXPECT_EQ(ask(server.port(), "/", name).result(), http::status::forbidden) << name;
    EXPECT_FALSE(Page(server.port(), "/session", *name == 0 ? "example.com" : name).accepted());
  }
}

TEST_F(ViewerServerTest, RefusesPagesOfOtherOrigins) {
  for (const char* origin : {"http://example.com", "https://localhost:8642", "null",
                             "http://localhost", "http://localhost:86420", "localhost:8643"}) {
    Page page(server.port(), "/session", "localhost:8643", origin);
    EXPECT_FALSE(page.accepted()) << origin;
    EXPECT_EQ(page.refusal(), http::status::forbidden) << origin;
  }
  EXPECT_TRUE(
      Page(server.port(), "/session", "localhost:8643", "http://localhost:8643").accepted());
}

TEST_F(ViewerServerTest, TakesAFileFromTheOperatorsPageAlone) {
  const std::string content(100'000, 'x');
  const auto send = [&](const std::string& token, const std::string& origin = {}) {
    return send_file(server.port(), "/file?token=" + token + "&name=cup.ply", content, origin)
        .result();
  };
  EXPECT_EQ(send(""), http::status::unauthorized);
  EXPECT_EQ(send("of-somebody-else"), http::status::unauthorized);
  EXPECT_EQ(send("operator-123", "http://example.com"), http::status::forbidden);
  EXPECT_EQ(send_file(server.port(), "/other?token=operator-123", "x").result(),
            http::status::not_found);
  EXPECT_FALSE(std::filesystem::exists(host.folder() / "cup.ply"));

  EXPECT_EQ(send("operator-123"), http::status::ok);
  EXPECT_EQ(host.next_file(), "whole cup.ply");
  EXPECT_EQ(std::filesystem::file_size(host.folder() / "cup.ply"), content.size());

  const auto refused = send_file(server.port(), "/file?name=song.mp3&token=operator-123", "x");
  EXPECT_EQ(refused.result(), http::status::unprocessable_entity);
  EXPECT_EQ(refused.body().substr(0, 28), "song.mp3: cannot be opened");
}

TEST(ViewerServer, GivesTheSplatThatIsFeltToWhoMayLook) {
  FakeHost host;
  const ViewerServer server({"127.0.0.1", 0, "secret-123"}, host);
  const auto get = [&](const std::string& target, const std::string& origin = {}) {
    return ask(server.port(), target, "localhost", origin);
  };
  EXPECT_EQ(get("/splat?token=secret-123").result(), http::status::not_found) << "there is none";
  host.drawn.assign(100'000, {1.0F, 2.0F, 3.0F});
  EXPECT_EQ(get("/splat").result(), http::status::unauthorized);
  EXPECT_EQ(get("/splat?token=secret-124").result(), http::status::unauthorized);
  EXPECT_EQ(get("/splat?token=secret-123", "http://example.com").result(), http::status::forbidden);
  const auto given = get("/splat?token=secret-123");
  EXPECT_EQ(given.result(), http::status::ok);
  const std::string_view sent(reinterpret_cast<const char*>(host.drawn.data()),
                              host.drawn.size() * sizeof(host.drawn[0]));
  EXPECT_TRUE(given.body() == sent) << given.body().size() << " of " << sent.size();
  EXPECT_EQ(given["X-Content-Type-Options"], "nosniff");
}

TEST_F(ViewerServerTest, LetsGoOfAFileThatDoesNotArriveInFull) {
  const std::string target = "/file?token=operator-123&name=";
  send_file(server.port(), target + "half.ply", "half", {}, 1000);
  EXPECT_EQ(host.next_file(), "part of half.ply");
  EXPECT_EQ(send_file(server.port(), target + "next.ply", "next").result(), http::status::ok);
  EXPECT_EQ(host.next_file(), "whole next.ply");
}

TEST(ViewerServer, AsksForItsToken) {
  FakeHost host;
  const ViewerServer server({"127.0.0.1", 0, "secret-123"}, host);
  EXPECT_NE(server.url().find("/?token=secret-123"), std::string::npos);
  for (const char* target : {"/session", "/session?token=", "/session?token=secret-12",
                             "/session?token=secret-1234", "/session?xtoken=secret-123"}) {
    Page page(server.port(), target);
    EXPECT_FALSE(page.accepted()) << target;
    EXPECT_EQ(page.refusal(), http::status::unauthorized) << target;
  }
  EXPECT_TRUE(Page(server.port(), "/session?token=secret-123").accepted());
  EXPECT_TRUE(Page(server.port(), "/session?a=b&token=secret-123").accepted());
}

TEST(ViewerServer, TellsAPageThatAsksWithoutAnUpgradeWhyItWasRefused) {
  FakeHost host;
  const ViewerServer server({"127.0.0.1", 0, "secret-123"}, host);
  const auto answer = [&](const std::string& target) {
    return ask(server.port(), target, "localhost").result();
  };
  EXPECT_EQ(answer("/session"), http::status::unauthorized);
  EXPECT_EQ(answer("/session?token=secret-124"), http::status::unauthorized);
  EXPECT_EQ(answer("/session?token=secret-123"), http::status::not_found) << "that is not why";
  // To ask does not use up the link with which the program opens a browser.
  EXPECT_EQ(answer(target_of(server.opening_url())), http::status::not_found);
  EXPECT_EQ(Page(server.port(), target_of(server.opening_url())).until("hello")["role"],
            "operating");
}

TEST(ViewerServer, ListensBeyondThisMachineOnlyWithAToken) {
  FakeHost host;
  const auto open = [&](const ViewerOptions& options) {
    return [&host, options] { return ViewerServer(options, host).port(); };
  };
  EXPECT_TRUE(test::fails_saying(open({"0.0.0.0", 0, ""}), "--token"));
  EXPECT_TRUE(test::fails_saying(open({"0.0.0.0", 0, "short"}), "--token"));
  EXPECT_TRUE(test::fails_saying(open({"127.0.0.1", 0, "no spaces"}), "--token"));
  EXPECT_TRUE(test::fails_saying(open({"nowhere", 0, ""}), "--listen nowhere"));
  const ViewerServer server({"0.0.0.0", 0, make_token()}, host);
  EXPECT_EQ(ask(server.port(), "/", "lab.example.com").result(), http::status::ok);
  EXPECT_EQ(Page(server.port(), "/session", "lab.example.com").refusal(),
            http::status::unauthorized);
}

TEST_F(ViewerServerTest, SaysThatItsPortIsTaken) {
  const auto again = [&] { return ViewerServer({"127.0.0.1", server.port(), ""}, host).port(); };
  EXPECT_TRUE(test::fails_saying(again, "another program"));
}

// In a process of its own without root's rights, by which ports below 1024 are another's.
TEST(ViewerServer, SaysThatItsPortIsNotThisAccounts) {
  int first_free = 1024;
  std::ifstream("/proc/sys/net/ipv4/ip_unprivileged_port_start") >> first_free;
  if (first_free <= 80) GTEST_SKIP() << "on this machine port 80 is anybody's";
  constexpr uid_t nobody = 65534;
  constexpr int as_it_should = 42;
  FakeHost host;
  const pid_t child = fork();
  if (child == 0) {
    if (geteuid() == 0 && setresuid(nobody, nobody, nobody) != 0) _exit(2);
    const auto listens = [&] { return ViewerServer({.port = 80}, host).port(); };
    const auto said =
        test::fails_saying(listens, "--listen 127.0.0.1 --port 80",
                           "this account may not listen there", "a port from 1024 on, or --port 0");
    if (!said) std::fprintf(stderr, "%s\n", said.message());
    _exit(said ? as_it_should : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), as_it_should);
}

TEST(ViewerServer, MakesTokensThatDiffer) {
  EXPECT_EQ(make_token().size(), 32u);
  EXPECT_NE(make_token(), make_token());
}

TEST_F(ViewerServerTest, IntroducesItselfAndTellsOfTicks) {
  Page page(server.port());
  ASSERT_TRUE(page.accepted());
  EXPECT_EQ(page.until("hello")["version"], "test");
  EXPECT_EQ(page.until("state")["method"], "paper");
  const auto presence = page.until("presence");
  EXPECT_EQ(presence["hand"], "free");
  EXPECT_EQ(presence["viewers"], 1);
  const std::string first = page.until_kind(2);
  const std::string second = page.until_kind(2);
  ASSERT_EQ(first.size(), 160u);
  EXPECT_NE(first, second);
}

TEST_F(ViewerServerTest, ShowsTheNewestFrameToWhoeverJoins) {
  server.show(0, frame(7));
  server.show(0, frame(8));
  Page page(server.port());
  const std::string message = page.until_kind(1);
  EXPECT_EQ(message.size(), 96u + 2 * 640 * 480);
  EXPECT_EQ(number_of(message), 8u);
  server.show(200, frame(9));  // a camera that cannot be: nothing happens
}

TEST_F(ViewerServerTest, SendsRaysBeforeTheFrameThatNeedsThem) {
  server.show(2, rays_message(2, ViewingRays({.width = 2, .height = 1, .fx = 1, .fy = 1})));
  server.show(2, frame(0, 2));
  Page page(server.port());
  std::string kinds;
  while (kinds.find('\1') == std::string::npos) {
    const auto message = page.read();
    ASSERT_TRUE(message);
    if (!page.was_text()) kinds += message->front();
  }
  EXPECT_NE(kinds.find('\3'), std::string::npos);
}

TEST_F(ViewerServerTest, ShowsTheToolToWhoIsThereAndToWhoeverJoins) {
  Page first(server.port());
  first.until("presence");
  server.show(0, tool_message(make_tool("box:40x20x5mm?points=100", {}).get()));
  EXPECT_EQ(first.until_kind(5).size(), 12u + 12 * (8 + 12));
  Page second(server.port());
  EXPECT_EQ(second.until_kind(5).size(), 12u + 12 * (8 + 12));
}

TEST_F(ViewerServerTest, GivesASlowPageFewerFrames) {
  Page page(server.port());
  page.until("hello");
  server.show(0, frame(0));
  EXPECT_EQ(number_of(page.until_kind(1)), 0u);
  server.show(0, frame(1));
  EXPECT_EQ(number_of(page.until_kind(1)), 1u);
  // Two are on the page and not drawn: of these only the last will do.
  for (std::uint32_t number = 2; number < 50; ++number) server.show(0, frame(number));
  for (int i = 0; i < 5; ++i) {
    const auto message = page.read();
    ASSERT_TRUE(message);
    EXPECT_FALSE(!page.was_text() && message->front() == 1) << "a frame that was not asked for";
  }
  page.shown(0);
  EXPECT_EQ(number_of(page.until_kind(1)), 49u);
}

TEST_F(ViewerServerTest, GivesTheOneHandToWhoComesFirst) {
  Page first(server.port());
  Page second(server.port());
  first.move_hand(true, 0.1, 0.2, 0.3);
  EXPECT_EQ(host.hand_number(1), Vec3(0.1, 0.2, 0.3));
  while (first.until("presence")["hand"] != "you") {
  }
  while (second.until("presence")["hand"] != "other") {
  }
  second.move_hand(true, 9.0, 9.0, 9.0);
  second.move_hand(false, 0.0, 0.0, 0.0);  // nor may it let go what it does not hold
  EXPECT_NE(second.until("error").get<std::string>().find("another page"), std::string::npos);
  second.send_text(R"({"reset": true})");
  EXPECT_NE(second.until("error").get<std::string>().find("can reset it"), std::string::npos);
  EXPECT_EQ(host.hands(), 1u);
  first.move_hand(false, 0.0, 0.0, 0.0);
  EXPECT_FALSE(host.hand_number(2)) << "let go";
  while (second.until("presence")["hand"] != "free") {
  }
  second.move_hand(true, 0.4, 0.5, 0.6);
  EXPECT_EQ(host.hand_number(3), Vec3(0.4, 0.5, 0.6));
}

TEST_F(ViewerServerTest, SendsAHandThatIsLetGoToWhereItsPageSays) {
  Page first(server.port());
  Page second(server.port());
  first.move_hand(true, 0.1, 0.2, 0.3);
  EXPECT_TRUE(host.hand_number(1));
  second.send_hand(2, 9.0, 9.0, 9.0);  // it is not this page's
  second.move_hand(true, 9.0, 9.0, 9.0);
  EXPECT_FALSE(second.until("error").is_null());
  EXPECT_EQ(host.hands(), 1u);
  first.send_hand(2, 0.1, 0.2, 0.5);
  EXPECT_FALSE(host.hand_number(2)) << "let go";
  EXPECT_EQ(host.last_hand().target, Vec3(0.1, 0.2, 0.5));
  while (second.until("presence")["hand"] != "free") {
  }
  first.send_hand(2, 9.0, 9.0, 9.0);  // nor a hand that it no longer has
  first.move_hand(true, 0.4, 0.5, 0.6);
  EXPECT_EQ(host.hand_number(3), Vec3(0.4, 0.5, 0.6));
}

// Hazard: silent-page
TEST_F(ViewerServerTest, LetsTheHandGoWhenItsPageIsLost) {
  {
    Page page(server.port());
    page.move_hand(true, 0.1, 0.2, 0.3);
    EXPECT_TRUE(host.hand_number(1));
  }  // the socket closes without a word
  EXPECT_FALSE(host.hand_number(2));
}

// Hazard: silent-page
TEST_F(ViewerServerTest, LetsTheHandGoWhenItsPageFallsSilent) {
  Page page(server.port());
  page.move_hand(true, 0.1, 0.2, 0.3);
  EXPECT_TRUE(host.hand_number(1));
  EXPECT_FALSE(host.hand_number(2));
  while (page.until("presence")["hand"] != "free") {
  }
}

TEST_F(ViewerServerTest, PassesCommandsOnAndExplainsRefusals) {
  Page page(server.port(), as_operator);
  Page other(server.port());
  page.send_text(R"({"set": {"name": "stiffness", "value": -1}})");
  EXPECT_EQ(page.until("error"), "parameter 'stiffness': it is negative");
  EXPECT_EQ(host.commands(), 0);
  page.send_text(R"({"set": {"name": "stiffness", "value": 1}})");
  page.until("state");
  EXPECT_FALSE(other.until("state").is_null());
}

TEST_F(ViewerServerTest, EndsSessionsThatSendWhatIsNotUnderstood) {
  for (const char* text : {"hello", "{}", "{\"quit\":true}"}) {
    Page page(server.port());
    page.send_text(text);
    while (page.read()) {
    }
    EXPECT_EQ(page.close_code(), websocket::close_code::policy_error) << text;
  }
  Page page(server.port());
  page.send_binary(std::vector<std::byte>(31, std::byte{16}));
  while (page.read()) {
  }
  EXPECT_EQ(page.close_code(), websocket::close_code::policy_error);
  Page flood(server.port());
  flood.send_text(std::string(max_page_message + 1, ' '));
  while (flood.read()) {
  }
  EXPECT_EQ(flood.close_code(), websocket::close_code::too_big);
  EXPECT_TRUE(Page(server.port()).accepted()) << "others are not concerned";
}

TEST_F(ViewerServerTest, SurvivesBytesThatAreNotHttp) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> byte(0, 255);
  boost::asio::io_context context;
  for (int i = 0; i < 40; ++i) {
    auto socket = connect_to(context, server.port());
    std::string bytes = i % 2 == 0 ? "" : "GET /session HTTP/1.1\r\nHost: localhost\r\nUpgrade: ";
    for (int n = 0; n < 50 * i; ++n) bytes += static_cast<char>(byte(random));
    boost::system::error_code ignored;
    boost::asio::write(socket, boost::asio::buffer(bytes), ignored);
  }
  EXPECT_EQ(ask(server.port(), "/", "localhost").result(), http::status::ok);
}

TEST_F(ViewerServerTest, HasRoomForSixteenPages) {
  std::vector<std::unique_ptr<Page>> pages;
  for (int i = 0; i < 16; ++i) {
    pages.push_back(std::make_unique<Page>(server.port()));
    ASSERT_TRUE(pages.back()->accepted()) << i;
    EXPECT_EQ(pages.back()->until("presence")["viewers"], i + 1);
  }
  EXPECT_EQ(Page(server.port()).refusal(), http::status::service_unavailable);
}

// Pages that ask to come in at the same moment, before any of them is answered: how many came in.
int admitted_of(std::uint16_t port, FakeHost& host, int count, const std::string& target) {
  boost::asio::io_context context;
  std::vector<boost::asio::ip::tcp::socket> sockets;
  for (int i = 0; i < count; ++i) sockets.push_back(connect_to(context, port));
  ask(port, "/", "localhost");  // after that, all connections above have been accepted
  {
    const auto held = host.hold();
    for (auto& socket : sockets) http::write(socket, upgrade_request(target, "localhost"));
  }
  int admitted = 0;
  for (auto& socket : sockets) {
    http::response_parser<http::empty_body> parser;
    boost::beast::flat_buffer buffer;
    boost::system::error_code error;
    http::read_header(socket, buffer, parser, error);
    if (!error && parser.get().result() == http::status::switching_protocols) ++admitted;
  }
  return admitted;
}

TEST_F(ViewerServerTest, LetsInSixteenPagesOfSixtyThatComeAtOnce) {
  EXPECT_EQ(admitted_of(server.port(), host, 60, "/session"), 16);
}

TEST_F(ViewerServerTest, AnswersNewcomersWhileManyConnectionsSayNothing) {
  boost::asio::io_context context;
  std::vector<boost::asio::ip::tcp::socket> silent;
  for (int i = 0; i < 200; ++i) {
    silent.push_back(connect_to(context, server.port()));
    const std::string half = "GET / HTTP/1.1\r\nHost: loc";
    boost::system::error_code closed;
    if (i % 2 == 0) boost::asio::write(silent.back(), boost::asio::buffer(half), closed);
  }
  EXPECT_EQ(ask(server.port(), "/", "localhost").result(), http::status::ok);
  EXPECT_TRUE(Page(server.port()).accepted());
}

// Hazard: strangers-limits
TEST_F(ViewerServerTest, LetsALookingPageChangeNothing) {
  Page page(server.port());
  for (const char* text : {R"({"set": {"name": "stiffness", "value": 1}})",
                           R"({"set_safety": {"name": "max_device_force", "value": 50}})",
                           R"({"place": {"name": "scale", "value": 2}})", R"({"method": "paper"})",
                           R"({"record": true})", R"({"record": false})", R"({"reset": true})"})
    page.send_text(text);
  page.send_text("no message of the protocol: the session ends");
  while (page.read()) {
  }
  EXPECT_EQ(host.commands(), 0);
}

TEST_F(ViewerServerTest, TellsEachPageItsRoleAndTheRolesOfTheHand) {
  Page viewer(server.port());
  Page chief(server.port(), as_operator);
  EXPECT_EQ(viewer.until("hello")["role"], "looking");
  EXPECT_EQ(viewer.until("state")["role"], "looking");
  const auto hello = chief.until("hello");
  EXPECT_EQ(hello["role"], "operating");
  EXPECT_FALSE(hello.contains("operator_token"));
  viewer.move_hand(true, 0.1, 0.2, 0.3);
  while (viewer.until("state")["role"] != "holding") {
  }
  EXPECT_EQ(chief.until("state")["role"], "operating");
  viewer.move_hand(false, 0.0, 0.0, 0.0);
  while (viewer.until("state")["role"] != "looking") {
  }
}

TEST_F(ViewerServerTest, LetsThePageWithTheHandSetParametersAndNoMore) {
  Page page(server.port());
  page.send_text(R"({"set": {"name": "stiffness", "value": 1}})");
  EXPECT_NE(page.until("error").get<std::string>().find("viewing only"), std::string::npos);
  page.move_hand(true, 0.1, 0.2, 0.3);
  page.send_text(R"({"method": "paper"})");
  EXPECT_NE(page.until("error").get<std::string>().find("operator"), std::string::npos);
  EXPECT_EQ(host.commands(), 0);
  page.send_text(R"({"set": {"name": "stiffness", "value": 1}})");
  page.send_text(R"({"reset": true})");
  page.send_text(R"({"record": false})");
  EXPECT_FALSE(page.until("error").is_null());
  EXPECT_EQ(host.commands(), 2);
}

TEST_F(ViewerServerTest, LeavesTheHandToItsPageWhateverTheOperatorResets) {
  Page page(server.port());
  Page chief(server.port(), as_operator);
  page.move_hand(true, 0.1, 0.2, 0.3);
  while (chief.until("presence")["hand"] != "other") {
  }
  chief.send_text(R"({"reset": true})");
  EXPECT_NE(chief.until("error").get<std::string>().find("another page"), std::string::npos);
  page.move_hand(false, 0.0, 0.0, 0.0);
  while (chief.until("presence")["hand"] != "free") {
  }
  chief.send_text(R"({"reset": true})");
  chief.send_text(R"({"set": {"name": "stiffness", "value": -1}})");
  EXPECT_FALSE(chief.until("error").is_null());
  EXPECT_EQ(host.commands(), 1);
}

TEST_F(ViewerServerTest, GivesNoPageTheHandOfADeviceThatPagesDoNotMove) {
  host.have_another_device();
  Page page(server.port());
  page.move_hand(true, 0.1, 0.2, 0.3);
  EXPECT_NE(page.until("error").get<std::string>().find("device"), std::string::npos);
  page.send_text(R"({"set": {"name": "stiffness", "value": 1}})");
  EXPECT_NE(page.until("error").get<std::string>().find("viewing only"), std::string::npos);
  EXPECT_EQ(host.hands(), 0u);
  EXPECT_EQ(host.commands(), 0);
}

TEST_F(ViewerServerTest, LetsALeftOverPageLookOn) {
  Page page(server.port(), "/session?token=of-an-earlier-session");
  const auto hello = page.until("hello");
  EXPECT_EQ(hello["role"], "looking");
  EXPECT_EQ(hello["token"], "unknown");
  EXPECT_FALSE(Page(server.port()).until("hello").contains("token"));
}

TEST_F(ViewerServerTest, OpensTheOperatorsPageOnceWithoutItsToken) {
  const std::string target = target_of(server.opening_url());
  EXPECT_EQ(server.opening_url().find("operator-123"), std::string::npos);
  Page first(server.port(), target);
  const auto hello = first.until("hello");
  EXPECT_EQ(hello["role"], "operating");
  EXPECT_EQ(hello["operator_token"], "operator-123");
  EXPECT_EQ(Page(server.port(), target).until("hello")["role"], "looking");
}

TEST(ViewerServer, MakesAnOperatorTokenAndAsksForItOnLoopback) {
  FakeHost host;
  const ViewerServer server({}, host);
  EXPECT_EQ(server.url().find("token"), std::string::npos);
  Page page(server.port(), target_of(server.operator_url()));
  EXPECT_EQ(page.until("hello")["role"], "operating");
  const auto open = [&](const std::string& token, const std::string& operator_token) {
    return [&host, token, operator_token] {
      return ViewerServer({.token = token, .operator_token = operator_token}, host).port();
    };
  };
  EXPECT_TRUE(test::fails_saying(open("", "short"), "--operator-token", "8 characters"));
  EXPECT_TRUE(test::fails_saying(open("", "no spaces"), "--operator-token"));
  EXPECT_TRUE(test::fails_saying(open("same-token", "same-token"), "--operator-token", "--token"));
}

TEST_F(ViewerServerTest, RefusesEvenTheRightTokenAfterManyWrongOnes) {
  Page before(server.port(), as_operator);
  bool refused = false;
  // Pauses grow: however slow the machine, one of them lasts longer than a request.
  for (int i = 0; i < 100 && !refused; ++i) {
    const std::string wrong = "/session?token=operator-" + std::to_string(1000 + i);
    const auto status = [&](const std::string& target) {
      return ask(server.port(), target, "localhost", {}, http::verb::get, true).result();
    };
    const http::status answer = status(wrong);
    EXPECT_TRUE(i >= 8 || answer == http::status::switching_protocols) << i;
    refused = status(as_operator) == http::status::too_many_requests;
    EXPECT_TRUE(i >= 8 || !refused) << i;
  }
  EXPECT_TRUE(refused);
  EXPECT_TRUE(Page(server.port()).accepted()) << "who gives no token guesses none";
  before.send_text(R"({"set": {"name": "stiffness", "value": 1}})");
  EXPECT_FALSE(before.until("state").is_null()) << "who is in stays in";
}

TEST_F(ViewerServerTest, KeepsPlacesForTheOperator) {
  std::vector<std::unique_ptr<Page>> pages;
  for (int i = 0; i < 16; ++i) {
    pages.push_back(std::make_unique<Page>(server.port()));
    ASSERT_TRUE(pages.back()->accepted()) << i;
  }
  EXPECT_EQ(Page(server.port()).refusal(), http::status::service_unavailable);
  EXPECT_TRUE(Page(server.port(), as_operator).accepted());
  EXPECT_EQ(admitted_of(server.port(), host, 20, as_operator), 4);
}

TEST_F(ViewerServerTest, GivesThePlaceOfAPageThatHasGoneToTheNext) {
  for (int i = 0; i < 50; ++i) {
    Page page(server.port());
    ASSERT_TRUE(page.accepted()) << i;
    page.send_text("no message of the protocol: the session ends");
    while (page.read()) {
    }
  }
}

TEST(ViewerServer, ClosesAConnectionWhoseRequestDoesNotCome) {
  FakeHost host;
  const ViewerServer server({.request_timeout = 0.2}, host);
  boost::asio::io_context context;
  auto socket = connect_to(context, server.port());
  boost::asio::write(socket, boost::asio::buffer(std::string("GET / HTTP/1.1\r\nHost: loc")));
  char byte = 0;
  boost::system::error_code error;
  socket.read_some(boost::asio::buffer(&byte, 1), error);
  EXPECT_TRUE(error == boost::asio::error::eof || error == boost::asio::error::connection_reset)
      << error.message();
}

}  // namespace test_server
}  // namespace palpate
