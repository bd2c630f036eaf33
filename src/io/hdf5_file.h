// SPDX-License-Identifier: Apache-2.0
/// Arrays of HDF5 files, by libhdf5. Builds without it throw Error that says so.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/npy.h"

namespace blindcorner {

/// Whether this build reads and writes HDF5.
bool has_hdf5();

/// A file that is read. Messages name the file and the dataset.
class Hdf5Reader {
 public:
  explicit Hdf5Reader(const std::string& path);
  ~Hdf5Reader();

  /// Whether there is such a dataset and it is not empty (h5py.Empty).
  bool has(const std::string& name) const;
  /// Numbers, enumerators and truth values of a dataset. Throws Error for other types, for a
  /// dataset that is not there, and for more than 2^31 numbers.
  NpyArray numbers(const std::string& name) const;
  /// The number in a dataset of exactly one.
  double number(const std::string& name) const;

 private:
  struct File;
  std::string path_;
  std::unique_ptr<File> file_;
};

/// A file that is put together in memory, as h5py would write it.
class Hdf5Writer {
 public:
  Hdf5Writer();
  ~Hdf5Writer();

  /// Floats; no extents: a scalar.
  void floats(const std::string& name, const std::vector<std::size_t>& shape,
              const std::vector<double>& values);
  /// One enumerator, as an array of one (`h5py.enum_dtype`).
  void enumerator(const std::string& name, const std::vector<std::pair<std::string, int>>& all,
                  int value);
  void truth(const std::string& name, bool value);
  void text(const std::string& name, const std::string& value);
  /// Something that is not known: h5py.Empty.
  void empty(const std::string& name);

  /// Completes the file and returns its bytes.
  std::string bytes();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace blindcorner
