// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/templates.h"

#include <gtest/gtest.h>

#include <array>

namespace blindcorner {
namespace {

// Two zones of three and four rows; the second column leaves the first zone dark.
class SparseTemplates : public testing::Test {
 protected:
  SparseTemplates() : dense_(7, 2) {
    dense_.col(0) << 0, 1, 2, 0, 3, 0, 4;
    dense_.col(1) << 0, 0, 0, 5, 0, 0, 0;
    templates_ = Templates(dense_, zone_begin_);
  }

  const std::array<int, 3> zone_begin_{0, 3, 7};
  Eigen::MatrixXf dense_;
  Templates templates_;
};

TEST_F(SparseTemplates, KeepTheLitBinsOfEachZone) {
  ASSERT_EQ(templates_.poses(), 2U);
  EXPECT_EQ(templates_.rows(), 7);
  const Templates::Column& column = templates_.column(0);
  ASSERT_EQ(column.pieces.size(), 2U);
  EXPECT_EQ(column.pieces[0].row, 1);
  EXPECT_EQ(column.pieces[0].count, 2);
  EXPECT_EQ(column.pieces[1].row, 4);
  EXPECT_EQ(column.pieces[1].count, 3);
  EXPECT_EQ(templates_.column(1).pieces[0].count, 0);
}

TEST_F(SparseTemplates, AddUpToTheMatrix) {
  for (std::size_t pose = 0; pose < 2; ++pose) {
    Eigen::VectorXf sum = Eigen::VectorXf::Constant(7, 1);
    templates_.add(pose, 2, sum);
    const Eigen::VectorXf expected =
        2 * dense_.col(static_cast<Eigen::Index>(pose)) + Eigen::VectorXf::Constant(7, 1);
    EXPECT_EQ(sum, expected);
    EXPECT_DOUBLE_EQ(templates_.sum(pose),
                     static_cast<double>(dense_.col(static_cast<Eigen::Index>(pose)).sum()));
  }
}

}  // namespace
}  // namespace blindcorner
