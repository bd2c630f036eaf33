// SPDX-License-Identifier: Apache-2.0
/// TMF882x lines #HLONG and #HSHORT, in the ways that programs print them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "blindcorner/io/import_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

int count(int measurement, int channel, int bin) {
  return 10'000 * measurement + 300 * channel + bin;
}

std::string bins(int measurement, int channel, char separator, int first = 0, int end = 128) {
  std::string text;
  for (int bin = first; bin < end; ++bin) {
    if (bin > first) text += separator;
    text += std::to_string(count(measurement, channel, bin));
  }
  return text;
}

std::string two_digits(int channel) { return (channel < 10 ? "0" : "") + std::to_string(channel); }

/// A capture of 4 x 4 zones as the makers' EVM program writes it.
std::string evm(int measurement) {
  std::string text = "#OBJ;1745607037698;77;4;4;1630;92\r\n#TMP;1745607037698;77;37\r\n";
  for (int channel = 1; channel <= 16; ++channel) {
    text += "#HLONG" + two_digits(channel) + ";" + bins(measurement, channel, ';') + "\r\n";
  }
  return text + "#HOCAL0;" + bins(9, 0, ';') + "\r\n#ITT;1745607037889;4000;6;7;5.0 m;4 x 4;0\r\n";
}

/// The head of such a file.
std::string evm_head() {
  std::string text = "sep=;\r\n#VER;ToF Serial Number\r\n#HLONG01";
  for (int bin = 0; bin < 128; ++bin) text += ";Bin" + std::to_string(bin);
  return text + "\r\n#VER;3b-83-41-01\r\n";
}

/// A measurement as SparkFun's library prints it: two channels each converter, the channel and the
/// first bin without a separator. The ninth channel is dark unless `ninth`.
std::string sparkfun(int measurement, int counter, bool ninth = true) {
  std::string text = "Histogram Number: " + std::to_string(counter) + "\r\n";
  for (int channel = 0; channel < 10; ++channel) {
    std::string numbers = bins(measurement, channel, ',');
    if (channel == 9 && !ninth) {
      numbers = "0";
      for (int bin = 1; bin < 128; ++bin) numbers += ",0";
    }
    if (channel % 2 == 0) text += "\r\n";
    text += "#HLONG" + std::to_string(channel) + numbers + "\r\n";
  }
  return text;
}

class Tmf882xLines : public ::testing::Test {
 protected:
  CaptureFile import(const std::string& text, ImportOptions options = {}) {
    write_text(path_, text);
    notes_.clear();
    return import_captures({path_}, options, &notes_);
  }
  static ImportOptions side(int zones) {
    ImportOptions options;
    options.rows = options.columns = zones;
    return options;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("log.csv");
  std::vector<std::string> notes_;
};

TEST_F(Tmf882xLines, EvaluationProgram) {
  const CaptureFile file = import(evm_head() + evm(0) + evm(1));
  EXPECT_EQ(file.sensor, "tmf882x");
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[0].counts.rows, 4);
  EXPECT_EQ(file.captures[0].counts.bins, 128);
  EXPECT_EQ(file.captures[1].counts.zone(15)[127], count(1, 16, 127));
  EXPECT_THAT(notes_, ElementsAre(AllOf(HasSubstr("1, 2, 3"), HasSubstr("row by row, 4 x 4"),
                                        Not(HasSubstr("reference")))));
}

TEST_F(Tmf882xLines, ArduinoLibraryWithoutASeparator) {
  const CaptureFile file = import("Taking 4 data samples.\r\n" + sparkfun(0, 1) + sparkfun(1, 2));
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[0].counts.rows, 3);
  EXPECT_EQ(file.captures[1].counts.zone(0)[0], count(1, 1, 0));
  EXPECT_EQ(file.captures[1].counts.zone(8)[127], count(1, 9, 127));
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("channel 0 as the reference")));
}

TEST_F(Tmf882xLines, CounterTellsWhichMeasurementsMakeACapture) {
  // The log begins with the second measurement of a 4 x 4 capture.
  const CaptureFile file = import(
      sparkfun(1, 2, false) + sparkfun(2, 3, false) + sparkfun(3, 4, false) + sparkfun(4, 1, false),
      side(4));
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_EQ(file.captures[0].counts.zone(0)[5], count(2, 1, 5));
  EXPECT_EQ(file.captures[0].counts.zone(15)[5], count(3, 8, 5));
  EXPECT_THAT(notes_, Contains(HasSubstr("line 1: ")).Times(0));
  EXPECT_THAT(notes_, Contains(HasSubstr("no others to make a capture")).Times(2));
}

