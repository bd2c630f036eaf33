// SPDX-License-Identifier: Apache-2.0
/// Materials of hidden objects in scene files.
#pragma once

#include "blindcorner/forward/scene/scene.h"
#include "io/json_reader.h"

namespace blindcorner {

/// "material" of a hidden object: a word, or an object with one field that names the material. An
/// absent one is Lambertian.
Material read_material(const JsonReader& reader);

}  // namespace blindcorner
