// SPDX-License-Identifier: Apache-2.0
#include "io/npz.h"

#include <zip.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"

namespace blindcorner {
namespace {

/// Unpacked bytes that an archive of any size may hold.
constexpr zip_uint64_t kAlwaysAllowed = zip_uint64_t{1} << 26;

/// Most bytes that an archive may hold, counted as unpacked bytes or as the doubles of an array.
zip_uint64_t most_bytes(const std::string& path) {
  return std::max(kAlwaysAllowed,
                  kDeflateExpansion * static_cast<zip_uint64_t>(std::filesystem::file_size(path)));
}

void check_expansion(zip_t* archive, zip_int64_t count, zip_uint64_t most,
                     const std::string& path) {
  zip_uint64_t all = 0;
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t stat;
    if (zip_stat_index(archive, static_cast<zip_uint64_t>(i), 0, &stat) != 0) continue;
    if (stat.size <= most) all += stat.size;
    if (stat.size <= most && all <= most) continue;
    throw Error(path, "found arrays of more than " + std::to_string(most >> 20) +
                          " MB, accepted: at most " + std::to_string(kDeflateExpansion) +
                          " times the file's size, or 64 MB");
  }
}

std::string message_of(zip_error_t* error) { return one_line(zip_error_strerror(error)); }

/// An error record of libzip that is freed in the end.
struct ZipError {
  ZipError() { zip_error_init(&error); }
  ~ZipError() { zip_error_fini(&error); }
  ZipError(const ZipError&) = delete;
  ZipError& operator=(const ZipError&) = delete;
  zip_error_t error;
};

struct DiscardArchive {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
using Archive = std::unique_ptr<zip_t, DiscardArchive>;
struct CloseMember {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

std::string read_member(zip_t* archive, zip_uint64_t index, const zip_stat_t& stat,
                        const std::string& where) {
  const std::unique_ptr<zip_file_t, CloseMember> file(zip_fopen_index(archive, index, 0));
  if (!file) throw Error(where, "cannot be read: " + message_of(zip_get_error(archive)));
  std::string bytes;
  std::string block(1 << 16, '\0');
  for (;;) {
    const zip_int64_t got = zip_fread(file.get(), block.data(), block.size());
    // libzip checks the member's CRC at its end.
    if (got < 0) throw Error(where, "is damaged: " + message_of(zip_file_get_error(file.get())));
    if (got == 0) break;
    bytes.append(block, 0, static_cast<std::size_t>(got));
    if (bytes.size() > stat.size) throw Error(where, "is damaged: longer than declared");
  }
  return bytes;
}

}  // namespace

NpzFile::NpzFile(const std::string& path) : path_(path) {
  check_readable(path);
  int code = 0;
  const Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &code));
  if (!archive) {
    ZipError error;
    zip_error_init_with_code(&error.error, code);
    throw Error(path, "is not a readable .npz (zip) archive: " + message_of(&error.error));
  }
  const zip_int64_t count = zip_get_num_entries(archive.get(), 0);
  const zip_uint64_t most = most_bytes(path);
  most_values_ = most / sizeof(double);
  check_expansion(archive.get(), count, most, path);
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t stat;
    if (zip_stat_index(archive.get(), static_cast<zip_uint64_t>(i), 0, &stat) != 0) {
      throw Error(path, "is damaged: " + message_of(zip_get_error(archive.get())));
    }
    std::string name = stat.name;
    if (!name.ends_with(".npy")) continue;
    name.resize(name.size() - 4);
    members_[name] =
        read_member(archive.get(), static_cast<zip_uint64_t>(i), stat, path + ": array " + name);
  }
  if (members_.empty()) throw Error(path, "holds no arrays");
}

std::string NpzFile::names() const {
  std::string text;
  for (const auto& [name, bytes] : members_) text += (text.empty() ? "" : ", ") + name;
  return text;
}

NpyArray NpzFile::read(const std::string& name) const {
  const auto found = members_.find(name);
  if (found == members_.end()) {
    throw Error(path_, "there is no array " + name + ", found " + names());
  }
  return parse_npy(found->second, path_ + ": array " + name, most_values_);
}

std::string npz_of(const std::vector<std::pair<std::string, std::string>>& members) {
  ZipError error;
  const auto fail = [](const char* step, const std::string& what) {
    throw Error(std::string("zip archive: ") + step, what);
  };
  zip_source_t* target = zip_source_buffer_create(nullptr, 0, 0, &error.error);
  if (target == nullptr) fail("create", message_of(&error.error));
  // One reference for the archive, one to read the result from.
  const std::unique_ptr<zip_source_t, void (*)(zip_source_t*)> result(target, zip_source_free);
  zip_source_keep(target);
  Archive archive(zip_open_from_source(target, ZIP_TRUNCATE, &error.error));
  if (!archive) {
    zip_source_free(target);
    fail("open", message_of(&error.error));
  }
  for (const auto& [name, bytes] : members) {
    zip_source_t* source = zip_source_buffer(archive.get(), bytes.data(), bytes.size(), 0);
    if (source == nullptr) fail("add", message_of(zip_get_error(archive.get())));
    const zip_int64_t index =
        zip_file_add(archive.get(), (name + ".npy").c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      fail("add", message_of(zip_get_error(archive.get())));
    }
    // 1980-01-01 00:00 as numpy writes it: the clock must not change the bytes.
    zip_file_set_dostime(archive.get(), static_cast<zip_uint64_t>(index), 0, 0x21, 0);
  }
  if (zip_close(archive.get()) != 0) fail("close", message_of(zip_get_error(archive.get())));
  (void)archive.release();  // closed

  if (zip_source_open(result.get()) != 0) fail("read", message_of(zip_source_error(result.get())));
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_source_stat(result.get(), &stat) != 0) fail("read", "its size is unknown");
  std::string bytes(stat.size, '\0');
  const zip_int64_t got = zip_source_read(result.get(), bytes.data(), bytes.size());
  zip_source_close(result.get());
  if (got != static_cast<zip_int64_t>(bytes.size())) fail("read", "it is incomplete");
  return bytes;
}

}  // namespace blindcorner
