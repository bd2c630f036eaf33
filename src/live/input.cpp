// SPDX-License-Identifier: Apache-2.0
#include "live/input.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <thread>
#include <utility>

#include "blindcorner/forward/error.h"
#include "io/readers/tmf8829_message.h"

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view kTcp = "tcp://", kZeroMq = "zmq://";
/// Time between two attempts to open a source that is not there.
constexpr auto kRetry = 300ms;
constexpr auto kConnectPatience = 1000ms;
constexpr std::size_t kMostBytes = 1 << 16;

constexpr std::array kSpeeds = {
    std::pair{9600, B9600},       std::pair{19200, B19200},     std::pair{38400, B38400},
    std::pair{57600, B57600},     std::pair{115200, B115200},   std::pair{230400, B230400},
    std::pair{460800, B460800},   std::pair{500000, B500000},   std::pair{921600, B921600},
    std::pair{1000000, B1000000}, std::pair{2000000, B2000000}, std::pair{3000000, B3000000}};

speed_t speed_of(int baud) {
  std::string accepted;
  for (const auto& [rate, speed] : kSpeeds) {
    if (rate == baud) return static_cast<speed_t>(speed);
    accepted += (accepted.empty() ? "" : ", ") + std::to_string(rate);
  }
  throw Error("baud", "found " + std::to_string(baud) + ", accepted: " + accepted);
}

bool has_bytes(int fd, short events, std::chrono::milliseconds patience) {
  pollfd waiting{fd, events, 0};
  return ::poll(&waiting, 1, static_cast<int>(patience.count())) > 0;
}

/// Connects within kConnectPatience; what went wrong is in errno.
bool connect_in_time(int fd, const addrinfo& to) {
  if (::connect(fd, to.ai_addr, to.ai_addrlen) == 0) return true;
  if (errno != EINPROGRESS) return false;
  if (!has_bytes(fd, POLLOUT, kConnectPatience)) {
    errno = ETIMEDOUT;
    return false;
  }
  int problem = 0;
  socklen_t size = sizeof problem;
  ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &problem, &size);
  errno = problem;
  return problem == 0;
}

}  // namespace

bool is_tcp_address(const std::string& text) { return text.starts_with(kTcp); }

TcpAddress parse_tcp_address(const std::string& text, const std::string& field,
                             const std::string& scheme) {
  const std::string before = scheme + "://";
  const std::string rest = text.starts_with(before) ? text.substr(before.size()) : std::string{};
  const std::size_t colon = rest.rfind(':');
  TcpAddress address;
  if (colon != std::string::npos) {
    address = {rest.substr(0, colon), rest.substr(colon + 1)};
    if (address.host.starts_with('[') && address.host.ends_with(']')) {
      address.host = address.host.substr(1, address.host.size() - 2);
    }
  }
  const bool digits = !address.port.empty() && address.port.size() <= 5 &&
                      address.port.find_first_not_of("0123456789") == std::string::npos;
  if (address.host.empty() || !digits || std::stoi(address.port) > 65535) {
    throw Error(field, "found '" + text + "', accepted: " + before + "host:port");
  }
  return address;
}

Input::Input(InputOptions options, Tally& tally) : options_(std::move(options)), tally_(tally) {
  speed_of(options_.baud);
  struct stat status {};
  if (options_.address == "-") {
    kind_ =
        ::fstat(STDIN_FILENO, &status) == 0 && S_ISREG(status.st_mode) ? Kind::file : Kind::pipe;
    fd_ = ::dup(STDIN_FILENO);
    if (fd_ < 0) throw Error("standard input", std::strerror(errno));
    return;
  }
  if (options_.address.starts_with(kZeroMq)) {
    parse_tcp_address(options_.address, "input", "zmq");
    kind_ = Kind::zeromq;
    publisher_ = std::make_unique<ZeroMqSubscriber>(
        std::string(kTcp) + options_.address.substr(kZeroMq.size()), "input");
    if (!options_.waits && !publisher_->connected_within(kConnectPatience)) {
      throw Error(options_.address, "no ZeroMQ publisher answers");
    }
    return;
  }
  if (is_tcp_address(options_.address)) {
    parse_tcp_address(options_.address, "input");
    kind_ = Kind::tcp;
  } else if (::stat(options_.address.c_str(), &status) == 0) {
    if (S_ISDIR(status.st_mode)) {
      throw Error(options_.address,
                  "is a folder, accepted: a device, a file, -, tcp://host:port or zmq://host:port");
    }
    kind_ = S_ISREG(status.st_mode) ? Kind::file : Kind::device;
  } else if (options_.address.starts_with("/dev/")) {
    kind_ = Kind::device;  // not plugged in yet
  } else {
    throw Error(options_.address, std::strerror(errno));
  }
  if (!open() && kind_ == Kind::file) throw Error(options_.address, std::strerror(errno));
  if (fd_ < 0 && !options_.waits) {
    throw Error(options_.address, "could not be opened: " + std::string(std::strerror(errno)));
  }
}

