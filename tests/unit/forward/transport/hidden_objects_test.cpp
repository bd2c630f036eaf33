// SPDX-License-Identifier: Apache-2.0
/// Meshes, bodies that shadow themselves, and several hidden objects.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "blindcorner/forward/error.h"
#include "bundled.h"
#include "io/mesh_file.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;
using Faces = std::vector<std::array<int, 3>>;

/// 3 x 3 zones before a wall, an object beside the line of sight.
Scene wall_scene() {
  Scene scene = one_narrow_zone();
  scene.name = "wall";
  Sensor& sensor = scene.sensor;
  sensor.rows = sensor.columns = 3;
  sensor.zones.clear();
  for (int z = 0; z < 9; ++z) {
    const int row = z / 3;
    const double left = -18 + 12 * (z % 3), top = -18 + 12 * row;
    Zone zone;
    zone.footprint = AngularRectangle{left * kDegree, (left + 12) * kDegree, top * kDegree,
                                      (top + 12) * kDegree};
    sensor.zones.push_back(zone);
  }
  sensor.bin_width = 88e-12;
  sensor.response = ImpulseResponse(GaussianResponse{120e-12});
  sensor.field = AngularCone{28 * kDegree};
  scene.hidden.shape = RectangleShape{0.2, 0.3};
  scene.hidden.placement.position = Vector3d(0.15, 0.6, 0.05);
  scene.hidden.placement.yaw = -25 * kDegree;
  scene.unknowns = {{Component::x, 0.1, 0.2, std::nullopt}};
  return scene;
}

Shape mesh_of(std::vector<Vector3d> vertices, Faces faces, bool two_sided = false) {
  return MeshShape{make_mesh(std::move(vertices), std::move(faces)), two_sided};
}

/// The plate of `wall_scene` as two triangles.
Shape plate_mesh(double width, double height, bool two_sided = false) {
  const double y = width / 2, z = height / 2;
  return mesh_of({{0, -y, -z}, {0, y, -z}, {0, y, z}, {0, -y, z}}, {{0, 1, 2}, {0, 2, 3}},
                 two_sided);
}

/// The triangles of another shape.
Shape mesh_like(const Shape& shape, int segments) {
  std::vector<Vector3d> vertices;
  Faces faces;
  for (const Triangle& t : triangulate(shape, Transform::Identity(), 1.0, segments)) {
    std::array<int, 3> face{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto known = std::find_if(vertices.begin(), vertices.end(),
                                      [&](const Vector3d& v) { return (v - t[k]).norm() < 1e-9; });
      face[k] = static_cast<int>(known - vertices.begin());
      if (known == vertices.end()) vertices.push_back(t[k]);
    }
    if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0]) faces.push_back(face);
  }
  return mesh_of(vertices, faces);
}

HistogramCube light_of(const Scene& scene, bool fast) {
  ReferenceOptions sampling;  // enough for a few tenths of a per cent
  sampling.zone_divisions = 2;
  sampling.field_divisions = 7;
  return model_of(scene, fast, sampling)->three_bounce(stated_pose(scene));
}

// ---------------------------------------------------------------------------------------------
// Meshes

TEST(Mesh, IsMovedToItsCentroidAndKnowsWhatItIs) {
  const auto box = std::get<MeshShape>(mesh_like(BoxShape{{0.2, 0.4, 0.6}}, 0)).mesh;
  EXPECT_NEAR(box->extent.y(), 0.4, 1e-12);
  EXPECT_NEAR(box->radius, Vector3d(0.1, 0.2, 0.3).norm(), 1e-12);
  EXPECT_TRUE(box->closed);
  EXPECT_TRUE(box->convex);
  const auto tetrahedron = make_mesh({{1, 1, 1}, {2, 1, 1}, {1, 2, 1}, {1, 1, 2}},
                                     {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}});
  EXPECT_TRUE(tetrahedron->closed);
  EXPECT_TRUE(tetrahedron->convex);
  // Three right triangles of 1/2 and one of sqrt(3)/2, their centroids 1/3 along two axes or all.
  const double oblique = std::sqrt(3.0) / 2;
  const double mean = (2 * 0.5 / 3 + oblique / 3) / (1.5 + oblique);
  EXPECT_NEAR((tetrahedron->origin + Vector3d::Constant(1 + mean)).norm(), 0, 1e-12);
}

TEST(Mesh, WrongOnesAreRefused) {
  EXPECT_THROW(make_mesh({{0, 0, 0}}, {}), Error);
  EXPECT_THROW(make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 3}}), Error);
  EXPECT_THROW(make_mesh({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}), Error);
  EXPECT_THROW(make_mesh({{0, 0, 0}, {1, NAN, 0}, {0, 1, 0}}, {{0, 1, 2}}), Error);
  EXPECT_THROW(read_obj(std::string(SOURCE_DIR) + "/scenes/meshes/none.obj", 1), Error);
  EXPECT_THROW(read_obj(std::string(SOURCE_DIR) + "/LICENSE", 1), Error);
}

