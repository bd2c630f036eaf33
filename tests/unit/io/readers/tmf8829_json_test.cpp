// SPDX-License-Identifier: Apache-2.0
/// Logs of a TMF8829 as the makers' programs write them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <nlohmann/json.hpp>

#include "blindcorner/io/import_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using nlohmann::json;
using test::error_of;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A frame of `side` x `side` zones with 64 numbers a histogram, of which 54 are in use; `count`
/// tells the counts of zone (row, column) in bin k, `noise` those of the results.
template <typename Count, typename Noise>
json frame(int side, Count count, Noise noise) {
  json rows = json::array();
  json results = json::array();
  for (int row = 0; row < side; ++row) {
    json histograms = json::array();
    json values = json::array();
    for (int column = 0; column < side; ++column) {
      std::vector<int> bins(64, 0);
      for (int k = 0; k < 54; ++k) bins[static_cast<std::size_t>(k)] = count(row, column, k);
      histograms.push_back({{"bin", bins}});
      values.push_back({{"noise", noise(row, column)}, {"peaks", json::array()}});
    }
    rows.push_back(histograms);
    results.push_back(values);
  }
  return {{"info", {{"frame_number", 1}}}, {"mp_histo", rows}, {"results", results}};
}

/// Every zone has counts of its own.
json distinct() {
  return frame(
      4, [](int row, int column, int k) { return 1000 * row + 100 * column + k; },
      [](int, int) { return 50; });
}

json log_of(const std::vector<json>& frames) {
  return {{"Result_Set", frames}, {"configuration", {{"histogram_bins", 218}, {"bin_shift", 2}}}};
}

std::string gzipped(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

class Tmf8829Log : public ::testing::Test {
 protected:
  CaptureFile import(const std::string& bytes) {
    write_text(path_, bytes);
    notes_.clear();
    return import_captures({path_}, {}, &notes_);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("log.json");
  std::vector<std::string> notes_;
};

TEST_F(Tmf8829Log, FramesBecomeCapturesOfTheBinsInUse) {
  const CaptureFile file = import(log_of({distinct(), distinct()}).dump(2));
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_THAT(notes_, IsEmpty());
  EXPECT_EQ(file.sensor, "tmf8829_4x4");
  EXPECT_NEAR(file.bin_width, 4 * 204.4e-12, 1e-15);
  const HistogramCube& counts = file.captures[1].counts;
  EXPECT_EQ(counts.rows, 4);
  EXPECT_EQ(counts.bins, 54);  // 218 bins, four to one: the last one is not whole
  EXPECT_EQ(counts.zone(4 * 2 + 3)[53], 2353);
  EXPECT_FALSE(file.captures[1].zone_exposures);
}

TEST_F(Tmf8829Log, GzippedIsTheSame) {
  const std::string text = log_of({distinct()}).dump();
  EXPECT_EQ(import(gzipped(text)).captures[0].counts.values,
            import(text).captures[0].counts.values);
}

TEST_F(Tmf8829Log, ALogThatEndsEarlyKeepsItsWholeFrames) {
  const std::string text = log_of({distinct(), distinct(), distinct()}).dump(1);
  const std::string cut = text.substr(0, text.size() / 2);
  EXPECT_EQ(import(cut).captures.size(), 1u);
  EXPECT_THAT(notes_, ElementsAre(AllOf(HasSubstr(path_ + ": line "), HasSubstr("ends within"))));
  const std::string packed = gzipped(text);
  EXPECT_GE(import(packed.substr(0, packed.size() - 20)).captures.size(), 1u);
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("ends within")));
  // Within the first frame, nothing is left.
  EXPECT_THAT(error_of([&] { import(text.substr(0, 2000)); }), HasSubstr("holds no frame"));
}

