// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "palpate/io/devices/hip_path.hpp"

namespace palpate {
class SyntheticCamera;
}

namespace palpate::lab {

/// One measured number. docs/feel.md says what each is.
struct FeelFigure {
  std::string method;
  std::string_view loop;  ///< who touches, and by which way: `path`, `light`, `firm`, `chain`, ...
  std::string measure;
  double value = 0.0;
};
using FeelFigures = std::vector<FeelFigure>;

/// How a scene is played.
struct FeelOptions {
  std::vector<OwnMethod> contestants;
  Parameters parameters;
  std::uint64_t seed = 1;
  int repeats = 4;  ///< with other noise
  int phases = 8;   ///< of the frames, in which a motion begins

  /// Of the noise of repeat `k`.
  [[nodiscard]] std::uint64_t seed_of(int k) const {
    return 10 * seed + 1 + static_cast<std::uint64_t>(k);
  }
};

/// Options of a synthetic camera that looks at the origin at 34 degrees off straight down, with the
/// pixels of 640 across 57 degrees but only those that see `across` [m] about it.
/// @param distance  [m]
std::string camera_options(double distance, double across, std::string_view sensor,
                           std::uint64_t seed);
/// A synthetic camera with such options before a scene.
std::shared_ptr<SyntheticCamera> camera_before(const Scene& scene, const std::string& options);

/// What a camera shows, and the truth about it.
struct FeelStage {
  explicit FeelStage(const std::string& uri);  ///< of a synthetic camera
  FeelStage(const std::shared_ptr<const Scene>& scene, const std::string& options);
  /// @param duration  [s]  @return to be played while this lives
  [[nodiscard]] Scenario scenario(double duration) const;

  std::shared_ptr<SyntheticCamera> camera;
  std::shared_ptr<const Scene> scene;
};

/// What repeats come to: measures of each method in each loop.
class FeelRepeats {
 public:
  /// @param name  method and loop
  void add(const std::pair<std::string, std::string_view>& name, std::string_view measure,
           double value);

  struct Figure {
    std::string_view measure;                      ///< as it was added
    double (*of)(std::span<const double> values);  ///< what stands for all repeats
    std::string_view as = {};                      ///< its name among the figures, if it is another
  };
  /// @param asked  in the order of the figures
  [[nodiscard]] FeelFigures figures(const std::vector<Figure>& asked) const;

 private:
  struct Entry {
    std::pair<std::string, std::string_view> name;
    std::string_view measure;
    std::vector<double> values;
  };
  std::vector<Entry> entries_;
};

/// A hand that comes down and goes along x at 0.1 m/s from 1 s to 3 s, 8 mm deep in a plane.
HipPath sliding_hand();

/// Along a resting plane at 0.1 m/s before a D4xx. @param distance  [m] from the camera
FeelFigures play_slide(const FeelOptions& options, double distance);
/// A plane begins to come at 0.05 m/s before an exact camera.
FeelFigures play_onset(const FeelOptions& options);
/// The force comes back after a surface was not seen.
enum class Unseen { covered, stopped, dropped };
FeelFigures play_return(const FeelOptions& options, Unseen why);
/// A resting plane before a D4xx with k_d = 2 N s/m. @param distance  [m] from the camera
FeelFigures play_rest(const FeelOptions& options, double distance);
/// A resting plane before a D4xx of one frame rate, at several latencies. @param rate  [Hz]
FeelFigures play_rate(const FeelOptions& options, double rate);

/// Along a resting plane at 0.1 m/s before a D4xx at 0.7 m, with friction of several coefficients.
FeelFigures play_rub(const FeelOptions& options);
/// A lightly held handle that is drawn along a plane before a D4xx at 0.7 m with half of what its
/// friction holds. @param stroke  [m] by which the plane bobs, at 1 Hz; 0: it rests
FeelFigures play_stick(const FeelOptions& options, double stroke);

/// Hands that press on a resting plane and come off again: the energy that each contact gives them,
/// beside what it is on an exact surface; and what the chain adds there.
/// @param distance  [m] from the camera  @param sensor  its, as of a synthetic camera
FeelFigures play_energy(const FeelOptions& options, double distance, const std::string& sensor);

}  // namespace palpate::lab
