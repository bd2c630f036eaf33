// SPDX-License-Identifier: Apache-2.0
// Scene files: every shipped one is accepted, and every wrong one is refused with one line that
// names the file, the field, what was found and what is accepted.
#include "blindcorner/io/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "io/json_reader.h"
#include "unit/error_message.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// Unit conversions and rotations leave a few roundings of a double.
constexpr double kRounding = 1e-12;

/// A complete explicit scene with nothing optional in it.
json minimal() {
  return json::parse(R"({
    "sensor": {
      "rows": 1, "columns": 2, "bins": 64, "bin_width_ps": 100, "fov_deg": [40, 20],
      "impulse_response": {"type": "gaussian", "fwhm_ps": 200}
    },
    "sensor_pose": {"position_m": [0, 0, 1]},
    "surfaces": [{"shape": "rectangle", "center_m": [1, 0, 1], "normal": [-1, 0, 0],
                  "width_m": 2, "height_m": 2, "relay": true}],
    "hidden": {"shape": "rectangle", "width_m": 0.2, "height_m": 0.3,
               "position_m": [null, null, 1]},
    "unknowns": {"x_m": [0, 0.5], "y_m": [0.4, 1.0]}
  })");
}

using Change = std::function<void(json&)>;

Scene changed(const Change& change) {
  json scene = minimal();
  change(scene);
  return parse_scene(scene, "test.json");
}

/// A file in the test's own temporary folder.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text)
      : path_(std::filesystem::path(::testing::TempDir()) /
              (std::string("scene_file_test_") +
               ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".json")) {
    std::ofstream(path_) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

TEST(SceneFile, EveryShippedSceneIsAccepted) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SOURCE_DIR "/scenes")) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() != ".json" || name.ends_with("_drive")) continue;  // drive files
    SCOPED_TRACE(entry.path().string());
    const Scene scene = read_scene(entry.path().string());
    EXPECT_EQ(scene.name, entry.path().stem().string());
    EXPECT_EQ(static_cast<int>(scene.sensor.zones.size()), scene.sensor.zone_count());
    EXPECT_FALSE(scene.unknowns.empty());
    for (const Unknown& unknown : scene.unknowns) {
      const Placement& placement = hidden_object(scene, unknown.object).placement;
      EXPECT_GE(placement.get(unknown.component), unknown.lower);
      EXPECT_LE(placement.get(unknown.component), unknown.upper);
    }
    ++count;
  }
  EXPECT_GE(count, 8);
}

TEST(SceneFile, DefaultsAreThoseOfTheDocumentation) {
  const Scene scene = parse_scene(minimal(), "folder/test.json");
  EXPECT_EQ(scene.name, "test");
  EXPECT_EQ(scene.sensor.name, "custom");
  EXPECT_EQ(scene.sensor.illumination, Illumination::flash);
  EXPECT_EQ(scene.sensor.path_origin, PathOrigin::sensor);
  EXPECT_EQ(scene.sensor.radiant_intensity, 1.0);
  EXPECT_EQ(scene.sensor.dispersion, 1.0);
  EXPECT_EQ(scene.sensor.wrap_bins, 0);
  EXPECT_EQ(scene.sensor.valid_end(1), 64);
  EXPECT_EQ(scene.sensor.zones[1].time_zero, 0.0);
  EXPECT_EQ(scene.sensor.zones[1].gain, 1.0);
  EXPECT_FALSE(scene.sensor.zones[1].dead);
  EXPECT_TRUE(scene.T_world_sensor.linear().isIdentity());
  EXPECT_FALSE(scene.sensor_covariance.has_value());
  EXPECT_EQ(scene.surfaces[0].albedo, 0.5);
  EXPECT_FALSE(scene.surfaces[0].occluder);
  EXPECT_TRUE(std::holds_alternative<LambertianMaterial>(scene.hidden.material));
  EXPECT_EQ(scene.hidden.anchor, Anchor::center);
  EXPECT_EQ(scene.hidden.placement.position, Eigen::Vector3d(0.25, 0.7, 1.0));
  EXPECT_EQ(scene.linear.amplitude, LinearMode::shared);
  EXPECT_EQ(scene.linear.ambient, LinearMode::per_zone);
  EXPECT_EQ(scene.linear.direct, LinearMode::fixed);
  EXPECT_EQ(scene.linear.fixed_direct, 1.0);
  EXPECT_EQ(scene.presence_prior, 0.5);
}

TEST(SceneFile, IlluminationIsTheRectangleAroundTheZonesUnlessGiven) {
  const Scene scene = parse_scene(minimal(), "test.json");
  const auto& field = std::get<AngularRectangle>(scene.sensor.field);
  EXPECT_NEAR(field.left, -20 * kDegree, kRounding);
  EXPECT_NEAR(field.right, 20 * kDegree, kRounding);
  EXPECT_NEAR(field.bottom, 10 * kDegree, kRounding);
}

TEST(SceneFile, UnitsBecomeSi) {
  const Scene scene = changed([](json& s) {
    s["sensor"]["time_zero_ps"] = {100, -50};
    s["sensor_pose"]["sigma_m"] = 0.01;
    s["sensor_pose"]["sigma_deg"] = {0, 0, 2};
    s["unknowns"]["yaw_deg"] = {{"range", {-90, 90}}, {"prior", {{"mean", 45}, {"sigma", 9}}}};
    s["hidden"]["material"] = {{"retroreflective", {{"lobe_sigma_deg", 0.5}}}};
  });
  EXPECT_NEAR(scene.sensor.bin_width, 1e-10, 1e-22);
  EXPECT_NEAR(scene.sensor.zones[0].time_zero, 1e-10, 1e-22);
  EXPECT_NEAR(scene.sensor.zones[1].time_zero, -5e-11, 1e-22);
  const auto& pulse = std::get<GaussianResponse>(scene.sensor.response.shape());
  EXPECT_NEAR(pulse.sigma, 2e-10 / kGaussianFwhm, 1e-22);
  ASSERT_TRUE(scene.sensor_covariance.has_value());
  EXPECT_NEAR((*scene.sensor_covariance)(0, 0), 1e-4, kRounding);
  EXPECT_EQ((*scene.sensor_covariance)(3, 3), 0.0);
  EXPECT_NEAR((*scene.sensor_covariance)(5, 5), std::pow(2 * kDegree, 2), kRounding);
  const Unknown& yaw = scene.unknowns[2];
  EXPECT_EQ(yaw.component, Component::yaw);
  EXPECT_NEAR(yaw.lower, -kPi / 2, kRounding);
  EXPECT_NEAR(yaw.prior->mean, kPi / 4, kRounding);
  EXPECT_NEAR(yaw.prior->sigma, kPi / 20, kRounding);
  EXPECT_NEAR(std::get<RetroreflectiveMaterial>(scene.hidden.material).lobe_sigma, 0.5 * kDegree,
              kRounding);
}

