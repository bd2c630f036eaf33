// SPDX-License-Identifier: Apache-2.0
/// Answers on their way to pipes, files and browsers: bounded, and nobody waits.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <thread>

#include "blindcorner/io/capture_file.h"
#include "live/access.h"
#include "live/event_hub.h"
#include "live/line_output.h"
#include "live/mailbox.h"
#include "live/page_server.h"
#include "live/recorder.h"
#include "unit/error_message.h"

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

double seconds_of(const std::function<void()>& work) {
  const auto begun = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

TEST(Mailbox, HoldsTheNewestAndSaysHowManyItReplaced) {
  Mailbox<int> box;
  EXPECT_EQ(box.put(1), 0U);
  EXPECT_EQ(box.put(2), 1U);
  EXPECT_FALSE(box.offer(3));
  EXPECT_EQ(box.take(0ms), 2);
  EXPECT_EQ(box.take(0ms), std::nullopt);
  box.put(4);
  box.close();
  EXPECT_FALSE(box.finished());
  EXPECT_EQ(box.take(0ms), 4);
  EXPECT_TRUE(box.finished());
}

TEST(Mailbox, PatienceLosesNothing) {
  Mailbox<int> box;
  std::thread feeder([&] {
    for (int i = 0; i < 1000; ++i) box.put_patiently(i);
    box.close();
  });
  int expected = 0;
  while (!box.finished()) {
    const auto value = box.take(100ms);
    if (value) {
      EXPECT_EQ(*value, expected++);
    }
  }
  feeder.join();
  EXPECT_EQ(expected, 1000);
}

TEST(EventHub, ABrowserThatNeverReadsHoldsABoundedNumberAndNobodyUp) {
  Tally tally;
  EventHub hub(2, 8, tally);
  const auto deaf = hub.join();
  const auto reads = hub.join();
  ASSERT_NE(reads, nullptr);
  EXPECT_EQ(hub.join(), nullptr);  // enough
  const double time = seconds_of([&] {
    for (int i = 0; i < 10000; ++i) {
      hub.publish("answer", std::to_string(i));
      EXPECT_EQ(**reads->take(0ms), "event: answer\ndata: " + std::to_string(i) + "\n\n");
    }
  });
  EXPECT_LT(time, 5.0);  // microseconds each; the bound is for a machine under load
  EXPECT_EQ(tally.of(Count::dropped_events), 10000 - 8);
  EXPECT_EQ(**deaf->take(0ms), "event: answer\ndata: 9992\n\n");  // the newest eight are kept
  hub.leave(deaf);
  EXPECT_NE(hub.join(), nullptr);
  hub.close();
  EXPECT_EQ(hub.join(), nullptr);
}

struct Pipe {
  int ends[2] = {-1, -1};
  Pipe() { EXPECT_EQ(::pipe(ends), 0); }
  ~Pipe() {
    for (const int end : ends) {
      if (end >= 0) ::close(end);
    }
  }
};

TEST(LineOutput, AFullPipeCostsTheCallerNothingAndIsCounted) {
  Pipe pipe;
  std::vector<std::string> said;
  Tally tally([&](const std::string& text) { said.push_back(text); });
  const std::string line(10'000, 'x');
  {
    LineOutput output(pipe.ends[1], tally, 4);
    const double time = seconds_of([&] {
      for (int i = 0; i < 1000; ++i) output.put(line);
    });
    EXPECT_LT(time, 1.0);
    EXPECT_GT(tally.of(Count::dropped_answers), 900);
    ASSERT_EQ(said.size(), 1U);
    EXPECT_THAT(said[0], HasSubstr("standard output is full"));
    EXPECT_FALSE(output.broken());
  }
}

TEST(LineOutput, LinesComeWholeAndInOrder) {
  Pipe pipe;
  Tally tally;
  std::string read;
  std::thread reader([&] {
    char bytes[1000];
    for (ssize_t size; (size = ::read(pipe.ends[0], bytes, sizeof bytes)) > 0;) {
      read.append(bytes, static_cast<std::size_t>(size));
    }
  });
  std::string expected;
  {
    LineOutput output(pipe.ends[1], tally, 1000);
    for (int i = 0; i < 300; ++i) {
      const std::string line = std::to_string(i) + std::string(3000, 'y');
      output.put(line);
      expected += line + "\n";
    }
  }
  ::close(std::exchange(pipe.ends[1], -1));
  reader.join();
  EXPECT_EQ(read, expected);
  EXPECT_EQ(tally.of(Count::dropped_answers), 0);
}

TEST(LineOutput, AReaderWhoLeavesIsNoticed) {
  std::signal(SIGPIPE, SIG_IGN);
  Pipe pipe;
  ::close(std::exchange(pipe.ends[0], -1));
  Tally tally;
  LineOutput output(pipe.ends[1], tally);
  output.put("to nobody");
  for (int i = 0; i < 200 && !output.broken(); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_TRUE(output.broken());
}

/// Options of a recorder that writes into a folder of its own.
class RecorderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder = (std::filesystem::temp_directory_path() / "blindcorner_live_XXXXXX").string();
    ASSERT_NE(mkdtemp(folder.data()), nullptr);
    options.path = folder + "/walk.exr";
    options.bin_width = 1e-10;
  }
  void TearDown() override { std::filesystem::remove_all(folder); }

  std::string folder;
  RecorderOptions options;
  Tally tally;
};

TEST_F(RecorderTest, ALongRecordingIsSeveralWholeFilesThatHoldEveryFrame) {
  options.most_bytes = 4UL * 2 * 2 * 16 * sizeof(double);  // four frames
  Recorder recorder(options, tally);
  for (int i = 0; i < 10; ++i) {
    Capture capture;
    capture.counts = HistogramCube(2, 2, 16);
    capture.counts.values.assign(64, i);
    recorder.add(capture, true);
  }
  const std::vector<std::string> files = recorder.finish();
  ASSERT_EQ(files.size(), 3U);
  EXPECT_EQ(files[1], folder + "/walk_0002.exr");
  double next = 0;
  for (const std::string& file : files) {
    for (const Capture& capture : read_captures(file).captures) {
      EXPECT_EQ(capture.counts.values.front(), next++);
    }
  }
  EXPECT_EQ(next, 10);
  EXPECT_EQ(tally.of(Count::unrecorded_frames), 0);
  EXPECT_THAT(message_of([&] { Recorder({.path = folder + "/none/x.exr"}, tally); }),
              HasSubstr("its folder does not exist"));
}

// The frames wait for the disk, and each attempt to write them counts only those that are new.
class RecorderWithoutFolder : public RecorderTest, public ::testing::WithParamInterface<bool> {};

TEST_P(RecorderWithoutFolder, CountsFramesOnceAndNotOnceTheyAreWritten) {
  const bool comes_back = GetParam();
  options.save_interval = 0;
  Recorder recorder(options, tally);
  std::filesystem::remove_all(folder);
  for (int i = 0; i < 5; ++i) {
    Capture capture;
    capture.counts = HistogramCube(2, 2, 16);
    recorder.add(capture, true);
    while (tally.of(Count::unrecorded_frames) <= i) std::this_thread::yield();
  }
  if (comes_back) std::filesystem::create_directory(folder);
  EXPECT_EQ(recorder.finish().size(), comes_back ? 1U : 0U);
  EXPECT_EQ(tally.of(Count::unrecorded_frames), comes_back ? 0 : 5);
}
INSTANTIATE_TEST_SUITE_P(ComesBack, RecorderWithoutFolder, ::testing::Bool());

TEST(Access, OnlyPagesOfThisServerMayRead) {
  const AccessRules here{"127.0.0.1", 8628, ""};
  EXPECT_EQ(refusal({.host = "127.0.0.1:8628"}, here), "");
  EXPECT_EQ(refusal({.host = "localhost:8628"}, here), "");
  EXPECT_EQ(refusal({.host = "[::1]:8628"}, here), "");
  for (const char* other :
       {"", "evil.example:8628", "127.0.0.1", "127.0.0.1:80", "127.0.0.1.evil.example:8628",
        "192.168.1.7:8628", "localhost.evil.example:8628"}) {
    EXPECT_EQ(refusal({.host = other}, here), "another Host") << other;
  }
  EXPECT_EQ(refusal({.host = "127.0.0.1:8628", .origin = "http://127.0.0.1:8628"}, here), "");
  for (const char* origin : {"http://evil.example", "null", "http://127.0.0.1:9999"}) {
    EXPECT_EQ(refusal({.host = "127.0.0.1:8628", .origin = origin}, here), "another Origin");
  }
  EXPECT_NE(refusal({.host = "127.0.0.1:8628", .fetch_site = "cross-site", .fetch_mode = "no-cors"},
                    here),
            "");
  EXPECT_EQ(
      refusal({.host = "127.0.0.1:8628", .fetch_site = "cross-site", .fetch_mode = "navigate"},
              here),
      "");
}

TEST(Access, BeyondThisMachineATokenIsAskedFor) {
  const AccessRules open{"0.0.0.0", 80, "secret"};
  EXPECT_EQ(refusal({.host = "192.168.1.7", .token = "secret"}, open), "");
  EXPECT_EQ(refusal({.host = "192.168.1.7"}, open), "no token");
  EXPECT_EQ(refusal({.host = "192.168.1.7", .token = "secre"}, open), "no token");
  EXPECT_EQ(refusal({.host = "evil.example", .token = "secret"}, open), "another Host");
  EXPECT_THAT(message_of([] { ServerOptions{.address = "0.0.0.0"}.validate(); }),
              HasSubstr("without a token"));
  EXPECT_TRUE(same_token("abc", "abc"));
  EXPECT_FALSE(same_token("abc", "abd"));
  EXPECT_FALSE(same_token("abc", ""));
  EXPECT_FALSE(same_token("", "abc"));
  EXPECT_EQ(new_token().size(), 32U);
  EXPECT_NE(new_token(), new_token());
}

/// Sends text to the server; what comes back until it closes or is silent for five seconds.
std::string exchange(int port, const std::string& request) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const timeval patience{.tv_sec = 5, .tv_usec = 0};
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  EXPECT_EQ(::send(fd, request.data(), request.size(), MSG_NOSIGNAL), std::ssize(request));
  std::string answer;
  char bytes[4096];
  for (ssize_t size; (size = ::recv(fd, bytes, sizeof bytes, 0)) > 0;) {
    answer.append(bytes, static_cast<std::size_t>(size));
  }
  ::close(fd);
  return answer;
}

