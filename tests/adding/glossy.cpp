// SPDX-License-Identifier: Apache-2.0
/// A material: matt paint with a gloss. docs/adding.md shows it; adding_test.cpp asks it.
#include <algorithm>
#include <cmath>
#include <memory>

#include "adding/examples.h"
#include "blindcorner/forward/constants.h"
#include "io/json_reader.h"

namespace blindcorner {
namespace {

// [material]
/// A lobe about the mirror direction beside matt light: the modified Phong model (Lafortune and
/// Willems, "Using the modified Phong reflectance model for physically based rendering", 1994).
class Glossy final : public Brdf {
 public:
  Glossy(double share, double exponent) : share_(share), exponent_(exponent) {}

  double value(const Eigen::Vector3d& normal, const Eigen::Vector3d& in,
               const Eigen::Vector3d& out) const override {
    const Eigen::Vector3d mirrored = 2 * normal.dot(in) * normal - in;
    const double lobe = std::pow(std::max(mirrored.dot(out), 0.0), exponent_);
    return (1 - share_) / kPi + share_ * (exponent_ + 2) / (2 * kPi) * lobe;
  }
  double narrowest_lobe() const override { return 1 / std::sqrt(exponent_); }

 private:
  double share_, exponent_;
};

}  // namespace

Material read_glossy(const JsonReader& reader) {
  reader.allow_only({"share", "exponent"});
  const double share = reader.at("share").number(NumberRange::between(0, 1));
  const double exponent = reader.at("exponent").number(NumberRange::between(1, 1000));
  return BrdfMaterial{"glossy", std::make_shared<Glossy>(share, exponent)};
}
// [/material]

}  // namespace blindcorner