TEST(Mesh, ArrowIsClosedPointsAlongXAndIsNotConvex) {
  const auto arrow = read_obj(std::string(SOURCE_DIR) + "/scenes/meshes/arrow.obj", 1);
  EXPECT_TRUE(arrow->closed);
  EXPECT_FALSE(arrow->convex);
  EXPECT_NEAR(arrow->extent.x(), 0.4, 1e-12);
  EXPECT_NEAR(arrow->extent.z(), 0.3, 1e-12);
  // Twice the outline (shaft 0.25 x 0.1, head 0.3 x 0.15 / 2) and its rim of 2 cm.
  double area = 0;
  for (const SurfaceCell& cell :
       divide(MeshShape{arrow, false}, Transform::Identity(), 1.0, 0.05)) {
    area += cell.area;
  }
  const double rim = 0.1 + 4 * 0.1 / 2 + 2 * 0.25 + 2 * std::hypot(0.15, 0.15);
  EXPECT_NEAR(area, 2 * (0.25 * 0.1 + 0.3 * 0.15 / 2) + 0.02 * rim, 1e-9);
  EXPECT_NEAR(read_obj(std::string(SOURCE_DIR) + "/scenes/meshes/arrow.obj", 0.5)->extent.x(), 0.2,
              1e-12);
}

// The moments of a triangle's cell are the triangle's own.
TEST(Mesh, CellHasTheMomentsOfItsTriangle) {
  const Vector3d a(0, 0, 0), b(0.4, 0.1, 0), c(0.1, 0.3, 0.2);
  const auto cells = divide(mesh_of({a, b, c}, {{0, 1, 2}}), Transform::Identity(), 1.0, 10);
  ASSERT_EQ(cells.size(), 1U);
  Matrix3d exact = Matrix3d::Zero();
  const Vector3d center = (a + b + c) / 3;
  for (const Vector3d& corner : {a, b, c}) {
    exact += (corner - center) * (corner - center).transpose() / 12;
  }
  const Matrix3d own = (cells[0].half_u * cells[0].half_u.transpose() +
                        cells[0].half_v * cells[0].half_v.transpose()) /
                       3;
  EXPECT_LT((own - exact).norm(), 1e-12);
}

class Objects : public testing::TestWithParam<bool> {
 protected:
  bool fast() const { return GetParam(); }
  /// Both models sample a mesh otherwise than the analytic shape.
  double tolerance() const { return fast() ? 0.02 : 0.004; }
};

INSTANTIATE_TEST_SUITE_P(Models, Objects, testing::Values(false, true), [](const auto& tested) {
  return std::string(tested.param ? "fast" : "reference");
});

TEST_P(Objects, MeshOfAPlateIsThePlate) {
  Scene scene = wall_scene();
  const HistogramCube want = light_of(scene, fast());
  scene.hidden.shape = plate_mesh(0.2, 0.3);
  EXPECT_LT(difference(light_of(scene, fast()), want), tolerance());
  // From behind, a one-sided mesh is dark and a two-sided one looks the same.
  scene.hidden.placement.yaw += kPi;
  EXPECT_EQ(sum(light_of(scene, fast())), 0.0);
  scene.hidden.shape = plate_mesh(0.2, 0.3, true);
  EXPECT_LT(difference(light_of(scene, fast()), want), tolerance());
}

TEST_P(Objects, MeshOfABoxIsTheBox) {
  Scene scene = wall_scene();
  scene.hidden.shape = BoxShape{{0.2, 0.1, 0.3}};
  const HistogramCube want = light_of(scene, fast());
  scene.hidden.shape = mesh_like(scene.hidden.shape, 0);
  EXPECT_LT(difference(light_of(scene, fast()), want), tolerance());
}

TEST_P(Objects, MeshOfASphereIsTheSphere) {
  Scene scene = wall_scene();
  scene.hidden.shape = mesh_like(SphereShape{0.1}, 20);
  ASSERT_TRUE(is_convex(scene.hidden.shape));
  const HistogramCube got = light_of(scene, fast());
  // The polyhedron is inscribed; a sphere of the same area has the same light but for its facets,
  // which lie up to (pi / 20)^2 / 2 of the radius within.
  double area = 0;
  for (const SurfaceCell& cell : divide(scene.hidden.shape, Transform::Identity(), 1.0, 1)) {
    area += cell.area;
  }
  scene.hidden.shape = SphereShape{std::sqrt(area / (4 * kPi))};
  EXPECT_LT(difference(got, light_of(scene, fast())), std::pow(kPi / 20, 2) / 2 + tolerance());
}