TEST(SceneFile, ZonesDivideTheFieldEvenlyInTangentsRowByRow) {
  const Scene scene = changed([](json& s) {
    s["sensor"]["rows"] = 2;
    s["sensor"]["columns"] = 3;
    s["sensor"]["fov_deg"] = {60, 40};
  });
  const auto& last_of_first_row = std::get<AngularRectangle>(scene.sensor.zones[2].footprint);
  EXPECT_NEAR(std::tan(last_of_first_row.left), std::tan(30 * kDegree) / 3, kRounding);
  EXPECT_NEAR(last_of_first_row.right, 30 * kDegree, kRounding);
  EXPECT_NEAR(last_of_first_row.top, -20 * kDegree, kRounding);  // rows go down
  EXPECT_NEAR(last_of_first_row.bottom, 0, kRounding);
  const auto& first_of_second_row = std::get<AngularRectangle>(scene.sensor.zones[3].footprint);
  EXPECT_NEAR(first_of_second_row.left, -30 * kDegree, kRounding);
  EXPECT_NEAR(first_of_second_row.bottom, 20 * kDegree, kRounding);
}

TEST(SceneFile, ZonesMayBeGivenOneByOneByEdgesOrAsRelayPoints) {
  const auto with_zones = [](const std::string& zones) {
    return changed([&](json& s) {
      s["sensor"].erase("fov_deg");
      s["sensor"].update(json::parse(zones));
    });
  };
  const Scene single = with_zones(R"({"zones": [
      {"angles_deg": {"left": -9, "right": -1, "top": -4, "bottom": 5}},
      {"angles_deg": {"left": -2, "right": 8, "top": -4, "bottom": 5}}]})");
  EXPECT_NEAR(std::get<AngularRectangle>(single.sensor.zones[1].footprint).left, -2 * kDegree,
              kRounding);
  const Scene edges =
      with_zones(R"({"zone_columns_deg": [[-9, -1], [-2, 8]], "zone_rows_deg": [[-4, 5]]})");
  EXPECT_NEAR(std::get<AngularRectangle>(edges.sensor.zones[1].footprint).right, 8 * kDegree,
              kRounding);
  const Scene points =
      with_zones(R"({"zones": [{"relay_point_m": [1, 0, 1]}, {"relay_point_m": [1, 0.5, 1]}]})");
  EXPECT_EQ(std::get<Eigen::Vector3d>(points.sensor.zones[1].footprint).y(), 0.5);
  const Scene captured = with_zones(R"({"zones": "from_capture"})");
  EXPECT_TRUE(std::get<Eigen::Vector3d>(captured.sensor.zones[0].footprint).hasNaN());
}

TEST(SceneFile, EveryKindOfImpulseResponseIsRead) {
  const auto response = [](const std::string& text) {
    return changed([&](json& s) { s["sensor"]["impulse_response"] = json::parse(text); })
        .sensor.response.shape();
  };
  const auto box = std::get<BoxGaussianResponse>(
      response(R"({"type": "box_gaussian", "box_ps": 400, "sigma_ps": 50})"));
  EXPECT_NEAR(box.box, 4e-10, 1e-22);
  EXPECT_NEAR(box.sigma, 5e-11, 1e-22);
  const auto tail =
      std::get<ExponentialTailResponse>(response(R"({"type": "exponential_tail", "fwhm_ps": 100,
                   "tails": [{"fraction": 0.2, "decay_ps": 500}]})"));
  EXPECT_EQ(tail.tails.at(0).fraction, 0.2);
  EXPECT_NEAR(tail.tails.at(0).decay, 5e-10, 1e-22);
  const auto table = std::get<TableResponse>(
      response(R"({"type": "table", "times_ps": [0, 100, 300], "values": [0, 5, 0]})"));
  EXPECT_NEAR(table.times.at(2), 3e-10, 1e-22);
  EXPECT_THAT(table.values, ElementsAre(0, 5, 0));
}

