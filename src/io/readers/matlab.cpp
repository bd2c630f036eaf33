// SPDX-License-Identifier: Apache-2.0
/// Any array of a MATLAB file, versions 5 and 7.3.
#include <algorithm>

#include "blindcorner/forward/error.h"
#include "io/readers/arrays.h"
#include "io/readers/capture_reader.h"
#include "io/readers/matlab_file.h"

namespace blindcorner {
namespace {

std::string counts_name(const std::string& path, const ImportOptions& options) {
  if (!options.array.empty()) return options.array;
  const std::vector<std::string> names = matlab_names(path);
  if (std::ranges::count(names, "counts") > 0) return "counts";
  if (names.size() == 1) return names.front();
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  throw Error(path, "which array holds the counts has to be stated, found " +
                        (list.empty() ? std::string("none") : list));
}

/// MATLAB's first index is the fastest; in this project the last one is. The numbers stay, and
/// shape and axes are reversed.
CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  const std::string name = counts_name(source.path(), options);
  MatlabArray array = read_matlab_array(source.path(), name);
  if (options.axes.empty()) {
    throw Error(source.path() + ": variable " + name,
                "the order of its axes has to be stated for size " + array.shape_text() +
                    ", for example row,column,bin,capture");
  }
  NpyArray turned;
  turned.shape.assign(array.shape.rbegin(), array.shape.rend());
  turned.values = std::move(array.values);
  ImportOptions turned_options = options;
  turned_options.axes = reversed_axes(options.axes);
  CaptureFile file;
  file.captures = arrange(turned, turned_options, source.path() + ": variable " + name, notes);
  return file;
}

}  // namespace

CaptureReader matlab_reader() {
  return {.name = "matlab",
          .recognises = ".mat of MATLAB, versions 5 and 7.3",
          .assumes = "nothing: --axes states the order of the axes as size() lists them",
          .options = {"axes", "array", "rows"},
          .recognise = is_matlab,
          .read = read};
}

}  // namespace blindcorner