// Two plates in one mesh, the larger one close before the other: nothing of the rear one is seen.
TEST_P(Objects, MeshShadowsItself) {
  Scene scene = wall_scene();
  const Scene front = scene;
  const double y = 0.1, z = 0.15, b = -0.002;
  scene.hidden.shape = mesh_of({{0, -y, -z},
                                {0, y, -z},
                                {0, y, z},
                                {0, -y, z},
                                {b, -y / 2, -z / 2},
                                {b, y / 2, -z / 2},
                                {b, y / 2, z / 2},
                                {b, -y / 2, z / 2}},
                               {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}});
  ASSERT_FALSE(is_convex(scene.hidden.shape));
  // The centroid moved back by a fifth of 2 mm.
  EXPECT_LT(difference(light_of(scene, fast()), light_of(front, fast())), 0.01 + tolerance());
}

TEST_P(Objects, ArrowIsLitAsItsPlatesAre) {
  Scene scene = wall_scene();
  scene.hidden.shape =
      MeshShape{read_obj(std::string(SOURCE_DIR) + "/scenes/meshes/arrow.obj", 0.5), false};
  scene.hidden.placement.yaw = 70 * kDegree;  // broadside towards the wall
  const HistogramCube arrow = light_of(scene, fast());
  // A plate with the area of the outline at the arrow's surface; the rim adds some per cent.
  const double area = 0.25 * (0.25 * 0.1 + 0.3 * 0.15 / 2);
  scene.hidden.shape = RectangleShape{std::sqrt(area), std::sqrt(area)};
  scene.hidden.placement.yaw -= kPi / 2;
  EXPECT_NEAR(sum(arrow), sum(light_of(scene, fast())), 0.12 * sum(arrow));
}

// ---------------------------------------------------------------------------------------------
// Several objects

HiddenObject plate(const Vector3d& position, double yaw_deg, double width) {
  HiddenObject object;
  object.name = "second";
  object.shape = RectangleShape{width, width};
  object.albedo = 0.6;
  object.placement.position = position;
  object.placement.yaw = yaw_deg * kDegree;
  return object;
}

TEST_P(Objects, ObjectsThatDoNotHideEachOtherAdd) {
  Scene both = wall_scene();
  both.further_hidden = {plate({0.2, -0.5, 0.1}, 30, 0.15)};
  // Each object has its share of the tolerance.
  const auto alone = [&](int object) {
    const Scene scene = only_object(both, object);
    const FastModelOptions half = at_tolerance(FastModelOptions{}.tolerance / 2);
    return fast() ? make_fast_model(scene, sensor_placement(scene), half)
                        ->three_bounce(stated_pose(scene))
                  : light_of(scene, false);
  };
  const HistogramCube a = alone(0);
  HistogramCube want = alone(1);
  for (std::size_t i = 0; i < want.values.size(); ++i) want.values[i] += a.values[i];
  EXPECT_LT(difference(light_of(both, fast()), want), 1e-9);
}

TEST_P(Objects, OneObjectHidesAnother) {
  Scene both = wall_scene();
  const Scene first = both;
  const Vector3d back(-std::cos(-25 * kDegree), -std::sin(-25 * kDegree), 0);
  both.further_hidden = {plate(both.hidden.placement.position + 0.003 * back, -25, 0.1)};
  // Fast models of one and of two objects have samplings of their own, of 1 % tolerance each.
  EXPECT_LT(difference(light_of(both, fast()), light_of(first, fast())), fast() ? 5e-3 : 1e-3);
}

// A sphere half hides another: the fast model's silhouettes against the reference's triangles.
TEST(SeveralObjects, FastModelAgreesWithTheReference) {
  for (const bool round : {true, false}) {
    Scene scene = wall_scene();
    scene.hidden.name = "front";
    scene.hidden.shape = round ? Shape(SphereShape{0.1}) : Shape(CylinderShape{0.08, 0.3});
    scene.hidden.anchor = Anchor::center;
    scene.hidden.placement.position = Vector3d(0.1, 0.6, 0);
    HiddenObject behind = plate({-0.08, 0.82, 0.04}, -30, 0.25);
    if (round) behind.shape = SphereShape{0.12};
    scene.further_hidden = {behind};
    scene.unknowns = {{Component::x, 0.05, 0.15, std::nullopt},
                      {Component::y, 0.75, 0.85, std::nullopt, 1}};
    const HistogramCube want = light_of(scene, false);
    EXPECT_LT(difference(light_of(scene, true), want), 0.04);
    // Hiding matters: without it the sum would be another.
    HistogramCube alone = light_of(only_object(scene, 0), false);
    const HistogramCube other = light_of(only_object(scene, 1), false);
    for (std::size_t i = 0; i < alone.values.size(); ++i) alone.values[i] += other.values[i];
    EXPECT_GT(difference(alone, want), 0.05);
  }
}

