// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

#include "tests/support/depth_pngs.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_depth_recording {

using test::fails_saying;
using test::TemporaryFolder;

constexpr const char* small_camera =
    R"({"width": 4, "height": 3, "fx": 2, "fy": 2, "cx": 1.5, "cy": 1,
        "depth_units_per_metre": 1000})";

// An image whose every pixel measured `raw`.
void write_flat(const std::filesystem::path& file, std::uint16_t raw, int width = 4,
                int height = 3) {
  const auto size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  test::write_depth_png(file, width, height, std::vector<std::uint16_t>(size, raw));
}

const DepthImage& image_of(const std::optional<Frame>& frame) {
  return dynamic_cast<const DepthImage&>(*frame.value().cloud);
}

// Images 0, 1 and 2, with depths of 1000, 1001 and 1002 units, listed at 100.0, 100.5 and 101.0 s;
// the camera moves along x by 1 m/s from 0 at 99.9 s on, not turned.
class TumFolder : public TemporaryFolder {
 public:
  TumFolder() {
    write("intrinsics.json", small_camera);
    write("depth.txt", "# stamp file\n100.0 0.png\n100.5 1.png\n101.0 2.png\n");
    std::string poses;
    for (int i = 0; i <= 12; ++i) {
      poses += std::to_string(99.9 + 0.1 * i) + " " + std::to_string(0.1 * i) + " 0 0 0 0 0 1\n";
    }
    write("groundtruth.txt", poses);
    for (int i = 0; i < 3; ++i) {
      write_flat(path() / (std::to_string(i) + ".png"), static_cast<std::uint16_t>(1000 + i));
    }
  }
  [[nodiscard]] std::unique_ptr<Source> open(const std::string& options = {}) const {
    return open_source("tum:" + path().string() + "?" + options);
  }
};

TEST(TumRecording, GivesFramesPlacedByTheTrajectoryWithStampsFromTheFirst) {
  const TumFolder folder;
  const auto source = folder.open();
  EXPECT_EQ(source->info().frames, 3u);
  EXPECT_DOUBLE_EQ(*source->info().frame_rate, 2.0);
  EXPECT_EQ(source->info().start_time, 100.0);
  EXPECT_TRUE(source->info().notes.empty());
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_DOUBLE_EQ(frame->stamp, 0.5 * i);
    const DepthImage& image = image_of(frame);
    EXPECT_NEAR(image.world_from_camera().translation().x(), 0.1 + 0.5 * i, 1e-9);
    EXPECT_EQ(image.depth().front(), 1000 + i);
    // Pixel (3, 1) looks along (0.75, 0, 1).
    const auto point = image.deproject(3, 1);
    ASSERT_TRUE(point);
    const double depth = 1.0 + 0.001 * i;
    EXPECT_TRUE(point->isApprox(Vec3(0.1 + 0.5 * i + 0.75 * depth, 0.0, depth), 1e-9));
  }
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->next());
}

TEST(TumRecording, KeepsToTheCamerasFrameAndTheFilesClockOnRequest) {
  const TumFolder folder;
  std::filesystem::remove(folder.path() / "groundtruth.txt");
  EXPECT_TRUE(fails_saying([&] { return folder.open(); }, "no groundtruth.txt", "poses=none"));
  const auto source = folder.open("poses=none&stamps=absolute");
  EXPECT_EQ(source->info().start_time, 0.0);
  const auto frame = source->next();
  EXPECT_EQ(frame->stamp, 100.0);
  EXPECT_TRUE(image_of(frame).world_from_camera().matrix().isIdentity());
}

TEST(TumRecording, CorrectsTheClockOfItsPosesOnRequest) {
  const TumFolder folder;
  const auto source = folder.open("pose_delay=-50ms&start=1");
  EXPECT_NEAR(image_of(source->next()).world_from_camera().translation().x(), 0.55, 1e-9);
  EXPECT_TRUE(fails_saying([&] { return folder.open("poses=none&pose_delay=1ms"); },
                           "'pose_delay' has no trajectory", "poses=FILE"));
  EXPECT_TRUE(fails_saying([&] { return folder.open("pose_delay=2s"); }, "'pose_delay'"));
}