TEST(SceneFile, SensorPoseMayBeALineOfSightAnglesOrAQuaternion) {
  const auto axes = [](const json& pose) {
    return Eigen::Matrix3d(
        changed([&](json& s) { s["sensor_pose"].update(pose); }).T_world_sensor.linear());
  };
  const Eigen::Matrix3d by_look = axes({{"look", {0, 2, 0}}});
  EXPECT_TRUE(by_look.col(0).isApprox(Eigen::Vector3d::UnitY()));
  EXPECT_TRUE(by_look.col(1).isApprox(-Eigen::Vector3d::UnitX()));  // columns go right, to +x
  EXPECT_TRUE(axes({{"yaw_pitch_roll_deg", {90, 0, 0}}}).isApprox(by_look, kRounding));
  const double h = std::sqrt(0.5);
  EXPECT_TRUE(axes({{"quaternion_wxyz", {h, 0, 0, h}}}).isApprox(by_look, 1e-9));
  // Positive pitch looks down.
  EXPECT_LT(axes({{"yaw_pitch_roll_deg", {0, 30, 0}}})(2, 0), -0.49);
  // Straight down, the top of the image is +x unless told otherwise.
  EXPECT_TRUE(axes({{"look", {0, 0, -1}}}).col(2).isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_TRUE(
      axes({{"look", {0, 0, -1}}, {"up", {0, 1, 0.2}}}).col(2).isApprox(Eigen::Vector3d::UnitY()));
}

TEST(SceneFile, SurfacesGetRightHandedAxesAndCentres) {
  const Scene scene = changed([](json& s) {
    s["surfaces"].push_back(json::parse(R"({"name": "floor", "shape": "rectangle",
        "center_m": [0, 0, 0], "normal": [0, 0, 3], "width_m": 1, "height_m": 2})"));
    s["surfaces"].push_back(json::parse(R"({"shape": "box", "base_m": [1, 2, 0],
        "size_m": [2, 1, 3], "yaw_deg": 90, "albedo": 0, "occluder": true})"));
  });
  for (const Surface& surface : scene.surfaces) {
    EXPECT_NEAR(surface.T_world_surface.linear().determinant(), 1, kRounding) << surface.name;
  }
  EXPECT_EQ(scene.surfaces[1].name, "floor");
  EXPECT_TRUE(scene.surfaces[1].T_world_surface.linear().col(2).isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_EQ(scene.surfaces[2].name, "surface 2");
  EXPECT_EQ(scene.surfaces[2].T_world_surface.translation(), Eigen::Vector3d(1, 2, 1.5));
  EXPECT_TRUE(scene.surfaces[2].T_world_surface.linear().col(0).isApprox(Eigen::Vector3d::UnitY()));
  EXPECT_TRUE(scene.surfaces[2].occluder);
}

TEST(SceneFile, UnknownsKeepTheOrderOfTheFile) {
  std::string text = minimal().dump();
  const std::string sorted = R"({"x_m":[0,0.5],"y_m":[0.4,1.0]})";
  const auto at = text.find(sorted);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, sorted.size(), R"({"y_m":[0.4,1.0],"yaw_deg":[0,90],"x_m":[0,0.5]})");
  const TemporaryFile file(text);
  EXPECT_THAT(unknown_names(read_scene(file.path())), ElementsAre("y_m", "yaw_rad", "x_m"));
  // In memory the fields have no order; the unknowns then come in the usual one.
  EXPECT_THAT(unknown_names(parse_scene(json::parse(text), "test.json")),
              ElementsAre("x_m", "y_m", "yaw_rad"));
}

TEST(SceneFile, GivenValueOfAnUnknownIsKeptAndYawIsTakenModuloATurn) {
  const Scene scene = changed([](json& s) {
    s["hidden"]["position_m"] = {0.1, nullptr, 1.2};
    s["hidden"]["yaw_deg"] = 350;
    s["unknowns"]["yaw_deg"] = {-90, 90};
  });
  EXPECT_EQ(scene.hidden.placement.position, Eigen::Vector3d(0.1, 0.7, 1.2));
  EXPECT_NEAR(scene.hidden.placement.yaw, -10 * kDegree, kRounding);
}

// What has to be given is said in the form in which it is given.
TEST(SceneFile, AMissingPositionIsToldWithWhatIsUnknownAsNull) {
  const auto message = [](const Change& change) { return message_of([&] { changed(change); }); };
  EXPECT_EQ(
      message([](json& s) { s["hidden"].erase("position_m"); }),
      "test.json: hidden.position_m: found nothing, accepted: [null, null, Z], Z a number from "
      "-10000000 to 10000000, because z_m is not among the unknowns");
  EXPECT_THAT(message([](json& s) {
                s["hidden"].erase("position_m");
                s["unknowns"].erase("x_m");
              }),
              HasSubstr("accepted: [X, null, Z], X and Z a number from -10000000 to 10000000, "
                        "because x_m and z_m are not among the unknowns"));
  EXPECT_EQ(changed([](json& s) {
              s["hidden"]["position_m"] = {nullptr, nullptr, 0};
            }).hidden.placement.position,
            Eigen::Vector3d(0.25, 0.7, 0));
}

TEST(SceneFile, StandingShapesAreAnchoredAtTheirBase) {
  const auto anchor = [](const char* hidden) {
    return changed([&](json& s) { s["hidden"] = json::parse(hidden); }).hidden.anchor;
  };
  EXPECT_EQ(anchor(R"({"shape": "cylinder", "radius_m": 0.2, "height_m": 1.7,
                       "position_m": [null, null, 0]})"),
            Anchor::base);
  EXPECT_EQ(anchor(R"({"shape": "box", "size_m": [1, 1, 1], "position_m": [null, null, 0]})"),
            Anchor::base);
  EXPECT_EQ(anchor(R"({"shape": "box", "size_m": [1, 1, 1], "anchor": "center",
                       "position_m": [null, null, 0]})"),
            Anchor::center);
  EXPECT_EQ(anchor(R"({"shape": "sphere", "radius_m": 0.2, "position_m": [null, null, 0]})"),
            Anchor::center);
}

/// Two hidden spheres.
json two_objects() {
  json scene = minimal();
  scene["hidden"] = json::parse(R"([
    {"name": "front", "shape": "sphere", "radius_m": 0.1, "position_m": [null, 0.5, 1]},
    {"name": "back", "shape": "sphere", "radius_m": 0.2, "position_m": [0.1, null, 1.1]}
  ])");
  scene["unknowns"] = json::parse(R"({"front.x_m": [0, 0.5], "back.y_m": [0.4, 1.0]})");
  return scene;
}

TEST(SceneFile, SeveralHiddenObjectsHaveNames) {
  const Scene scene = parse_scene(two_objects(), "test.json");
  ASSERT_EQ(object_count(scene), 2);
  EXPECT_EQ(unknown_names(scene), (std::vector<std::string>{"front.x_m", "back.y_m"}));
  EXPECT_EQ(scene.unknowns[1].object, 1);
  EXPECT_EQ(hidden_object(scene, 1).placement.position.x(), 0.1);
  EXPECT_NEAR(hidden_object(scene, 1).placement.position.y(), 0.7, kRounding);
  const auto message = [](const Change& change) {
    json wrong = two_objects();
    change(wrong);
    return message_of([&] { parse_scene(wrong, "test.json"); });
  };
  EXPECT_THAT(message([](json& s) {
                s["unknowns"]["x_m"] = {0, 1};
              }),
              HasSubstr("unknowns.x_m: found an unknown of no known name"));
  EXPECT_THAT(message([](json& s) { s["hidden"][1]["name"] = "front"; }),
              HasSubstr("hidden[1].name: found the name of another object"));
  EXPECT_THAT(message([](json& s) { s["hidden"][0]["name"] = "a.b"; }),
              HasSubstr("hidden[0].name: found \"a.b\""));
  EXPECT_THAT(message([](json& s) { s["hidden"] = json::array(); }), HasSubstr("hidden"));
  EXPECT_THAT(message([](json& s) {
                s["hidden"][1]["material"]["measured_law"] = {{"cosine_exponent", 2},
                                                              {"distance_exponent", 4}};
              }),
              HasSubstr("hidden[1].material: found a measured law beside other objects"));
}

