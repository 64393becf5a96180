// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/servo/tick_ring.hpp"

namespace palpate {
namespace test_tick_ring {

struct Record {
  std::uint64_t number = 0;
  std::uint64_t copies[20] = {};

  static Record of(std::uint64_t n) {
    Record record{.number = n};
    for (auto& copy : record.copies) copy = n;
    return record;
  }
  [[nodiscard]] bool whole() const {
    for (const auto& copy : copies) {
      if (copy != number) return false;
    }
    return true;
  }
};

TEST(TickRing, GivesEachReaderEveryRecordSinceItBeganInOrder) {
  TickRing<Record> ring(8);
  ring.push(Record::of(1));
  auto a = ring.reader();
  ring.push(Record::of(2));
  auto b = ring.reader();
  ring.push(Record::of(3));
  Record record;
  ASSERT_TRUE(a.try_pop(record));
  EXPECT_EQ(record.number, 2U);
  ASSERT_TRUE(a.try_pop(record));
  EXPECT_EQ(record.number, 3U);
  EXPECT_FALSE(a.try_pop(record));
  ASSERT_TRUE(b.try_pop(record));
  EXPECT_EQ(record.number, 3U);
  EXPECT_FALSE(b.try_pop(record));
  EXPECT_EQ(a.lost() + b.lost(), 0U);
}

TEST(TickRing, TellsAReaderThatFellBehindHowManyOfTheOldestItLost) {
  TickRing<Record> ring(8);
  auto reader = ring.reader();
  for (std::uint64_t n = 1; n <= 20; ++n) ring.push(Record::of(n));
  Record record;
  ASSERT_TRUE(reader.try_pop(record));
  EXPECT_EQ(record.number, 13U);
  EXPECT_EQ(reader.lost(), 12U);
  int left = 0;
  while (reader.try_pop(record)) ++left;
  EXPECT_EQ(left, 7);
}

TEST(TickRing, NeverGivesATornRecordAndAccountsForAllWhileTheWriterLapsItsReaders) {
  constexpr std::uint64_t count = 100'000;
  TickRing<Record> ring(16);
  std::vector<std::thread> readers;
  std::atomic<int> torn{0};
  std::atomic<int> unaccounted{0};
  for (int i = 0; i < 2; ++i) {
    readers.emplace_back([&, reader = ring.reader()]() mutable {
      Record record;
      std::uint64_t seen = 0;
      while (record.number < count) {
        if (!reader.try_pop(record)) {
          std::this_thread::yield();
          continue;
        }
        ++seen;
        if (!record.whole()) ++torn;
        if (record.number != seen + reader.lost()) ++unaccounted;
      }
    });
  }
  for (std::uint64_t n = 1; n <= count; ++n) ring.push(Record::of(n));
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(unaccounted, 0);
}

}  // namespace test_tick_ring
}  // namespace palpate
