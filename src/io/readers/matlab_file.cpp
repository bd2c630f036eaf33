// SPDX-License-Identifier: Apache-2.0
#include "io/readers/matlab_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <numeric>

#include "blindcorner/forward/error.h"
#include "io/matlab_check.h"

#ifdef BLINDCORNER_HAS_MATIO
#include <matio.h>
#endif

namespace blindcorner {

std::string MatlabArray::shape_text() const {
  std::string text;
  for (const std::size_t extent : shape) {
    text += (text.empty() ? "" : " x ") + std::to_string(extent);
  }
  return text;
}

bool is_matlab(const ImportSource& source) {
  return source.ending() == ".mat" || source.beginning().starts_with("MATLAB 5.0 MAT-file") ||
         source.beginning().starts_with("MATLAB 7.3 MAT-file");
}

#ifdef BLINDCORNER_HAS_MATIO

namespace {

struct MatCloser {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct VariableFreer {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using MatFile = std::unique_ptr<mat_t, MatCloser>;
using Variable = std::unique_ptr<matvar_t, VariableFreer>;

MatFile open_matlab(const std::string& path) {
  check_matlab_file(path);
  MatFile file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (!file) throw Error(path, "is no MATLAB file that can be read");
  return file;
}

Variable read_variable(mat_t* file, const std::string& path, const std::string& name) {
  Variable variable(Mat_VarRead(file, name.c_str()));
  if (!variable) throw Error(path, "variable " + name + " is missing");
  return variable;
}

template <typename T>
void copy_numbers(const matvar_t& array, std::vector<double>& values) {
  const T* data = static_cast<const T*>(array.data);
  std::transform(data, data + values.size(), values.begin(),
                 [](T value) { return static_cast<double>(value); });
}

MatlabArray numbers_of(const matvar_t* array, const std::string& where) {
  if (array == nullptr || array->data == nullptr || array->isComplex != 0) {
    throw Error(where, "is empty, accepted: real numbers");
  }
  MatlabArray numbers;
  numbers.shape.assign(array->dims, array->dims + array->rank);
  numbers.values.resize(std::accumulate(numbers.shape.begin(), numbers.shape.end(), std::size_t{1},
                                        std::multiplies<>()));
  switch (array->class_type) {
    case MAT_C_DOUBLE:
      copy_numbers<double>(*array, numbers.values);
      break;
    case MAT_C_SINGLE:
      copy_numbers<float>(*array, numbers.values);
      break;
    case MAT_C_INT8:
      copy_numbers<std::int8_t>(*array, numbers.values);
      break;
    case MAT_C_UINT8:
      copy_numbers<std::uint8_t>(*array, numbers.values);
      break;
    case MAT_C_INT16:
      copy_numbers<std::int16_t>(*array, numbers.values);
      break;
    case MAT_C_UINT16:
      copy_numbers<std::uint16_t>(*array, numbers.values);
      break;
    case MAT_C_INT32:
      copy_numbers<std::int32_t>(*array, numbers.values);
      break;
    case MAT_C_UINT32:
      copy_numbers<std::uint32_t>(*array, numbers.values);
      break;
    default:
      throw Error(where, "holds no numbers, accepted: real numbers");
  }
  if (!std::ranges::all_of(numbers.values, [](double value) { return std::isfinite(value); })) {
    throw Error(where, "holds a number that is not finite, accepted: finite numbers");
  }
  return numbers;
}

}  // namespace

bool reads_matlab() { return true; }

std::vector<std::string> matlab_names(const std::string& path) {
  const MatFile file = open_matlab(path);
  std::vector<std::string> names;
  while (const Variable variable{Mat_VarReadNextInfo(file.get())}) {
    if (variable->name != nullptr) names.emplace_back(variable->name);
  }
  return names;
}

MatlabArray read_matlab_array(const std::string& path, const std::string& name) {
  const MatFile file = open_matlab(path);
  return numbers_of(read_variable(file.get(), path, name).get(), path + ": variable " + name);
}

std::vector<MatlabArray> read_matlab_cells(const std::string& path, const std::string& name) {
  const MatFile file = open_matlab(path);
  const Variable cells = read_variable(file.get(), path, name);
  if (cells->class_type != MAT_C_CELL || cells->data == nullptr) {
    throw Error(path + ": variable " + name, "found no cell array, accepted: a cell per position");
  }
  const std::size_t count =
      std::accumulate(cells->dims, cells->dims + cells->rank, std::size_t{1}, std::multiplies<>());
  std::vector<MatlabArray> arrays;
  for (std::size_t i = 0; i < count; ++i) {
    arrays.push_back(numbers_of(Mat_VarGetCell(cells.get(), static_cast<int>(i)),
                                path + ": " + name + "{" + std::to_string(i) + "}"));
  }
  return arrays;
}

#else

bool reads_matlab() { return false; }

namespace {

[[noreturn]] void refuse(const std::string& path) {
  throw Error(path, "is a MATLAB file, but this build is without matio (Debian: libmatio-dev)");
}

}  // namespace

std::vector<std::string> matlab_names(const std::string& path) { refuse(path); }
MatlabArray read_matlab_array(const std::string& path, const std::string&) { refuse(path); }
std::vector<MatlabArray> read_matlab_cells(const std::string& path, const std::string&) {
  refuse(path);
}

#endif

}  // namespace blindcorner