TEST_F(Tmf8829Log, DamagedFramesAreNamedAndLeftOut) {
  json broken = distinct();
  broken["mp_histo"][1][2]["bin"][3] = "many";
  json other = frame(
      2, [](int, int, int) { return 1; }, [](int, int) { return 1; });
  json bare = distinct();
  bare.erase("mp_histo");
  EXPECT_EQ(import(log_of({distinct(), broken, other, bare, distinct()}).dump()).captures.size(),
            2u);
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("Result_Set[1]: is damaged"),
                                  AllOf(HasSubstr("Result_Set[2]"), HasSubstr("2 x 2 x 64")),
                                  HasSubstr("Result_Set[3]: holds no mp_histo")));
}

TEST_F(Tmf8829Log, RepeatedHistogramsGoToTheZonesWhoseNoiseTheyHave) {
  // As some logs have it: the histogram of zone (0, r) stands in all columns of row r.
  const auto ambient = [](int zone) { return 100 + 37 * zone * zone % 101; };
  const json repeated = frame(
      4, [&](int row, int, int k) { return k == 20 ? 900 + row : ambient(row); },
      [&](int row, int column) { return row == 0 ? ambient(column) - 3 : 5 * row + column; });
  const CaptureFile file = import(log_of({repeated, repeated}).dump());
  EXPECT_THAT(notes_, ElementsAre(AllOf(HasSubstr("all 4 columns"), HasSubstr("row 0"))));
  const Capture& capture = file.captures[0];
  for (int zone = 0; zone < 4; ++zone) EXPECT_EQ(capture.counts.zone(zone)[20], 900 + zone);
  for (int zone = 0; zone < 16; ++zone) EXPECT_EQ(capture.exposures_of(zone), zone < 4 ? 1 : 0);
}

TEST_F(Tmf8829Log, RepeatedHistogramsWithoutATraceAreTheFirstColumns) {
  const json repeated = frame(
      4, [](int row, int, int k) { return 100 * row + k; }, [](int, int) { return 5; });
  const CaptureFile file = import(log_of({repeated}).dump());
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("nothing says of which column")));
  EXPECT_EQ(file.captures[0].exposures_of(4), 1);
  EXPECT_EQ(file.captures[0].exposures_of(5), 0);
  EXPECT_EQ(file.captures[0].counts.zone(8)[7], 207);
}

TEST_F(Tmf8829Log, TheOtherRangeOfDualModeIsChosen) {
  json dual = distinct();
  dual["mp_histo_HA"] = frame(
      4, [](int, int, int) { return 7; }, [](int, int) { return 1; })["mp_histo"];
  dual["mp_histo_HA"][0][0]["bin"][0] = 8;
  write_text(path_, log_of({dual}).dump());
  ImportOptions options;
  options.array = "mp_histo_HA";
  const CaptureFile file = import_captures({path_}, options);
  EXPECT_EQ(file.captures[0].counts.zone(0)[0], 8);
  EXPECT_EQ(file.captures[0].counts.zone(5)[9], 7);
}

/// A log of the makers' evaluation kit (ams-OSRAM/tmf8829_json_logfile_viewer).
TEST(Tmf8829Data, MakersLog) {
  const std::string path = test::data_folder() + "/tmf8829/tmf8829_16x16.json.gz";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no data at " << path;
  std::vector<std::string> notes;
  const CaptureFile file = import_captures({path}, {}, &notes);
  ASSERT_EQ(file.captures.size(), 26u);
  EXPECT_THAT(notes, ElementsAre(AllOf(HasSubstr("all 16 columns"), HasSubstr("row 0"))));
  const Capture& capture = file.captures.front();
  EXPECT_EQ(capture.counts.rows, 16);
  EXPECT_EQ(capture.counts.columns, 16);
  EXPECT_EQ(capture.counts.bins, 54);
  EXPECT_EQ(capture.counts.zone(0)[11], 872);  // the first numbers of the file
  EXPECT_THAT(
      std::vector<double>(capture.zone_exposures->begin(), capture.zone_exposures->begin() + 16),
      Each(1));
  EXPECT_THAT(
      std::vector<double>(capture.zone_exposures->begin() + 16, capture.zone_exposures->end()),
      Each(0));
}

}  // namespace
}  // namespace blindcorner
