// SPDX-License-Identifier: Apache-2.0
/// What the examples of docs/adding.md give to their test.
#pragma once

#include <memory>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"
#include "blindcorner/simulation/perception.h"
#include "forward/scene/shapes/shape_geometry.h"
#include "io/json_reader.h"
#include "io/readers/capture_reader.h"

namespace CLI {
class App;
}

namespace blindcorner {

/// Upright column on a regular hexagon, two of whose corners lie on its own x axis.
struct HexagonShape {
  double edge = 0.5;    ///< m, also the distance of the corners from the axis
  double height = 1.0;  ///< m
  static void lengths(auto& shape, auto visit) {
    visit("edge_m", shape.edge);
    visit("height_m", shape.height);
  }
  std::unique_ptr<const ShapeGeometry> geometry() const;
};

Material read_glossy(const JsonReader& reader);
CaptureReader hex_reader();
std::unique_ptr<Perception> reported_perception(const PerceptionSetup& setup);
std::shared_ptr<const VehicleModel> cart();
void example_study(CLI::App& benchmark, int& exit_code);

}  // namespace blindcorner
