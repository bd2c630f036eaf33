// SPDX-License-Identifier: Apache-2.0
/// Messages of the TMF8829 makers' publisher: what the protocol says, damage, and a real publisher.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "blindcorner/forward/error.h"
#include "io/readers/tmf8829_message.h"
#include "live/frames.h"
#include "live/input.h"
#include "unit/error_message.h"

#ifdef BLINDCORNER_TEST_ZEROMQ
#include <zmq.h>
#endif

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

std::string little_endian(std::uint32_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> 8 * i & 0xFF);
  return text;
}

/// Five bytes of the host, header, payload and footer of one frame of the sensor.
std::string sensor_frame(unsigned id, unsigned layout, const std::string& payload) {
  const auto size = static_cast<std::uint32_t>(payload.size() + 12 + 12);
  return std::string(5, 'h') + little_endian(id, 1) + little_endian(layout, 1) +
         little_endian(size, 2) + std::string(12, '\1') + payload + std::string(8, 't') +
         little_endian(1, 1) + '\0' + little_endian(0xE0F7, 2);
}

std::string container(const std::string& frames) {
  const auto size = static_cast<std::uint32_t>(84 - 8 + frames.size());
  return little_endian(0xFE5E1234, 4) + '\2' + std::string(3, '\0') + little_endian(size, 4) +
         std::string(72, '\0') + frames;
}

/// A count that names zone and bin, of 24 bits.
std::uint32_t count_of(std::size_t row, std::size_t column, std::size_t bin, std::uint32_t add) {
  return static_cast<std::uint32_t>((row * 48 + column) * 256 + bin) + add;
}

/// The frame of histograms that has these rows and columns of zones.
std::string histograms(unsigned mode, unsigned place, const std::vector<std::size_t>& rows,
                       const std::vector<std::size_t>& columns, std::uint32_t add = 0) {
  std::string payload(4 * 64 * 3, 'r');
  for (const std::size_t row : rows) {
    for (const std::size_t column : columns) {
      for (std::size_t bin = 0; bin < (mode < 2 ? 256U : 64U); ++bin) {
        payload += little_endian(count_of(row, column, bin, add), 3);
      }
    }
  }
  return sensor_frame(0x20 | mode, place, payload);
}

std::vector<std::size_t> every(std::size_t first, std::size_t step, std::size_t count) {
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(first + i * step);
  return numbers;
}

/// Results, then both halves of 16 x 16 zones.
std::string whole_message(std::uint32_t add = 0) {
  return container(histograms(2, 0, every(0, 1, 16), every(0, 1, 8), add) +
                   histograms(2, 1, every(0, 1, 16), every(8, 1, 8), add) +
                   sensor_frame(0x12, 0x01, std::string(256 * 3, 'p')) +
                   sensor_frame(0x32, 0, std::string(32, 's')));
}

void expect_counts(const nlohmann::json& rows, std::size_t bins, std::uint32_t add) {
  for (std::size_t row = 0; row < rows.size(); ++row) {
    for (std::size_t column = 0; column < rows[row].size(); ++column) {
      const nlohmann::json& zone = rows[row][column]["bin"];
      ASSERT_EQ(zone.size(), bins);
      for (std::size_t bin = 0; bin < bins; ++bin) {
        ASSERT_EQ(zone[bin].get<std::uint32_t>(), count_of(row, column, bin, add))
            << row << ", " << column << ", " << bin;
      }
    }
  }
}

TEST(Tmf8829Message, HasEachZoneWhereTheProtocolSaysInEveryMode) {
  const auto sixteen = nlohmann::json::parse(tmf8829_line(whole_message()));
  ASSERT_EQ(sixteen["mp_histo"].size(), 16U);
  ASSERT_EQ(sixteen["mp_histo"][0].size(), 16U);
  expect_counts(sixteen["mp_histo"], 64, 0);
  const auto eight = nlohmann::json::parse(
      tmf8829_line(container(histograms(0, 0, every(0, 1, 8), every(0, 1, 4)) +
                             histograms(0, 1, every(0, 1, 8), every(4, 1, 4)))));
  ASSERT_EQ(eight["mp_histo"].size(), 8U);
  ASSERT_EQ(eight["mp_histo"][0].size(), 8U);
  expect_counts(eight["mp_histo"], 256, 0);
  // T0 to T11 of the protocol's table for 48 x 32.
  std::string frames;
  const std::size_t first_column[] = {0, 24, 1, 25, 2, 26};
  for (unsigned place = 0; place < 12; ++place) {
    frames += histograms(5, place, every(place / 6, 2, 16), every(first_column[place % 6], 3, 8));
  }
  const auto all = nlohmann::json::parse(tmf8829_line(container(frames)));
  ASSERT_EQ(all["mp_histo"].size(), 32U);
  ASSERT_EQ(all["mp_histo"][0].size(), 48U);
  expect_counts(all["mp_histo"], 64, 0);
}

