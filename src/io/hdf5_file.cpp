// SPDX-License-Identifier: Apache-2.0
#include "io/hdf5_file.h"

#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>

#include "blindcorner/forward/error.h"

#ifdef BLINDCORNER_HAS_HDF5
#include <hdf5.h>
#endif

namespace blindcorner {

#ifdef BLINDCORNER_HAS_HDF5

namespace {

/// Something of libhdf5 that has to be closed.
template <herr_t (*Close)(hid_t)>
class Handle {
 public:
  explicit Handle(hid_t id) : id_(id) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (id_ >= 0) Close(id_);
  }
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
};
using FileHandle = Handle<H5Fclose>;
using Dataset = Handle<H5Dclose>;
using Dataspace = Handle<H5Sclose>;
using Datatype = Handle<H5Tclose>;
using Properties = Handle<H5Pclose>;

/// Stops the library from printing the errors that it finds.
void be_quiet() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

constexpr std::size_t kMostNumbers = std::size_t{1} << 31;
/// Deflate shrinks data to a 1032nd at most. An array of up to a page is accepted in any case.
constexpr hsize_t kMostPacked = 1032, kPage = 65536;

void require(bool good, const std::string& what) {
  if (!good) throw Error("hdf5", "cannot write " + what);
}

}  // namespace

bool has_hdf5() { return true; }

struct Hdf5Reader::File {
  FileHandle id;
};

Hdf5Reader::Hdf5Reader(const std::string& path) : path_(path) {
  be_quiet();
  file_.reset(new File{FileHandle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT))});
  if (file_->id < 0) throw Error(path, "is no HDF5 file that can be read");
}

Hdf5Reader::~Hdf5Reader() = default;

bool Hdf5Reader::has(const std::string& name) const {
  if (H5Lexists(file_->id, name.c_str(), H5P_DEFAULT) <= 0) return false;
  const Dataset dataset(H5Dopen2(file_->id, name.c_str(), H5P_DEFAULT));
  if (dataset < 0) return false;
  const Dataspace space(H5Dget_space(dataset));
  return H5Sget_simple_extent_type(space) != H5S_NULL;
}

NpyArray Hdf5Reader::numbers(const std::string& name) const {
  const std::string where = path_ + ": dataset " + name;
  if (!has(name)) throw Error(where, "is missing or empty");
  const Dataset dataset(H5Dopen2(file_->id, name.c_str(), H5P_DEFAULT));
  const Dataspace space(H5Dget_space(dataset));
  const Datatype type(H5Dget_type(dataset));
  const H5T_class_t kind = H5Tget_class(type);
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 0 || (kind != H5T_INTEGER && kind != H5T_FLOAT && kind != H5T_ENUM)) {
    throw Error(where, "holds no numbers");
  }
  std::vector<hsize_t> extents(static_cast<std::size_t>(rank));
  if (rank > 0) H5Sget_simple_extent_dims(space, extents.data(), nullptr);
  NpyArray array;
  std::size_t count = 1;
  for (const hsize_t extent : extents) {
    array.shape.push_back(static_cast<std::size_t>(extent));
    if (extent > kMostNumbers || (count *= extent) > kMostNumbers) {
      throw Error(where, "holds more than 2^31 numbers");
    }
  }
  const hsize_t stored = H5Dget_storage_size(dataset), bytes = count * H5Tget_size(type);
  if (bytes > kPage && (bytes - kPage) / kMostPacked > stored) {
    throw Error(where, "has shape " + array.shape_text() + ", of which the file holds " +
                           std::to_string(stored) + " bytes only");
  }
  array.values.resize(count);
  herr_t verdict = 0;
  if (kind == H5T_ENUM) {  // converts to whole numbers only
    std::vector<int> whole(count);
    verdict = H5Dread(dataset, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, whole.data());
    array.values.assign(whole.begin(), whole.end());
  } else {
    verdict =
        H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, array.values.data());
  }
  if (verdict < 0) throw Error(where, "cannot be read: the file is damaged or cut");
  return array;
}

double Hdf5Reader::number(const std::string& name) const {
  const NpyArray array = numbers(name);
  if (array.values.size() != 1 || !std::isfinite(array.values[0])) {
    throw Error(path_ + ": dataset " + name,
                "has shape " + array.shape_text() + ", accepted one finite number");
  }
  return array.values[0];
}

struct Hdf5Writer::File {
  FileHandle id;

