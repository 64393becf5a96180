// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/net/viewer/protocol.hpp"
#include "palpate/net/viewer/server.hpp"
#include "palpate/session/observer_recordings.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// Files that the operator's page sends to be touched: in a temporary folder that only this account
/// can read, gone with this object. Used on one thread at a time.
class DroppedFiles {
 public:
  static constexpr std::uint64_t usual_limit = 1'000'000'000;  ///< [bytes]
  static constexpr std::size_t longest_name = 100;             ///< [characters]
  /// Of the folder's name, in the system's folder of temporary files.
  static constexpr const char* folder_prefix = "palpate-dropped-";

  /// @param limit  [bytes] of all that is sent while this object lives
  explicit DroppedFiles(std::uint64_t limit = usual_limit) : limit_(limit) {}
  ~DroppedFiles();
  DroppedFiles(const DroppedFiles&) = delete;
  DroppedFiles& operator=(const DroppedFiles&) = delete;

  [[nodiscard]] std::uint64_t limit() const { return limit_; }
  /// Where a file of that name and size goes, which does not exist yet.
  /// @param size  [bytes]
  /// @throws Error for a name that is not of letters, digits, '.', '-' and '_' alone, a kind that
  ///         cannot be touched, no room under the limit or on the disk.
  std::filesystem::path begin(const std::string& name, std::uint64_t size);
  /// The file did not arrive in full: removes it, and does not count it.
  void abandon(const std::filesystem::path& file);

 private:
  struct File {
    std::filesystem::path path;
    std::uint64_t size;
  };

  std::uint64_t limit_;
  std::filesystem::path folder_;  // empty: not made yet
  std::vector<File> files_;
  unsigned count_ = 0;
};

/// What the operator's page can choose to touch.
struct SceneChoice {
  std::string uri;
  std::string meaning;
  std::string group = {};  ///< of its like, as a heading; empty: none
};

/// A robot that is led, for pages to draw.
struct RobotPicture {
  std::string name;
  std::optional<Vec3> tool = {};  ///< [m] world; none: it has not been heard yet
  std::vector<Vec3> links = {};   ///< [m] world: the arm as a line from base to tip
  Vec3 force = Vec3::Zero();      ///< [N] world: of what it touches, on the tool
  double radius = 0.005;          ///< [m] of the tool
  double age = 0.0;               ///< [s] since it said so
  double latency = 0.0;           ///< [s] of what is felt; 0: not known
  bool led = false;               ///< a hand leads it
  std::string trouble = {};       ///< why it does not move; empty: nothing is wrong
};

/// What a session's options say about its pages.
struct PageRules {
  /// By name, the loosest values to which the operator's page may set safety limits.
  std::map<std::string, double> operator_limits = {};
  RecordingRules recordings = {};
  std::vector<SceneChoice> scenes = {};
  /// Called with the URI of one of these, which is to be touched: this session is to end, and one
  /// with that camera to begin. On the server's thread; must be quick. Empty: no scene is chosen.
  std::function<void(const std::string& uri)> open_scene = {};
  /// Where files go that the operator's page sends to be touched; null: it sends none.
  std::shared_ptr<DroppedFiles> files = {};
  /// The robot that the hand leads; empty: there is none. The server's thread.
  std::function<std::optional<RobotPicture>()> robot = {};
  std::string notice = {};  ///< what pages are told when they join; empty: nothing
};

/// A session as pages see it: an observer that reads its ticks and frames and sends settings back.
///
/// Made before the session, whose frames it shows; then `attach`, then the server, then `show_on`;
/// at the end `detach`, after the server and before the session.
class SessionHost final : public ViewerHost {
 public:
  /// @param version  of the program, for pages
  explicit SessionHost(std::string version, PageRules rules = {})
      : version_(std::move(version)), rules_(std::move(rules)) {}

