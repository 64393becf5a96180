// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace test_hip_path {

// A file of that content that goes with the test.
class CsvFile {
 public:
  explicit CsvFile(const std::string& content) {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(testing::TempDir()) /
            (std::string("palpate_") + test->name() + ".csv");
    std::ofstream(path_, std::ios::binary) << content;
  }
  ~CsvFile() { std::filesystem::remove(path_); }
  CsvFile(const CsvFile&) = delete;
  CsvFile& operator=(const CsvFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string message_of(const std::filesystem::path& path) {
  try {
    HipPath::read_csv(path);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string message_of_content(const std::string& content) {
  const CsvFile file(content);
  return message_of(file.path());
}

TEST(HipPath, ReadsSamplesAndJoinsThemByStraightLines) {
  const CsvFile file("t,x,y,z\n1,0,0,0.5\n2,0.1,-0.2,0.5\n4,0.1,0.2,1e-1\n");
  const HipPath path = HipPath::read_csv(file.path());
  ASSERT_EQ(path.samples().size(), 3U);
  EXPECT_EQ(path.first_time(), 1.0);
  EXPECT_EQ(path.last_time(), 4.0);
  EXPECT_EQ(path.at(2.0), Vec3(0.1, -0.2, 0.5));
  EXPECT_LT((path.at(1.5) - Vec3(0.05, -0.1, 0.5)).norm(), 1e-15);
  EXPECT_LT((path.at(3.5) - Vec3(0.1, 0.1, 0.2)).norm(), 1e-15);
}

TEST(HipPath, RestsBeforeItsFirstSampleAndAfterItsLast) {
  const HipPath path({{1.0, Vec3(1, 2, 3)}, {2.0, Vec3(4, 5, 6)}});
  EXPECT_EQ(path.at(-1e300), Vec3(1, 2, 3));
  EXPECT_EQ(path.at(1e300), Vec3(4, 5, 6));
  EXPECT_EQ(path.at(std::numeric_limits<double>::quiet_NaN()), Vec3(1, 2, 3));
}

TEST(HipPath, TakesColumnsInAnyOrderAndWhatSpreadsheetsAddToAFile) {
  const CsvFile file("\xEF\xBB\xBFz, label,t ,y,x\r\n3,a,0,2,1\r\n\r\n6,b,1,5,4\r\n\r\n");
  const HipPath path = HipPath::read_csv(file.path());
  ASSERT_EQ(path.samples().size(), 2U);
  EXPECT_EQ(path.at(0.0), Vec3(1, 2, 3));
  EXPECT_EQ(path.at(1.0), Vec3(4, 5, 6));
}

TEST(HipPath, NamesTheFileAndTheLineThatIsWrong) {
  struct Case {
    const char* content;
    const char* expected;
  };
  for (const auto& [content, expected] : std::vector<Case>{
           {"t,x,y,z\n0,0,0,0\n1,0,nan,0\n", ".csv: line 3: x, y or z is not finite"},
           {"t,x,y,z\n0,0,0,0\n1,inf,0,0\n", ".csv: line 3: x, y or z is not finite"},
           {"t,x,y,z\nnan,0,0,0\n", ".csv: line 2: t is not finite"},
           {"t,x,y,z\n\n1,0,0,0\n1,0,0,0\n", ".csv: line 4: t does not increase"},
           {"t,x,y,z\n1,0,0,0\n0.5,0,0,0\n", ".csv: line 3: t does not increase"},
           {"t,x,y,z\n0,0,0,0\n1,0,0\n", ".csv: line 3: z is missing"},
           {"t,x,y,z\n0,0,,0\n", ".csv: line 2: y is missing"},
           {"t,x,y,z\n0,1 2,0,0\n", ".csv: line 2: x is not a number"},
           {"t,x,y,z\n0,0x1,0,0\n", ".csv: line 2: x is not a number"},
           {"t,x,y,z\n0,1e999,0,0\n", ".csv: line 2: x is not a number"},
           {"t,x,y,z\n0,2e6,0,0\n", ".csv: line 2: the position is beyond 1000 km"},
           {"t,x,y,z\n0,0,0,0\n1e15,0,0,0\n", ".csv: line 3: the path is longer than 1000000 s"},
           {"t,x,z\n0,0,0\n", ".csv: line 1: the header has no column 'y'"},
           {"0,0,0,0\n1,0,0,0\n", ".csv: line 1: the header has no column 't'"},
           {"t,x,y,z\n", ".csv: it has no samples"},
           {"\n\n", ".csv: it is empty"},
           {"", ".csv: it is empty"},
       }) {
    EXPECT_NE(message_of_content(content).find(expected), std::string::npos)
        << "for " << content << "it says: " << message_of_content(content);
  }
}

TEST(HipPath, TurnsOnTheShortestWayBetweenItsSamples) {
  std::istringstream text(
      "t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,1,0,0,-0.70710678,-0.70710678\n");
  const HipPath path = HipPath::parse_csv(text, "p.csv");
  EXPECT_TRUE(path.turns());
  EXPECT_TRUE(path.pose_at(-1.0).orientation.isApprox(Rotation::Identity()));
  // 90 degrees about z: halfway, 45.
  const HandPose half = path.pose_at(0.5);
  EXPECT_NEAR(half.position.z(), 0.5, 1e-12);
  EXPECT_NEAR(std::abs(half.orientation.z()), std::sin(std::numbers::pi / 8), 1e-8);
  ScriptedDevice device(path, false);
  ASSERT_TRUE(device.read(0.0).orientation);
  std::istringstream still("t,x,y,z\n0,0,0,0\n");
  EXPECT_FALSE(HipPath::parse_csv(still, "p.csv").turns());
  std::istringstream wrong("t,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,2\n");
  EXPECT_THROW(HipPath::parse_csv(wrong, "p.csv"), Error);
}

TEST(HipPath, SaysWhichFileItCannotRead) {
  EXPECT_EQ(
      message_of("/nonexistent/path.csv").rfind("/nonexistent/path.csv: it cannot be read", 0), 0U);
  EXPECT_NE(message_of(testing::TempDir()).find("it cannot be read"), std::string::npos);
}

TEST(HipPath, RefusesSamplesInMemoryThatAFileCouldNotHold) {
  EXPECT_THROW(HipPath({}), Error);
  EXPECT_THROW(HipPath({{1.0, Vec3::Zero()}, {1.0, Vec3::Zero()}}), Error);
  EXPECT_THROW(HipPath({{1.0, Vec3(0, std::numeric_limits<double>::infinity(), 0)}}), Error);
}

}  // namespace test_hip_path
}  // namespace palpate