TEST(Tmf8829Message, DualModeHasTwoArraysInTheOrderOfTheMakersProgram) {
  const auto half = [](unsigned place, std::uint32_t add) {
    return histograms(2, place, every(0, 1, 16), every(place * 8, 1, 8), add);
  };
  const auto dual = nlohmann::json::parse(
      tmf8829_line(container(half(0, 7) + half(1, 7) + half(0, 0) + half(1, 0))));
  expect_counts(dual["mp_histo_HA"], 64, 7);
  expect_counts(dual["mp_histo"], 64, 0);
}

TEST(Tmf8829Message, SaysWhatIsDamaged) {
  const std::string whole = whole_message();
  const auto said = [](const std::string& message) {
    return message_of([&] { tmf8829_line(message); });
  };
  const auto changed = [&](std::size_t at, char byte) {
    std::string message = whole;
    message[at] = byte;
    return said(message);
  };
  EXPECT_THAT(said(""), HasSubstr("ends early"));
  EXPECT_THAT(said("{\"mp_histo\":[]}"), HasSubstr("0xFE5E1234"));
  EXPECT_THAT(changed(4, '\3'), HasSubstr("protocol 3"));
  EXPECT_THAT(said(whole.substr(0, whole.size() - 1)), HasSubstr("states"));
  EXPECT_THAT(changed(84 + 5, 0x26), HasSubstr("mode 6"));
  EXPECT_THAT(changed(84 + 5 + 1, '\2'), HasSubstr("at place 2"));
  EXPECT_THAT(changed(84 + 5 + 1, '\1'), HasSubstr("lacks histograms"));
  EXPECT_THAT(said(container(sensor_frame(0x12, 0x01, "results"))), HasSubstr("\"histograms\": 1"));
  EXPECT_THAT(said(container(histograms(2, 0, every(0, 1, 16), every(0, 1, 8)))),
              HasSubstr("1 frames of histograms"));
  std::string aborted = histograms(2, 0, every(0, 1, 16), every(0, 1, 8));
  aborted[aborted.size() - 4] = '\x41';
  EXPECT_THAT(said(container(aborted)), HasSubstr("invalid"));
}