class Server : public ::testing::Test {
 protected:
  std::string get(const std::string& path, const std::string& more = "") {
    const std::string host = "127.0.0.1:" + std::to_string(server_.port());
    return exchange(server_.port(), "GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\n" + more +
                                        "Connection: close\r\n\r\n");
  }
  Tally tally_;
  EventHub hub_{4, 8, tally_};
  PageServer server_{{.port = 0, .token = "secret"},
                     {.page = "<p>the page",
                      .greeting = [] { return "event: first\n\n"; },
                      .status = [] { return "{\"state\":1}"; }},
                     hub_,
                     tally_};
};

TEST_F(Server, ServesThePageToThoseWithTheTokenOnly) {
  EXPECT_THAT(get("/"), AllOf(StartsWith("HTTP/1.1 403"), Not(HasSubstr("the page"))));
  EXPECT_THAT(get("/?token=wrong"), StartsWith("HTTP/1.1 403"));
  const std::string page = get("/?token=secret");
  EXPECT_THAT(page, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("the page"),
                          HasSubstr("SameSite=Strict"), HasSubstr("Content-Security-Policy")));
  EXPECT_THAT(page, Not(HasSubstr("Access-Control-Allow-Origin")));
  const std::string cookie =
      "Cookie: a=b; blindcorner_" + std::to_string(server_.port()) + "=secret\r\n";
  EXPECT_THAT(get("/status.json", cookie), HasSubstr("{\"state\":1}"));
  EXPECT_THAT(get("/status.json", "Authorization: Bearer secret\r\n"), HasSubstr("{\"state\":1}"));
  EXPECT_THAT(get("/status.json", cookie + "Origin: http://evil.example\r\n"),
              StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(exchange(server_.port(),
                       "GET /?token=secret HTTP/1.1\r\nHost: evil.example\r\n"
                       "Connection: close\r\n\r\n"),
              StartsWith("HTTP/1.1 403"));
}

