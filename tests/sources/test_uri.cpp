// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_uri {

using test::fails_saying;

TEST(Uri, IsTakenApartIntoSchemePathAndOptions) {
  const Uri uri("tum:/data/fr1 xyz?poses=none&fx=525&verbose");
  EXPECT_EQ(uri.scheme(), "tum");
  EXPECT_EQ(uri.path(), "/data/fr1 xyz");
  EXPECT_EQ(uri.text_option("poses", "file"), "none");
  EXPECT_EQ(uri.number_option("fx", 1.0, 0.0, 1e4), 525.0);
  EXPECT_TRUE(uri.has("verbose"));
  EXPECT_EQ(uri.text_option("verbose", "x"), "");
  EXPECT_FALSE(uri.has("units"));
  EXPECT_EQ(uri.text_option("units", "5000"), "5000");
}

TEST(Uri, KeepsAQuestionMarkInAPathThatEndsWithOne) {
  EXPECT_EQ(Uri("pcd:what?.pcd?").path(), "what?.pcd");
  EXPECT_EQ(Uri("pcd:what?.pcd?fps=30").path(), "what?.pcd");
  EXPECT_EQ(Uri("pcd:a:b").path(), "a:b");
  EXPECT_EQ(Uri("synthetic:").path(), "");
}

TEST(Uri, RejectsTextWithoutAScheme) {
  for (const char* text : {"", "folder", ":folder", "./a:b", "my folder:x"}) {
    EXPECT_TRUE(fails_saying([&] { return Uri(text); }, "scheme")) << text;
  }
}

TEST(Uri, RejectsAnOptionWithoutANameOrGivenTwice) {
  EXPECT_TRUE(fails_saying([] { return Uri("tum:d?=3"); }, "without a name"));
  EXPECT_TRUE(fails_saying([] { return Uri("tum:d?a&&b"); }, "without a name"));
  EXPECT_TRUE(fails_saying([] { return Uri("tum:d?fx=1&fx=2"); }, "'fx' is given twice"));
}

TEST(Uri, ReadsNumbersWithUnitsInSi) {
  const Uri uri("synthetic:desk?a=1mm&b=0.5cm&c=2m&d=30Hz&e=33ms&f=180deg&g=-1.5e2&h=2%&i=7");
  const auto number = [&](const char* key, const char* unit) {
    return uri.number_option(key, 0.0, -1e9, 1e9, unit);
  };
  EXPECT_DOUBLE_EQ(number("a", "m"), 0.001);
  EXPECT_DOUBLE_EQ(number("b", "m"), 0.005);
  EXPECT_DOUBLE_EQ(number("c", ""), 2.0);
  EXPECT_DOUBLE_EQ(number("d", "Hz"), 30.0);
  EXPECT_DOUBLE_EQ(number("e", "s"), 0.033);
  EXPECT_DOUBLE_EQ(number("f", "rad"), 3.14159265358979323846);
  EXPECT_DOUBLE_EQ(number("g", ""), -150.0);
  EXPECT_DOUBLE_EQ(number("h", "1"), 0.02);
  EXPECT_DOUBLE_EQ(number("i", "px"), 7.0);
  EXPECT_DOUBLE_EQ(uri.number_option("absent", 9.0, 0.0, 1.0), 9.0);
}

TEST(Uri, RejectsWhatIsNotANumberOrNotInRange) {
  for (const char* value : {"", "abc", "nan", "inf", "1e999", "--1", "+1", "0x10", "1 mm", "1,5"}) {
    const Uri uri("depth:d?fps=" + std::string(value));
    EXPECT_THROW(static_cast<void>(uri.number_option("fps", 30.0, 0.0, 1e6)), Error) << value;
  }
  EXPECT_TRUE(
      fails_saying([] { return Uri("depth:d?fps=0").number_option("fps", 30, 1, 1000, "Hz"); },
                   "from 1 to 1000 Hz"));
}

TEST(Uri, RejectsAUnitThatDoesNotFit) {
  const Uri uri("depth:d?fps=30mm&fx=525mm");
  EXPECT_TRUE(fails_saying([&] { return uri.number_option("fps", 30, 1, 1000, "Hz"); },
                           "valid units: hz, khz"));
  EXPECT_TRUE(
      fails_saying([&] { return uri.number_option("fx", 30, 1, 1000, "px"); }, "plain number"));
}

TEST(Uri, NamesTheNearestOfTheKnownOptions) {
  constexpr std::array<std::string_view, 2> known{"poses", "units"};
  EXPECT_NO_THROW(Uri("tum:d?poses=none&units=5000").allow_only(known));
  EXPECT_TRUE(fails_saying([&] { Uri("tum:d?poess=none").allow_only(known); },
                           "unknown option 'poess'; did you mean 'poses'?"));
  EXPECT_TRUE(fails_saying([] { Uri("tum:d?a=1").allow_only({}); }, "none"));
}

TEST(Uri, WithoutAnOptionIsAsIfItHadNotBeenGiven) {
  EXPECT_EQ(Uri("tum:a?units=5&pose=1,2&fps=3").without("pose").text(), "tum:a?units=5&fps=3");
  EXPECT_EQ(Uri("tum:a?pose=1,2").without("pose").text(), "tum:a");
  EXPECT_EQ(Uri("tum:a?b?pose=1,2").without("pose").text(), "tum:a?b?");
  EXPECT_EQ(Uri("tum:a?b?").without("pose").path(), "a?b");
  EXPECT_FALSE(Uri("tum:a?pose=1").without("pose").has("pose"));
  constexpr std::array<std::string_view, 1> own{"fps"};
  EXPECT_TRUE(fails_saying([&] { Uri("tum:a?pos=1").without("pose").allow_only(own); }, "'pos'",
                           "did you mean 'pose'", "fps, pose"));
}

TEST(OpenSource, ListsTheKnownSchemesForAnUnknownOne) {
  EXPECT_TRUE(fails_saying([] { return open_source("kinect:0"); },
                           "unknown type of source 'kinect:'; known here:"));
  EXPECT_THROW(open_source("folder"), Error);
}

}  // namespace test_uri
}  // namespace palpate