TEST(SceneFile, MeshesAreReadFromBesideTheScene) {
  json scene = minimal();
  scene["hidden"] = json::parse(R"({"shape": "mesh", "file": "meshes/arrow.obj", "scale": 0.5,
                                    "position_m": [null, null, 1], "yaw_deg": 30})");
  scene["surfaces"].push_back(json::parse(R"({"shape": "mesh", "file": "meshes/arrow.obj",
    "position_m": [1, 2, 3], "occluder": true})"));
  const std::string beside = SOURCE_DIR "/scenes/test.json";
  const Scene read = parse_scene(scene, beside);
  const auto& mesh = std::get<MeshShape>(read.hidden.shape);
  EXPECT_NEAR(mesh.mesh->extent.x(), 0.2, kRounding);
  EXPECT_FALSE(mesh.two_sided) << "a closed body is seen from outside";
  EXPECT_EQ(read.hidden.anchor, Anchor::center);
  // A surface's position is that of the file's origin, 5 cm before the tip's rear edge.
  const auto& surface = std::get<MeshShape>(read.surfaces[1].shape);
  const Eigen::Vector3d origin = read.surfaces[1].T_world_surface * surface.mesh->origin;
  EXPECT_NEAR((origin - Eigen::Vector3d(1, 2, 3)).norm(), 0, 1e-9);
  scene["hidden"]["file"] = "meshes/none.obj";
  EXPECT_THAT(message_of([&] { parse_scene(scene, beside); }),
              AllOf(HasSubstr("hidden.file: "), HasSubstr("none.obj: no such file")));
  scene["hidden"].erase("file");
  EXPECT_EQ(message_of([&] { parse_scene(scene, beside); }),
            beside + ": hidden.file: found nothing, accepted: a string");
}

