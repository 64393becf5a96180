// SPDX-License-Identifier: Apache-2.0
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "palpate/io/sources/intrinsics_file.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_intrinsics_file {

using nlohmann::json;
using test::fails_saying;

json complete() {
  return {{"width", 640},
          {"height", 480},
          {"fx", 525.0},
          {"fy", 524.0},
          {"cx", 319.5},
          {"cy", 239.5},
          {"depth_units_per_metre", 5000}};
}

RecordedCamera parse(const json& object) { return parse_intrinsics(object.dump(), "k.json"); }

json with(const char* key, const json& value) {
  json object = complete();
  object[key] = value;
  return object;
}

TEST(IntrinsicsFile, ReadsACameraWithoutDistortion) {
  const RecordedCamera camera = parse(complete());
  EXPECT_EQ(camera.intrinsics,
            (Intrinsics{
                .width = 640, .height = 480, .fx = 525.0, .fy = 524.0, .cx = 319.5, .cy = 239.5}));
  EXPECT_EQ(camera.units_per_metre, 5000.0);
  EXPECT_EQ(camera.invalid_value, 0);
  EXPECT_EQ(camera.saturated_value, 65535);
  EXPECT_FALSE(camera.frame_rate);
}

TEST(IntrinsicsFile, ReadsWhatMayBeLeftOutAndPassesOverNotes) {
  json object = complete();
  object.update({{"invalid_value", 7},
                 {"saturated_value", 4000},
                 {"fps_nominal", 15},
                 {"distortion", nullptr},
                 {"note", "by hand"}});
  const RecordedCamera camera = parse(object);
  EXPECT_EQ(camera.invalid_value, 7);
  EXPECT_EQ(camera.saturated_value, 4000);
  EXPECT_EQ(camera.frame_rate, 15.0);
  EXPECT_FALSE(parse(with("fps_nominal", nullptr)).frame_rate);
}

TEST(IntrinsicsFile, ReadsDistortionInOpenCvsOrderUnderBothNames) {
  const json coefficients = {{"k1", 1.0}, {"k2", 2.0}, {"k3", 3.0},   {"k4", 4.0}, {"k5", 5.0},
                             {"k6", 6.0}, {"p1", 7.0}, {"p2", -8e-5}, {"codx", 0}, {"cody", 0.0}};
  for (const char* key : {"distortion", "distortion_brown_conrady_k1_6_p"}) {
    EXPECT_EQ(parse(with(key, coefficients)).intrinsics.distortion,
              (std::array<double, 8>{1.0, 2.0, 7.0, -8e-5, 3.0, 4.0, 5.0, 6.0}));
  }
  EXPECT_EQ(parse(with("distortion", {{"k1", 0.1}})).intrinsics.distortion,
            (std::array<double, 8>{0.1}));
}

TEST(IntrinsicsFile, RejectsDistortionItDoesNotUnderstand) {
  const auto fails = [](const json& distortion, const char* saying) {
    return fails_saying([&] { return parse(with("distortion", distortion)); }, "k.json",
                        "distortion", saying);
  };
  EXPECT_TRUE(fails({{"k1", 0.1}, {"codx", 0.2}}, "codx"));
  EXPECT_TRUE(fails({{"k1", 0.1}, {"k\n7", 0.2}}, "not understood"));
  EXPECT_TRUE(fails({{"k1", "0.1"}}, "'k1'"));
  EXPECT_TRUE(fails({0.1, 0.2}, "is not an object"));
  json twice = with("distortion", {{"k1", 0.1}});
  twice["distortion_brown_conrady_k1_6_p"] = {{"k1", 0.1}};
  EXPECT_TRUE(fails_saying([&] { return parse(twice); }, "second distortion"));
}

TEST(IntrinsicsFile, NamesTheKeyThatIsMissing) {
  for (const char* key : {"width", "height", "fx", "fy", "cx", "cy", "depth_units_per_metre"}) {
    json object = complete();
    object.erase(key);
    EXPECT_TRUE(fails_saying([&] { return parse(object); }, "k.json", "has no '", key));
    EXPECT_TRUE(fails_saying([&] { return parse(with(key, nullptr)); }, "has no '", key));
    EXPECT_TRUE(fails_saying([&] { return parse(with(key, "525")); }, key, "is not a number"));
  }
}

TEST(IntrinsicsFile, NamesTheKeyThatMakesNoSense) {
  const auto fails = [](const char* key, const json& value) {
    return fails_saying([&] { return parse(with(key, value)); }, "k.json", key, value.dump());
  };
  for (const char* key : {"width", "height"}) {
    EXPECT_TRUE(fails(key, 0));
    EXPECT_TRUE(fails(key, -640));
    EXPECT_TRUE(fails(key, 16385));
    EXPECT_TRUE(fails(key, 640.5));
    EXPECT_TRUE(fails(key, 1e300));
  }
  for (const char* key : {"fx", "fy", "depth_units_per_metre", "fps_nominal"}) {
    EXPECT_TRUE(fails(key, 0.0));
    EXPECT_TRUE(fails(key, -525.0));
    EXPECT_TRUE(fails(key, 1e300));
  }
  EXPECT_TRUE(fails("cx", 1e300));
  EXPECT_TRUE(fails("invalid_value", 65536));
  EXPECT_TRUE(fails("invalid_value", -1));
  EXPECT_TRUE(fails("saturated_value", 0.5));
}

TEST(IntrinsicsFile, RejectsWhatIsNotAnObjectOfJson) {
  for (const char* text : {"", "{", "{\"fx\": 1e999}", "{\"fx\": nan}", "\xff\xfe", "fx: 525"}) {
    EXPECT_TRUE(
        fails_saying([&] { return parse_intrinsics(text, "k.json"); }, "k.json", "not valid JSON"))
        << text;
  }
  for (const char* text : {"[]", "null", "525"}) {
    EXPECT_TRUE(
        fails_saying([&] { return parse_intrinsics(text, "k.json"); }, "not a JSON object"));
  }
  EXPECT_TRUE(fails_saying([] { return parse_intrinsics(std::string(100000, '['), "k.json"); },
                           "not valid JSON"));
}

TEST(IntrinsicsFile, IsReadFromAFileThatIsNamedInErrors) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(read_intrinsics(folder.write("a.json", complete().dump())).intrinsics.fy, 524.0);
  const auto bad = folder.write("b.json", "{}");
  EXPECT_TRUE(fails_saying([&] { return read_intrinsics(bad); }, bad.string(), "'width'"));
  EXPECT_TRUE(fails_saying([&] { return read_intrinsics(folder.path() / "c.json"); }, "c.json"));
}

TEST(Intrinsics, SayHowTheSensorMeasures) {
  json object = complete();
  EXPECT_EQ(parse(object).sensor, SensorKind::unknown);
  object["sensor_kind"] = nullptr;
  EXPECT_EQ(parse(object).sensor, SensorKind::unknown);
  object["sensor_kind"] = "time of flight";
  EXPECT_EQ(parse(object).sensor, SensorKind::time_of_flight);
  object["sensor_kind"] = "radar";
  EXPECT_TRUE(fails_saying([&] { return parse(object); }, "k.json", "sensor_kind", "\"radar\"",
                           "structured light"));
  object["sensor_kind"] = 3;
  EXPECT_TRUE(fails_saying([&] { return parse(object); }, "k.json", "sensor_kind"));
}

}  // namespace test_intrinsics_file
}  // namespace palpate
