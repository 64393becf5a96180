// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/servo/mailbox.hpp"

namespace palpate {
namespace test_mailbox {

TEST(Mailbox, IsEmptyUntilSomethingIsPutAndAfterItWasTaken) {
  Mailbox<int> box;
  EXPECT_EQ(box.take(), nullptr);
  box.put(7);
  const int* taken = box.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 7);
  EXPECT_EQ(box.take(), nullptr);
  EXPECT_EQ(box.taken_last(), 7);
}

TEST(Mailbox, GivesTheNewestAndCountsWhatItOvertook) {
  Mailbox<int> box;
  for (int i = 1; i <= 5; ++i) box.put(i);
  EXPECT_EQ(*box.take(), 5);
  EXPECT_EQ(box.dropped(), 4U);
  box.put(6);
  EXPECT_EQ(*box.take(), 6);
  EXPECT_EQ(box.dropped(), 4U);
}

// Says when and where the last owner let go of it.
struct Watched {
  explicit Watched(std::vector<int>& gone, int name) : gone_(gone), name_(name) {}
  ~Watched() { gone_.push_back(name_); }
  Watched(const Watched&) = delete;
  Watched& operator=(const Watched&) = delete;
  std::vector<int>& gone_;
  int name_;
};

TEST(Mailbox, ReleasesValuesOnlyInPut) {
  std::vector<int> gone;
  Mailbox<std::shared_ptr<Watched>> box;
  for (int i = 0; i < 10; ++i) {
    box.put(std::make_shared<Watched>(gone, i));
    const std::size_t before = gone.size();
    box.take();
    EXPECT_EQ(gone.size(), before) << "taking " << i;
  }
  EXPECT_GE(gone.size(), 6U);
}

TEST(Mailbox, KeepsTheValueBeforeTheOneTakenUntilTheNextIsTaken) {
  std::vector<int> gone;
  Mailbox<std::shared_ptr<Watched>> box;
  box.put(std::make_shared<Watched>(gone, 0));
  box.take();
  box.put(std::make_shared<Watched>(gone, 1));
  box.take();
  for (int i = 2; i < 20; ++i) box.put(std::make_shared<Watched>(gone, i));
  EXPECT_EQ(std::count_if(gone.begin(), gone.end(), [](int name) { return name < 2; }), 0);
  EXPECT_EQ(box.taken_last()->name_, 1);
}

TEST(Mailbox, GivesWholeValuesInOrderAndTheLastOneWhileTheWriterFloodsIt) {
  struct Pair {
    int a = 0;
    std::shared_ptr<int> b;
  };
  constexpr int count = 50'000;
  Mailbox<Pair> box;
  std::thread writer([&] {
    for (int i = 1; i <= count; ++i) box.put({i, std::make_shared<int>(i)});
  });
  int last = 0;
  int wrong = 0;
  std::uint64_t taken = 0;
  while (last < count) {
    const Pair* pair = box.take();
    if (pair == nullptr) {
      std::this_thread::yield();
      continue;
    }
    ++taken;
    if (pair->a <= last || *pair->b != pair->a) ++wrong;
    last = pair->a;
  }
  writer.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(taken + box.dropped(), static_cast<std::uint64_t>(count));
}

}  // namespace test_mailbox
}  // namespace palpate