TEST(Tmf8829Message, NoDamageDoesMoreThanAnError) {
  std::mt19937 chance(11);  // NOLINT: the same every time
  const std::string whole = whole_message();
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string message = whole;
    // Headers and footers, where damage matters.
    const std::size_t at = chance() % 2 == 0 ? chance() % 120 : chance() % message.size();
    message[at] = static_cast<char>(chance());
    if (chance() % 2 == 0) message.resize(chance() % message.size());
    try {
      tmf8829_line(message);
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
}

#ifdef BLINDCORNER_TEST_ZEROMQ

/// A publisher at an address of this machine, "host:port"; * is a free port.
class Publisher {
 public:
  explicit Publisher(const std::string& address = "127.0.0.1:*") {
    const int none = 0;
    zmq_setsockopt(socket_, ZMQ_LINGER, &none, sizeof none);
    EXPECT_EQ(zmq_bind(socket_, ("tcp://" + address).c_str()), 0) << zmq_strerror(errno);
    char endpoint[64] = {};
    std::size_t size = sizeof endpoint;
    zmq_getsockopt(socket_, ZMQ_LAST_ENDPOINT, endpoint, &size);
    address_ = std::string(endpoint).substr(std::string_view("tcp://").size());
  }
  ~Publisher() {
    zmq_close(socket_);
    zmq_ctx_term(context_);
  }
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  /// The address with the port that was taken.
  const std::string& address() const { return address_; }
  /// Until then nobody would get what is sent.
  void wait_for_subscriber() {
    char byte = 0;
    const int patience = 20000;
    zmq_setsockopt(socket_, ZMQ_RCVTIMEO, &patience, sizeof patience);
    ASSERT_EQ(zmq_recv(socket_, &byte, 1, 0), 1) << "nobody subscribed";
  }
  void send(const std::string& message) { zmq_send(socket_, message.data(), message.size(), 0); }

 private:
  void* context_ = zmq_ctx_new();
  void* socket_ = zmq_socket(context_, ZMQ_XPUB);
  std::string address_;
};

/// Reads until something of that kind comes.
bool comes(Input& input, Input::Event wanted, std::string& bytes) {
  const auto patience = Clock::now() + 20s;
  while (Clock::now() < patience) {
    if (input.read(bytes, 50ms) == wanted) return true;
  }
  return false;
}

TEST(ZeroMqInput, FramesComeThroughAndDamagedMessagesCostThemselvesAlone) {
  Publisher publisher;
  Tally tally;
  Input input({"zmq://" + publisher.address(), 115200, true}, tally);
  publisher.wait_for_subscriber();
  Sensor sensor;
  sensor.rows = sensor.columns = 16;
  sensor.bins = 54;
  FrameAssembler assembler(sensor, "auto", {}, tally);
  std::vector<Frame> frames;
  std::string bytes;
  publisher.send("");
  publisher.send("rubbish");
  publisher.send(whole_message().substr(0, 30000));
  publisher.send(whole_message());
  ASSERT_TRUE(comes(input, Input::Event::bytes, bytes));
  assembler.add(bytes, Clock::now(), [&](Frame frame) { frames.push_back(std::move(frame)); });
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(tally.of(Count::damaged_lines), 3);
  const HistogramCube& counts = frames.front().capture.counts;
  for (int zone = 0; zone < 256; ++zone) {
    for (int bin = 0; bin < 54; ++bin) {
      ASSERT_EQ(counts.zone(zone)[bin],
                count_of(static_cast<std::size_t>(zone / 16), static_cast<std::size_t>(zone % 16),
                         static_cast<std::size_t>(bin), 0));
    }
  }
}

TEST(ZeroMqInput, APublisherThatGoesIsWaitedFor) {
  // Between two publishers the port is free. Tests that run beside this one use 127.0.0.1 and
  // cannot take a port of another address.
  Tally tally;
  auto publisher = std::make_unique<Publisher>("127.0.0.2:*");
  const std::string address = publisher->address();
  Input input({"zmq://" + address, 115200, true}, tally);
  std::string bytes;
  publisher->wait_for_subscriber();
  publisher->send(whole_message(1));
  ASSERT_TRUE(comes(input, Input::Event::bytes, bytes));
  publisher.reset();
  ASSERT_TRUE(comes(input, Input::Event::interrupted, bytes));
  EXPECT_EQ(tally.of(Count::interruptions), 1);
  Publisher again(address);
  again.wait_for_subscriber();
  again.send(whole_message(2));
  ASSERT_TRUE(comes(input, Input::Event::bytes, bytes));
  EXPECT_EQ(bytes, tmf8829_line(whole_message(2)));
}

TEST(ZeroMqInput, OnceAsksForAPublisherAndEndsWithIt) {
  Tally tally;
  auto publisher = std::make_unique<Publisher>();
  const std::string address = "zmq://" + publisher->address();
  Input input({address, 115200, false}, tally);
  publisher->wait_for_subscriber();
  publisher.reset();
  std::string bytes;
  EXPECT_TRUE(comes(input, Input::Event::ended, bytes));
  EXPECT_THAT(message_of([&] {
                Input({address, 115200, false}, tally);
              }),
              HasSubstr("no ZeroMQ publisher answers"));
}

#else

TEST(ZeroMqInput, WithoutTheLibraryTheErrorSaysWhatToInstall) {
  Tally tally;
  EXPECT_THAT(message_of([&] {
                Input({"zmq://127.0.0.1:5558", 115200, true}, tally);
              }),
              HasSubstr("install libzmq3-dev"));
}

#endif

TEST(ZeroMqInput, AnAddressWithoutAPortIsRefused) {
  Tally tally;
  EXPECT_THAT(message_of([&] {
                Input({"zmq://127.0.0.1", 115200, true}, tally);
              }),
              HasSubstr("accepted: zmq://host:port"));
}

}  // namespace
}  // namespace blindcorner::live
