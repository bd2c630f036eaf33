// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what, int error) {
  throw OutputError(path, what + ": " + std::strerror(error));
}

/// Owns a file descriptor and, until `release`, the file's existence.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& target) {
    // Process and counter make the name unique among the writers that could be running; O_EXCL
    // covers what another machine left on a shared disk.
    static std::atomic<unsigned> counter{0};
    for (int attempt = 0; attempt < 100; ++attempt) {
      path_ = target + ".tmp-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
      descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (descriptor_ >= 0) return;
      if (errno != EEXIST) break;
    }
    fail(target, "cannot be written", errno);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  int descriptor() const { return descriptor_; }

  void rename_to(const std::string& target) {
    // Without fsync a power cut after the rename could leave an empty file of the right name.
    if (::fsync(descriptor_) != 0) fail(target, "cannot be written", errno);
    const int closed = ::close(descriptor_);
    descriptor_ = -1;
    if (closed != 0) fail(target, "cannot be written", errno);
    if (std::rename(path_.c_str(), target.c_str()) != 0) fail(target, "cannot be replaced", errno);
    path_.clear();
  }

 private:
  std::string path_;
  int descriptor_ = -1;
};

void write_all(int descriptor, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      fail(path, "cannot be written", errno);
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void write_to_device(const std::string& path, std::string_view bytes) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) fail(path, "cannot be written", errno);
  try {
    write_all(descriptor, bytes, path);
  } catch (...) {
    ::close(descriptor);
    throw;
  }
  if (::close(descriptor) != 0) fail(path, "cannot be written", errno);
}

}  // namespace

void write_atomically(const std::string& path, std::string_view bytes) {
  if (path.empty()) throw Error("output file", "its name is empty");
  struct stat existing {};
  if (::stat(path.c_str(), &existing) == 0) {
    if (S_ISDIR(existing.st_mode)) throw OutputError(path, "is a directory, a file name is needed");
    if (!S_ISREG(existing.st_mode)) return write_to_device(path, bytes);
  }
  TemporaryFile temporary(path);
  write_all(temporary.descriptor(), bytes, path);
  temporary.rename_to(path);
}

}  // namespace blindcorner
