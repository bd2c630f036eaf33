// SPDX-License-Identifier: Apache-2.0
/// Streams of lines become frames, whatever happens to the lines.
#include "live/frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>
#include <sstream>

#include "blindcorner/forward/error.h"
#include "unit/error_message.h"

namespace blindcorner::live {
namespace {

using ::testing::HasSubstr;

Sensor sensor_of(int rows, int columns, int bins) {
  Sensor sensor;
  sensor.rows = rows;
  sensor.columns = columns;
  sensor.bins = bins;
  return sensor;
}

/// Frames whose counts are all different, whole numbers.
std::vector<Capture> numbered(int frames, int rows, int columns, int bins) {
  std::vector<Capture> captures;
  std::mt19937_64 random(3);
  for (int i = 0; i < frames; ++i) {
    Capture capture;
    capture.counts = HistogramCube(rows, columns, bins);
    for (double& count : capture.counts.values) count = static_cast<double>(random() % 100000);
    captures.push_back(capture);
  }
  return captures;
}

std::string text_of(const std::string& format, const std::vector<Capture>& captures) {
  std::string text;
  for (const Capture& capture : captures) text += stream_reader(format).print(capture, "test");
  return text;
}

std::vector<std::string> lines_in(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

/// What a stream gave.
struct Outcome {
  std::vector<Frame> frames;
  std::vector<std::string> said;
  std::map<std::string, long> counts;
};

/// Feeds the text in pieces of `piece` bytes; "!" lines stand for an interruption.
Outcome feed(const std::string& text, const Sensor& sensor, std::size_t piece = 1000,
             const std::string& format = "auto") {
  Outcome outcome;
  Tally tally([&](const std::string& sentence) { outcome.said.push_back(sentence); });
  FrameAssembler assembler(sensor, format, {}, tally);
  const auto take = [&](Frame frame) { outcome.frames.push_back(std::move(frame)); };
  for (std::size_t at = 0; at < text.size(); at += piece) {
    assembler.add(std::string_view(text).substr(at, piece), Clock::now(), take);
  }
  outcome.counts = tally.all();
  return outcome;
}

void expect_frames(const Outcome& outcome, const std::vector<Capture>& expected,
                   const std::vector<std::size_t>& which) {
  ASSERT_EQ(outcome.frames.size(), which.size());
  for (std::size_t i = 0; i < which.size(); ++i) {
    EXPECT_EQ(outcome.frames[i].capture.counts.values, expected[which[i]].counts.values) << i;
    EXPECT_EQ(outcome.frames[i].number, static_cast<long>(i));
  }
}

struct Format {
  const char* name;
  int side, bins;
};
const Format kFormats[] = {{"tmf8828", 3, 128}, {"tmf8828", 4, 128}, {"tmf8828", 8, 128},
                           {"vl53l8ch", 4, 64}, {"tmf8829", 16, 54}, {"json_lines", 4, 32}};

TEST(Frames, EveryFormatThatIsPrintedIsReadBackInPiecesOfAnySize) {
  for (const Format& format : kFormats) {
    const auto captures = numbered(5, format.side, format.side, format.bins);
    const std::string text = text_of(format.name, captures);
    for (const std::size_t piece : {1UL, 37UL, 4096UL, text.size()}) {
      SCOPED_TRACE(std::string(format.name) + " " + std::to_string(format.side) + " in pieces of " +
                   std::to_string(piece));
      const Outcome outcome = feed(text, sensor_of(format.side, format.side, format.bins), piece);
      expect_frames(outcome, captures, {0, 1, 2, 3, 4});
      EXPECT_TRUE(outcome.said.empty());
    }
  }
}

TEST(Frames, AFrameIsThereWithItsLastByte) {
  for (const Format& format : kFormats) {
    const auto captures = numbered(1, format.side, format.side, format.bins);
    const std::string text = text_of(format.name, captures);
    const Sensor sensor = sensor_of(format.side, format.side, format.bins);
    EXPECT_EQ(feed(text, sensor).frames.size(), 1U) << format.name;
    EXPECT_EQ(feed(text.substr(0, text.size() - 1), sensor).frames.size(), 0U) << format.name;
  }
}

// Any line may be cut, damaged, lost or come twice: only its own frame may be missing.
TEST(Frames, ADamagedLineCostsItsOwnFrameAlone) {
  for (const Format& format : kFormats) {
    if (format.side == 8) continue;  // without results, see below
    const auto captures = numbered(4, format.side, format.side, format.bins);
    const Sensor sensor = sensor_of(format.side, format.side, format.bins);
    const auto lines = lines_in(text_of(format.name, captures));
    const std::size_t each = lines.size() / captures.size();
    for (std::size_t in_frame = 0; in_frame < each; in_frame += 1 + each / 7) {
      const std::size_t at = each + in_frame;  // of the second frame
      const auto with = [&](const std::string& line) {
        auto damaged = lines;
        damaged[at] = line;
        return feed(joined(damaged), sensor);
      };
      SCOPED_TRACE(std::string(format.name) + " line " + std::to_string(in_frame));
      const std::string& line = lines[at];
      if (line.size() < 2) continue;  // "D", see below
      Outcome cut = with(line.substr(0, line.size() / 2));
      expect_frames(cut, captures, {0, 2, 3});
      EXPECT_GE(cut.counts["damaged_lines"] + cut.counts["incomplete_captures"], 1);
      EXPECT_FALSE(cut.said.empty());
      expect_frames(with(line.substr(0, line.size() / 2) + "x" + line.substr(line.size() / 2)),
                    captures, {0, 2, 3});
      auto missing = lines;
      missing.erase(missing.begin() + static_cast<std::ptrdiff_t>(at));
      expect_frames(feed(joined(missing), sensor), captures, {0, 2, 3});
      auto twice = lines;
      twice.insert(twice.begin() + static_cast<std::ptrdiff_t>(at), line);
      Outcome repeated = feed(joined(twice), sensor);
      expect_frames(repeated, captures, {0, 1, 2, 3});
      EXPECT_EQ(repeated.counts["repeated_lines"], 1);
      EXPECT_EQ(repeated.said.size(), 1U);
    }
  }
}

TEST(Frames, TroubleIsNamedOnceAndCountedAlways) {
  const auto captures = numbered(6, 3, 3, 128);
  auto lines = lines_in(text_of("tmf8828", captures));
  for (const std::size_t at : {5UL, 65UL, 125UL}) lines[at] = "#Raw,65,5,1,2,garbage";
  Outcome outcome = feed(joined(lines), sensor_of(3, 3, 128));
  expect_frames(outcome, captures, {1, 3, 5});
  EXPECT_EQ(outcome.counts["damaged_lines"], 3);
  EXPECT_EQ(outcome.counts["incomplete_captures"], 3);
  EXPECT_EQ(outcome.said.size(), 2U);  // one sentence for each kind
}

TEST(Frames, ABoardThatStartsAgainLosesTheFrameThatItWasIn) {
  for (const int side : {3, 4}) {
    const auto captures = numbered(3, side, side, 128);
    auto lines = lines_in(text_of("tmf8828", captures));
    const std::size_t each = lines.size() / captures.size();
    std::vector<std::string> restarted(lines.begin(), lines.begin() + static_cast<long>(each) + 7);
    restarted.push_back("TMF8828 Arduino Version 1.0");
    restarted.insert(restarted.end(), lines.begin() + 2 * static_cast<long>(each), lines.end());
    Outcome outcome = feed(joined(restarted), sensor_of(side, side, 128));
    expect_frames(outcome, captures, {0, 2});
    EXPECT_EQ(outcome.counts["restarts"], 1);
  }
}

TEST(Frames, AStreamThatIsReadFromItsMiddleGivesTheNextWholeFrame) {
  for (const Format& format :
       {Format{"tmf8828", 3, 128}, Format{"vl53l8ch", 4, 64}, Format{"tmf8829", 16, 54}}) {
    const auto captures = numbered(3, format.side, format.side, format.bins);
    const std::string text = text_of(format.name, captures);
    const Outcome outcome =
        feed(text.substr(text.size() / 6), sensor_of(format.side, format.side, format.bins));
    expect_frames(outcome, captures, {1, 2});
  }
}

// The line D alone may be lost: then a frame's zones follow those of the one before.
TEST(Frames, AFrameWithoutItsBeginningIsLeftOut) {
  const auto captures = numbered(3, 4, 4, 64);
  auto lines = lines_in(text_of("vl53l8ch", captures));
  lines.erase(lines.begin() + 17);
  Outcome outcome = feed(joined(lines), sensor_of(4, 4, 64));
  expect_frames(outcome, captures, {0, 2});
  EXPECT_EQ(outcome.counts["incomplete_captures"], 1);
}

// An 8 x 8 frame takes eight measurements, which results number.
TEST(Frames, ResultsSayWhereAFrameBegins) {
  const auto captures = numbered(4, 8, 8, 128);
  const auto lines = lines_in(text_of("tmf8828", captures));
  std::vector<std::string> with_results;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i != 300) with_results.push_back(lines[i]);
    if (i % 60 == 59) with_results.push_back("#Obj,65," + std::to_string(i / 60) + ",0");
  }
  expect_frames(feed(joined(with_results), sensor_of(8, 8, 128)), captures, {0, 2, 3});
}

TEST(Frames, LinesOfTheMakersEvaluationKitAreLearned) {
  std::string text;
  for (int frame = 0; frame < 5; ++frame) {
    for (int channel = 1; channel <= 9; ++channel) {
      text += "#HLONG" + std::string(channel < 10 ? "0" : "") + std::to_string(channel);
      for (int bin = 0; bin < 128; ++bin)
        text += ";" + std::to_string(1000 * frame + channel + bin);
      text += "\n";
    }
  }
  const Outcome outcome = feed(text, sensor_of(3, 3, 128));
  ASSERT_EQ(outcome.frames.size(), 4U);  // the first shows which channels there are
  EXPECT_EQ(outcome.frames.back().capture.counts.zone(8)[5], 4000 + 9 + 5);
}

TEST(Frames, FramesOfAnotherSensorAreNamedWithWhatTheSceneHas) {
  Outcome outcome = feed(text_of("json_lines", numbered(2, 4, 4, 32)), sensor_of(3, 3, 128));
  EXPECT_TRUE(outcome.frames.empty());
  EXPECT_EQ(outcome.counts["unsuitable_frames"], 2);
  ASSERT_EQ(outcome.said.size(), 1U);
  EXPECT_THAT(outcome.said[0], HasSubstr("found 4 x 4 zones of 32 bins"));
  EXPECT_THAT(outcome.said[0], HasSubstr("the scene's 3 x 3 zones of 128 bins"));
}

TEST(Frames, ALineWithoutAnEndTakesBoundedMemoryAndTheNextFrameIsRead) {
  const auto captures = numbered(2, 3, 3, 128);
  const std::string endless(20 << 20, '7');
  Outcome outcome =
      feed(text_of("tmf8828", captures) + "#Raw," + endless + "\n" + text_of("tmf8828", captures),
           sensor_of(3, 3, 128), 1 << 16);
  EXPECT_EQ(outcome.frames.size(), 4U);
  EXPECT_EQ(outcome.counts["long_lines"], 1);
}

TEST(Frames, RandomCutsLeaveWholeFramesAlone) {
  std::mt19937_64 random(7);
  for (const Format& format :
       {Format{"tmf8828", 3, 128}, Format{"vl53l8ch", 4, 64}, Format{"tmf8829", 16, 54}}) {
    const auto captures = numbered(60, format.side, format.side, format.bins);
    std::string text;
    std::set<std::vector<double>> known;
    std::size_t touched = 0;
    for (const Capture& capture : captures) {
      known.insert(capture.counts.values);
      std::string frame = text_of(format.name, {capture});
      if (random() % 3 == 0) {
        ++touched;
        frame.erase(random() % frame.size(), 1 + random() % 200);
      }
      text += frame;
    }
    const Outcome outcome = feed(text, sensor_of(format.side, format.side, format.bins), 777);
    // A cut that swallows the end of a frame's last line costs the one after as well; one that
    // takes whole digits out of a number is a number again, which nothing tells from the sensor's.
    EXPECT_GE(outcome.frames.size(), captures.size() - 2 * touched) << format.name;
    std::size_t altered = 0;
    for (const Frame& frame : outcome.frames)
      altered += known.count(frame.capture.counts.values) ? 0 : 1;
    EXPECT_LE(altered, touched / 4) << format.name;
  }
}

TEST(Frames, AnUnknownFormatIsRefused) {
  Tally tally;
  const auto refused = [&](const char* name) {
    return message_of([&] { FrameAssembler(sensor_of(3, 3, 128), name, {}, tally); });
  };
  EXPECT_THAT(refused("numpy"), HasSubstr("accepted: auto, tmf8829, tmf8828, tmf882x, vl53l8ch"));
}

}  // namespace
}  // namespace blindcorner::live
