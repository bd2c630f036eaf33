// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace blindcorner {

/// Point of a quadrature rule on [-1, 1]. The weights add up to 2.
struct QuadraturePoint {
  double position;
  double weight;
  /// Stretch of [-1, 1] that the point stands for: as long as its weight, one after the other.
  double begin, end;
};

/// Gauss-Legendre rule of `count` points in increasing order, exact for polynomials of degree
/// 2 count - 1; by the eigenvalues of the Jacobi matrix (Golub and Welsch 1969).
const std::vector<QuadraturePoint>& gauss_legendre(int count);

}  // namespace blindcorner