TEST(SceneFile, HiddenMeshesWoundInwardsAreRecognised) {
  const test::TemporaryFolder folder;
  const auto write_pyramid = [&](const std::string& faces) {
    test::write_text(folder.file("body.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + faces);
  };
  json scene = minimal();
  scene["hidden"] = json::parse(R"({"shape": "mesh", "file": "body.obj", "scale": 0.1,
                                    "position_m": [null, null, 1]})");
  const auto read = [&] { return parse_scene(scene, folder.file("scene.json")); };
  write_pyramid("f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  EXPECT_NO_THROW(read());
  write_pyramid("f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n");
  EXPECT_THAT(message_of(read), AllOf(HasSubstr("hidden.file: found faces that are wound inwards"),
                                      HasSubstr("-0.000167 m^3"), HasSubstr("two_sided")));
  scene["hidden"]["two_sided"] = true;
  EXPECT_NO_THROW(read());
  // A surface may be a room that is seen from inside, and what is open has no inside.
  scene["surfaces"].push_back(scene["hidden"]);
  scene["surfaces"][1].erase("two_sided");
  scene["surfaces"][1]["position_m"] = {0, 0, 0};
  EXPECT_NO_THROW(read());
  scene["hidden"].erase("two_sided");
  write_pyramid("f 1 2 3\nf 1 4 2\nf 1 3 4\n");
  EXPECT_NO_THROW(read());
}

TEST(SceneFile, CommentsAreNamedAsSuch) {
  const std::string good = minimal().dump(1);
  const auto message = [](const std::string& text) {
    return message_of([&] { JsonReader::parse(text, "scene.json"); });
  };
  for (const std::string comment : {"// a wall\n", "/* a wall */", "# a wall\n"}) {
    EXPECT_THAT(message(comment + good), HasSubstr("accepted: JSON (it has no comments)"));
    std::string within = good;
    within.insert(within.find("\"surfaces\""), comment);
    EXPECT_THAT(message(within), HasSubstr("it has no comments"));
  }
  EXPECT_THAT(message("{\"a\": 1,}"), Not(HasSubstr("comments")));
  EXPECT_EQ(message("{\"a\": \"// text\"}"), "no error");
}

TEST(SceneFile, DetectorsEffectsAreRead) {
  const Scene scene = changed([](json& s) {
    s["sensor"]["pile_up_cycles"] = 1e5;
    s["sensor"]["saturation"] = 65535;
    s["sensor"]["crosstalk"] = 0.1;
    s["sensor"]["background_counts"] = {json::array(), std::vector<double>(64, 2.5)};
  });
  EXPECT_TRUE(scene.sensor.zones[0].background.empty());
  EXPECT_EQ(scene.sensor.zones[1].background, std::vector<double>(64, 2.5));
  // Photons are not negative; what is left of them after subtraction may be.
  const auto negative = [](json& s) {
    s["sensor"]["background_counts"] = {json::array(), std::vector<double>(64, -2.5)};
  };
  EXPECT_THAT(message_of([&] { changed(negative); }),
              HasSubstr("sensor.background_counts[1][0]: found -2.5"));
  const Scene subtracted = changed([&](json& s) {
    s["sensor"]["noise"] = {{"law", "gaussian"}, {"variance_floor", 1}};
    negative(s);
  });
  EXPECT_EQ(subtracted.sensor.zones[1].background[63], -2.5);
  EXPECT_EQ(scene.sensor.pile_up_cycles, 1e5);
  EXPECT_EQ(scene.sensor.saturation, 65535);
  ASSERT_EQ(scene.sensor.crosstalk.size(), 4U);  // two zones side by side
  EXPECT_NEAR(scene.sensor.crosstalk[0], 0.9, kRounding);
  EXPECT_NEAR(scene.sensor.crosstalk[1], 0.1, kRounding);
  const Scene matrix = changed([](json& s) { s["sensor"]["crosstalk"] = {{1, 0.2}, {0, 0.8}}; });
  EXPECT_EQ(matrix.sensor.crosstalk, (std::vector<double>{1, 0.2, 0, 0.8}));
  EXPECT_THAT(message_of([] {
                changed([](json& s) {
                  s["sensor"]["pile_up_cycles"] = 10;
                  s["sensor"]["noise"] = {{"law", "gaussian"}, {"variance_floor", 1}};
                });
              }),
              HasSubstr("sensor.pile_up_cycles"));
}

TEST(SceneFile, LinearUnknownsAreRead) {
  const Scene scene = changed([](json& s) {
    s["linear"] = json::parse(R"({
      "amplitude": {"mode": "per_zone", "prior": {"median": 2, "sigma_log": 0.7}},
      "ambient": {"mode": "fixed", "counts_per_bin": 12},
      "direct": {"mode": "absent"}})");
    s["presence_prior"] = 0.2;
  });
  EXPECT_EQ(scene.linear.amplitude, LinearMode::per_zone);
  EXPECT_EQ(scene.linear.amplitude_prior.median, 2.0);
  EXPECT_EQ(scene.linear.amplitude_prior.sigma_log, 0.7);
  EXPECT_EQ(scene.linear.ambient, LinearMode::fixed);
  EXPECT_EQ(scene.linear.fixed_ambient, 12.0);
  EXPECT_EQ(scene.linear.direct, LinearMode::fixed);
  EXPECT_EQ(scene.linear.fixed_direct, 0.0);
  EXPECT_EQ(scene.presence_prior, 0.2);
}

TEST(SceneFile, ValidBinsAreForAllZonesOrForEach) {
  const Scene all = changed([](json& s) { s["sensor"]["valid_bins"] = {3, 9}; });
  EXPECT_EQ(all.sensor.zones[1].first_valid_bin, 3);
  EXPECT_EQ(all.sensor.valid_end(1), 10);
  const Scene each = changed([](json& s) {
    s["sensor"]["valid_bins"] = json::parse("[[0, 63], [5, 5]]");
    s["sensor"]["dead_zones"] = {0};
  });
  EXPECT_EQ(each.sensor.valid_end(0), 64);
  EXPECT_EQ(each.sensor.zones[1].first_valid_bin, 5);
  EXPECT_TRUE(each.sensor.zones[0].dead);
  EXPECT_FALSE(each.sensor.zones[1].dead);
}

TEST(SceneFile, NoiseFloorsAreForAllZonesOrForEach) {
  const json law = {{"law", "gaussian"}, {"variance_floor", 9}, {"variance_per_count", 2}};
  const Scene all = changed([&](json& s) { s["sensor"]["noise"] = law; });
  const Scene each = changed([&](json& s) {
    s["sensor"]["noise"] = law;
    s["sensor"]["noise"]["variance_floor"] = {4, 16};
  });
  for (int z = 0; z < 2; ++z) {
    EXPECT_EQ(std::get<GaussianNoise>(all.sensor.noise_of(z)).variance_floor, 9);
    EXPECT_EQ(std::get<GaussianNoise>(each.sensor.noise_of(z)).variance_floor, z == 0 ? 4 : 16);
    EXPECT_EQ(std::get<GaussianNoise>(each.sensor.noise_of(z)).variance_per_count, 2);
  }
}

struct PresetFacts {
  const char* name;
  int rows, columns, bins;
  double bin_width_ps;
};

TEST(SceneFile, PresetsHoldWhatTheirNameSays) {
  for (const PresetFacts& facts :
       {PresetFacts{"tmf8828_3x3_short", 3, 3, 128, 88},
        PresetFacts{"tmf8828_4x4_short", 4, 4, 128, 88},
        PresetFacts{"tmf8828_8x8_short", 8, 8, 128, 88},
        PresetFacts{"tmf8828_3x3_long", 3, 3, 128, 260},
        PresetFacts{"vl53l8ch_4x4", 4, 4, 128, 250}, PresetFacts{"vl53l8ch_8x8", 8, 8, 128, 250},
        PresetFacts{"vl53l1x_2x2", 2, 2, 24, 1314.2},
        PresetFacts{"street_lidar_8x8", 8, 8, 256, 1000}}) {
    SCOPED_TRACE(facts.name);
    const Scene scene = changed([&](json& s) { s["sensor"] = {{"preset", facts.name}}; });
    EXPECT_EQ(scene.sensor.name, facts.name);
    EXPECT_EQ(scene.sensor.rows, facts.rows);
    EXPECT_EQ(scene.sensor.columns, facts.columns);
    EXPECT_EQ(scene.sensor.bins, facts.bins);
    EXPECT_NEAR(scene.sensor.bin_width * 1e12, facts.bin_width_ps, 1e-9);
    EXPECT_EQ(static_cast<int>(scene.sensor.zones.size()), facts.rows * facts.columns);
  }
}

// The tail of the TMF8828, binned, as measured: 6 % of the peak at +5 bins, 2.3 % at +10, 0.43 % at
// +20, full width at half maximum about 3 bins. Each figure was read off with about two digits.
TEST(SceneFile, PresetOfTheTmf8828HasTheMeasuredPulse) {
  const Sensor sensor = changed([](json& s) {
                          s["sensor"] = {{"preset", "tmf8828_3x3_short"}};
                        }).sensor;
  const auto bin = [&](double bins_after_peak) {  // content of a bin centred there
    const double centre = bins_after_peak * sensor.bin_width;
    return sensor.response.cumulative(centre + sensor.bin_width / 2) -
           sensor.response.cumulative(centre - sensor.bin_width / 2);
  };
  double peak_at = 0;
  for (double t = -1; t <= 1; t += 0.01) {
    if (bin(t) > bin(peak_at)) peak_at = t;
  }
  const double peak = bin(peak_at);
  EXPECT_NEAR(bin(peak_at + 5) / peak, 0.06, 0.002);
  EXPECT_NEAR(bin(peak_at + 10) / peak, 0.023, 0.001);
  EXPECT_NEAR(bin(peak_at + 20) / peak, 0.0043, 0.0002);
  double width = 0;
  for (double t = -6; t <= 6; t += 0.01) width += bin(t) > peak / 2 ? 0.01 : 0;
  EXPECT_NEAR(width, 3.0, 0.1);
}

TEST(SceneFile, PresetFieldsCanBeReplaced) {
  const Scene scene = changed([](json& s) {
    s["sensor"] = json::parse(R"({"preset": "tmf8828_3x3_short", "name": "mine", "bins": 100,
        "zone_columns_deg": [[-12, -4], [-2, 11], [13, 20]],
        "zone_rows_deg": [[-15, -6], [-8, 11], [10, 18]],
        "illumination": {"offset_m": [0, 0.01, 0]}})");
  });
  EXPECT_EQ(scene.sensor.name, "mine");
  EXPECT_EQ(scene.sensor.bins, 100);
  EXPECT_NEAR(scene.sensor.bin_width, 88e-12, 1e-22);
  EXPECT_NEAR(std::get<AngularRectangle>(scene.sensor.zones[5].footprint).right, 20 * kDegree,
              kRounding);
  // Illumination is replaced field by field: the preset's own field of illumination stays.
  EXPECT_NEAR(std::get<AngularRectangle>(scene.sensor.field).bottom, 26 * kDegree, kRounding);
  EXPECT_EQ(scene.sensor.light_offset.y(), 0.01);
}

