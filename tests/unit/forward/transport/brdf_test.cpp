// SPDX-License-Identifier: Apache-2.0
/// Materials that are given by a BRDF.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/validate.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;

class Matt final : public Brdf {
 public:
  double value(const Vector3d& /*normal*/, const Vector3d& /*in*/,
               const Vector3d& /*out*/) const override {
    return 1 / kPi;
  }
  double narrowest_lobe() const override { return kPi / 2; }
};

/// Light goes back in a lobe, cos^n of the angle between both ways.
class Returning final : public Brdf {
 public:
  explicit Returning(double exponent) : exponent_(exponent) {}
  double value(const Vector3d& /*normal*/, const Vector3d& in, const Vector3d& out) const override {
    return std::pow(std::max(in.dot(out), 0.0), exponent_);
  }
  double narrowest_lobe() const override { return 1 / std::sqrt(exponent_); }

 private:
  double exponent_;
};

class BrdfModels : public testing::TestWithParam<bool> {
 protected:
  bool fast() const { return GetParam(); }
  double light(const Scene& scene) const {
    return sum(model_of(scene, fast())->three_bounce(stated_pose(scene)));
  }
  /// Light of the object with this BRDF over that of the same object, matt.
  double over_matt(Scene scene, std::shared_ptr<const Brdf> brdf) const {
    const double matt = light(scene);
    scene.hidden.material = BrdfMaterial{"tested", std::move(brdf)};
    return light(scene) / matt;
  }
};

INSTANTIATE_TEST_SUITE_P(Models, BrdfModels, testing::Values(false, true), [](const auto& tested) {
  return std::string(tested.param ? "fast" : "reference");
});

/// A wall that a cone lights and four zones see, and a plate in front of it.
Scene four_zones(Illumination illumination) {
  Scene scene = one_narrow_zone();
  Sensor& sensor = scene.sensor;
  sensor.rows = sensor.columns = 2;
  sensor.illumination = illumination;
  sensor.zones.assign(4, Zone{});
  for (int z = 0; z < 4; ++z) {
    const double left = (z % 2 == 0 ? -10 : 0) * kDegree, low = (z < 2 ? -10 : 0) * kDegree;
    sensor.zones[static_cast<std::size_t>(z)].footprint =
        AngularRectangle{left, left + 10 * kDegree, low, low + 10 * kDegree};
  }
  sensor.field = field_of(20, 20);
  scene.hidden.shape = RectangleShape{0.1, 0.1};
  return scene;
}

// A BRDF of 1 / pi is Lambertian: the same sum in the reference, pairs instead of a convolution in
// the fast model.
TEST_P(BrdfModels, AConstantIsLambertian) {
  for (const Illumination illumination : {Illumination::flash, Illumination::confocal}) {
    Scene scene = four_zones(illumination);
    const PoseVector pose = stated_pose(scene);
    const HistogramCube want = model_of(scene, fast())->three_bounce(pose);
    scene.hidden.material = BrdfMaterial{"matt", std::make_shared<Matt>()};
    const HistogramCube got = model_of(scene, fast())->three_bounce(pose);
    EXPECT_LT(difference(got, want), fast() ? 0.01 : 1e-9);
  }
}

// A small patch faces the middle of a lit disc at distance d, where a narrow zone looks. Light of
// the disc's point at the angle t falls as cos t / r^2 cos t = cos^4 t / d^2 on the patch and is
// returned with cos^n t: the ratio to a matt patch is an integral over the disc's radius.
TEST_P(BrdfModels, ALobeOverALitDisc) {
  for (const double exponent : {4.0, 30.0, 200.0}) {
    Scene scene = one_narrow_zone();
    const double d = 0.5, a = 0.1;
    scene.sensor.field = AngularCone{std::atan(a / 0.6)};
    scene.hidden.placement.position = Vector3d(0.6 - d, 0, 0);
    scene.hidden.placement.yaw = 0;
    scene.unknowns = {{Component::x, 0.095, 0.105, std::nullopt}};
    // The sensor's light on the wall falls as the third power of its own cosine.
    const auto integral = [&](double n) {
      constexpr int kSteps = 2000;
      double total = 0;
      for (int i = 0; i < kSteps; ++i) {
        const double r = a * (i + 0.5) / kSteps;
        const double t = std::atan(r / d), sensor = std::atan(r / 0.6);
        total += r * std::pow(std::cos(t), 4 + n) * std::pow(std::cos(sensor), 3);
      }
      return total;
    };
    const double want = kPi * integral(exponent) / integral(0);
    EXPECT_NEAR(over_matt(scene, std::make_shared<Returning>(exponent)), want,
                (fast() ? 0.01 : 0.002) * want)
        << exponent;
  }
}

/// Light goes where a mirror sends it, in a lobe.
class Mirror final : public Brdf {
 public:
  explicit Mirror(double exponent) : exponent_(exponent) {}
  double value(const Vector3d& normal, const Vector3d& in, const Vector3d& out) const override {
    const Vector3d mirrored = 2 * normal.dot(in) * normal - in;
    return std::pow(std::max(mirrored.dot(out), 0.0), exponent_);
  }
  double narrowest_lobe() const override { return 1 / std::sqrt(exponent_); }

 private:
  double exponent_;
};

// A plate parallel to the wall at distance d, and a spot that is lit and seen. Light of the plate's
// point at the angle t comes and goes under t, both cosines twice, and the mirror's way is 2 t off:
// the ratio to a matt plate is an integral over the plate.
TEST_P(BrdfModels, AMirrorLobeOverAPlate) {
  for (const double exponent : {10.0, 100.0}) {
    Scene scene = one_narrow_zone();
    const double d = 0.4, edge = 0.4;
    scene.hidden.shape = RectangleShape{edge, edge};
    scene.hidden.placement.position = Vector3d(0.6 - d, 0, 0);
    scene.hidden.placement.yaw = 0;
    scene.unknowns = {{Component::x, 0.195, 0.205, std::nullopt}};
    const auto integral = [&](double n) {
      constexpr int kSteps = 400;
      double total = 0;
      for (int i = 0; i < kSteps; ++i) {
        for (int j = 0; j < kSteps; ++j) {
          const double y = edge * ((i + 0.5) / kSteps - 0.5), z = edge * ((j + 0.5) / kSteps - 0.5);
          const double r2 = d * d + y * y + z * z;
          const double c2 = d * d / r2;  // squared cosine
          total += c2 * c2 / (r2 * r2) * std::pow(std::max(2 * c2 - 1, 0.0), n);
        }
      }
      return total;
    };
    const double want = kPi * integral(exponent) / integral(0);
    EXPECT_NEAR(over_matt(scene, std::make_shared<Mirror>(exponent)), want,
                (fast() ? 0.02 : 0.01) * want)
        << exponent;
  }
}

TEST(Brdf, AMaterialWithoutABrdfIsRefused) {
  Scene scene = one_narrow_zone();
  scene.hidden.material = BrdfMaterial{"none", nullptr};
  try {
    validate(scene);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("hidden.material"), std::string::npos);
  }
}

}  // namespace
}  // namespace blindcorner
