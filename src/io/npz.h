// SPDX-License-Identifier: Apache-2.0
/// NumPy's .npz format: a zip archive of .npy files.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "io/npy.h"

namespace blindcorner {

/// A .npz file held in memory; arrays are decoded when asked for.
class NpzFile {
 public:
  /// Throws Error when `path` is missing, not a zip archive or damaged.
  explicit NpzFile(const std::string& path);

  bool has(const std::string& name) const { return members_.contains(name); }
  /// Names of the arrays, for messages: "counts, metadata_json".
  std::string names() const;
  std::size_t size() const { return members_.size(); }
  std::string only_name() const { return members_.begin()->first; }

  /// Throws Error if there is no such array, listing the names that there are, or if it is damaged.
  NpyArray read(const std::string& name) const;

 private:
  std::string path_;
  std::map<std::string, std::string> members_;  ///< array name -> .npy bytes
  std::size_t most_values_ = 0;                 ///< most values of an array in a file of this size
};

/// Archive of the given (name, .npy bytes), compressed. Equal input gives equal bytes.
std::string npz_of(const std::vector<std::pair<std::string, std::string>>& members);

}  // namespace blindcorner