TEST(TumRecording, StartsLateAndEndsEarlyOnRequest) {
  const TumFolder folder;
  const auto source = folder.open("start=1&frames=1");
  EXPECT_EQ(source->info().frames, 1u);
  EXPECT_EQ(source->info().start_time, 100.5);
  const auto frame = source->next();
  EXPECT_EQ(frame->stamp, 0.0);
  EXPECT_EQ(image_of(frame).depth().front(), 1001);
  EXPECT_FALSE(source->next());
  EXPECT_TRUE(fails_saying([&] { return folder.open("start=3"); }, "none remains"));
  EXPECT_TRUE(fails_saying([&] { return folder.open("frames=0"); }, "'frames'"));
  EXPECT_TRUE(fails_saying([&] { return folder.open("start=0.5"); }, "not a whole number"));
}

TEST(TumRecording, LeavesOutFramesWithoutAPoseAndSaysSo) {
  const TumFolder folder;
  folder.write("late.txt", "100.49 0 0 0 0 0 0 1\n100.6 0 0 0 0 0 0 1\n100.99 0 0 0 0 0 0 1\n");
  const auto source = folder.open("poses=late.txt");
  EXPECT_EQ(source->info().frames, 2u);
  EXPECT_EQ(source->info().start_time, 100.5);
  ASSERT_EQ(source->info().notes.size(), 1u);
  EXPECT_EQ(source->info().notes[0].find("1 of 3 frames are dropped"), 0u);
  EXPECT_EQ(image_of(source->next()).depth().front(), 1001);
  folder.write("other.txt", "5 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(fails_saying([&] { return folder.open("poses=other.txt"); }, "no frame has a pose"));
}

TEST(TumRecording, HasTheFreiburgCameraUnlessToldOtherwise) {
  const TumFolder folder;
  std::filesystem::remove(folder.path() / "intrinsics.json");
  write_flat(folder.path() / "0.png", 5000, 640, 480);
  const auto standard = folder.open()->next();
  EXPECT_EQ(
      image_of(standard).intrinsics(),
      (Intrinsics{.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5}));
  EXPECT_EQ(image_of(standard).units_per_metre(), 5000.0);
  const auto given = folder.open("fx=1&fy=2&cx=3&cy=4&units=1000&k1=0.01&p2=0.001")->next();
  EXPECT_EQ(image_of(given).intrinsics(), (Intrinsics{.width = 640,
                                                      .height = 480,
                                                      .fx = 1,
                                                      .fy = 2,
                                                      .cx = 3,
                                                      .cy = 4,
                                                      .distortion = {0.01, 0.0, 0.0, 0.001}}));
  EXPECT_EQ(image_of(given).units_per_metre(), 1000.0);
}

TEST(TumRecording, GivesEachFrameTheVisibleImageNextToItInTime) {
  const TumFolder folder;
  std::filesystem::create_directory(folder.path() / "rgb");
  const auto grey = [](char value) {
    std::string samples;
    for (int v = 0; v < 3; ++v) samples += std::string(1, '\0') + std::string(4, value);
    return test::png_of(4, 3, 8, test::grey, samples);
  };
  folder.write("rgb/a.png", grey(10));
  folder.write("rgb/b.png", grey(20));
  folder.write("rgb.txt",
               "99.985 rgb/a.png\n100.008 rgb/b.png\n100.53 rgb/a.png\n101.02 rgb/a.png\n");
  EXPECT_TRUE(image_of(folder.open()->next()).brightness().empty()) << "unless it is asked for";
  const auto source = folder.open("brightness=rgb.txt&colour=none");
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_EQ(source->info().notes[0].substr(0, 37), "1 of 3 frames have no brightness: rgb");
  EXPECT_EQ(image_of(source->next()).brightness(), std::vector<std::uint8_t>(12, 20));
  EXPECT_TRUE(image_of(source->next()).brightness().empty());
  EXPECT_EQ(image_of(source->next()).brightness(), std::vector<std::uint8_t>(12, 10));
  folder.write("rgb/b.png", test::png_of(1, 1, 8, test::grey, std::string(2, '\0')));
  EXPECT_TRUE(
      fails_saying([&] { return folder.open("brightness=rgb.txt")->next(); }, "b.png", "1x1"));
  EXPECT_TRUE(fails_saying([&] { return folder.open("brightness=grey.txt"); }, "grey.txt"));
}

TEST(TumRecording, GivesEachFrameTheColoursNextToItInTime) {
  const TumFolder folder;
  std::string samples;
  for (int v = 0; v < 3; ++v) {
    samples += '\0';
    for (int u = 0; u < 4; ++u)
      samples += {static_cast<char>(u), static_cast<char>(v), static_cast<char>(200)};
  }
  EXPECT_TRUE(folder.open()->info().notes.empty());
  folder.write("seen.png", test::png_of(4, 3, 8, test::rgb, samples));
  folder.write("rgb.txt", "100.008 seen.png\n101.02 seen.png\n");
  EXPECT_EQ(folder.open("colour=none")->next()->colour, nullptr);
  const auto source = folder.open();
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_EQ(source->info().notes[0].substr(0, 33), "1 of 3 frames have no colour: rgb");
  const auto frame = source->next();
  ASSERT_NE(frame->colour, nullptr);
  EXPECT_EQ(frame->colour->width, 4);
  EXPECT_EQ(frame->colour->height, 3);
  EXPECT_FALSE(frame->colour->camera) << "registered to the depth";
  const std::vector<std::uint8_t> pixel(frame->colour->rgb.begin() + 3 * (4 * 2 + 3),
                                        frame->colour->rgb.begin() + 3 * (4 * 2 + 4));
  EXPECT_EQ(pixel, (std::vector<std::uint8_t>{3, 2, 200}));
  EXPECT_TRUE(image_of(frame).brightness().empty());
  EXPECT_EQ(source->next()->colour, nullptr);
  EXPECT_NE(source->next()->colour, nullptr);
  folder.write("seen.png", test::png_of(1, 1, 8, test::grey, std::string(2, '\0')));
  EXPECT_TRUE(
      fails_saying([&] { return folder.open("colour=rgb.txt")->next(); }, "seen.png", "1x1"));
  // Who did not ask for colour touches without it.
  const auto plain = folder.open();
  for (int k = 0; k < 3; ++k) {
    const auto without = plain->next();
    ASSERT_TRUE(without);
    EXPECT_EQ(without->colour, nullptr);
  }
  ASSERT_EQ(plain->info().notes.size(), 2U);
  EXPECT_EQ(plain->info().notes[1].substr(0, 19), "colour is skipped: ");
  EXPECT_NE(plain->info().notes[1].find("1x1"), std::string::npos);
  folder.write("rgb.txt", "no number\n");
  EXPECT_TRUE(folder.open()->next());
  EXPECT_TRUE(fails_saying([&] { return folder.open("colour=no.txt"); }, "no.txt", "colour="));
}

TEST(TumRecording, LeavesOutImagesWithoutReadingThem) {
  const TumFolder folder;
  folder.write("0.png", "damaged");
  const auto source = folder.open();
  EXPECT_EQ(source->skip(1), 1U);
  EXPECT_EQ(image_of(source->next()).depth().front(), 1001);
  EXPECT_EQ(source->skip(5), 1U);
  EXPECT_FALSE(source->next());
}

TEST(TumRecording, GoesOnAfterAnImageThatCannotBeUsed) {
  const TumFolder folder;
  const std::string good = test::png_of(1, 1, 16, test::grey, std::string(3, '\0'));
  const auto reads = [&](const char* saying) {
    const auto source = folder.open();
    EXPECT_TRUE(source->next());
    EXPECT_TRUE(fails_saying([&] { return source->next(); }, "1.png", saying));
    const auto last = source->next();
    EXPECT_TRUE(last);
    EXPECT_EQ(image_of(last).depth().front(), 1002);
    EXPECT_FALSE(source->next());
  };
  folder.write("1.png", "");
  reads("is empty");
  folder.write("1.png", good.substr(0, good.size() - 20));
  reads("damaged");
  folder.write("1.png", good);
  reads("1x1 pixels, but the camera has 4x3");
  folder.write("1.png", test::png_of(4, 3, 8, test::grey, std::string(15, '\0')));
  reads("8-bit grey");
  std::filesystem::remove(folder.path() / "1.png");
  reads("no such file");
}

TEST(TumRecording, NamesWhatIsWrongWithTheFolder) {
  const TumFolder folder;
  const auto fails = [&](const std::string& options, const char* saying) {
    return fails_saying([&] { return folder.open(options); }, folder.path().string(), saying);
  };
  EXPECT_TRUE(fails("posez=none", "did you mean 'poses'"));
  EXPECT_TRUE(fails("stamps=unix", "relative or absolute"));
  EXPECT_TRUE(fails("fx=0", "'fx'"));
  EXPECT_TRUE(fails("fx=-525", "'fx'"));
  EXPECT_TRUE(fails("units=0", "'units'"));
  EXPECT_TRUE(fails("poses=missing.txt", "has no missing.txt"));
  folder.write("depth.txt", "100.0 0.png\n99.0 1.png\n");
  EXPECT_TRUE(fails("", "depth.txt:2: the timestamp goes backwards"));
  folder.write("intrinsics.json", "{}");
  EXPECT_TRUE(fails("", "has no 'width'"));
  std::filesystem::remove(folder.path() / "depth.txt");
  EXPECT_TRUE(fails("", "has no depth.txt"));
  EXPECT_TRUE(fails_saying([] { return open_source("tum:/no/such/folder"); }, "is not a folder"));
  EXPECT_TRUE(fails_saying([] { return open_source("tum:"); }, "names no folder"));
}

TEST(DepthFolder, GivesImagesInNaturalOrderAtTheGivenRate) {
  const TemporaryFolder folder;
  folder.write("intrinsics.json", small_camera);
  std::filesystem::create_directory(folder.path() / "depth");
  for (const int i : {10, 9, 1}) {
    write_flat(folder.path() / "depth" / ("frame_" + std::to_string(i) + ".PNG"),
               static_cast<std::uint16_t>(i));
  }
  folder.write("depth/notes.txt", "no image");
  const auto read = [&](const std::string& uri, double rate) {
    const auto source = open_source(uri);
    EXPECT_EQ(source->info().frames, 3u);
    EXPECT_EQ(source->info().frame_rate, rate);
    for (int k = 0; k < 3; ++k) {
      const auto frame = source->next();
      EXPECT_DOUBLE_EQ(frame.value().stamp, k / rate);
      EXPECT_EQ(image_of(frame).depth().front(), std::vector({1, 9, 10})[k]);
      EXPECT_TRUE(image_of(frame).world_from_camera().matrix().isIdentity());
    }
    EXPECT_FALSE(source->next());
  };
  const std::string uri = "depth:" + folder.path().string();
  read(uri, 30.0);
  read(uri + "/depth", 30.0);
  read(uri + "?fps=10hz", 10.0);
  folder.write("intrinsics.json", R"({"fps_nominal": 15,)" + std::string(small_camera + 1));
  read(uri, 15.0);
}

TEST(DepthFolder, TakesRecordedNoValuesForHoles) {
  const TemporaryFolder folder;
  folder.write("intrinsics.json",
               R"({"invalid_value": 7, "saturated_value": 9,)" + std::string(small_camera + 1));
  test::write_depth_png(folder.path() / "0.png", 4, 3,
                        std::vector<std::uint16_t>{0, 7, 9, 65535, 8, 8, 8, 8, 8, 8, 8, 8});
  const auto frame = open_source("depth:" + folder.path().string())->next();
  EXPECT_EQ(image_of(frame).points().size(), 8u);
  EXPECT_FALSE(image_of(frame).deproject(1, 0));
  EXPECT_FALSE(image_of(frame).deproject(2, 0));
}

TEST(DepthFolder, IsPlacedByAFileOfPoses) {
  const TemporaryFolder folder;
  folder.write("intrinsics.json", small_camera);
  for (const char* name : {"0.png", "1.png"}) write_flat(folder.path() / name, 1000);
  const std::string uri = "depth:" + folder.path().string() + "?poses=";
  const auto x_of_second = [&](const std::string& options) {
    const auto source = open_source(uri + options);
    source->next();
    return image_of(source->next()).world_from_camera().translation().x();
  };
  folder.write("poses.json",
               R"({"world_from_camera": [[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],
                                         [[1,0,0,5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]})");
  EXPECT_EQ(x_of_second("poses.json"), 5.0);
  EXPECT_EQ(image_of(open_source(uri + "poses.json&start=1")->next())
                .world_from_camera()
                .translation()
                .x(),
            5.0);
  folder.write("poses.txt", "0 0 0 0 0 0 0 1\n0.2 4 0 0 0 0 0 1\n");
  EXPECT_NEAR(x_of_second("poses.txt&fps=10"), 2.0, 1e-12);

  folder.write("poses.json", R"({"world_from_camera": []})");
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "poses.json"); }, "poses.json",
                           "0 poses for 2 images"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "no.txt"); }, "no.txt", "no such file"));
}

