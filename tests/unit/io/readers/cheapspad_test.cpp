// SPDX-License-Identifier: Apache-2.0
/// The CheapSPAD layout: phases told apart, bad repeats left out, weights kept.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/import_file.h"
#include "io/readers/matlab_file.h"
#include "io/repeats.h"
#include "unit/io/io_test_files.h"

#ifdef BLINDCORNER_TEST_MATIO
#include <matio.h>
#endif

namespace blindcorner {
namespace {

/// A direct return in bins 2 and 8, ambient light 100, both times `gain`.
std::vector<double> row(double gain) {
  std::vector<double> bins(24, 100 * gain);
  bins[2] = 50'000 * gain;
  bins[8] = 20'000 * gain;
  bins[23] = 0;
  return bins;
}

/// Alternating gains 1 and 0.8, or the other way round.
RepeatSeries series(int repeats, bool brighter_first) {
  RepeatSeries all;
  for (int r = 0; r < repeats; ++r) all.push_back(row((r % 2 == 0) == brighter_first ? 1 : 0.8));
  return all;
}

TEST(Repeats, PhasesAreToldApartByTheirDirectReturn) {
  const RepeatSeries a = series(10, true);
  const RepeatSeries b = series(10, false);
  const RepeatReference reference = repeat_reference({&a, &b});
  ASSERT_EQ(reference.direct.size(), 2u);
  EXPECT_EQ(reference.direct[0], (std::pair<std::size_t, std::size_t>{2, 3}));
  EXPECT_EQ(reference.direct[1], (std::pair<std::size_t, std::size_t>{8, 9}));
  EXPECT_EQ(sort_repeats(a, reference).phase[0], 0);
  EXPECT_EQ(sort_repeats(b, reference).phase[0], 1);
  for (const Rejection r : sort_repeats(b, reference).rejected) EXPECT_EQ(r, Rejection::none);
}

TEST(Repeats, BadOnesAreLeftOutWithTheirReason) {
  RepeatSeries bad = series(12, true);
  for (double& n : bad[0]) n *= 0.5;                      // far too dark
  bad[1][8] *= 0.7;                                       // one direct return of two has moved away
  bad[2][15] = 16'777'215;                                // 24 bits
  for (std::size_t b = 10; b < 23; ++b) bad[5][b] = 400;  // ambient light
  for (std::size_t r = 4; r < 12; r += 2) bad[r][2] *= 1.01;
  const RepeatSeries good = series(12, true);
  RepeatReference reference = repeat_reference({&good, &good, &bad});
  reference.ambient_scale = 1;  // sqrt(100) counts
  const SortedRepeats sorted = sort_repeats(bad, reference);
  EXPECT_EQ(sorted.rejected[0], Rejection::gain);
  EXPECT_EQ(sorted.rejected[1], Rejection::unsettled);
  EXPECT_EQ(sorted.rejected[2], Rejection::overflow);
  EXPECT_EQ(sorted.rejected[5], Rejection::background);
  for (const std::size_t r : {3u, 4u, 6u, 7u, 8u, 9u, 10u, 11u}) {
    EXPECT_EQ(sorted.rejected[r], Rejection::none) << r;
  }
}

// Light before the wall's return that others do not have, in both phases: an object in direct view.
// Late light that wraps around shows in one phase only.
TEST(Repeats, ObjectsInDirectViewAreLeftOut) {
  std::vector<RepeatSeries> all;
  for (int i = 0; i < 7; ++i) {
    all.push_back(series(10, i % 2 == 0));
    for (std::size_t r = 0; r < 10; ++r) all.back()[r][5] += i + static_cast<double>(r % 3);
  }
  for (auto& repeat : all[1]) repeat[5] += 60;                  // in view
  for (std::size_t r = 0; r < 10; r += 2) all[2][r][4] += 500;  // wrapped around
  for (auto& repeat : all[3]) repeat[15] += 900;                // third bounce
  all[4][2][5] += 5000;                                         // one bad repeat
  std::vector<const RepeatSeries*> list;
  for (const RepeatSeries& one : all) list.push_back(&one);
  const RepeatReference reference = repeat_reference(list);
  EXPECT_EQ(reference.early, (std::pair<std::size_t, std::size_t>{4, 7}));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const SortedRepeats sorted = sort_repeats(all[i], reference);
    const auto in_view = std::ranges::count(sorted.rejected, Rejection::direct_view);
    EXPECT_EQ(in_view, i == 1 ? 10 : 0) << i;
  }
  // A third bounce that most positions share is no wall: nothing before it is early.
  for (RepeatSeries& one : all) {
    for (auto& repeat : one) repeat[17] += 700;
  }
  const RepeatReference bounced = repeat_reference(list);
  EXPECT_EQ(bounced.direct.size(), 3u);
  EXPECT_EQ(bounced.early, reference.early);
  // Nor where the wall's is the only other return.
  for (RepeatSeries& one : all) {
    for (auto& repeat : one) repeat[2] = repeat[3];
  }
  const RepeatReference alone = repeat_reference(list);
  EXPECT_EQ(alone.direct.size(), 2u);
  EXPECT_EQ(alone.early, (std::pair<std::size_t, std::size_t>{0, 7}));
  // Where nothing varies, nothing is known about what is usual.
  const RepeatSeries same = series(10, true);
  RepeatSeries brighter = same;
  for (auto& repeat : brighter) repeat[5] += 60;
  const RepeatReference constant = repeat_reference({&same, &same, &same, &brighter});
  EXPECT_EQ(sort_repeats(brighter, constant).rejected[3], Rejection::none);
}

#ifdef BLINDCORNER_TEST_MATIO

class CheapSpadFile : public ::testing::Test {
 protected:
  /// Two positions, four repeats; spot (row, column) has 1000 row + 100 column more in bin 14.
  /// `y` of the second position.
  void write(double y, bool positions = true, std::size_t repeats = 4) const {
    mat_t* file = Mat_CreateVer(path_.c_str(), nullptr, MAT_FT_MAT5);
    ASSERT_NE(file, nullptr);
    std::size_t dims[2] = {1, 2};
    matvar_t* cubes = Mat_VarCreate("datacubes", MAT_C_CELL, MAT_T_CELL, 2, dims, nullptr, 0);
    matvar_t* places = Mat_VarCreate("positions", MAT_C_CELL, MAT_T_CELL, 2, dims, nullptr, 0);
    for (int i = 0; i < 2; ++i) {
      std::vector<std::int32_t> values(2 * 2 * 24 * 4);
      for (std::size_t r = 0; r < 4; ++r) {
        for (std::size_t s = 0; s < 4; ++s) {
          // In the second position the darker phase comes first at spot 3.
          const bool first = !(i == 1 && s == 3);
          const auto one = row((r % 2 == 0) == first ? 1 : 0.8);
          for (std::size_t b = 0; b < 24; ++b) {
            values[s / 2 + 2 * (s % 2) + 4 * (b + 24 * r)] =
                static_cast<std::int32_t>(one[b]) +
                (b == 14 ? static_cast<int>(1000 * (s / 2) + 100 * (s % 2)) : 0);
          }
        }
      }
      std::size_t cube[4] = {2, 2, 24, repeats};
      Mat_VarSetCell(cubes, i,
                     Mat_VarCreate(nullptr, MAT_C_INT32, MAT_T_INT32, 4, cube, values.data(), 0));
      double place[3] = {0.1 * i, i == 0 ? -1.0 : y, 1.2};
      std::size_t three[2] = {3, 1};
      Mat_VarSetCell(places, i,
                     Mat_VarCreate(nullptr, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, three, place, 0));
    }
    Mat_VarWrite(file, cubes, MAT_COMPRESSION_NONE);
    if (positions) Mat_VarWrite(file, places, MAT_COMPRESSION_NONE);
    Mat_VarFree(cubes);
    Mat_VarFree(places);
    Mat_Close(file);
  }

