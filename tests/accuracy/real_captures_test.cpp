// SPDX-License-Identifier: Apache-2.0
/// Recorded captures through the program, against what is known about them.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/io/capture_file.h"
#include "bundled.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct Point {
  double x = 0, z = 0;  ///< along the wall, away from it
};

/// Floor marks in the order in which their rectangle is walked around, m.
constexpr std::array<Point, 4> kMarks = {{{-0.8, 0.66}, {-1.4, 0.66}, {-1.4, 1.25}, {-0.8, 1.25}}};
/// A mark counts as visited within this distance of the smoothed track, m.
constexpr double kVisit = 0.25;

double distance(const Point& a, const Point& b) { return std::hypot(a.x - b.x, a.z - b.z); }

/// One of the values; of an even number the upper one of the middle two.
double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Distance to the outline of the rectangle of floor marks.
double outline_distance(const Point& p) {
  const double x =
      std::abs(p.x - 0.5 * (kMarks[0].x + kMarks[1].x)) - 0.5 * (kMarks[0].x - kMarks[1].x);
  const double z =
      std::abs(p.z - 0.5 * (kMarks[0].z + kMarks[2].z)) - 0.5 * (kMarks[2].z - kMarks[0].z);
  return std::abs(std::hypot(std::max(x, 0.0), std::max(z, 0.0)) + std::min(std::max(x, z), 0.0));
}

/// Share of the outline within `reach` of some point.
double coverage(const std::vector<Point>& track, double reach) {
  constexpr int kSteps = 200;  // per side
  int near = 0;
  for (std::size_t side = 0; side < 4; ++side) {
    for (int i = 0; i < kSteps; ++i) {
      const double t = (i + 0.5) / kSteps;
      const Point& a = kMarks[side];
      const Point& b = kMarks[(side + 1) % 4];
      const Point on{a.x + t * (b.x - a.x), a.z + t * (b.z - a.z)};
      near += std::any_of(track.begin(), track.end(),
                          [&](const Point& p) { return distance(p, on) < reach; })
                  ? 1
                  : 0;
    }
  }
  return near / (4.0 * kSteps);
}

/// A stay near a mark, from a first frame to before an end.
struct Visit {
  int mark = 0;
  std::size_t first = 0, end = 0;
};

/// Visits in their order; the track smoothed by a running median of `2 half + 1`.
std::vector<Visit> visits(const std::vector<Point>& track, std::size_t half) {
  std::vector<Visit> order;
  for (std::size_t i = 0; i < track.size(); ++i) {
    std::vector<double> x, z;
    for (std::size_t k = i > half ? i - half : 0; k < std::min(track.size(), i + half + 1); ++k) {
      x.push_back(track[k].x);
      z.push_back(track[k].z);
    }
    const Point smooth{median(x), median(z)};
    const auto nearest = std::min_element(
        kMarks.begin(), kMarks.end(),
        [&](const Point& a, const Point& b) { return distance(a, smooth) < distance(b, smooth); });
    if (distance(*nearest, smooth) >= kVisit) continue;
    const auto mark = static_cast<int>(nearest - kMarks.begin());
    if (order.empty() || order.back().mark != mark) order.push_back({mark, i, i});
    order.back().end = i + 1;
  }
  return order;
}

std::string names(const std::vector<Visit>& order) {
  std::string sequence;
  for (const Visit& visit : order) sequence += std::to_string(visit.mark);
  return sequence;
}

/// The smallest distance to the mark in each visit, averaged.
double mean_approach(const std::vector<Point>& track, const std::vector<Visit>& order) {
  double sum = 0;
  for (const Visit& visit : order) {
    double closest = 1e9;
    for (std::size_t i = visit.first; i < visit.end; ++i) {
      closest = std::min(closest, distance(track[i], kMarks[static_cast<std::size_t>(visit.mark)]));
    }
    sum += closest / static_cast<double>(order.size());
  }
  return sum;
}

void expect_steps_along_the_sides(const std::vector<Visit>& order) {
  for (int mark = 0; mark < 4; ++mark) {
    EXPECT_TRUE(std::any_of(order.begin(), order.end(),
                            [&](const Visit& visit) { return visit.mark == mark; }))
        << "mark " << mark << " never visited";
  }
  for (std::size_t i = 1; i < order.size(); ++i) {
    EXPECT_NE((order[i].mark - order[i - 1].mark + 4) % 4, 2) << names(order);
  }
}

