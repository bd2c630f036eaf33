// SPDX-License-Identifier: Apache-2.0
/// Expected histograms of scored poses. Of each zone, the bins that a pose lights are kept.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace blindcorner {

/// Columns of counts at unit amplitude, mostly dark. Rows are those of the observed time gates, one
/// zone after the other.
class Templates {
 public:
  /// Consecutive rows of one zone.
  struct Piece {
    int row = 0;           ///< first
    int count = 0;         ///< rows
    std::size_t from = 0;  ///< first of the column's counts
  };
  struct Column {
    std::vector<Piece> pieces;  ///< [zones], some without rows
    std::vector<float> counts;
  };

  Templates() = default;
  Templates(int rows, std::vector<Column> columns) : rows_(rows), columns_(std::move(columns)) {}
  /// Takes a matrix [rows, poses] whose zones begin in the rows `zone_begin` [zones + 1]. The dark
  /// ends of each zone are left out.
  Templates(const Eigen::MatrixXf& dense, std::span<const int> zone_begin);

  int rows() const { return rows_; }
  std::size_t poses() const { return columns_.size(); }
  const Column& column(std::size_t pose) const { return columns_[pose]; }
  /// into += factor * column; `into` is [rows].
  void add(std::size_t pose, float factor, Eigen::VectorXf& into) const;
  /// Sum of the counts of a column.
  double sum(std::size_t pose) const;
  std::size_t bytes() const;

 private:
  int rows_ = 0;
  std::vector<Column> columns_;
};

}  // namespace blindcorner
