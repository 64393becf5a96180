// SPDX-License-Identifier: Apache-2.0
#include <string>

#include <gtest/gtest.h>

#include "palpate/drivers/shared_library.hpp"

#include "tests/support/environment.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_shared_library {

const std::string folder = PALPATE_FAKES;

LibraryNames vendor() {
  return {.name = "Vendor's SDK",
          .files = {"libvendor.so.3", "libvendor.so.2"},
          .variable = "PALPATE_TEST_VENDOR",
          .remedy = "install it from example.org"};
}

int added(const SharedLibrary& library) {
  int (*add)(int, int) = library.find("vendor_add");
  return add(40, 2);
}

TEST(SharedLibrary, TriesItsFilesInOrderAndCallsTheirFunctions) {
  LibraryNames names = vendor();
  names.files = {folder + "/libvendor.so.3", folder + "/libvendor.so.2"};
  const SharedLibrary library(names);
  EXPECT_EQ(library.path(), folder + "/libvendor.so.2");
  EXPECT_EQ(added(library), 42);
  double (*half)(double) = library.try_find("vendor_half");
  ASSERT_NE(half, nullptr);
  EXPECT_EQ(half(3.0), 1.5);
  half = library.try_find("vendor_quarter");
  EXPECT_EQ(half, nullptr);
}

TEST(SharedLibrary, TakesWhatTheEnvironmentNamesAFileOrAFolder) {
  {
    const test::Environment set("PALPATE_TEST_VENDOR", folder);
    EXPECT_EQ(added(SharedLibrary(vendor())), 42);
  }
  {
    const test::Environment set("PALPATE_TEST_VENDOR", folder + "/libvendor.so.2");
    EXPECT_EQ(added(SharedLibrary(vendor())), 42);
  }
}

TEST(SharedLibrary, SaysWhatIsMissingAndWhatToDo) {
  const auto open = [] { return SharedLibrary(vendor()).path(); };
  EXPECT_TRUE(test::fails_saying(open, "Vendor's SDK: its library is not there",
                                 "libvendor.so.3, libvendor.so.2", "install it from example.org",
                                 "set PALPATE_TEST_VENDOR"));
  const test::TemporaryFolder empty;
  {
    const test::Environment set("PALPATE_TEST_VENDOR", empty.path().string());
    EXPECT_TRUE(test::fails_saying(open, empty.path().string(), "of PALPATE_TEST_VENDOR has no"));
  }
  {
    const test::Environment set("PALPATE_TEST_VENDOR", "/nowhere/libvendor.so");
    EXPECT_TRUE(test::fails_saying(open, "is not there", "/nowhere/libvendor.so"));
  }
  {
    const auto text = empty.write("libvendor.so.3", "this is no library");
    const test::Environment set("PALPATE_TEST_VENDOR", text.string());
    EXPECT_TRUE(test::fails_saying(open, "cannot be loaded", "libvendor.so.3", "install it"));
  }
}

TEST(SharedLibrary, NamesAFunctionThatItDoesNotHave) {
  const test::Environment set("PALPATE_TEST_VENDOR", folder);
  const SharedLibrary library(vendor());
  EXPECT_TRUE(test::fails_saying([&] { return library.find("vendor_subtract"); }, "Vendor's SDK",
                                 "libvendor.so.2 has no function vendor_subtract",
                                 "another version", "install it"));
}

}  // namespace test_shared_library
}  // namespace palpate
