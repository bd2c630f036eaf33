// SPDX-License-Identifier: Apache-2.0
/// Arrays of MATLAB files, versions 5 and 7.3.
#ifdef BLINDCORNER_TEST_MATIO
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <matio.h>

#include "blindcorner/io/import_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::TemporaryFolder;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Matlab : public ::testing::TestWithParam<mat_ft> {
 protected:
  /// reshape(0:11, 2, 3, 2) in MATLAB, and another variable beside it if `another`.
  void write(bool another = false) const {
    mat_t* file = Mat_CreateVer(path_.c_str(), nullptr, GetParam());
    ASSERT_NE(file, nullptr);
    std::size_t extents[3] = {2, 3, 2};
    std::vector<float> numbers;
    for (int i = 0; i < 12; ++i) numbers.push_back(static_cast<float>(i));
    for (const char* name : {"counts_", "h"}) {
      if (std::string(name) == "counts_" && !another) continue;
      matvar_t* variable =
          Mat_VarCreate(name, MAT_C_SINGLE, MAT_T_SINGLE, 3, extents, numbers.data(), 0);
      Mat_VarWrite(file, variable, MAT_COMPRESSION_NONE);
      Mat_VarFree(variable);
    }
    Mat_Close(file);
  }
  static ImportOptions with_axes(const std::string& axes) {
    ImportOptions options;
    options.axes = axes;
    return options;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("a.mat");
};

TEST_P(Matlab, AxesAreThoseOfSize) {
  write();
  // h(row, column, bin) = row + 2 column + 6 bin, from 0.
  const CaptureFile file = import_captures({path_}, with_axes("row,column,bin"));
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_EQ(file.captures[0].counts.rows, 2);
  EXPECT_EQ(file.captures[0].counts.columns, 3);
  EXPECT_THAT(file.captures[0].counts.values, ElementsAre(0, 6, 2, 8, 4, 10, 1, 7, 3, 9, 5, 11));
  EXPECT_EQ(import_captures({path_}, with_axes("bin,capture,column")).captures.size(), 3u);
}

TEST_P(Matlab, WhatIsNotStatedIsAskedFor) {
  write(true);
  EXPECT_THAT(error_of([&] { import_captures({path_}, with_axes("row,column,bin")); }),
              AllOf(HasSubstr("counts_"), HasSubstr("has to be stated")));
  ImportOptions options;
  options.array = "h";
  EXPECT_THAT(error_of([&] { import_captures({path_}, options); }), HasSubstr("2 x 3 x 2"));
  options.axes = "row,column,bin";
  EXPECT_EQ(import_captures({path_}, options).captures[0].counts.values[1], 6);
  options.array = "none";
  EXPECT_THAT(error_of([&] { import_captures({path_}, options); }), HasSubstr("none is missing"));
}

INSTANTIATE_TEST_SUITE_P(Versions, Matlab, ::testing::Values(MAT_FT_MAT5, MAT_FT_MAT73),
                         [](const auto& version) {
                           return version.param == MAT_FT_MAT5 ? "Version5" : "Version73";
                         });

}  // namespace
}  // namespace blindcorner
#endif
