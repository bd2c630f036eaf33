// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/templates.h"

namespace blindcorner {

Templates::Templates(const Eigen::MatrixXf& dense, std::span<const int> zone_begin)
    : rows_(static_cast<int>(dense.rows())) {
  columns_.resize(static_cast<std::size_t>(dense.cols()));
  for (std::size_t pose = 0; pose < columns_.size(); ++pose) {
    const float* values = dense.col(static_cast<Eigen::Index>(pose)).data();
    Column& column = columns_[pose];
    for (std::size_t z = 0; z + 1 < zone_begin.size(); ++z) {
      int first = zone_begin[z], end = zone_begin[z + 1];
      while (first < end && values[first] == 0) ++first;
      while (end > first && values[end - 1] == 0) --end;
      column.pieces.push_back({first, end - first, column.counts.size()});
      column.counts.insert(column.counts.end(), values + first, values + end);
    }
  }
}

void Templates::add(std::size_t pose, float factor, Eigen::VectorXf& into) const {
  const Column& column = columns_[pose];
  for (const Piece& piece : column.pieces) {
    const Eigen::Map<const Eigen::VectorXf> counts(column.counts.data() + piece.from, piece.count);
    into.segment(piece.row, piece.count) += factor * counts;
  }
}

double Templates::sum(std::size_t pose) const {
  double sum = 0;
  for (const float count : columns_[pose].counts) sum += static_cast<double>(count);
  return sum;
}

std::size_t Templates::bytes() const {
  std::size_t bytes = 0;
  for (const Column& column : columns_) {
    bytes += sizeof(Column) + column.pieces.size() * sizeof(Piece) +
             column.counts.size() * sizeof(float);
  }
  return bytes;
}

}  // namespace blindcorner