  /// Before there is a server. @param session  must outlive the server, and be there until `detach`
  /// @throws Error if the rules name no limit.
  void attach(Session& session);
  /// After the server. May be left out if no recording was ever started.
  void detach() { recordings_.reset(); }
  /// @param server  shows the frames from now on, and the hands that were recorded with them; null:
  ///                nobody does, before the server goes
  void show_on(ViewerServer* server);
  /// A camera's frame, as SessionOptions::on_frame: to all pages. Any camera's thread.
  void show(std::size_t camera, const FedFrame& frame);

  nlohmann::json hello() override;
  nlohmann::json state() override;
  nlohmann::json robot() override;
  nlohmann::json more_hands() override;
  std::optional<TickBatch> ticks() override;
  bool takes_hand() override { return mouse_ != nullptr; }
  void hand(const HandMessage& hand) override;
  void command(const Command& command, Role role) override;
  std::vector<Body::DrawnGaussian> gaussians() override;
  std::filesystem::path begin_file(const std::string& name, std::uint64_t size) override;
  void end_file(const std::filesystem::path& file, bool whole) override;

  /// Ends a page's recording that has reached a limit, where nobody else looks (RecordingRules).
  void look_at_recordings() {
    if (recordings_) recordings_->look();
  }
  /// Why the last recording of a page was ended by its limits; empty if it was not.
  [[nodiscard]] std::string recording_ended() const {
    return recordings_ ? recordings_->ended() : std::string();
  }

 private:
  [[nodiscard]] std::vector<std::string> paintable() const;
  void show_tool(const std::shared_ptr<const ToolShape>& tool);
  [[nodiscard]] std::string recorded_scene(const RecordingState& recording) const;
  [[nodiscard]] nlohmann::json recording_json(const RecordingState& recording) const;
  void look_at_points(const std::string& uri);
  void rescale(double times);
  void paint(const ServoTick& record, double contact_radius);

  std::string version_;
  PageRules rules_;
  std::optional<LimitBounds> bounds_;
  std::unique_ptr<ObserverRecordings> recordings_;
  Session* session_ = nullptr;
  std::atomic<ViewerServer*> server_{nullptr};
  std::array<std::uint32_t, Patch::max_views> numbers_{};  // of each camera's own frames
  MouseDevice* mouse_ = nullptr;
  Vec3 start_ = Vec3::Zero();                    // [m, device] where the mouse's hand began
  Vec3 target_ = Vec3::Zero();                   // [m, device] where it was sent last
  std::optional<Eigen::Quaterniond> turn_;       // device_from_handle, likewise
  std::shared_ptr<const ToolShape> first_tool_;  // of the session, as it began; null: a ball
  std::shared_ptr<const ToolShape> tool_;        // that pages show
  void forbid(const Forbid& wanted);
  void guide(const Guide& wanted);
  // Gives the session one more, which it names.
  void add_fixture(Fixture fixture, const std::string& name);
  void remove_fixture(const std::string& name);
  void follow(const Tick& tick, const Vec3& foot);

  std::optional<Vec3> touched_;    // [m] where the hand touched last
  std::vector<Vec3> stroke_;       // [m] along the surface, in the last contact
  double stroke_spacing_ = 0.0;    // [m] between its places
  bool stroke_is_over_ = true;     // the next contact begins another
  std::optional<SetBrush> brush_;  // what is touched is painted with; none: it is not
  std::optional<Vec3> dabbed_;     // [m] where the last dab was
  std::string brush_trouble_;      // why it does not paint
  // Of the first camera, if it shows points without an image, once it has shown some.
  std::optional<ProposedTouch> proposed_;
  std::string rescaled_uri_;  // of the same scene as long as is proposed; empty: nobody is asked
  std::optional<TickRing<ServoTick>::Reader> reader_;
  std::optional<TickBatcher> batcher_;
  // A hand beside the first.
  struct Other {
    TickRing<ServoTick>::Reader reader;
    ServoTick newest = {};
  };
  std::vector<Other> others_;
};

}  // namespace palpate
