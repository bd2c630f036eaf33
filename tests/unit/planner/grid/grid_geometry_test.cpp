// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/grid_geometry.h"

#include <gtest/gtest.h>

#include <limits>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

const GridGeometry kGrid{.columns = 4, .rows = 3, .cell_size = 0.5, .origin = {-1.0, 2.0}};

TEST(GridGeometry, CentersLieInTheirCells) {
  for (std::size_t index = 0; index < kGrid.cells(); ++index) {
    const Cell cell = kGrid.cell(index);
    EXPECT_EQ(kGrid.index(cell), index);
    EXPECT_TRUE(kGrid.contains(cell));
    EXPECT_EQ(kGrid.cell_at(kGrid.center(cell)), cell);
  }
}

TEST(GridGeometry, LowerLeftSidesBelongToACell) {
  EXPECT_EQ(kGrid.cell_at({-1.0, 2.0}), (Cell{0, 0}));
  EXPECT_EQ(kGrid.cell_at({-0.5, 2.5}), (Cell{1, 1}));
  EXPECT_FALSE(kGrid.contains(kGrid.cell_at({1.0, 2.0})));
  EXPECT_FALSE(kGrid.contains(kGrid.cell_at({-1.001, 2.0})));
}

TEST(GridGeometry, FarPointsLieBesideIt) {
  EXPECT_FALSE(kGrid.contains(kGrid.cell_at({1e300, -1e300})));
}

TEST(GridGeometry, RefusesNonsense) {
  GridGeometry grid = kGrid;
  grid.validate();
  grid.cell_size = 0;
  EXPECT_THROW(grid.validate(), Error);
  grid = kGrid;
  grid.rows = 0;
  EXPECT_THROW(grid.validate(), Error);
  grid = kGrid;
  grid.origin.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(grid.validate(), Error);
}

}  // namespace
}  // namespace blindcorner