struct Mistake {
  const char* pointer;   ///< where the scene is changed, JSON pointer
  const char* value;     ///< JSON put there; empty: the field is taken out
  const char* expected;  ///< field path at the start of the message, after the file's name
};

/// Each mistake is told in one line that starts with the file and the field's path.
void expect_told(std::initializer_list<Mistake> mistakes) {
  for (const Mistake& mistake : mistakes) {
    SCOPED_TRACE(std::string(mistake.pointer) + " = " + mistake.value);
    json scene = minimal();
    const json::json_pointer pointer(mistake.pointer);
    if (*mistake.value == '\0') {
      scene.at(pointer.parent_pointer()).erase(pointer.back());
    } else {
      scene[pointer] = json::parse(mistake.value);
    }
    const std::string message = message_of([&] { parse_scene(scene, "test.json"); });
    test::keep_refused("scene", scene.dump(), message);
    EXPECT_THAT(message, StartsWith(std::string("test.json: ") + mistake.expected + ": found "));
    EXPECT_THAT(message, HasSubstr(", accepted: "));
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(SceneFile, SensorMistakesAreToldWithTheirPath) {
  expect_told(
      {{"/sensor", "", "sensor"},
       {"/sensor", "3", "sensor"},
       {"/sensor", R"({"preset": "tmf8829"})", "sensor.preset"},
       {"/sensor", R"({"preset": "vl53l8ch_4x4", "bins": 0})", "sensor.bins"},
       {"/sensor/bin_width_ps", R"("abc")", "sensor.bin_width_ps"},
       {"/sensor/bin_width_ps", "0", "sensor.bin_width_ps"},
       {"/sensor/bin_width_ps", "", "sensor.bin_width_ps"},
       {"/sensor/bins", "12.5", "sensor.bins"},
       {"/sensor/rows", "-1", "sensor.rows"},
       {"/sensor/colums", "2", "sensor.colums"},
       {"/sensor/fov_deg", "[180, 20]", "sensor.fov_deg[0]"},
       {"/sensor/fov_deg", "[40]", "sensor.fov_deg"},
       {"/sensor/fov_deg", "", "sensor"},
       {"/sensor/zones", R"("from_capture")", "sensor.zones"},
       {"/sensor/zone_rows_deg", "[[-1, 1]]", "sensor.zone_rows_deg"},
       {"/sensor/time_zero_ps", "[1, 2, 3]", "sensor.time_zero_ps"},
       {"/sensor/gain", "[1, 0]", "sensor.gain[1]"},
       {"/sensor/wrap_bins", "65", "sensor.wrap_bins"},
       {"/sensor/valid_bins", "[4, 64]", "sensor.valid_bins[1]"},
       {"/sensor/valid_bins", "[9, 4]", "sensor.valid_bins[1]"},
       {"/sensor/valid_bins", "[[0, 9]]", "sensor.valid_bins"},
       {"/sensor/dead_zones", "[2]", "sensor.dead_zones[0]"},
       {"/sensor/background_counts", "[[]]", "sensor.background_counts"},
       {"/sensor/background_counts", "[[1, 2], []]", "sensor.background_counts[0]"},
       {"/sensor/background_counts", "[[], 3]", "sensor.background_counts[1]"},
       {"/sensor/path_origin", R"("wall")", "sensor.path_origin"},
       {"/sensor/impulse_response", "", "sensor.impulse_response"},
       {"/sensor/impulse_response/type", R"("gauss")", "sensor.impulse_response.type"},
       {"/sensor/impulse_response/sigma_ps", "3", "sensor.impulse_response.sigma_ps"},
       {"/sensor/impulse_response",
        R"({"type": "exponential_tail", "fwhm_ps": 9, "tails": [
                    {"fraction": 0.6, "decay_ps": 9}, {"fraction": 0.4, "decay_ps": 9}]})",
        "sensor.impulse_response.tails"},
       {"/sensor/impulse_response",
        R"({"type": "table", "times_ps": [0, 5, 5], "values": [0, 1, 0]})",
        "sensor.impulse_response.times_ps[2]"},
       {"/sensor/impulse_response", R"({"type": "table", "times_ps": [0, 5], "values": [0, 0]})",
        "sensor.impulse_response.values"},
       {"/sensor/noise", R"({"law": "laplace"})", "sensor.noise.law"},
       {"/sensor/noise", R"({"law": "gaussian", "variance_floor": 0})",
        "sensor.noise.variance_floor"},
       {"/sensor/noise", R"({"law": "gaussian", "variance_floor": [1, 0]})",
        "sensor.noise.variance_floor[1]"},
       {"/sensor/noise", R"({"law": "gaussian", "variance_floor": [1]})",
        "sensor.noise.variance_floor"},
       {"/sensor/noise", R"({"law": "poisson", "dispersion": -1})", "sensor.noise.dispersion"},
       {"/sensor/illumination", R"({"field": {"cone_half_angle_deg": 95}})",
        "sensor.illumination.field.cone_half_angle_deg"},
       {"/sensor/illumination", R"({"field": {}})", "sensor.illumination.field"},
       {"/sensor/illumination",
        R"({"field": {"left_deg": 5, "right_deg": 4, "top_deg": -1, "bottom_deg": 1}})",
        "sensor.illumination.field.left_deg"}});
}