// The plan of the scene is what any of its objects needs: here a screen that shades the second
// only.
TEST(SeveralObjects, PlanAndSamplingSuitEveryObject) {
  Scene scene = wall_scene();
  scene.hidden.name = "first";
  HiddenObject large = plate({0.2, -0.5, 0.1}, 30, 0.4);
  scene.further_hidden = {large};
  scene.unknowns = {{Component::x, 0.1, 0.2, std::nullopt},
                    {Component::x, 0.15, 0.25, std::nullopt, 1}};
  Surface screen = scene.surfaces.front();
  screen.name = "screen";
  screen.shape = RectangleShape{0.15, 0.15};
  screen.T_world_surface.translation() = Vector3d(0.45, -0.2, 0.05);
  screen.relay = false;
  screen.occluder = true;
  scene.surfaces.push_back(screen);
  const SensorPlacement sensor = sensor_placement(scene);
  const auto both = make_fast_model(scene, sensor, at_tolerance(0.04));
  const auto first = make_fast_model(only_object(scene, 0), sensor, at_tolerance(0.02));
  const auto second = make_fast_model(only_object(scene, 1), sensor, at_tolerance(0.02));
  ASSERT_TRUE(first->plan().occluders.empty());
  ASSERT_FALSE(second->plan().occluders.empty());
  EXPECT_EQ(both->plan().occluders.size(), second->plan().occluders.size());
  EXPECT_TRUE(both->plan().decision(Term::occlusion).used);
  EXPECT_DOUBLE_EQ(both->plan().decision(Term::dim_patches).bound,
                   first->plan().decision(Term::dim_patches).bound +
                       second->plan().decision(Term::dim_patches).bound);
  EXPECT_EQ(both->sampling_step()->relay,
            std::min(first->sampling_step()->relay, second->sampling_step()->relay));
  EXPECT_EQ(both->sampling_step()->object,
            std::min(first->sampling_step()->object, second->sampling_step()->object));
}

// What one sum leaves out of a lobe's light lies where that light does, and is held against the
// whole tolerance. Held against each object's share of it, the street with two lobes took pairs,
// for an evaluation that lasts a hundred times as long, though they change no bin by the tolerance.
TEST(SeveralObjects, TwoLobesNeedPairsNoMoreThanEachByItself) {
  const Scene scene = bundled_scene("street_two");
  const SensorPlacement sensor = sensor_placement(scene);
  FastModelOptions options = at_tolerance(0.1);
  const auto both = make_fast_model(scene, sensor, options);
  EXPECT_EQ(both->plan().kernel, Kernel::retro_single);
  EXPECT_FALSE(both->sampling_step()->lobe_pairs);
  options.overrides.on = {Term::patch_pairs};
  options.sampling_step = both->sampling_step();
  const auto pairs = make_fast_model(scene, sensor, options);
  ASSERT_EQ(pairs->plan().kernel, Kernel::retro_pairs);
  std::mt19937_64 random(3);
  for (int i = 0; i < 4; ++i) {
    const PoseVector pose = random_pose(scene, random);
    const HistogramCube want = pairs->three_bounce(pose), got = both->three_bounce(pose);
    double largest = 0;
    for (std::size_t k = 0; k < want.values.size(); ++k) {
      largest = std::max(largest, std::abs(got.values[k] - want.values[k]));
    }
    EXPECT_LT(largest, options.tolerance * *std::ranges::max_element(want.values)) << i;
  }
}

TEST(SeveralObjects, PosesGoToTheirObjects) {
  Scene scene = wall_scene();
  scene.hidden.name = "front";
  scene.further_hidden = {plate({0, 0.9, 0}, 0, 0.1)};
  scene.unknowns = {{Component::x, 0, 1, std::nullopt},
                    {Component::x, 0, 1, std::nullopt, 1},
                    {Component::yaw, 0, 1, std::nullopt, 1}};
  EXPECT_EQ(unknown_names(scene),
            (std::vector<std::string>{"front.x_m", "second.x_m", "second.yaw_rad"}));
  const auto placements = placements_at(scene, Vector3d(0.3, 0.4, 0.5));
  ASSERT_EQ(placements.size(), 2U);
  EXPECT_EQ(placements[0].position.x(), 0.3);
  EXPECT_EQ(placements[1].position.x(), 0.4);
  EXPECT_EQ(placements[1].yaw, 0.5);
  EXPECT_EQ(placements[0].yaw, -25 * kDegree);
  EXPECT_EQ(pose_of(placements, scene.unknowns), PoseVector(Vector3d(0.3, 0.4, 0.5)));
}

}  // namespace
}  // namespace blindcorner