class RealCaptures : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* stated = std::getenv("BLINDCORNER_DATA");
    data_ = fs::path(stated != nullptr ? stated : DATA_DIR) / "consumer_nlos";
    if (!fs::is_directory(data_)) GTEST_SKIP() << "no recorded captures in " << data_;
    std::string name = (fs::temp_directory_path() / "blindcorner_real_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  std::string path(const std::string& name) const { return "'" + (folder_ / name).string() + "'"; }
  std::string data(const std::string& name) const { return "'" + (data_ / name).string() + "'"; }

  void run(const std::string& arguments) const {
    const std::string command =
        std::string("'") + PROGRAM + "' " + arguments + " > " + path("log") + " 2>&1";
    const int status = std::system(command.c_str());
    std::ifstream log(folder_ / "log");
    ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0)
        << command << "\n"
        << std::string(std::istreambuf_iterator<char>(log), {});
  }

  json fit(const std::string& scene, const std::string& captures,
           const std::string& options) const {
    run("fit '" + std::string(SOURCE_DIR) + "/scenes/" + scene + "' " + path(captures) +
        " --no-page " + options + " -o " + path("result"));
    if (HasFatalFailure()) return {};
    return json::parse(std::ifstream(folder_ / "result" / "result.json"));
  }

  void import_letter() const {
    run("import " + data("ams_u/ams_u.npz") + " -o " + path("ams.exr") +
        " --array histogram --axes capture,row,column,bin --sensor-positions sensor_position_m"
        " --axes-world z,-x,y --bin-width-ps 88 --exposures 20 --dispersion 1.3");
  }

  fs::path data_, folder_;
};

TEST_F(RealCaptures, PersonWalksBetweenTheFloorMarks) {
  ASSERT_NO_FATAL_FAILURE(run("import " + data("st_person_tracking") + " -o " + path("st.exr")));
  const json result = fit("st_person_tracking.json", "st.exr", "--threads 1");
  ASSERT_FALSE(HasFatalFailure());
  ASSERT_EQ(result["captures"].size(), 300U);
  std::vector<Point> track;
  std::vector<double> distances, times;
  for (const json& capture : result["captures"]) {
    ASSERT_TRUE(capture["error"].is_null()) << capture["error"];
    const json& pose = capture["modes"][0]["optimum"];
    track.push_back({pose[0].get<double>(), -pose[1].get<double>()});
    distances.push_back(outline_distance(track.back()));
    const json& time = capture["time_ms"];
    times.push_back(time["total"].get<double>() - time["prepare"].get<double>());
  }
  const double share = coverage(track, 0.10);
  const std::vector<Visit> order = visits(track, 3);
  std::printf("median distance %.2f cm, perimeter %.3f, marks %s, %.1f ms a frame\n",
              100 * median(distances), share, names(order).c_str(), median(times));
  EXPECT_LE(median(distances), 0.065);
  EXPECT_GE(share, 0.85);
  expect_steps_along_the_sides(order);
  // Not asserted: a test shares the machine with others. docs/measured.md has the command that
  // measures.
  RecordProperty("ms_per_frame", static_cast<int>(median(times)));
}

/// Nearest point of the rectangle's outline.
Point nearest_on_outline(const Point& p) {
  Point best;
  double least = 1e9;
  for (std::size_t side = 0; side < 4; ++side) {
    const Point& a = kMarks[side];
    const Point& b = kMarks[(side + 1) % 4];
    const Point along{b.x - a.x, b.z - a.z};
    const double length2 = along.x * along.x + along.z * along.z;
    const double t =
        std::clamp(((p.x - a.x) * along.x + (p.z - a.z) * along.z) / length2, 0.0, 1.0);
    const Point foot{a.x + t * along.x, a.z + t * along.z};
    if (distance(p, foot) < least) {
      least = distance(p, foot);
      best = foot;
    }
  }
  return best;
}