TEST(SceneFile, ZoneMistakesAreToldWithTheirPath) {
  expect_told({{"/sensor", R"({"rows": 1, "columns": 2, "bins": 8, "bin_width_ps": 9, "zones": [
            {"angles_deg": {"left": 0, "right": 1, "top": 0, "bottom": 1}}],
            "impulse_response": {"type": "gaussian", "fwhm_ps": 9}})",
                "sensor.zones"},
               {"/sensor", R"({"rows": 1, "columns": 2, "bins": 8, "bin_width_ps": 9, "zones": [
            {"angles_deg": {"left": 0, "right": 1, "top": 0, "bottom": 1}},
            {"angles_deg": {"left": 0, "right": 1, "top": 2, "bottom": 1}}],
            "impulse_response": {"type": "gaussian", "fwhm_ps": 9}})",
                "sensor.zones[1].angles_deg.top"},
               {"/sensor", R"({"rows": 1, "columns": 2, "bins": 8, "bin_width_ps": 9, "zones": [
            {"angles_deg": {"left": 0, "right": 1, "top": 0, "bottom": 1}},
            {"relay_point_m": [1, 0, 1]}],
            "impulse_response": {"type": "gaussian", "fwhm_ps": 9}})",
                "sensor.zones[1]"},
               {"/sensor", R"({"rows": 1, "columns": 2, "bins": 8, "bin_width_ps": 9,
            "zone_columns_deg": [[-3, 0], [1, 0]], "zone_rows_deg": [[-1, 1]],
            "impulse_response": {"type": "gaussian", "fwhm_ps": 9}})",
                "sensor.zone_columns_deg[1]"}});
}

TEST(SceneFile, PoseAndSurfaceMistakesAreToldWithTheirPath) {
  expect_told({{"/sensor_pose", "", "sensor_pose"},
               {"/sensor_pose/position_m", "[0, 0]", "sensor_pose.position_m"},
               {"/sensor_pose/position_m/1", R"("a")", "sensor_pose.position_m[1]"},
               {"/sensor_pose/up", "[0, 0, 1]", "sensor_pose.up"},
               {"/sensor_pose/look", "[0, 0, 0]", "sensor_pose.look"},
               {"/sensor_pose", R"({"position_m": [0, 0, 1], "look": [1, 0, 0], "up": [2, 0, 0]})",
                "sensor_pose.up"},
               {"/sensor_pose",
                R"({"position_m": [0, 0, 1], "look": [1, 0, 0], "quaternion_wxyz": [1, 0, 0, 0]})",
                "sensor_pose.quaternion_wxyz"},
               {"/sensor_pose/quaternion_wxyz", "[1, 1, 0, 0]", "sensor_pose.quaternion_wxyz"},
               {"/sensor_pose/sigma_m", "-0.1", "sensor_pose.sigma_m"},
               {"/surfaces", "[]", "surfaces"},
               {"/surfaces/0/relay", "false", "surfaces"},
               {"/surfaces/0/relay", "1", "surfaces[0].relay"},
               {"/surfaces/0/shape", R"("sphere")", "surfaces[0].shape"},
               {"/surfaces/0/normal", "[0, 0, 0]", "surfaces[0].normal"},
               {"/surfaces/0/width_m", "0", "surfaces[0].width_m"},
               {"/surfaces/0/albedo", "1.2", "surfaces[0].albedo"},
               {"/surfaces/0/albedo", "0", "surfaces[0].albedo"},
               {"/surfaces/0/yaw_deg", "9", "surfaces[0].yaw_deg"},
               {"/surfaces/1", R"({"shape": "box", "size_m": [1, 1, 1]})", "surfaces[1]"},
               {"/surfaces/1", R"({"shape": "box", "size_m": [1, -1, 1], "base_m": [0, 0, 0]})",
                "surfaces[1].size_m[1]"}});
}

TEST(SceneFile, ObjectAndUnknownMistakesAreToldWithTheirPath) {
  expect_told(
      {{"/hidden", "", "hidden"},
       {"/hidden/shape", R"("disc")", "hidden.shape"},
       {"/hidden/radius_m", "1", "hidden.radius_m"},
       {"/hidden/width_m", "", "hidden.width_m"},
       {"/hidden/anchor", R"("top")", "hidden.anchor"},
       {"/hidden/material", R"("glossy")", "hidden.material"},
       {"/hidden/material", R"({"retroreflective": {"lobe_sigma_deg": 0}})",
        "hidden.material.retroreflective.lobe_sigma_deg"},
       {"/hidden/albedo", "0", "hidden.albedo"},
       {"/hidden/position_m", "", "hidden.position_m"},
       {"/hidden/position_m", "[null, null, null]", "hidden.position_m[2]"},
       {"/hidden/position_m", "[0.6, null, 1]", "hidden.position_m[0]"},
       {"/hidden/size", "0", "hidden.size"},
       {"/unknowns", "{}", "unknowns"},
       {"/unknowns", "", "unknowns"},
       {"/unknowns/yaw", "[0, 1]", "unknowns.yaw"},
       {"/unknowns/x_m", "[1, 1]", "unknowns.x_m"},
       {"/unknowns/x_m", "1", "unknowns.x_m"},
       {"/unknowns/yaw_deg", "[0, 361]", "unknowns.yaw_deg"},
       {"/unknowns/size", "[0, 2]", "unknowns.size[0]"},
       {"/unknowns/x_m", R"({"range": [0, 1], "prior": {"mean": 0, "sigma": 0}})",
        "unknowns.x_m.prior.sigma"},
       {"/unknowns/x_m", R"({"prior": {"mean": 0, "sigma": 1}})", "unknowns.x_m.range"},
       {"/linear", R"({"amplitude": {"mode": "free"}})", "linear.amplitude.mode"},
       {"/linear", R"({"amplitude": {"mode": "fixed", "prior": {}}})", "linear.amplitude.prior"},
       {"/linear", R"({"ambient": {"mode": "shared"}})", "linear.ambient.mode"},
       {"/linear", R"({"ambient": {"counts_per_bin": -1}})", "linear.ambient.counts_per_bin"},
       {"/linear", R"({"direct": {"mode": "absent", "scale": 1}})", "linear.direct.scale"},
       {"/presence_prior", "1", "presence_prior"},
       {"/presence", "0.5", "presence"}});
}

