// SPDX-License-Identifier: Apache-2.0
/// Parts of the extension module `blindcorner._core`. The package's Python sources wrap them; their
/// docstrings are what users read.
#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <string>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner::python {

namespace nb = nanobind;

/// A scene and the text that it was read from.
struct SceneData {
  Scene scene;
  std::string text;
  double nominal_bin_width = 0;  ///< s, before a calibration
};
using ScenePointer = std::shared_ptr<const SceneData>;

void add_scene(nb::module_& m);
void add_captures(nb::module_& m);
void add_fit(nb::module_& m);
void add_studies(nb::module_& m);
void add_drive(nb::module_& m);
void add_places(nb::module_& m);

}  // namespace blindcorner::python
