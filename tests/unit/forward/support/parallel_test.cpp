// SPDX-License-Identifier: Apache-2.0
#include "forward/support/parallel.h"

#include <gtest/gtest.h>
#include <tbb/blocked_range.h>
#include <tbb/partitioner.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <thread>
#include <vector>

namespace blindcorner {
namespace {

struct Stopped {};

/// One iteration throws while a loop runs inside another one: `inner` must write all results before
/// the code behind it reads them. `inner` takes the number of iterations and what each of them
/// does.
template <typename Inner>
void expect_whole(const Inner& inner) {
  using namespace std::chrono_literals;
  constexpr std::size_t kInner = 200;
  std::atomic<bool> inside{false};
  std::atomic<int> cut{0};
  const auto loop = [&](std::size_t i) {
    if (i == 0) {
      for (int k = 0; k < 2000 && !inside; ++k) std::this_thread::sleep_for(1ms);
      throw Stopped{};
    }
    std::vector<int> written(kInner, 0);
    inner(kInner, [&](std::size_t k) {
      inside = true;
      std::this_thread::sleep_for(100us);
      written[k] = 1;
    });
    if (std::ranges::find(written, 0) != written.end()) ++cut;
  };
  EXPECT_THROW(parallel_for(std::size_t{0}, std::size_t{4}, loop), Stopped);
  EXPECT_EQ(cut, 0);
}

TEST(ParallelFor, AnExceptionBesideALoopDoesNotCutIt) {
  expect_whole(
      [](std::size_t count, const auto& body) { parallel_for(std::size_t{0}, count, body); });
}

TEST(ParallelFor, NorALoopOverARange) {
  expect_whole([](std::size_t count, const auto& body) {
    parallel_for(tbb::blocked_range<std::size_t>(0, count, 8), [&](const auto& part) {
      for (std::size_t i = part.begin(); i != part.end(); ++i) body(i);
    });
  });
}

TEST(ParallelFor, NorALoopWithAPartitioner) {
  expect_whole([](std::size_t count, const auto& body) {
    parallel_for(std::size_t{0}, count, body, tbb::simple_partitioner());
  });
}

TEST(ParallelInvoke, AnExceptionBesideALoopDoesNotCutIt) {
  std::atomic<bool> inside{false};
  std::vector<int> written(200, 0);
  const auto throwing = [&] {
    using namespace std::chrono_literals;
    for (int k = 0; k < 2000 && !inside; ++k) std::this_thread::sleep_for(1ms);
    throw Stopped{};
  };
  const auto looping = [&] {
    parallel_for(std::size_t{0}, written.size(), [&](std::size_t k) {
      inside = true;
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      written[k] = 1;
    });
    EXPECT_EQ(std::ranges::count(written, 1), std::ssize(written));
  };
  EXPECT_THROW(parallel_invoke(looping, throwing), Stopped);
}

#ifdef __SANITIZE_THREAD__
TEST(ParallelForDeathTest, TheThreadSanitizerSeesIterationsThatDisturbEachOther) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto disturb = [] {
    int sum = 0;
    parallel_for(0, 64, [&](int) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      ++sum;
    });
    std::exit(sum == 64 ? 0 : 1);
  };
  EXPECT_EXIT(disturb(), testing::ExitedWithCode(66), "data race");
}
#endif

}  // namespace
}  // namespace blindcorner