TEST_F(Server, ABrowserThatComesBackWhileTheProgramEndsIsNoFault) {
  hub_.close();
  EXPECT_THAT(get("/events?token=secret"),
              AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("live has ended")));
  EXPECT_EQ(tally_.of(Count::refused_requests), 0);
}

TEST_F(Server, EventsComeAsTheyArePublished) {
  std::thread publisher([&] {
    for (int k = 0; k < 2000 && hub_.clients() == 0; ++k) std::this_thread::sleep_for(5ms);
    for (int i = 0; i < 3; ++i) hub_.publish("answer", std::to_string(i));
    std::this_thread::sleep_for(100ms);
    hub_.close();
  });
  const std::string events = get("/events?token=secret");
  publisher.join();
  EXPECT_THAT(events, AllOf(HasSubstr("text/event-stream"), HasSubstr("event: first"),
                            HasSubstr("event: answer\ndata: 0\n"), HasSubstr("data: 2\n")));
}

TEST_F(Server, RubbishAndLargeRequestsAreRefused) {
  EXPECT_THAT(exchange(server_.port(), std::string(2000, '\x01') + "\r\n\r\n"),
              Not(HasSubstr("the page")));
  const std::string host = "Host: 127.0.0.1:" + std::to_string(server_.port()) + "\r\n";
  EXPECT_THAT(exchange(server_.port(), "POST /?token=secret HTTP/1.1\r\n" + host +
                                           "Content-Length: 100000000\r\n\r\n"),
              Not(HasSubstr(" 200 ")));
  EXPECT_THAT(get("/?token=secret"), HasSubstr("the page"));  // it still serves
}

}  // namespace
}  // namespace blindcorner::live