Input::~Input() {
  if (fd_ >= 0) ::close(fd_);
}

bool Input::open() {
  std::string problem;
  if (kind_ == Kind::tcp) {
    fd_ = connect_tcp(problem);
  } else {
    fd_ = ::open(options_.address.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd_ < 0) problem = std::strerror(errno);
    if (fd_ >= 0 && kind_ == Kind::device) set_up_serial();
  }
  if (fd_ < 0 && kind_ != Kind::file && options_.waits && !std::exchange(told_waiting_, true)) {
    tally_.say(options_.address + ": " + problem + "; waiting for it");
  }
  if (fd_ >= 0) told_waiting_ = false;
  next_try_ = std::chrono::steady_clock::now() + kRetry;
  return fd_ >= 0;
}

int Input::connect_tcp(std::string& problem) const {
  const TcpAddress address = parse_tcp_address(options_.address, "input");
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int code = ::getaddrinfo(address.host.c_str(), address.port.c_str(), &wanted, &found)) {
    problem = ::gai_strerror(code);
    return -1;
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> all(found, &::freeaddrinfo);
  for (const addrinfo* to = found; to != nullptr; to = to->ai_next) {
    const int fd = ::socket(to->ai_family, to->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) continue;
    if (connect_in_time(fd, *to)) return fd;
    problem = std::strerror(errno);
    ::close(fd);
  }
  return -1;
}

/// Sets a serial device to raw bytes at the stated speed. Other devices stay as they are.
void Input::set_up_serial() const {
  termios settings{};
  if (::tcgetattr(fd_, &settings) != 0) return;
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  ::cfsetispeed(&settings, speed_of(options_.baud));
  ::cfsetospeed(&settings, speed_of(options_.baud));
  ::tcsetattr(fd_, TCSANOW, &settings);
}

Input::Event Input::lost(const std::string& reason) {
  ::close(fd_);
  fd_ = -1;
  next_try_ = std::chrono::steady_clock::now() + kRetry;
  if (!options_.waits) return Event::ended;
  told_waiting_ = true;
  tally_.note(Count::interruptions, options_.address + ": " + reason + "; waiting for it");
  return Event::interrupted;
}

Input::Event Input::pause(std::chrono::milliseconds patience) {
  const auto until = next_try_ - std::chrono::steady_clock::now();
  if (until > 0ms) {
    std::this_thread::sleep_for(std::min<std::chrono::nanoseconds>(until, patience));
  } else {
    open();
  }
  return Event::nothing;
}

/// Turns a message into the line that a log would have. ZeroMQ itself connects again.
Input::Event Input::read_published(std::string& into, std::chrono::milliseconds patience) {
  std::string message;
  switch (publisher_->receive(message, patience)) {
    case ZeroMqSubscriber::Event::message:
      try {
        into = tmf8829_line(message);
      } catch (const Error& damage) {
        tally_.note(Count::damaged_lines, options_.address + ": " + damage.what());
        return Event::nothing;
      }
      return Event::bytes;
    case ZeroMqSubscriber::Event::disconnected:
      if (!options_.waits) return Event::ended;
      tally_.note(Count::interruptions,
                  options_.address + ": the connection was closed; waiting for it");
      return Event::interrupted;
    default:
      return Event::nothing;
  }
}

Input::Event Input::read(std::string& into, std::chrono::milliseconds patience) {
  into.clear();
  if (kind_ == Kind::zeromq) return read_published(into, patience);
  if (fd_ < 0) return pause(patience);
  if (!has_bytes(fd_, POLLIN, patience)) return Event::nothing;
  into.resize(kMostBytes);
  const ssize_t size = ::read(fd_, into.data(), into.size());
  const int problem = errno;
  into.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  if (size > 0) return Event::bytes;
  if (size < 0 && (problem == EAGAIN || problem == EINTR)) return Event::nothing;
  if (kind_ == Kind::file || kind_ == Kind::pipe) return Event::ended;
  return lost(size == 0 ? (kind_ == Kind::tcp ? "the connection was closed" : "is gone")
                        : std::strerror(problem));
}

}  // namespace blindcorner::live