TEST(SceneFile, YawOfARoundObjectIsRefused) {
  const auto round = [](const Change& change) {
    return message_of([&] {
      changed([&](json& s) {
        s["hidden"] = {
            {"shape", "sphere"}, {"radius_m", 0.1}, {"position_m", {nullptr, nullptr, 1}}};
        change(s);
      });
    });
  };
  EXPECT_EQ(round([](json&) {}), "no error");
  EXPECT_THAT(round([](json& s) {
                s["unknowns"]["yaw_deg"] = {0, 9};
              }),
              StartsWith("test.json: unknowns.yaw_deg: found "));
  EXPECT_THAT(round([](json& s) { s["hidden"]["yaw_deg"] = 5; }),
              StartsWith("test.json: hidden.yaw_deg: found 5, accepted: no yaw"));
}

TEST(SceneFile, MessagesQuoteTheValueAndSuggestTheLikelyName) {
  EXPECT_EQ(
      message_of([] { changed([](json& s) { s["sensor"]["bin_width_ps"] = "abc"; }); }),
      R"(test.json: sensor.bin_width_ps: found "abc", accepted: a number > 0 and <= 1000000000)");
  EXPECT_THAT(message_of([] { changed([](json& s) { s["sensor"]["bin_widht_ps"] = 3; }); }),
              HasSubstr("did you mean \"bin_width_ps\"?"));
  EXPECT_THAT(message_of([] { changed([](json& s) { s["sensor"]["time_zero"] = 3; }); }),
              HasSubstr("did you mean \"time_zero_ps\"?"));
  // Neither a long value nor a key with a line break makes more than a short line of it.
  const std::string message =
      message_of([] { changed([](json& s) { s["name"] = std::vector<int>(10'000, 1); }); });
  EXPECT_LT(message.size(), 200U);
  EXPECT_EQ(message_of([] { changed([](json& s) { s["a\nb"] = 1; }); }).find('\n'),
            std::string::npos);
}

TEST(SceneFile, WhatIsNotJsonIsToldWithLineAndColumn) {
  const auto message = [](const std::string& text) {
    const TemporaryFile file(text);
    std::string told = message_of([&] { read_scene(file.path()); });
    EXPECT_THAT(told, StartsWith(file.path() + ": "));
    EXPECT_EQ(told.find('\n'), std::string::npos) << told;
    return told;
  };
  EXPECT_THAT(message("{\n  \"name\": \"a\",\n  oops\n}"), HasSubstr(": line 3, column 3: found "));
  EXPECT_THAT(message("{\"name\": \"a\""), HasSubstr("line 1, column"));
  EXPECT_THAT(message(R"({"name": 1e999})"), HasSubstr("accepted: "));
  EXPECT_THAT(message(R"({"name": "a", "name": "b"})"), HasSubstr("name: found twice"));
  EXPECT_THAT(message("[]"), HasSubstr("accepted: an object"));
  EXPECT_THAT(message(""), HasSubstr("empty"));
  EXPECT_THAT(message("\"\xff\""), HasSubstr("accepted: JSON"));
  EXPECT_THAT(message_of([] { read_scene("/does/not/exist.json"); }),
              StartsWith("/does/not/exist.json: "));
}

TEST(SceneFile, NumbersThatAreNotFiniteAreRefused) {
  EXPECT_THAT(message_of([] { changed([](json& s) { s["hidden"]["albedo"] = NAN; }); }),
              StartsWith("test.json: hidden.albedo: found a number that is not finite"));
}

TEST(SceneFile, ListsEveryProblemOfAFileOnALineOfItsOwn) {
  const std::string message = message_of([] {
    changed([](json& scene) {
      scene["sensor"]["bin_width_ps"] = -100;
      scene["sensor"]["fov_deg"] = {40, 400};
      scene["sensor"]["impulse_response"]["type"] = "gauss";
      scene["sensor_pose"]["positon_m"] = {0, 0, 0};
      scene["surfaces"][0]["albedo"] = 5;
      scene["surfaces"][0]["normal"] = "up";
      scene["hidden"]["material"] = "mirror";
      scene["unknowns"]["y_m"] = {1, 0};
      scene["presence_prior"] = 2;
    });
  });
  for (const char* field :
       {"sensor.bin_width_ps: found -100", "sensor.fov_deg[1]: found 400",
        "sensor.impulse_response.type: found \"gauss\"", "sensor_pose.positon_m: found an unknown",
        "surfaces[0].albedo: found 5", "surfaces[0].normal: found \"up\"",
        "hidden.material: found \"mirror\"", "unknowns.y_m: found [1,0]",
        "presence_prior: found 2"}) {
    EXPECT_THAT(message, HasSubstr("test.json: " + std::string(field)));
  }
  EXPECT_EQ(std::ranges::count(message, '\n'), 8) << message;  // nothing beside these nine
}

TEST(SceneFile, AMistakeHasNoFollowers) {
  for (const Change& change : std::vector<Change>{
           [](json& s) { s["sensor"]["rows"] = 0; }, [](json& s) { s["sensor"]["bins"] = -1; },
           [](json& s) { s["sensor"] = 3; }, [](json& s) { s["hidden"]["shape"] = "cube"; },
           [](json& s) { s["unknowns"]["x_m"] = "wide"; }, [](json& s) { s["surfaces"][0] = 1; },
           [](json& s) { s["sensor"]["impulse_response"]["fwhm_ps"] = "short"; }}) {
    const std::string message = message_of([&] { changed(change); });
    EXPECT_THAT(message, HasSubstr("accepted"));
    EXPECT_EQ(std::ranges::count(message, '\n'), 0) << message;
  }
}

}  // namespace
}  // namespace blindcorner