/// The filter's answer after each frame, which knows nothing of later frames.
TEST_F(RealCaptures, PersonIsTracked) {
  constexpr double kChiSquare95 = 5.991;  // two degrees of freedom
  constexpr double kRunning = 7.0;        // m/s
  ASSERT_NO_FATAL_FAILURE(run("import " + data("st_person_tracking") + " -o " + path("st.exr")));
  const json result = fit("st_person_tracking.json", "st.exr", "--track --threads 1");
  ASSERT_FALSE(HasFatalFailure());
  std::vector<Point> track;
  std::vector<double> distances;
  double covered = 0, fastest = 0, before = 0;
  for (const json& capture : result["captures"]) {
    ASSERT_TRUE(capture["error"].is_null()) << capture["error"];
    if (capture["modes"].empty()) continue;
    const json& mode = capture["modes"][0];
    const Point at{mode["pose"][0].get<double>(), -mode["pose"][1].get<double>()};
    const double time = capture["track"]["time_s"].get<double>();
    if (!track.empty()) {
      fastest = std::max(fastest, distance(at, track.back()) / (time - before));
    }
    before = time;
    track.push_back(at);
    distances.push_back(outline_distance(at));
    const Point foot = nearest_on_outline(at);
    const double dx = foot.x - at.x;
    const double dy = -(foot.z - at.z);
    const json& c = mode["covariance"];
    const double xx = c[0][0].get<double>(), xy = c[0][1].get<double>(), yy = c[1][1].get<double>();
    const double squared = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy);
    covered += squared < kChiSquare95 ? 1 : 0;
  }
  ASSERT_GE(track.size(), 290U);  // the person enters after the third frame
  const auto frames = static_cast<double>(track.size());
  const std::vector<Visit> order = visits(track, 2);
  std::printf(
      "median distance %.2f cm, closest approach %.2f cm, marks %s, perimeter %.3f, fastest %.1f "
      "m/s, ellipse covers %.3f\n",
      100 * median(distances), 100 * mean_approach(track, order), names(order).c_str(),
      coverage(track, 0.10), fastest, covered / frames);
  EXPECT_LE(median(distances), 0.05);
  EXPECT_LE(mean_approach(track, order), 0.05);
  EXPECT_LE(fastest, kRunning);
  EXPECT_GE(covered / frames, 0.90);
  EXPECT_LE(covered / frames, 0.98);
  expect_steps_along_the_sides(order);
}

TEST_F(RealCaptures, FirstBounceGivesTheWallDistance) {
  ASSERT_NO_FATAL_FAILURE(import_letter());
  const Scene scene = bundled_scene("ams_u");
  const CaptureFile file = read_captures((folder_ / "ams.exr").string());
  ASSERT_EQ(file.captures.size(), 36U);
  std::vector<double> walls;
  for (const Capture& capture : file.captures) {
    double sum = 0;
    for (int z = 0; z < capture.counts.zones(); ++z) {
      const double* bins = capture.counts.zone(z);
      double ambient = 0;
      for (int k = 110; k < 128; ++k) ambient += bins[k] / 18;
      const auto peak = std::max_element(bins, bins + capture.counts.bins) - bins;
      ASSERT_GT(peak, 0);
      ASSERT_LT(peak, capture.counts.bins - 1);
      // Vertex of the parabola through the logarithms around the peak.
      const auto level = [&](std::ptrdiff_t k) {
        return std::log(std::max(bins[k] - ambient, 1.0));
      };
      const double left = level(peak - 1), top = level(peak), right = level(peak + 1);
      const double at =
          static_cast<double>(peak) + 0.5 + 0.5 * (left - right) / (left - 2 * top + right);
      // Zones centred at -13.3, 0, 13.3 by 16.7, 0, -16.7 degrees.
      constexpr double kDegree = std::numbers::pi / 180;
      const int row = z / 3;
      const int column = z % 3;
      const double right_tangent = std::tan((column - 1) * 13.333 * kDegree);
      const double down_tangent = std::tan((row - 1) * 16.667 * kDegree);
      const double cosine =
          1 / std::sqrt(1 + right_tangent * right_tangent + down_tangent * down_tangent);
      const double time =
          at * scene.sensor.bin_width - scene.sensor.zones[static_cast<std::size_t>(z)].time_zero;
      sum += 0.5 * kSpeedOfLight * time * cosine;
    }
    walls.push_back(sum / capture.counts.zones());
  }
  double mean = 0, square = 0;
  for (const double wall : walls) mean += wall / 36;
  for (const double wall : walls) square += (wall - mean) * (wall - mean) / 35;
  std::printf("wall at %.2f cm, spread %.2f cm\n", 100 * mean, 100 * std::sqrt(square));
  EXPECT_LT(std::sqrt(square), 0.01);
}

TEST_F(RealCaptures, JointFitFindsThePlaneOfTheLetter) {
  ASSERT_NO_FATAL_FAILURE(import_letter());
  const json result = fit("ams_u.json", "ams.exr", "--joint");
  ASSERT_FALSE(HasFatalFailure());
  const json& mode = result["captures"][0]["modes"][0];
  const double plane = mode["optimum"][0].get<double>();
  std::printf("plane at %.4f m +- %.4f m\n", plane,
              std::sqrt(mode["covariance"][0][0].get<double>()));
  EXPECT_NEAR(plane, -0.31, 0.02);
}

}  // namespace
}  // namespace blindcorner
