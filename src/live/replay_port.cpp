// SPDX-License-Identifier: Apache-2.0
#include "live/replay_port.h"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>
#include <vector>

#include "blindcorner/forward/error.h"
#include "live/input.h"

namespace blindcorner::live {
namespace {

constexpr int kLookEvery = 100;  ///< ms between looks at whether to stop
/// A reader that takes nothing for this long is let go, ms.
constexpr int kDeaf = 2000;

enum class Written { all, reader_gone, stopped };

/// Writes to a descriptor that does not block.
Written write_all(int fd, std::string_view bytes, const std::function<bool()>& stop, int deaf) {
  int waited = 0;
  while (!bytes.empty()) {
    if (stop()) return Written::stopped;
    pollfd waiting{fd, POLLOUT, 0};
    if (::poll(&waiting, 1, kLookEvery) <= 0) {
      waited += kLookEvery;
      if (deaf > 0 && waited >= deaf) return Written::reader_gone;
      continue;
    }
    if ((waiting.revents & (POLLERR | POLLHUP)) != 0) return Written::reader_gone;
    // A pipe that poll calls writable takes 4096 bytes (PIPE_BUF) without blocking.
    const ssize_t size = ::write(fd, bytes.data(), std::min<std::size_t>(bytes.size(), 4096));
    if (size > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(size));
      waited = 0;
    } else if (size < 0 && errno != EAGAIN && errno != EINTR) {
      return Written::reader_gone;
    }
  }
  return Written::all;
}

/// A file descriptor that is closed with its owner.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

Error failed(const std::string& what) { return {what, std::strerror(errno)}; }

class PseudoTerminal : public ReplayPort {
 public:
  PseudoTerminal() : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    if (master_.get() < 0 || ::grantpt(master_.get()) != 0 || ::unlockpt(master_.get()) != 0) {
      throw failed("pseudo-terminal");
    }
    std::array<char, 128> path{};
    if (::ptsname_r(master_.get(), path.data(), path.size()) != 0) throw failed("pseudo-terminal");
    path_ = path.data();
    // After the terminal was opened and closed once, poll shows whether anybody has it open.
    const Descriptor once(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    if (once.get() < 0) throw failed(path_);
    termios settings{};
    if (::tcgetattr(once.get(), &settings) == 0) {
      ::cfmakeraw(&settings);
      ::tcsetattr(once.get(), TCSANOW, &settings);
    }
  }
  std::string name() const override { return path_; }
  bool has_reader() override {
    pollfd state{master_.get(), 0, 0};
    return ::poll(&state, 1, 0) <= 0 || (state.revents & POLLHUP) == 0;
  }
  bool write(std::string_view bytes, const std::function<bool()>& stop) override {
    if (has_reader()) write_all(master_.get(), bytes, stop, kDeaf);
    return true;
  }

 private:
  Descriptor master_;
  std::string path_;
};

class TcpPort : public ReplayPort {
 public:
  explicit TcpPort(const std::string& text) {
    const TcpAddress address = parse_tcp_address(text, "listen");
    addrinfo wanted{};
    wanted.ai_socktype = SOCK_STREAM;
    wanted.ai_flags = AI_PASSIVE;
    addrinfo* found = nullptr;
    if (const int code =
            ::getaddrinfo(address.host.c_str(), address.port.c_str(), &wanted, &found)) {
      throw Error(text, ::gai_strerror(code));
    }
    const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> all(found, &::freeaddrinfo);
    listener_ =
        Descriptor(::socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int yes = 1;
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (::bind(listener_.get(), found->ai_addr, found->ai_addrlen) != 0 ||
        ::listen(listener_.get(), 4) != 0) {
      throw failed(text);
    }
    sockaddr_storage bound{};
    socklen_t size = sizeof bound;
    std::array<char, NI_MAXSERV> port{};
    ::getsockname(listener_.get(), reinterpret_cast<sockaddr*>(&bound), &size);
    ::getnameinfo(reinterpret_cast<sockaddr*>(&bound), size, nullptr, 0, port.data(), port.size(),
                  NI_NUMERICSERV);
    const bool v6 = address.host.find(':') != std::string::npos;
    name_ = "tcp://" + (v6 ? "[" + address.host + "]" : address.host) + ":" + port.data();
  }
  std::string name() const override { return name_; }
  bool has_reader() override {
    for (;;) {
      Descriptor reader(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (reader.get() < 0) break;
      readers_.push_back(std::move(reader));
    }
    return !readers_.empty();
  }
  bool write(std::string_view bytes, const std::function<bool()>& stop) override {
    if (!has_reader()) return true;
    std::erase_if(readers_, [&](const Descriptor& reader) {
      return write_all(reader.get(), bytes, stop, kDeaf) == Written::reader_gone;
    });
    return true;
  }

 private:
  Descriptor listener_;
  std::vector<Descriptor> readers_;
  std::string name_;
};

class StandardOutput : public ReplayPort {
 public:
  std::string name() const override { return "-"; }
  bool has_reader() override { return true; }
  bool write(std::string_view bytes, const std::function<bool()>& stop) override {
    return write_all(STDOUT_FILENO, bytes, stop, 0) != Written::reader_gone;
  }
};

}  // namespace

std::unique_ptr<ReplayPort> pseudo_terminal() { return std::make_unique<PseudoTerminal>(); }
std::unique_ptr<ReplayPort> tcp_port(const std::string& address) {
  return std::make_unique<TcpPort>(address);
}
std::unique_ptr<ReplayPort> standard_output() { return std::make_unique<StandardOutput>(); }

}  // namespace blindcorner::live