  void write(const std::string& name, hid_t file_type, hid_t memory_type, hid_t space,
             const void* values) const {
    const Dataset dataset(
        H5Dcreate2(id, name.c_str(), file_type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    require(dataset >= 0, name);
    if (values == nullptr) return;
    require(H5Dwrite(dataset, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name);
  }
};

Hdf5Writer::Hdf5Writer() {
  be_quiet();
  constexpr std::size_t kGrowth = std::size_t{1} << 20;
  const Properties in_memory(H5Pcreate(H5P_FILE_ACCESS));
  require(H5Pset_fapl_core(in_memory, kGrowth, 0) >= 0, "to memory");
  // The library tells open files apart by their names, also those that are never written.
  static std::atomic<int> count{0};
  const std::string name = "in_memory_" + std::to_string(count++) + ".hdf5";
  file_.reset(new File{FileHandle(H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, in_memory))});
  require(file_->id >= 0, "to memory");
}

Hdf5Writer::~Hdf5Writer() = default;

void Hdf5Writer::floats(const std::string& name, const std::vector<std::size_t>& shape,
                        const std::vector<double>& values) {
  const std::vector<hsize_t> extents(shape.begin(), shape.end());
  const Dataspace space(
      shape.empty() ? H5Screate(H5S_SCALAR)
                    : H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr));
  file_->write(name, H5T_IEEE_F32LE, H5T_NATIVE_DOUBLE, space, values.data());
}

void Hdf5Writer::enumerator(const std::string& name,
                            const std::vector<std::pair<std::string, int>>& all, int value) {
  const Datatype type(H5Tenum_create(H5T_NATIVE_INT));
  for (const auto& [word, number] : all) H5Tenum_insert(type, word.c_str(), &number);
  const hsize_t one = 1;
  const Dataspace space(H5Screate_simple(1, &one, nullptr));
  file_->write(name, type, type, space, &value);
}

void Hdf5Writer::truth(const std::string& name, bool value) {
  const Datatype type(H5Tenum_create(H5T_NATIVE_INT8));
  const std::int8_t no = 0, yes = 1;
  H5Tenum_insert(type, "FALSE", &no);
  H5Tenum_insert(type, "TRUE", &yes);
  const Dataspace space(H5Screate(H5S_SCALAR));
  file_->write(name, type, type, space, value ? &yes : &no);
}

void Hdf5Writer::text(const std::string& name, const std::string& value) {
  const Datatype type(H5Tcopy(H5T_C_S1));
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  const Dataspace space(H5Screate(H5S_SCALAR));
  const char* characters = value.c_str();
  file_->write(name, type, type, space, &characters);
}

void Hdf5Writer::empty(const std::string& name) {
  const Dataspace space(H5Screate(H5S_NULL));
  file_->write(name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, space, nullptr);
}

std::string Hdf5Writer::bytes() {
  H5Fflush(file_->id, H5F_SCOPE_GLOBAL);
  const ssize_t size = H5Fget_file_image(file_->id, nullptr, 0);
  require(size > 0, "to memory");
  std::string image(static_cast<std::size_t>(size), '\0');
  require(H5Fget_file_image(file_->id, image.data(), image.size()) >= 0, "to memory");
  return image;
}

#else

namespace {

[[noreturn]] void refuse() {
  throw Error("hdf5", "this build is without libhdf5 (Debian: libhdf5-dev)");
}

}  // namespace

bool has_hdf5() { return false; }
struct Hdf5Reader::File {};
Hdf5Reader::Hdf5Reader(const std::string&) { refuse(); }
Hdf5Reader::~Hdf5Reader() = default;
bool Hdf5Reader::has(const std::string&) const { refuse(); }
NpyArray Hdf5Reader::numbers(const std::string&) const { refuse(); }
double Hdf5Reader::number(const std::string&) const { refuse(); }
struct Hdf5Writer::File {};
Hdf5Writer::Hdf5Writer() { refuse(); }
Hdf5Writer::~Hdf5Writer() = default;
void Hdf5Writer::floats(const std::string&, const std::vector<std::size_t>&,
                        const std::vector<double>&) {}
void Hdf5Writer::enumerator(const std::string&, const std::vector<std::pair<std::string, int>>&,
                            int) {}
void Hdf5Writer::truth(const std::string&, bool) {}
void Hdf5Writer::text(const std::string&, const std::string&) {}
void Hdf5Writer::empty(const std::string&) {}
std::string Hdf5Writer::bytes() { refuse(); }

#endif

}  // namespace blindcorner