TEST(DepthFile, IsOneImageWithACameraBesideItAboveItOrFromOptions) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() / "depth");
  const auto file = folder.path() / "depth" / "a.png";
  write_flat(file, 2000);
  write_flat(folder.path() / "depth" / "b.png", 1);
  const std::string uri = "depth:" + file.string();
  for (const char* missing : {"fx", "fy", "cx", "cy", "units"}) {
    std::string options = "?";
    for (const char* key : {"fx", "fy", "cx", "cy", "units"}) {
      if (std::string(key) != missing) options += std::string(key) + "=2&";
    }
    EXPECT_TRUE(fails_saying([&] { return open_source(uri + options); }, "no intrinsics.json",
                             "'" + std::string(missing) + "'"));
  }
  const auto given = open_source(uri + "?fx=2&fy=2&cx=1.5&cy=1&units=1000")->next();
  EXPECT_EQ(image_of(given).intrinsics().width, 4);
  EXPECT_EQ(image_of(given).intrinsics().height, 3);

  folder.write("intrinsics.json", small_camera);  // above
  const auto source = open_source(uri);
  EXPECT_EQ(source->info().frames, 1u);
  EXPECT_FALSE(source->info().frame_rate);
  EXPECT_TRUE(image_of(source->next()).deproject(3, 1)->isApprox(Vec3(1.5, 0.0, 2.0)));
  EXPECT_FALSE(source->next());

  folder.write("depth/intrinsics.json", "{\"note\": 1}");  // beside comes first
  EXPECT_TRUE(fails_saying([&] { return open_source(uri); }, "depth/intrinsics.json"));
}

TEST(DepthFolder, NamesWhatIsWrongWithIt) {
  const TemporaryFolder folder;
  const std::string uri = "depth:" + folder.path().string();
  EXPECT_TRUE(fails_saying([&] { return open_source(uri); }, "holds no PNG"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "/no.png"); }, "no such file or folder"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?fbs=3"); }, "did you mean 'fps'"));
  folder.write("0.png", "no image");
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?fx=2&fy=2&cx=1&cy=1&units=1000"); },
                           "0.png", "is not a PNG"));
  folder.write("intrinsics.json", small_camera);
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?fps=0"); }, "'fps'"));
}

}  // namespace test_depth_recording
}  // namespace palpate