TEST_F(Tmf882xLines, DashesColonsAndConverters) {
  std::string dashes;
  for (int channel = 0; channel < 10; ++channel) {
    dashes += "#HLONG-" + std::to_string(channel) + ":" + bins(1, channel, ',') + "\n";
  }
  EXPECT_EQ(import(dashes).captures.at(0).counts.zone(8)[3], count(1, 9, 3));
  std::string converters;  // two channels a line
  for (int line = 0; line < 5; ++line) {
    converters += "#HLONG" + std::to_string(line) + "," + bins(1, 2 * line, ',') + "," +
                  bins(1, 2 * line + 1, ',') + "\n";
  }
  EXPECT_EQ(import(converters).captures.at(0).counts.values,
            import(dashes).captures.at(0).counts.values);
}

TEST_F(Tmf882xLines, TimesOfASerialMonitorAreNoPartOfALine) {
  std::string stamped;
  const std::string text = sparkfun(0, 1);
  for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1) {
    stamped += "12:34:56.789 -> " + text.substr(at, text.find('\n', at) + 1 - at);
  }
  EXPECT_EQ(import(stamped).captures.at(0).counts.zone(2)[7], count(0, 3, 7));
}

TEST_F(Tmf882xLines, CutLinesCostTheirMeasurementAndAreNamed) {
  std::string cut = evm(1);
  const std::size_t line = cut.find("#HLONG05");
  cut.erase(line + 100, cut.find("\r\n", line) - line - 100);
  const CaptureFile file = import(evm(0) + cut + evm(2));
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[1].counts.zone(0)[0], count(2, 1, 0));
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr(path_ + ": line 27: "), HasSubstr("fields"))));
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("line 23: "), HasSubstr("left out"))));
  std::string damaged = evm(1);
  damaged.replace(damaged.find(";" + std::to_string(count(1, 2, 7)) + ";"), 3, ";x");
  EXPECT_EQ(import(evm(0) + damaged).captures.size(), 1u);
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("line 24"), HasSubstr("bin 7"))));
}

TEST_F(Tmf882xLines, ARestartOfTheBoardCostsTheMeasurementThatItCut) {
  const std::string begun = evm(1).substr(0, evm(1).find("#HLONG09"));
  const CaptureFile file = import(evm(0) + begun + evm_head() + evm(2));
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[1].counts.zone(3)[3], count(2, 4, 3));
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("line 23"), HasSubstr("most have"))));
}

TEST_F(Tmf882xLines, OfTwoKindsOneIsKept) {
  std::string both;
  for (const std::string kind : {"LONG", "SHORT"}) {
    for (int channel = 0; channel < 10; ++channel) {
      both += "#H" + kind + std::to_string(channel) + "," +
              bins(kind == "LONG" ? 1 : 2, channel, ',') + "\n";
    }
  }
  EXPECT_EQ(import(both).captures.at(0).counts.zone(0)[0], count(1, 1, 0));
  EXPECT_THAT(notes_, Contains(HasSubstr("--array chooses")));
  ImportOptions options;
  options.array = "HSHORT";
  EXPECT_EQ(import(both, options).captures.at(0).counts.zone(0)[0], count(2, 1, 0));
  options.array = "HMIDDLE";
  EXPECT_THAT(error_of([&] { import(both, options); }), HasSubstr("accepted HLONG and HSHORT"));
}

TEST_F(Tmf882xLines, ZonesThatAreNoSquareHaveToBeStated) {
  std::string text;
  for (int channel = 1; channel <= 18; ++channel) {
    text += "#HLONG" + two_digits(channel) + ";" + bins(0, channel, ';') + "\n";
  }
  EXPECT_THAT(error_of([&] { import(text); }), HasSubstr("rows and columns have to be stated"));
  ImportOptions options;
  options.rows = 6;
  options.columns = 3;
  EXPECT_EQ(import(text, options).captures.at(0).counts.zone(17)[1], count(0, 18, 1));
}

}  // namespace
}  // namespace blindcorner