  test::TemporaryFolder folder_;
  std::string path_ = folder_.file("small.mat");
};

TEST_F(CheapSpadFile, ZonesAreSpotsInTheirPhases) {
  write(-1.2);
  const CaptureFile file = import_captures({path_});
  ASSERT_EQ(file.captures.size(), 2u);
  const Capture& capture = file.captures[1];
  EXPECT_EQ(capture.counts.rows, 4);
  EXPECT_EQ(capture.counts.columns, 2);
  EXPECT_DOUBLE_EQ(capture.truth.at("x_m"), 0.1);
  EXPECT_DOUBLE_EQ(capture.truth.at("y_m"), -1.2);
  for (int spot = 0; spot < 4; ++spot) {
    const int row = spot / 2;
    const double extra = 1000 * row + 100 * (spot % 2);
    EXPECT_DOUBLE_EQ(capture.counts.zone(2 * spot)[2], 50'000) << spot;
    EXPECT_DOUBLE_EQ(capture.counts.zone(2 * spot + 1)[2], 40'000) << spot;
    EXPECT_DOUBLE_EQ(capture.counts.zone(2 * spot)[14], 100 + extra) << spot;
    EXPECT_DOUBLE_EQ(capture.exposures_of(2 * spot), 2);
    // Phase 0 wraps after 20 bins.
    EXPECT_DOUBLE_EQ(capture.counts.zone(2 * spot)[22], 50'000) << spot;
    EXPECT_DOUBLE_EQ(capture.counts.zone(2 * spot + 1)[22], 80) << spot;
  }
}

TEST_F(CheapSpadFile, SamplesOfTwoRepeatsAndThePublishedFilter) {
  write(-1.9);
  ImportOptions options;
  options.repeats_per_sample = 2;
  EXPECT_EQ(import_captures({path_}, options).captures.size(), 4u);
  options.published_filter = PublishedFilter::without_mirrors;
  const CaptureFile file = import_captures({path_}, options);
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_DOUBLE_EQ(file.captures[1].truth.at("y_m"), -1.0);
  EXPECT_DOUBLE_EQ(file.captures[1].exposures_of(0), 1);
}

TEST_F(CheapSpadFile, WithoutRepeatsIsRefused) {
  write(-1, /*positions=*/true, /*repeats=*/0);
  EXPECT_THROW(import_captures({path_}), Error);
}

TEST_F(CheapSpadFile, MissingVariablesAndOtherFilesAreNamed) {
  write(-1, /*positions=*/false);
  try {
    import_captures({path_});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("positions is missing"), std::string::npos)
        << error.what();
  }
  std::ofstream(path_) << "not a MATLAB file";
  EXPECT_THROW(import_captures({path_}), Error);
}

#else

TEST(CheapSpadFile, NeedsMatio) {
  EXPECT_FALSE(reads_matlab());
  EXPECT_THROW(read_matlab_cells("x.mat", "datacubes"), Error);
}

#endif

}  // namespace
}  // namespace blindcorner
