// SPDX-License-Identifier: Apache-2.0
/// The program as other programs use it: exit codes, messages, files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/io/capture_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/io/sensor_presets.h"
#include "bundled.h"
#include "io/npz.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kScene = std::string(SOURCE_DIR) + "/scenes/tmf8828_wall.json";
/// Enough for an answer; these tests are not about its quality.
const std::string kQuick =
    " --starts 1 --importance-samples 0 --empty-captures 0 --scored-poses 300";

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

class Cli : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "blindcorner_cli_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    directory_ = name;
  }
  void TearDown() override { fs::remove_all(directory_); }

  std::string path(const std::string& name) const { return (directory_ / name).string(); }

  Outcome run(const std::string& arguments) const {
    const std::string command =
        std::string("'") + PROGRAM + "' " + arguments + " 2>'" + path("stderr") + "'";
    Outcome result;
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return result;
    std::array<char, 4096> buffer;
    std::size_t size = 0;
    while ((size = fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
      result.out.append(buffer.data(), size);
    }
    const int status = pclose(pipe);
    if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
    result.err = text_of(path("stderr"));
    return result;
  }

  /// The page after its script has drawn it; nothing where there is no Chromium.
  std::optional<std::string> as_drawn(const std::string& page,
                                      const std::string& options = "") const {
    if (std::system("command -v chromium >/dev/null") != 0) return {};
    const std::string command =
        "chromium --headless --no-sandbox --disable-gpu --virtual-time-budget=4000 --dump-dom " +
        options + " --user-data-dir='" + path("browser") + "' 'file://" + page + "' >'" +
        path("drawn.html") + "' 2>/dev/null";
    if (std::system(command.c_str()) != 0) return {};
    return text_of(path("drawn.html"));
  }

  /// Captures that suit the scene: a flat level of light, so nothing to find.
  std::string write_flat(const std::string& name, int captures = 1) const {
    const Scene scene = read_scene(kScene);
    CaptureFile file;
    file.bin_width = scene.sensor.bin_width;
    for (int i = 0; i < captures; ++i) {
      Capture capture;
      capture.counts = HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
      for (double& count : capture.counts.values) count = 4600.0;
      capture.exposures = 1 + 0.05 * i;
      file.captures.push_back(capture);
    }
    write_captures(path(name), file);
    return path(name);
  }

  std::string write_with_nan(const std::string& name) const {
    CaptureFile file = read_captures(write_flat(name));
    file.captures[0].counts.values[700] = std::numeric_limits<double>::quiet_NaN();
    write_captures(path(name), file);
    return path(name);
  }

  std::string write_text(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
    return path(name);
  }

  /// The same captures as `export` writes them.
  std::string write_npz(const std::string& captures) const {
    const std::string npz = path("exported.npz");
    EXPECT_EQ(run("export '" + captures + "' -o '" + npz + "'").exit_code, 0);
    return npz;
  }

  std::string fit(const std::string& scene, const std::string& captures) const {
    return "fit '" + scene + "' " + captures + " -o '" + path("out") + "'" + kQuick;
  }

  void expect_refused(const Outcome& result) const {
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, StartsWith("blindcorner: "));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_FALSE(fs::exists(path("out"))) << "nothing may be written";
  }

  static void expect_refused_beside(const Outcome& result, const std::string& words) {
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_THAT(result.err, AllOf(StartsWith("blindcorner: "), HasSubstr(words)));
  }

  fs::path directory_;
};

TEST_F(Cli, SaysItsVersion) {
  const Outcome result = run("--version");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, ::testing::MatchesRegex("blindcorner [0-9]+\\.[0-9]+\\.[0-9]+ "
                                                  "\\(([0-9a-f]+(-modified)?|unknown)\\)\n"));
}

// What wrote a file can be told from it: results, drives and journals name the program.
TEST_F(Cli, FilesNameTheProgramThatWroteThem) {
  std::string version = run("--version").out;
  version.pop_back();
  ASSERT_EQ(run("fit '" SOURCE_DIR "/scenes/tmf8828_wall.json' '" SOURCE_DIR
                "/scenes/captures/tmf8828_wall.exr' -o '" +
                path("fit") + "'")
                .exit_code,
            0);
  EXPECT_EQ(json::parse(text_of(path("fit/result.json")))["program"], version);
  const std::string drive = "'" SOURCE_DIR "/scenes/robot_drive.json' -o '";
  ASSERT_EQ(run("drive " + drive + path("drive") + "' --perception los --no-page").exit_code, 0);
  EXPECT_EQ(json::parse(text_of(path("drive/drive.json")))["program"], version);
  ASSERT_EQ(run("trials " + drive + path("trials") + "' -n 1 --perception los").exit_code, 0);
  EXPECT_THAT(text_of(path("trials/journal.csv")), ::testing::EndsWith("," + version + "\n"));
  EXPECT_THAT(text_of(path("trials/trials.html")), HasSubstr(version));
}

TEST_F(Cli, NamesTheCommandThatAMistypedOneResembles) {
  expect_refused(run("fitt"));
  EXPECT_THAT(run("fitt").err, HasSubstr("did you mean 'fit'"));
  EXPECT_THAT(run("benchmark slover").err, HasSubstr("did you mean 'solver'"));
  EXPECT_THAT(run("see").err, HasSubstr("accepted: fit, render"));
}

TEST_F(Cli, SaysThatItsOutputCouldNotBeWritten) {
  const Outcome result = run("info '" + write_flat("flat.exr") + "' > /dev/full");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("standard output: could not be written"));
}

TEST_F(Cli, RenderTakesPosesOfSeveralObjectsByName) {
  json scene =
      json::parse(text_of(std::string(SOURCE_DIR) + "/scenes/reference_tilted_spheres.json"));
  std::ofstream(path("two.json")) << scene;
  const std::string render = "render '" + path("two.json") + "' --noiseless --model fast -o '";
  EXPECT_EQ(run(render + path("near.exr") + "' --pose front.x_m=0.1,back.x_m=-0.2").exit_code, 0);
  const CaptureFile file = read_captures(path("near.exr"));
  EXPECT_EQ(file.captures.front().truth.at("front.x_m"), 0.1);
  EXPECT_EQ(file.captures.front().truth.at("back.x_m"), -0.2);
  const Outcome wrong = run(render + path("wrong.exr") + "' --pose x_m=0.1");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("front."));
  EXPECT_FALSE(fs::exists(path("wrong.exr")));
}

// Captures rendered from several poses carry them, so that each is fitted where it was taken.
TEST_F(Cli, RenderKeepsWhereTheSensorStood) {
  const Scene scene = read_scene(kScene);
  const std::string render = "render '" + kScene + "' --model fast -o '" + path("c.exr") + "' ";
  for (const char* noise : {"", "--noiseless", "--empty"}) {
    ASSERT_EQ(run(render + noise).exit_code, 0);
    const CaptureFile file = read_captures(path("c.exr"));
    ASSERT_TRUE(file.captures[0].T_world_sensor.has_value()) << noise;
    EXPECT_TRUE(file.captures[0].T_world_sensor->isApprox(scene.T_world_sensor, 1e-12));
  }
  const Outcome moved = run(render + "--noiseless --sensor-pose y_m=0.05,yaw_deg=10 " +
                            "--sensor-pose x_m=-0.1,pitch_rad=0.1");
  ASSERT_EQ(moved.exit_code, 0) << moved.err;
  const CaptureFile file = read_captures(path("c.exr"));
  ASSERT_EQ(file.captures.size(), 2U);
  const Transform& first = *file.captures[0].T_world_sensor;
  EXPECT_TRUE(first.translation().isApprox(Eigen::Vector3d(0, 0.05, 1)));
  EXPECT_NEAR(std::atan2(first(1, 0), first(0, 0)), 10 * M_PI / 180, 1e-12);
  const Transform& second = *file.captures[1].T_world_sensor;
  EXPECT_TRUE(second.translation().isApprox(Eigen::Vector3d(-0.1, 0, 1)));
  EXPECT_NEAR(second(2, 0), -std::sin(0.1), 1e-12) << "positive pitch looks down";
  EXPECT_NE(file.captures[0].counts.values, file.captures[1].counts.values);
}

// The truth of a bright capture has to be right to its photon noise.
TEST_F(Cli, RenderSamplesMoreDenselyWhereThereAreManyPhotons) {
  const auto counts_of = [&](const std::string& arguments) {
    const Outcome outcome = run("render '" + kScene + "' -o '" + path("c.exr") + "' " + arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_captures(path("c.exr")).captures.front().counts.values;
  };
  const auto usual = counts_of("--noiseless"),
             dense = counts_of("--noiseless --reference-sampling 2");
  EXPECT_EQ(counts_of("--noiseless --reference-sampling 1"), usual);
  EXPECT_NE(dense, usual);
  EXPECT_EQ(counts_of("--photons 2e5"), counts_of("--photons 2e5 --reference-sampling 2"));
  EXPECT_EQ(counts_of("--photons 5e4"), counts_of("--photons 5e4 --reference-sampling 1"));
  const Outcome none =
      run("render '" + kScene + "' -o '" + path("none.exr") + "' --reference-sampling 0");
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("--reference-sampling"));
}

TEST_F(Cli, RenderFollowsAPathOfTheSensor) {
  const std::string render =
      "render '" + kScene + "' --model fast --noiseless -o '" + path("c.exr") + "' ";
  const auto x_of = [&](const std::string& arguments) {
    const Outcome outcome = run(render + arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    std::vector<double> x;
    for (const Capture& capture : read_captures(path("c.exr")).captures) {
      x.push_back(capture.T_world_sensor->translation().x());
    }
    return x;
  };
  using ::testing::DoubleNear;
  const auto even =
      ElementsAre(DoubleNear(0, 1e-12), DoubleNear(0.05, 1e-12), DoubleNear(0.1, 1e-12));
  EXPECT_THAT(x_of("--sensor-pose x_m=0 --sensor-pose x_m=0.1,yaw_deg=5 --frames 3"), even);
  const std::string table = write_text("path.csv", "x_m, yaw_deg\n0,0\n0.1,5\n");
  EXPECT_THAT(x_of("--sensor-path '" + table + "' --frames 3"), even);
  EXPECT_THAT(x_of("--sensor-path '" + table + "' --random 2"), ElementsAre(0, 0.1));
  EXPECT_EQ(read_captures(path("c.exr")).captures[1].truth.count("x_m"), 1U);
}

TEST_F(Cli, RenderRefusesSensorPosesThatItCannotUse) {
  const std::string render = "render '" + kScene + "' --model fast -o '" + path("c.exr") + "' ";
  const auto refused = [&](const std::string& arguments) {
    const Outcome outcome = run(render + arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(path("c.exr")));
    return outcome.err;
  };
  EXPECT_THAT(refused("--sensor-pose size=2"), AllOf(HasSubstr("size"), HasSubstr("pitch_deg")));
  EXPECT_THAT(refused("--sensor-pose x_m=far"), HasSubstr("--sensor-pose x_m"));
  EXPECT_THAT(refused("--sensor-pose yaw_deg=180"), HasSubstr("relay"));
  EXPECT_THAT(refused("--sensor-pose x_m=0 --sensor-pose x_m=0.1 --random 3"),
              AllOf(HasSubstr("3 poses of the object"), HasSubstr("2 of the sensor")));
  EXPECT_THAT(refused("--sensor-path '" + write_text("p.csv", "x_m,up\n0,1\n") + "'"),
              AllOf(HasSubstr("p.csv: row 1"), HasSubstr("up")));
}

TEST_F(Cli, HelpIsNoFailure) {
  const Outcome all = run("--help");
  EXPECT_EQ(all.exit_code, 0);
  EXPECT_THAT(all.out, AllOf(HasSubstr("fit"), HasSubstr("import"), HasSubstr("export")));
  const Outcome fit_help = run("fit --help");
  EXPECT_EQ(fit_help.exit_code, 0);
  EXPECT_THAT(fit_help.out, AllOf(HasSubstr("--joint"), HasSubstr("--seed")));
}

TEST_F(Cli, WrongArgumentsAreRefused) {
  const std::string capture = write_flat("good.exr");
  for (const std::string& arguments :
       {std::string(), std::string("no-such-command"), std::string("fit"), "fit '" + kScene + "'",
        fit(kScene, capture) + " --no-such-option", fit(kScene, capture) + " --threads -3",
        fit(kScene, capture) + " --seed yes"}) {
    SCOPED_TRACE(arguments);
    expect_refused(run(arguments));
  }
}

TEST_F(Cli, OptionsOutOfRangeNameTheField) {
  const Outcome result = run(fit(kScene, write_flat("good.exr")) + " --tolerance -1");
  expect_refused(result);
  EXPECT_THAT(result.err, HasSubstr("model_tolerance"));
}

// What cannot end is refused at once: a tolerance below that of the arithmetic, and more poses than
// can be kept.
TEST_F(Cli, ToleranceAndSearchRegionHaveLimits) {
  const std::string capture = path("c.exr");
  ASSERT_EQ(run("render '" + kScene + "' --model fast -o '" + capture + "'").exit_code, 0);
  for (const std::string& command :
       {fit(kScene, capture), "explain '" + kScene + "'",
        "render '" + kScene + "' --model fast -o '" + path("d.exr") + "'"}) {
    const Outcome refused = run(command + " --tolerance 1e-300");
    EXPECT_EQ(refused.exit_code, 2) << command;
    EXPECT_THAT(refused.err, AllOf(HasSubstr("olerance"), HasSubstr("1e-5"))) << command;
  }
  json scene = json::parse(text_of(kScene));
  scene["unknowns"]["x_m"] = {-1e7, 1e7};
  scene["unknowns"]["y_m"] = {-1e7, 1e7};
  std::ofstream(path("vast.json")) << scene;
  const Outcome vast = run(fit(path("vast.json"), capture));
  EXPECT_NE(vast.exit_code, 0);
  EXPECT_THAT(vast.err, AllOf(HasSubstr("poses to be scored"), HasSubstr("from -1e+07 to 1e+07")));
}

TEST_F(Cli, WrongScenesAreRefused) {
  const std::string capture = write_flat("good.exr");
  json wrong = json::parse(text_of(kScene));
  wrong["unknowns"]["x_m"] = "left";
  for (const std::string& scene : {path("missing.json"), write_text("broken.json", "{\"name\": "),
                                   write_text("wrong.json", wrong.dump())}) {
    SCOPED_TRACE(scene);
    const Outcome result = run(fit(scene, capture));
    expect_refused(result);
    EXPECT_THAT(result.err, HasSubstr(scene));
  }
}

TEST_F(Cli, WrongSceneNamesTheField) {
  json wrong = json::parse(text_of(kScene));
  wrong["unknowns"]["x_m"] = "left";
  const Outcome result = run(fit(write_text("wrong.json", wrong.dump()), write_flat("good.exr")));
  EXPECT_THAT(result.err, HasSubstr("x_m"));
}

TEST_F(Cli, OneCaptureGivesResultAndPage) {
  const Outcome result = run(fit(kScene, write_flat("good.exr")));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const json written = json::parse(text_of(path("out/result.json")));
  EXPECT_EQ(written["format"], "blindcorner.result/1");
  EXPECT_THAT(written["unknowns"], ElementsAre("x_m", "y_m", "z_m", "yaw_rad"));
  const json& capture = written["captures"].at(0);
  EXPECT_EQ(capture["source"], path("good.exr"));
  EXPECT_EQ(capture["index"], 0);
  EXPECT_TRUE(capture["error"].is_null());
  EXPECT_TRUE(capture["truth"].is_null());
  double weights = 0.0;
  for (const json& mode : capture["modes"]) {
    EXPECT_EQ(mode["pose"].size(), 4u);
    EXPECT_EQ(mode["covariance"].size(), 4u);
    weights += mode["weight"].get<double>();
  }
  EXPECT_NEAR(weights, 1.0, 1e-9);
  // A whole page that fetches nothing.
  const std::string page = text_of(path("out/result.html"));
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  EXPECT_THAT(page, HasSubstr("</html>"));
  EXPECT_EQ(page.find("<script src"), std::string::npos);
  EXPECT_EQ(page.find("<link"), std::string::npos);
}

// What a reader sees is what the page's script draws.
TEST_F(Cli, PageAsDrawnByABrowser) {
  const std::string sample = SOURCE_DIR "/scenes/captures/tmf8828_wall.exr";
  ASSERT_EQ(run(fit(kScene, sample)).exit_code, 0);
  const std::optional<std::string> page = as_drawn(path("out/result.html"));
  if (!page) GTEST_SKIP() << "needs chromium";
  const auto found = [&page](const char* pattern) {
    std::smatch match;
    std::regex_search(*page, match, std::regex(pattern));
    return match;
  };
  // Noise of the direct return does not look like a fault of the fit: the line there is not empty.
  const std::size_t drowned = page->find("\" fill=\"none\" class=\"drowned\"");
  ASSERT_NE(drowned, std::string::npos);
  EXPECT_NE(page->at(drowned - 1), '"');
  EXPECT_THAT(*page, HasSubstr("photon noise of the subtracted light is large"));
  // The partition is a box in the picture, so it is one in the legend.
  EXPECT_FALSE(
      found("<rect[^>]*fill=\"var\\(--occluder\\)\"[^>]*></rect></svg><span>occluder<").empty());
  // The label stands on the left of its ellipse, because the arrow is on its right.
  const std::smatch label = found("<text x=\"([0-9.]+)\"[^>]*mode-label[^>]*>([^<]*)");
  const std::smatch ellipse =
      found("<ellipse rx=\"([0-9.]+)\"[^>]*translate\\(([0-9.]+),[0-9.]+\\)rotate\\((-?[0-9.]+)");
  ASSERT_FALSE(label.empty() || ellipse.empty());
  const double left_end =
      std::stod(ellipse[2]) -
      std::stod(ellipse[1]) * std::abs(std::cos(std::stod(ellipse[3]) * M_PI / 180));
  const double half_label = 3 * static_cast<double>(label[2].length());  // pixels, at 11 px
  EXPECT_LT(std::stod(label[1]) + half_label, left_end);
  // What stands below each other on a narrow screen says what it is.
  EXPECT_THAT(*page, HasSubstr("<td data-title=\"distance to truth\""));
}

TEST_F(Cli, PageCanBeLeftOut) {
  EXPECT_EQ(run(fit(kScene, write_flat("good.exr")) + " --no-page").exit_code, 0);
  EXPECT_TRUE(fs::exists(path("out/result.json")));
  EXPECT_FALSE(fs::exists(path("out/result.html")));
}

TEST_F(Cli, BadCapturesDoNotStopTheOthers) {
  const std::string good = write_flat("good.exr");
  const std::string nan = write_with_nan("nan.exr");
  const std::string damaged = write_text("damaged.exr", text_of(good).substr(0, 400));
  const std::string missing = path("missing.exr");
  const Outcome result = run(fit(kScene, nan + " " + damaged + " " + good + " " + missing));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr(nan), HasSubstr(damaged), HasSubstr(missing)));
  const json captures = json::parse(text_of(path("out/result.json")))["captures"];
  ASSERT_EQ(captures.size(), 4u);
  const std::array<std::string, 4> sources = {nan, damaged, good, missing};
  for (std::size_t i = 0; i < 4; ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(captures[i]["source"], sources[i]) << "results follow the order of the arguments";
    const bool failed = i != 2;
    EXPECT_EQ(captures[i]["error"].is_string(), failed);
    EXPECT_EQ(captures[i]["mean"].is_null(), failed);
    EXPECT_EQ(captures[i]["modes"].empty(), failed);
  }
}

TEST_F(Cli, CapturesOfAnotherSensorFailAlone) {
  CaptureFile other;
  other.captures.emplace_back();
  other.captures[0].counts = HistogramCube(2, 2, 64);
  write_captures(path("other.exr"), other);
  const Outcome result = run(fit(kScene, path("other.exr") + " " + write_flat("good.exr")));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("other.exr"));
}

TEST_F(Cli, BinWidthOfAnotherSensorIsRefused) {
  CaptureFile file = read_captures(write_flat("good.exr"));
  file.bin_width *= 1.05;
  write_captures(path("wide.exr"), file);
  const Outcome result = run(fit(kScene, path("wide.exr") + " " + path("good.exr")));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("bin_width"));
}

TEST_F(Cli, DirectoriesAreReadInSortedOrder) {
  fs::create_directory(path("captures"));
  write_flat("captures/b.exr");
  write_flat("captures/a.exr", 2);
  write_text("captures/notes.txt", "not a capture");
  EXPECT_EQ(run(fit(kScene, path("captures"))).exit_code, 0);
  const json captures = json::parse(text_of(path("out/result.json")))["captures"];
  ASSERT_EQ(captures.size(), 3u);
  EXPECT_EQ(captures[0]["source"], path("captures/a.exr"));
  EXPECT_EQ(captures[1]["index"], 1);
  EXPECT_EQ(captures[2]["source"], path("captures/b.exr"));
}

TEST_F(Cli, EmptyDirectoryIsRefused) {
  fs::create_directory(path("empty"));
  const Outcome result = run(fit(kScene, path("empty")));
  expect_refused(result);
  EXPECT_THAT(result.err, HasSubstr("empty"));
}

TEST_F(Cli, NoReadableCaptureIsRefused) {
  expect_refused(run(fit(kScene, path("missing.exr"))));
  expect_refused(run(fit(kScene, path("missing.exr") + " " + write_text("text.exr", "text"))));
}

TEST_F(Cli, JointFitListsItsCaptures) {
  const Outcome result = run(fit(kScene, write_flat("two.exr", 2)) + " --joint");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const json captures = json::parse(text_of(path("out/result.json")))["captures"];
  ASSERT_EQ(captures.size(), 1u);
  EXPECT_THAT(captures[0]["source"], ElementsAre(path("two.exr"), path("two.exr")));
  EXPECT_THAT(captures[0]["index"], ElementsAre(0, 1));
}

/// Results are compared without their run times, which no seed can fix.
TEST_F(Cli, ThreadsDoNotChangeTheResult) {
  const std::string captures = write_flat("three.exr", 3);
  const auto result_with = [&](const std::string& threads) {
    EXPECT_EQ(run(fit(kScene, captures) + " --no-page --threads " + threads).exit_code, 0);
    json result = json::parse(text_of(path("out/result.json")));
    for (json& capture : result["captures"]) capture.erase("time_ms");
    return result.dump();
  };
  EXPECT_EQ(result_with("1"), result_with("3"));
}

TEST_F(Cli, OutputThatIsAFileIsRefused) {
  write_text("out", "a file of the user");
  const Outcome result = run(fit(kScene, write_flat("good.exr")));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(text_of(path("out")), "a file of the user");
}

TEST_F(Cli, OutputThatCannotBeWrittenIsTold) {
  const std::string scene = "'" SOURCE_DIR "/scenes/tmf8828_wall.json'";
  const Outcome nowhere = run("render " + scene + " --model fast -o '" + path("no/a.exr") + "'");
  EXPECT_EQ(nowhere.exit_code, 1);
  EXPECT_THAT(nowhere.err, HasSubstr("no/a.exr: cannot be written"));
  EXPECT_EQ(run("--version > /dev/full").exit_code, 1);
  // A capture over a scene would be a scene lost.
  const std::string own = write_text("own.json", text_of(SOURCE_DIR "/scenes/tmf8828_wall.json"));
  EXPECT_EQ(run("render '" + own + "' -o '" + own + "'").exit_code, 2);
  EXPECT_EQ(text_of(own), text_of(SOURCE_DIR "/scenes/tmf8828_wall.json"));
}

TEST_F(Cli, OptionsThatAreNoneAndNumbersOutOfRangeAreNamed) {
  const std::string scene = "'" SOURCE_DIR "/scenes/tmf8828_wall.json' -o '" + path("a.exr") + "'";
  EXPECT_THAT(run("render " + scene + " --photon 3").err,
              AllOf(HasSubstr("'--photon'"), HasSubstr("did you mean '--photons'?")));
  for (const char* wrong : {"nan", "inf", "0", "1e19"}) {
    const Outcome outcome = run("render " + scene + " --photons " + wrong);
    EXPECT_EQ(outcome.exit_code, 2) << wrong;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("--photons: found " + std::string(wrong)),
                                   HasSubstr("accepted: a number > 0 and <= 1e+18")));
  }
}

TEST_F(Cli, ExportAndImportComeBack) {
  const std::string capture = write_flat("good.exr", 2);
  EXPECT_EQ(run("export '" + capture + "' -o '" + path("a.npz") + "'").exit_code, 0);
  EXPECT_EQ(run("import '" + path("a.npz") + "' -o '" + path("back.exr") + "'").exit_code, 0);
  const CaptureFile before = read_captures(capture);
  const CaptureFile after = read_captures(path("back.exr"));
  ASSERT_EQ(after.captures.size(), 2u);
  EXPECT_EQ(after.captures[1].counts.values, before.captures[1].counts.values);
  EXPECT_DOUBLE_EQ(after.bin_width, before.bin_width);
  EXPECT_EQ(run("export '" + capture + "' -o '" + path("a.csv") + "'").exit_code, 0);
  EXPECT_THAT(text_of(path("a.csv")), StartsWith("capture,zone,row,column,bin,count\n"));
}

TEST_F(Cli, ImportAndExportRefuseOtherEndings) {
  const std::string capture = write_flat("good.exr");
  EXPECT_EQ(run("export '" + capture + "' -o '" + path("a.txt") + "'").exit_code, 2);
  EXPECT_FALSE(fs::exists(path("a.txt")));
  EXPECT_EQ(run("import '" + capture + "' -o '" + path("a.npz") + "'").exit_code, 2);
  EXPECT_FALSE(fs::exists(path("a.npz")));
}

// Every term with its verdict, its bound, the measured change and the time, then the photons.
TEST_F(Cli, ExplainTellsOfTermsAndPhotons) {
  const std::string scenes = std::string(SOURCE_DIR) + "/scenes/";
  const Outcome outcome =
      run("explain '" + scenes + "denali_like.json' --tolerance 0.1 --poses 2 --pose y_m=0.4");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* term :
       {"occlusion between relay and object", "self-shadowing of the object",
        "pairs of lit and seen relay patches", "object before the sensor", "dim relay patches",
        "bins that no light can reach", "direct return of the known surfaces", "pile-up"}) {
    EXPECT_THAT(outcome.out, HasSubstr(term));
  }
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("left out"), HasSubstr("three-bounce"),
                                 HasSubstr("it gives no link"), HasSubstr("d^-2")));
  const Outcome captures = run("explain '" + scenes + "st_person_tracking.json'");
  EXPECT_EQ(captures.exit_code, 2);
  EXPECT_THAT(captures.err, HasSubstr("--capture"));
}

// With a link, gains follow from it: twice the aperture is four times the counts.
TEST_F(Cli, RenderTakesTheLinksGain) {
  std::ifstream file(std::string(SOURCE_DIR) + "/scenes/denali_like.json");
  json scene = json::parse(file);
  const auto total = [&](double aperture) {
    scene["sensor"]["link"] = {{"pulse_energy_nj", 1},    {"repetition_rate_hz", 1e7},
                               {"exposure_s", 0.03},      {"wavelength_nm", 940},
                               {"aperture_mm", aperture}, {"detection_efficiency", 0.02},
                               {"filter_width_nm", 30},   {"ambient_illuminance_lux", 100}};
    std::ofstream(path("link.json")) << scene;
    const Outcome outcome = run("render '" + path("link.json") + "' -o '" + path("link.exr") +
                                "' --noiseless --model fast --tolerance 0.1");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const CaptureFile rendered = read_captures(path("link.exr"));
    double sum = 0;
    for (const double v : rendered.captures.front().counts.values) sum += v;
    return sum;
  };
  const double one = total(1);
  EXPECT_GT(one, 0);
  EXPECT_NEAR(total(2) / one, 4.0, 1e-5);
  scene["sensor"]["link"]["aperture_mm"] = -1;
  std::ofstream(path("wrong.json")) << scene;
  const Outcome wrong = run("explain '" + path("wrong.json") + "'");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("sensor.link.aperture_mm: found -1"));
}

TEST_F(Cli, ForwardBenchmarksWriteTableAndPicture) {
  const std::string scene = "'" + std::string(SOURCE_DIR) + "/scenes/denali_like.json'";
  const Outcome forward = run("benchmark forward " + scene + " -o '" + path("study") +
                              "' --poses 1 --truth 0.3 --slowest-ms 0.05");
  EXPECT_EQ(forward.exit_code, 0) << forward.err;
  EXPECT_THAT(text_of(path("study/forward.csv")),
              AllOf(StartsWith("scene,model,setting"), HasSubstr("denali_like,fast,sampling step"),
                    HasSubstr("denali_like,reference,sampling")));
  EXPECT_THAT(text_of(path("study/forward.html")),
              AllOf(StartsWith("<!doctype html>"), HasSubstr("<svg"),
                    HasSubstr("noise of one capture"), Not(HasSubstr("src="))));
  const Outcome derivatives = run("benchmark derivatives " + scene + " -o '" + path("study") +
                                  "' --poses 1 --tolerance 0.1");
  EXPECT_EQ(derivatives.exit_code, 0) << derivatives.err;
  EXPECT_THAT(text_of(path("study/derivatives.csv")), HasSubstr("denali_like,y_m,0,"));
  EXPECT_THAT(text_of(path("study/derivatives.html")), HasSubstr("denali_like: x_m"));
}

TEST_F(Cli, InfoTellsOfScenesAndCaptures) {
  const Outcome scene = run("info '" + kScene + "'");
  EXPECT_EQ(scene.exit_code, 0);
  EXPECT_THAT(scene.out,
              AllOf(HasSubstr("3 x 3 zones"), HasSubstr("unknown   yaw_deg  -75 to 30\n")));
  EXPECT_EQ(run("info '" + write_flat("good.exr") + "'").exit_code, 0);
  EXPECT_EQ(run("info '" + path("missing.exr") + "'").exit_code, 2);
}

// A scene can be looked at before anything is fitted, by the page that draws fits.
TEST_F(Cli, InfoDrawsScenes) {
  const Outcome drawn = run("info '" + kScene + "' -o '" + path("out") + "'");
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  EXPECT_THAT(drawn.out, HasSubstr(path("out/tmf8828_wall.html")));
  const std::string page = text_of(path("out/tmf8828_wall.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("Nothing is fitted yet"), HasSubstr("\"name\":\"partition\""),
                          HasSubstr("\"field_of_view\":[[0,0],"), HasSubstr("function drawScene")));
  // Where the zones look is known with the captures only.
  const std::string mirrors = SOURCE_DIR "/scenes/cheapspad_mirrors.json";
  EXPECT_EQ(run("info '" + mirrors + "' -o '" + path("out") + "'").exit_code, 0);
  const Outcome none = run("info '" + write_flat("flat.exr") + "' -o '" + path("none") + "'");
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("--output: found no scene to draw"));
}

// A starter scene for every preset renders and fits as it is, and is drawn.
TEST_F(Cli, InitWritesASceneToBeginWith) {
  for (const std::string& preset : sensor_preset_names()) {
    const std::string scene = path(preset + ".json"), capture = path("c.exr");
    const Outcome begun = run("init --sensor " + preset + " -o '" + scene + "'");
    ASSERT_EQ(begun.exit_code, 0) << begun.err;
    EXPECT_THAT(begun.out,
                AllOf(HasSubstr(preset), HasSubstr("position_m"), HasSubstr("unknowns")));
    EXPECT_THAT(text_of(path(preset + ".html")), HasSubstr("Nothing is fitted yet"));
    const Outcome rendered = run("render '" + scene + "' --model fast -o '" + capture + "'");
    EXPECT_THAT(rendered.err, Not(HasSubstr("hint"))) << preset;
    EXPECT_EQ(run(fit(scene, capture)).exit_code, 0) << preset;
  }
  const std::string again = path("vl53l8ch_4x4.json"), before = text_of(again);
  expect_refused_beside(run("init --sensor vl53l8ch_8x8 -o '" + again + "'"), "there already");
  EXPECT_EQ(text_of(again), before);
  // A name that holds the sign which stands for the name in what is printed.
  EXPECT_EQ(run("init --sensor vl53l8ch_8x8 -o '" + path("a@desk.json") + "'").exit_code, 0);
  expect_refused_beside(run("init --sensor vl53 -o '" + path("new.json") + "'"),
                        "--sensor: found \"vl53\", accepted: street_lidar_8x8, ");
}

// The first example of the reference is the scene that `init` writes.
TEST_F(Cli, TheFirstExampleOfTheSceneReferenceIsABoxOnADesk) {
  ASSERT_EQ(run("init --sensor tmf8828_3x3_short -o '" + path("desk.json") + "'").exit_code, 0);
  const std::string page = text_of(SOURCE_DIR "/docs/scene.md");
  const std::size_t begin = page.find("```json\n") + 8;
  EXPECT_EQ(page.substr(begin, page.find("```", begin) - begin), text_of(path("desk.json")));
}

/// Captures of the mirrors' scene at known poses, from `render`.
class CliCalibration : public Cli {
 protected:
  const std::string scene_ = "'" SOURCE_DIR "/scenes/cheapspad_mirrors.json'";

  void SetUp() override {
    Cli::SetUp();
    for (int i = 0; i < 12; ++i) {
      const double x = -0.3 + 0.07 * i;
      const double y = -0.8 - 0.06 * (i % 5);
      const double z = 0.6 + 0.09 * (i % 9);
      const std::string pose =
          "x_m=" + std::to_string(x) + ",y_m=" + std::to_string(y) + ",z_m=" + std::to_string(z);
      const std::string file = path("capture" + std::to_string(i) + ".exr");
      ASSERT_EQ(run("render " + scene_ + " --model fast --seed " + std::to_string(i) + " --pose " +
                    pose + " -o '" + file + "'")
                    .exit_code,
                0);
      files_ += " '" + file + "'";
    }
  }
  std::string files_;
};

// A plate turned by half a turn is the same plate.
TEST_F(Cli, EvaluatesYawModuloTheShapesSymmetry) {
  const json covariance = {{0.01, 0}, {0, 0.01}};
  const json mode = {{"optimum", {0.1, 3.1}}, {"covariance", covariance}};
  const json capture = {
      {"modes", {mode}}, {"mean", {0.1, 3.1}}, {"covariance", covariance}, {"truth", {0.1, 0.0}}};
  json result = {{"format", "blindcorner.result/1"},
                 {"unknowns", {"x_m", "yaw_rad"}},
                 {"periods", {0.0, 3.14159265}},
                 {"captures", {capture, capture, capture}}};
  const std::string file = path("result.json");
  std::ofstream(file) << result;
  ASSERT_EQ(run("evaluate '" + file + "' --resamples 10").exit_code, 0);
  const json figures = json::parse(text_of(path("evaluation.json")));
  EXPECT_NEAR(figures.at("rows")[0].at("figures").at("rmse_yaw_rad").at("value"), 0.0416, 1e-3);
  result.erase("periods");
  std::ofstream(file) << result;
  const Outcome refused = run("evaluate '" + file + "'");
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr("result.json: periods"));
}

// The number that the page of the fit states comes first; the others are called what they are.
TEST_F(Cli, EvaluateNamesEachNumberAndBeginsWithThatOfThePage) {
  const json covariance = {{1e-4, 0, 0}, {0, 1e-4, 0}, {0, 0, 0.01}};
  const json mode = {
      {"pose", {0.3, 0.4, 0.1}}, {"optimum", {0.3, 0.41, 0.1}}, {"covariance", covariance}};
  const json capture = {{"modes", {mode}},
                        {"mean", {0.03, 0.04, 3.1}},
                        {"covariance", covariance},
                        {"truth", {0.0, 0.0, 0.0}}};
  const auto evaluated = [&](const json& captures) {
    std::ofstream(path("result.json")) << json{{"format", "blindcorner.result/1"},
                                               {"unknowns", {"x_m", "y_m", "yaw_rad"}},
                                               {"periods", {0.0, 0.0, 3.14159265}},
                                               {"captures", captures}};
    const Outcome outcome = run("evaluate '" + path("result.json") + "' --resamples 10");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out;
  };
  const std::string one = evaluated(json::array({capture}));
  EXPECT_THAT(one, HasSubstr("1 positions\n  heaviest mode to truth: 0.5000 m\n"
                             "  errors of the posterior mean (all modes together):\n"));
  EXPECT_THAT(one, ::testing::ContainsRegex("median_distance_m +0.050 +distance in space"));
  EXPECT_THAT(one,
              ::testing::ContainsRegex("rmse_m +0.035 +root mean square error of a coordinate"));
  EXPECT_THAT(one, ::testing::ContainsRegex("rmse_yaw_deg +2.38[0-9] "));
  EXPECT_THAT(one, Not(HasSubstr(" to 0."))) << "one position says nothing about an interval";
  const std::string page = text_of(path("evaluation.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("The position is within 50 cm of the truth"),
                          HasSubstr("0.5000 m"), Not(HasSubstr("yaw_rad"))));
  json moved = capture;
  moved["truth"] = {0.3, 0.0, 0.0};
  const std::string two = evaluated(json::array({capture, moved}));
  EXPECT_THAT(two, HasSubstr("heaviest mode to truth: median 0.4500 m, 90th percentile"));
  EXPECT_THAT(two, HasSubstr(" to 0."));
}

// What is no covariance, or no result at all, is named by file and field.
TEST_F(Cli, EvaluateRefusesWhatIsNoEstimate) {
  const std::string file = path("result.json");
  const auto refused = [&](const json& capture) {
    std::ofstream(file) << json{{"format", "blindcorner.result/1"},
                                {"unknowns", {"x_m"}},
                                {"periods", {0.0}},
                                {"captures", {capture}}};
    const Outcome outcome = run("evaluate '" + file + "'");
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr("result.json: captures[0]"));
  };
  for (const json& covariance : {json{{nullptr}}, json{{-1.0}}, json{{0.0}}, json(nullptr)}) {
    refused({{"mean", {0.1}}, {"covariance", covariance}, {"truth", {0.1}}});
  }
  refused({{"mean", {nullptr}}, {"covariance", {{1.0}}}, {"truth", {0.1}}});
  refused({{"mean", {0.1}}, {"truth", {0.1}}});
  refused(7);
  // Not over what it reads.
  const std::string before = text_of(file);
  for (const char* page : {"result.html", "result.json"}) {
    const Outcome over = run("evaluate '" + file + "' --page '" + path(page) + "'");
    EXPECT_EQ(over.exit_code, 2);
    EXPECT_THAT(over.err, HasSubstr("--page: found"));
  }
  EXPECT_EQ(text_of(file), before);
}

TEST_F(Cli, EvaluateReadsEachTruthOnce) {
  const json capture = {{"mean", {0.1, 0.2}}, {"covariance", {{0.01, 0}, {0, 0.01}}}};
  const std::string file = path("result.json");
  std::ofstream(file) << json{{"format", "blindcorner.result/1"},
                              {"unknowns", {"x_m", "yaw_rad"}},
                              {"periods", {0.0, 0.0}},
                              {"captures", {capture, capture}}};
  const auto message = [&](const std::string& table) {
    return run("evaluate '" + file + "' '" + write_text("t.csv", table) + "'").err;
  };
  EXPECT_EQ(message("\xEF\xBB\xBFx_m,yaw_rad,note\n.1,.2,a\n.1,.2,b\n"), "");
  EXPECT_THAT(message("index,x_m,yaw_rad\n0,.1,.2\n0,.1,.2\n"),
              HasSubstr("row 2: index: found 0 again"));
  EXPECT_THAT(message("index,x_m,yaw_rad\na,.1,.2\n"), HasSubstr("row 1: index: found \"a\""));
  EXPECT_THAT(message("x_m,yaw_rad,yaw_deg\n.1,.2,3\n"),
              AllOf(HasSubstr("\"yaw_rad\""), HasSubstr("\"yaw_deg\"")));
  EXPECT_THAT(message("x_m,yaw_rad\n.1,inf\n"), HasSubstr("row 1: yaw_rad: found \"inf\""));
}

// Whoever waits is told at once for what, also where nothing is a terminal.
TEST_F(Cli, LongCommandsSayWhatTheyDo) {
  EXPECT_THAT(run("explain '" + kScene + "' --poses 2").err,
              StartsWith("blindcorner: choosing how finely to sample tmf8828_wall"));
  EXPECT_THAT(run("stability --rows one_bin").err, StartsWith("blindcorner: 1 case"));
  const Outcome rendered =
      run("render '" + kScene + "' --model fast --random 2 -o '" + path("two.exr") + "'");
  EXPECT_EQ(rendered.out, path("two.exr") + ": 2 captures of 3 x 3 zones, 128 bins\n");
}

TEST_F(Cli, StabilityPrintsWritesAndNamesRows) {
  const Outcome table = run("stability --rows pulse_of_0.01,one_bin -o '" + path("s") + "'");
  ASSERT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(table.out, AllOf(HasSubstr("one_bin"), HasSubstr("2 of 2 hold")));
  const json written = json::parse(text_of(path("s") + "/stability.json"));
  EXPECT_EQ(written.at("format"), "blindcorner.stability/1");
  EXPECT_EQ(written.at("rows").size(), 2U);
  EXPECT_EQ(written.at("rows")[0].at("verdict"), "holds");
  const std::string page = text_of(path("s") + "/stability.html");
  EXPECT_THAT(page, HasSubstr("pulse_of_0.01"));
  // A mark for each case against its limit, before the tables.
  EXPECT_LT(page.find("class=\"mark"), page.find("<table"));
  EXPECT_THAT(page, AllOf(HasSubstr("<div class=\"mark\" style=\"left:"),
                          HasSubstr("the line is the limit")));
  const Outcome wrong = run("stability --rows one_bim");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean one_bin"));
}

TEST_F(CliCalibration, CalibratesFitsAndEvaluates) {
  const std::string instrument = path("instrument.json");
  const Outcome calibrated = run("calibrate " + scene_ + files_ +
                                 " --no-assignments --no-variance-scale -o '" + instrument + "'");
  ASSERT_EQ(calibrated.exit_code, 0) << calibrated.err;
  EXPECT_THAT(calibrated.out, HasSubstr("measured_law.cosine_exponent"));
  const json file = json::parse(text_of(instrument));
  EXPECT_EQ(file.at("format"), "blindcorner.instrument/1");
  EXPECT_EQ(file.at("captures_used"), 12);
  const json& floors = file.at("patch").at("sensor").at("noise").at("variance_floor");
  ASSERT_EQ(floors.size(), 8U);
  const Scene known = read_scene(SOURCE_DIR "/scenes/cheapspad_mirrors.json", instrument);
  for (int z = 0; z < 8; ++z) {
    EXPECT_EQ(std::get<GaussianNoise>(known.sensor.noise_of(z)).variance_floor,
              floors[static_cast<std::size_t>(z)].get<double>());
  }
  EXPECT_THAT(text_of(path("instrument.html")), HasSubstr("<svg"));

  const Outcome fitted = run("fit " + scene_ + files_ + kQuick + " --instrument '" + instrument +
                             "' -o '" + path("fit") + "'");
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  const std::string result = path("fit") + "/result.json";
  const Outcome evaluated = run("evaluate '" + result + "' --resamples 100");
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  EXPECT_THAT(evaluated.out, AllOf(HasSubstr("rmse_x_m"), HasSubstr("coverage_2sigma"),
                                   HasSubstr("normalised_error")));
  const json figures = json::parse(text_of(path("fit") + "/evaluation.json"));
  EXPECT_LT(figures.at("rows")[0].at("figures").at("rmse_m").at("value"), 0.5);
  EXPECT_THAT(text_of(path("fit") + "/evaluation.html"), HasSubstr("<svg"));

  // The same with the truth in a table, shifted by 1 m.
  std::ofstream table(path("truth.csv"));
  table << "index,x_m,y_m,z_m\n";
  const json fit = json::parse(text_of(result));
  table << "0," << 1 + fit["captures"][0]["mean"][0].get<double>() << ","
        << fit["captures"][0]["mean"][1] << "," << fit["captures"][0]["mean"][2] << "\n";
  table.close();
  const Outcome shifted = run("evaluate '" + result + "' '" + path("truth.csv") + "'");
  const json again = json::parse(text_of(path("fit") + "/evaluation.json"));
  EXPECT_NEAR(again["rows"][0]["figures"]["rmse_x_m"]["value"].get<double>(), 1, 1e-6)
      << shifted.out << shifted.err;
}

TEST_F(Cli, ATableOfTruthsMayHaveYawInDegrees) {
  const std::string capture = SOURCE_DIR "/scenes/captures/tmf8828_wall.exr";
  ASSERT_EQ(run("fit '" SOURCE_DIR "/scenes/tmf8828_wall.json' '" + capture + "' -o '" +
                path("fit") + "'")
                .exit_code,
            0);
  const std::string result = "'" + path("fit") + "/result.json'";
  const auto yaw_error = [&](const std::string& truth) {
    const Outcome outcome = run("evaluate " + result + " " + truth);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const json figures = json::parse(text_of(path("fit") + "/evaluation.json"));
    return figures["rows"][0]["figures"]["rmse_yaw_rad"]["value"].get<double>();
  };
  const double expected = yaw_error("'" + capture + "'");
  EXPECT_NEAR(yaw_error("'" + write_text("d.csv", "x_m,y_m,z_m,yaw_deg\n.28,.5,1.05,-20\n") + "'"),
              expected, 1e-9);
  const Outcome nowhere =
      run("evaluate " + result + " '" +
          write_text("i.csv", "index,x_m,y_m,z_m,yaw_deg\n1e30,0,0,0,0\n") + "'");
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("index: found"));
}

TEST_F(Cli, CalibrationAndEvaluationNameWhatIsWrong) {
  const std::string scene = "'" SOURCE_DIR "/scenes/cheapspad_mirrors.json'";
  ASSERT_EQ(run("render " + scene + " --model fast -o '" + path("c.exr") + "'").exit_code, 0);
  EXPECT_EQ(
      run("calibrate " + scene + " '" + path("c.exr") + "' -o '" + path("x.txt") + "'").exit_code,
      2);
  const Outcome none =
      run("calibrate " + scene + " '" + path("none.exr") + "' -o '" + path("x.json") + "'");
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_FALSE(fs::exists(path("x.json")));
  std::ofstream(path("i.json"))
      << R"({"format": "blindcorner.instrument/1", "patch": {"sensor": {"gain": -1}}})";
  const Outcome wrong = run("fit " + scene + " '" + path("c.exr") + "' --instrument '" +
                            path("i.json") + "' -o '" + path("fit") + "'");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("i.json"), HasSubstr("sensor.gain")));
  std::ofstream(path("r.json")) << "{}";
  const Outcome no_result = run("evaluate '" + path("r.json") + "'");
  EXPECT_EQ(no_result.exit_code, 2);
  EXPECT_THAT(no_result.err, HasSubstr("no result"));
  EXPECT_EQ(run("evaluate '" + path("none.json") + "'").exit_code, 2);
  const Outcome few =
      run("crossvalidate " + scene + " '" + path("none.exr") + "' -o '" + path("cv") + "'");
  EXPECT_EQ(few.exit_code, 2);
}

/// An object that moves by 2 cm a frame, with a capture in between that cannot be used.
TEST_F(Cli, TrackFollowsFramesAndPassesOverABrokenOne) {
  const std::string scene = std::string(SOURCE_DIR) + "/scenes/denali_like.json";
  std::string captures;
  for (int i = 0; i < 4; ++i) {
    const std::string name = path("frame" + std::to_string(i) + ".exr");
    captures += " '" + name + "'";
    const std::string pose = "x_m=" + std::to_string(1.10 + 0.02 * i) + ",y_m=0.3";
    ASSERT_EQ(
        run("render '" + scene + "' -o '" + name + "' --noiseless --model fast --pose " + pose)
            .exit_code,
        0);
    if (i == 1) captures += " '" + write_with_nan("broken.exr") + "'";
  }
  const Outcome result = run(fit(scene, captures) + " --track --no-page");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  const json list = json::parse(text_of(path("out/result.json")))["captures"];
  ASSERT_EQ(list.size(), 5U);
  EXPECT_TRUE(list[2]["error"].is_string());
  EXPECT_FALSE(list[2].contains("track"));
  for (const int i : {0, 1, 3, 4}) {
    const json& frame = list[static_cast<std::size_t>(i)];
    EXPECT_TRUE(frame["error"].is_null());
    // The frame interval that scenes have when they do not say.
    EXPECT_NEAR(frame["track"]["time_s"].get<double>(), 0.1 * i, 1e-9);
    ASSERT_FALSE(frame["modes"].empty());
    for (const std::size_t k : {0U, 1U}) {
      EXPECT_NEAR(frame["modes"][0]["pose"][k].get<double>(), frame["truth"][k].get<double>(),
                  0.02);
      EXPECT_NEAR(frame["track"]["smoothed_pose"][k].get<double>(), frame["truth"][k].get<double>(),
                  0.02);
    }
  }
}

TEST_F(Cli, TrackExcludesJoint) {
  expect_refused(run(fit(kScene, write_flat("good.exr")) + " --track --joint"));
}

// Gains that were calibrated stand in place of the link that stated them.
TEST_F(Cli, InstrumentFilesSuitScenesWithALink) {
  json scene = json::parse(text_of(kScene));
  json& sensor = scene["sensor"];
  sensor.update({{"rows", 1}, {"columns", 1}, {"fov_deg", {12, 12}}});
  sensor.erase("gain");
  if (sensor.contains("illumination")) sensor["illumination"].erase("radiant_intensity_w_per_sr");
  sensor["link"] = {{"pulse_energy_nj", 0.1}, {"repetition_rate_hz", 1e6},
                    {"exposure_s", 0.03},     {"wavelength_nm", 940},
                    {"aperture_mm", 0.5},     {"detection_efficiency", 0.03},
                    {"filter_width_nm", 20},  {"ambient_illuminance_lux", 100}};
  scene["linear"]["ambient"].erase("counts_per_bin");
  std::ofstream(path("scene.json")) << scene;
  const std::string of = "'" + path("scene.json") + "' ";
  ASSERT_EQ(run("render " + of + "--empty --model fast -o '" + path("c.exr") + "'").exit_code, 0);
  const std::string instrument = " '" + path("instrument.json") + "'";
  const Outcome calibrated = run("calibrate " + of + "'" + path("c.exr") +
                                 "' --no-object --no-variance-scale -o" + instrument);
  ASSERT_EQ(calibrated.exit_code, 0) << calibrated.err;
  const Outcome fitted = run("fit " + of + "'" + path("c.exr") + "'" + kQuick + " --instrument" +
                             instrument + " -o '" + path("fit") + "'");
  EXPECT_EQ(fitted.exit_code, 0) << fitted.err;
  const Scene before = read_scene(path("scene.json"));
  const Scene after = read_scene(path("scene.json"), path("instrument.json"));
  EXPECT_FALSE(after.sensor.link.has_value());
  EXPECT_NEAR(after.sensor.radiant_intensity / before.sensor.radiant_intensity, 1, 1e-5);
  EXPECT_NEAR(after.linear.fixed_ambient / before.linear.fixed_ambient, 1, 1e-5);
}

// Captures of nothing show what is always there; the instrument file keeps it.
TEST_F(Cli, InstrumentFilesHoldTheBackgroundOfAnEmptyScene) {
  const std::string known = SOURCE_DIR "/scenes/cheapspad_mirrors.json";
  json scene = json::parse(text_of(known));
  std::vector<double> counts(24, 0.0);
  counts[18] = 500;
  scene["sensor"]["background_counts"] = json::array();
  for (int z = 0; z < 8; ++z) {
    scene["sensor"]["background_counts"].push_back(z == 5 ? json(counts) : json::array());
  }
  std::ofstream(path("scene.json")) << scene;
  std::string files;
  for (int i = 0; i < 10; ++i) {
    const std::string file = " '" + path("empty" + std::to_string(i) + ".exr") + "'";
    ASSERT_EQ(run("render '" + path("scene.json") + "' --empty --model fast --seed " +
                  std::to_string(i) + " -o" + file)
                  .exit_code,
              0);
    files += file;
  }
  const std::string instrument = path("instrument.json");
  const Outcome calibrated = run("calibrate '" + known + "'" + files +
                                 " --no-object --no-variance-scale -o '" + instrument + "'");
  ASSERT_EQ(calibrated.exit_code, 0) << calibrated.err;
  EXPECT_THAT(calibrated.out, HasSubstr("background[zone 5, bin 18]"));
  EXPECT_THAT(text_of(path("instrument.html")), HasSubstr("Static background"));
  const json found = json::parse(text_of(instrument)).at("background");
  ASSERT_EQ(found.size(), 1U);
  const double error = found[0].at("standard_error");
  EXPECT_NEAR(found[0].at("counts"), 500, 5 * error);
  EXPECT_LT(error, 50);
  const Scene after = read_scene(known, instrument);
  EXPECT_TRUE(after.sensor.zones[4].background.empty());
  ASSERT_EQ(after.sensor.zones[5].background.size(), 24U);
  EXPECT_NEAR(after.sensor.zones[5].background[18], found[0].at("counts"), 1e-3);

  // And it takes one away that the scene states and the captures do not have.
  scene["sensor"]["background_counts"][2] = counts;
  std::ofstream(path("scene.json")) << scene;
  const Outcome again = run("calibrate '" + path("scene.json") + "'" + files +
                            " --no-object --no-variance-scale -o '" + instrument + "'");
  ASSERT_EQ(again.exit_code, 0) << again.err;
  const Scene without = read_scene(path("scene.json"), instrument);
  EXPECT_TRUE(without.sensor.zones[2].background.empty());
  EXPECT_EQ(without.sensor.zones[5].background.size(), 24U);
}

// Scenes that cannot be fitted are refused before any capture is, and nothing is written.
TEST_F(Cli, FitRefusesScenesWithWrongRelayPoints) {
  const json good =
      json::parse(text_of(std::string(SOURCE_DIR) + "/scenes/cheapspad_mirrors.json"));
  ASSERT_EQ(run("render '" + std::string(SOURCE_DIR) + "/scenes/cheapspad_mirrors.json' -o '" +
                path("c.exr") + "'")
                .exit_code,
            0);
  const auto refused = [&](const json& scene) {
    std::ofstream(path("scene.json")) << scene;
    const Outcome outcome =
        run("fit '" + path("scene.json") + "' '" + path("c.exr") + "' -o '" + path("out") + "'");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_FALSE(fs::exists(path("out") + "/result.json"));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    return outcome.err;
  };
  json far = good;
  far["sensor"]["zones"][1]["relay_point_m"] = {0, 40, 0};
  EXPECT_THAT(refused(far), AllOf(HasSubstr("scene.json: sensor.zones[1]"), HasSubstr("accepted")));
  json wide = good;
  wide["sensor"].erase("zones");
  wide["sensor"]["fov_deg"] = {20, 20};
  EXPECT_THAT(refused(wide), AllOf(HasSubstr("scene.json: hidden.material"), HasSubstr("points")));
}

// The first bounce fills bins of every zone. What comes after them shows the object all the same;
// taken for counts, they would leave nothing of it.
TEST_F(Cli, FitLeavesOutBinsThatTheFirstBounceFillsUp) {
  json scene = json::parse(text_of(kScene));
  std::ofstream(path("free.json")) << scene;
  scene["sensor"]["saturation"] = 65535;
  std::ofstream(path("full.json")) << scene;
  ASSERT_EQ(
      run("render '" + path("full.json") + "' --seed 3 --model fast -o '" + path("c.exr") + "'")
          .exit_code,
      0);
  const auto fitted = [&](const std::string& name) {
    const Outcome outcome = run("fit '" + path(name) + "' '" + path("c.exr") + "' -o '" +
                                path("out") + "' --empty-captures 0 --no-page");
    EXPECT_EQ(outcome.exit_code, 0);
    const json result = json::parse(text_of(path("out/result.json")));
    return std::pair(outcome.err, result);
  };
  const auto [said, result] = fitted("full.json");
  EXPECT_THAT(said, HasSubstr("saturation: left out"));
  const auto flags = [](const json& r) { return r["captures"][0]["flags"].dump(); };
  EXPECT_THAT(flags(result), Not(HasSubstr("model_misfit")));
  // Nobody has said that the bins are full; that the scene cannot explain them is seen.
  const auto [hinted, taken] = fitted("free.json");
  EXPECT_THAT(hinted, AllOf(Not(HasSubstr("saturation")), HasSubstr("hint: The light is")));
  EXPECT_THAT(flags(taken), HasSubstr("model_misfit"));
}

TEST_F(Cli, RenderNeedsTheRelayPointsOfACapture) {
  const Outcome outcome = run("render '" + std::string(SOURCE_DIR) +
                              "/scenes/st_person_tracking.json' -o '" + path("c.exr") + "'");
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("st_person_tracking.json: sensor.zones"), HasSubstr("from_capture")));
  EXPECT_FALSE(fs::exists(path("c.exr")));
}

TEST_F(Cli, RenderFollowsTheAmplitude) {
  json scene = json::parse(text_of(kScene));
  scene["linear"]["direct"] = {{"mode", "absent"}};
  scene["linear"]["ambient"] = {{"mode", "fixed"}, {"counts_per_bin", 0}};
  const auto light = [&](double amplitude, const std::string& noise) {
    scene["linear"]["amplitude"] = {{"mode", "fixed"}, {"value", amplitude}};
    std::ofstream(path("scene.json")) << scene;
    EXPECT_EQ(run("render '" + path("scene.json") + "' " + noise + " --model fast -o '" +
                  path("c.exr") + "'")
                  .exit_code,
              0);
    double sum = 0;
    const CaptureFile file = read_captures(path("c.exr"));
    for (const double n : file.captures.front().counts.values) sum += n;
    return sum;
  };
  const double expected = light(100, "--noiseless");
  EXPECT_NEAR(expected / light(1, "--noiseless"), 100, 1e-3);
  EXPECT_NEAR(light(100, ""), expected, 5 * std::sqrt(expected));
}

TEST_F(Cli, SolverBenchmarkFitsSavedCapturesAgain) {
  const std::string command =
      "benchmark solver '" + std::string(SOURCE_DIR) + "/scenes/denali_like.json' --max-poses 200 ";
  const Outcome first = run(command + "-n 2 --truth 0.5 -o '" + path("first") +
                            "' --save-captures '" + path("kept") + "'");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const std::string again = command + "--saved-captures '" + path("kept") + "' -n ";
  ASSERT_EQ(run(again + "2 -o '" + path("again") + "'").exit_code, 0);
  const auto trials = [&](const std::string& name) {
    return json::parse(text_of(path(name) + "/solver.json"))[0]["trials"];
  };
  const json before = trials("first"), after = trials("again");
  ASSERT_EQ(before.size(), 2U);
  ASSERT_EQ(after.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(before[i]["photons"], after[i]["photons"]);
    // A capture file has single precision.
    EXPECT_NEAR(before[i]["position_error_m"], after[i]["position_error_m"], 1e-5);
  }

  const Outcome other = run(again + "2 --seed 2");
  EXPECT_NE(other.exit_code, 0);
  EXPECT_THAT(other.err, AllOf(HasSubstr("denali_like.exr: capture 0"), HasSubstr("seed")));
  const Outcome more = run(again + "3");
  EXPECT_NE(more.exit_code, 0);
  EXPECT_THAT(more.err, HasSubstr("found 2 captures, accepted: at least 3"));
}

TEST_F(Cli, SweepComparesSettingsAndOtherMethodsBesideTheBound) {
  const std::string scene = "'" + std::string(SOURCE_DIR) + "/scenes/denali_like.json'";
  const std::string command = "benchmark solver --sweep " + scene +
                              " -n 3 --light sensor --photons 300,3000 --settings 'quick,1 start'";
  const Outcome outcome = run(command + " -o '" + path("out") + "'");
  // 1: the default is not on the front, which so few captures hardly say.
  ASSERT_LE(outcome.exit_code, 1) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Cramer-Rao bound"), HasSubstr("multilateration"),
                                 HasSubstr("on the front")));
  EXPECT_THAT(text_of(path("out/sweep.html")), AllOf(HasSubstr("<svg"), HasSubstr("front")));
  EXPECT_THAT(text_of(path("out/sweep.svg")), AllOf(HasSubstr("<svg"), HasSubstr("front")));
  const std::string csv = text_of(path("out/sweep.csv"));
  EXPECT_THAT(csv, StartsWith("scene,wrong,photons,bound_median_m,"));
  const json sweep = json::parse(text_of(path("out/sweep.json")));
  EXPECT_EQ(sweep["format"], "blindcorner.sweep/1");
  const json& levels = sweep["scenes"][0]["levels"];
  ASSERT_EQ(levels.size(), 2U);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'),
            1 + 2 * static_cast<int>(levels[0]["methods"].size()));
  EXPECT_EQ(levels[0]["methods"][0]["method"], "default");
  EXPECT_LT(levels[1]["bound_rms_m"], levels[0]["bound_rms_m"]);
  for (const json& method : levels[1]["methods"]) {
    EXPECT_EQ(method["answers"], 3) << method["method"];
    EXPECT_GT(method["first_cpu_ms"], 0);
  }
  // Errors depend on the seed alone.
  ASSERT_LE(run(command + " -o '" + path("again") + "'").exit_code, 1);
  const json again = json::parse(text_of(path("again/sweep.json")));
  for (std::size_t m = 0; m < levels[0]["methods"].size(); ++m) {
    EXPECT_EQ(levels[0]["methods"][m]["errors_m"],
              again["scenes"][0]["levels"][0]["methods"][m]["errors_m"]);
  }
  const Outcome wrong = run("benchmark solver --sweep " + scene + " --wrong fog -o out");
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("relay tilted by 2 degrees"));
  const Outcome both =
      run("benchmark solver --sweep " + scene + " --light tracer --wrong 'half the albedo' -o out");
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.err, AllOf(HasSubstr("--wrong"), HasSubstr("--light tracer")));
  const Outcome setting = run("benchmark solver --sweep " + scene + " --settings quik -o out");
  EXPECT_EQ(setting.exit_code, 2);
  EXPECT_THAT(setting.err, HasSubstr("did you mean quick"));
  // What the sweep has of its own, or has not, is not passed over.
  const Outcome passed_over = run("benchmark solver --sweep " + scene + " --tolerance 0.2 -o out");
  EXPECT_EQ(passed_over.exit_code, 2);
  EXPECT_THAT(passed_over.err, AllOf(HasSubstr("--tolerance"), HasSubstr("--sweep")));
  EXPECT_EQ(run("benchmark solver").exit_code, 2);
}

TEST_F(Cli, CoverageBenchmarkJudgesClaims) {
  const std::string command = "benchmark coverage '" + std::string(SOURCE_DIR) +
                              "/scenes/denali_like.json' -n 12 --light sensor --photons 300 ";
  const Outcome outcome =
      run(command + "--wrong-assumptions --wrong-captures 3 -o '" + path("out") + "'");
  ASSERT_LE(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("truth in the 95 % region"), HasSubstr("allowed"),
                                 HasSubstr("second object"), HasSubstr("claims hold")));
  EXPECT_THAT(text_of(path("out/coverage.html")), AllOf(HasSubstr("<svg"), HasSubstr("verdict")));
  EXPECT_THAT(text_of(path("out/coverage.csv")),
              StartsWith("scene,photons,claim,trials,claimed,found,allowed_low,"));
  const std::string wrong = text_of(path("out/wrong_assumptions.csv"));
  EXPECT_EQ(std::count(wrong.begin(), wrong.end(), '\n'), 7) << wrong;
  const json level = json::parse(text_of(path("out/coverage.json")))["scenes"][0]["levels"][0];
  EXPECT_EQ(level["trials"].size(), 12U);
  EXPECT_EQ(level["claims"][2]["trials"], 12);
  // The same at any number of threads.
  ASSERT_LE(run(command + "--threads 1 -o '" + path("one") + "'").exit_code, 1);
  const json one = json::parse(text_of(path("one/coverage.json")))["scenes"][0]["levels"][0];
  EXPECT_EQ(one["trials"], level["trials"]);
}

// Scenes that nobody tuned: their files are kept, and a table holds a row for each.
TEST_F(Cli, CoverageBenchmarkDrawsScenesAtRandom) {
  const Outcome outcome =
      run("benchmark coverage --random 2 -n 2 --light sensor --seed 3 -o '" + path("out") + "'");
  ASSERT_LE(outcome.exit_code, 1) << outcome.err;
  for (const char* name : {"random_30000", "random_30001"}) {
    EXPECT_THAT(outcome.out, HasSubstr(std::string("\n") + name + " ")) << outcome.out;
    EXPECT_EQ(run("info '" + path("out/scenes/") + name + ".json'").exit_code, 0);
  }
  EXPECT_THAT(text_of(path("out/coverage.html")), HasSubstr("<td>random_30001<td>"));
  EXPECT_EQ(run("benchmark coverage").exit_code, 2);
}

TEST_F(Cli, DetectionBenchmarkDrawsCurvesAndChecksTheStatedRate) {
  const Outcome outcome =
      run("benchmark detection '" + std::string(SOURCE_DIR) +
          "/scenes/denali_like.json' -n 4 --empty 12 --light sensor --photons 10,3000 -o '" +
          path("out") + "'");
  ASSERT_LE(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("false-alarm probability below 0.05"),
                                 HasSubstr("stated false-alarm probabilities hold")));
  EXPECT_THAT(text_of(path("out/detection.html")), HasSubstr("<svg"));
  EXPECT_THAT(text_of(path("out/roc.csv")),
              StartsWith("scene,photons,statistic,false_share,true_share\n"));
  const std::string rates = text_of(path("out/false_alarms.csv"));
  EXPECT_EQ(std::count(rates.begin(), rates.end(), '\n'), 9) << rates;
  const json levels = json::parse(text_of(path("out/detection.json")))["scenes"][0]["levels"];
  EXPECT_EQ(levels[1]["reported_with"], 4);
  EXPECT_GE(levels[1]["area_false_alarm"].get<double>() + 1e-9, 0.9);
}

// The truth comes from an archive of traced light; here the program's own renderer stands in for
// the tracer.
TEST_F(Cli, LightBenchmarkTellsErrorsAndClaims) {
  const std::string scene = std::string(SOURCE_DIR) + "/scenes/reference_wall_rectangle.json";
  const std::string render = "render '" + scene + "' --noiseless -o '";
  ASSERT_EQ(run(render + path("with.exr") + "' --pose x_m=0.2,y_m=0.7,z_m=1,yaw_deg=-10 " +
                "--pose x_m=0.3,y_m=0.8,z_m=1.1,yaw_deg=5")
                .exit_code,
            0);
  ASSERT_EQ(run(render + path("without.exr") + "' --empty").exit_code, 0);
  std::vector<double> mean;
  for (const Capture& capture : read_captures(path("with.exr")).captures) {
    mean.insert(mean.end(), capture.counts.values.begin(), capture.counts.values.end());
  }
  const std::vector<double> empty = read_captures(path("without.exr")).captures[0].counts.values;
  const std::vector<std::size_t> cube = {3, 3, 128}, cubes = {2, 3, 3, 128};
  fs::create_directory(path("data"));
  write_text("data/wall_rectangle.npz",
             npz_of({{"poses", npy_of({2, 4}, {0.2, 0.7, 1, -10, 0.3, 0.8, 1.1, 5})},
                     {"mean", npy_of(cubes, mean)},
                     {"standard_error", npy_of(cubes, std::vector<double>(mean.size(), 1e-12))},
                     {"empty_mean", npy_of(cube, empty)},
                     {"empty_standard_error", npy_of(cube, std::vector<double>(empty.size()))}}));
  const std::string command = "benchmark light '" + scene + "' --data '" + path("data") + "' ";
  const Outcome outcome = run(command + "--photons 300,30000 --seeds 2 -o '" + path("out") +
                              "' --save-captures '" + path("kept") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("in 95%"), HasSubstr("file mm"), HasSubstr("30000")));
  EXPECT_THAT(text_of(path("out/light.html")), HasSubstr("<svg"));
  const std::string csv = text_of(path("out/light.csv"));
  EXPECT_THAT(csv, StartsWith("scene,without,photons,captures,failed,median_error_m,"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3) << csv;
  // A row for each rule that is left out, on the same captures.
  const Outcome rules = run(command + "--photons 300 --seeds 1 --without ridges --each-rule -o '" +
                            path("rules") + "'");
  ASSERT_EQ(rules.exit_code, 0) << rules.err;
  EXPECT_THAT(rules.out, AllOf(HasSubstr("without turn"), HasSubstr("without local_light")));
  EXPECT_THAT(rules.out, Not(HasSubstr("without ridges")));
  EXPECT_NE(run(command + "--without nothing").exit_code, 0);
  const json rows = json::parse(text_of(path("out/light.json")));
  ASSERT_EQ(rows.size(), 2U);
  for (const json& row : rows) {
    EXPECT_EQ(row["trials"].size(), 4U);
    EXPECT_GT(row["first_ms"], 0);
    EXPECT_GT(row["file_limit_m"], 0);
  }
  // A hundred times the photons: a tenth of the error, but for what the brightness's prior tells of
  // the dim ones and what the static background may be off by in the bright ones.
  const double falls =
      rows[0]["photon_bound_m"].get<double>() / rows[1]["photon_bound_m"].get<double>();
  EXPECT_LT(falls, 10);
  EXPECT_GT(falls, 5);
  for (const json& trial : rows[1]["trials"]) {
    EXPECT_LT(trial["position_error_m"].get<double>(), 8 * rows[1]["photon_bound_m"].get<double>());
  }
  const CaptureFile kept = read_captures(path("kept/reference_wall_rectangle_300.exr"));
  ASSERT_EQ(kept.captures.size(), 4U);
  EXPECT_EQ(kept.captures[1].truth.at("y_m"), 0.8);

  const Outcome missing = run("benchmark light '" + scene + "' --data '" + path("none") + "'");
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.err, HasSubstr("wall_rectangle.npz"));
}

TEST_F(Cli, MovingBenchmarkFitsAndTracksAtNewSensorPoses) {
  const std::string command = "benchmark moving '" + std::string(SOURCE_DIR) +
                              "/scenes/denali_like.json' --objects 2 " +
                              "--exhaustive-every 3 --max-poses 200 --photons 500 ";
  const Outcome outcome = run(command + "--frames 4 --truth 0.3 --endurance 20 -o '" + path("out") +
                              "' --save-captures '" + path("kept") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("denali_like"), HasSubstr("/2 "), HasSubstr("20 poses:"),
                                 HasSubstr("MB")));
  EXPECT_THAT(text_of(path("out/moving.html")), AllOf(HasSubstr("<svg"), HasSubstr("memory")));
  const std::string csv = text_of(path("out/moving.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5) << csv;

  // The scene's own pose first, for the first answer, and none of it among the frames.
  const Scene scene = bundled_scene("denali_like");
  const CaptureFile kept = read_captures(path("kept/denali_like.exr"));
  ASSERT_EQ(kept.captures.size(), 5U);
  EXPECT_TRUE(kept.captures[0].T_world_sensor->isApprox(scene.T_world_sensor, 1e-12));
  EXPECT_FALSE(kept.captures[1].T_world_sensor->isApprox(scene.T_world_sensor, 1e-3));
  EXPECT_EQ(kept.captures[1].truth, kept.captures[2].truth);
  EXPECT_NE(kept.captures[2].truth, kept.captures[3].truth);

  const Outcome again = run(command + "--frames 4 -o '" + path("again") + "' --saved-captures '" +
                            path("kept") + "'");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  const Outcome more =
      run(command + "--frames 9 -o '" + path("more") + "' --saved-captures '" + path("kept") + "'");
  EXPECT_EQ(more.exit_code, 2);
  EXPECT_THAT(more.err, HasSubstr("accepted: at least 10"));
  EXPECT_EQ(run(command + "--to yaw_deg=180").exit_code, 2);
}

/// 4 x 4 cells with a wall that leaves one cell open.
std::string write_map(const std::string& path) {
  std::ofstream(path) << "type octile\nheight 4\nwidth 4\nmap\n....\n@@@.\n....\n....\n";
  return path;
}

TEST_F(Cli, PlanWritesPathAndPage) {
  const std::string map = write_map(path("small.map"));
  const Outcome planned = run("plan " + map + " --start 0.5,3.5 --goal 0.5,0.5 -o " + path("out"));
  EXPECT_EQ(planned.exit_code, 0) << planned.err;
  const json file = json::parse(text_of(path("out/path.json")));
  EXPECT_EQ(file["format"], "blindcorner.path/1");
  EXPECT_EQ(file["status"], "found");
  // Steps between cells are 7 + sqrt(2) m long, straight lines with rounded corners less.
  EXPECT_LT(file["length_m"], 7 + std::sqrt(2.0));
  EXPECT_EQ(file["points"].front()[0], 0.5);
  EXPECT_EQ(file["points"].back()[1], 0.5);
  EXPECT_NEAR(file["points"].back()[4], file["length_m"], 1e-9);
  EXPECT_THAT(text_of(path("out/path.html")), AllOf(HasSubstr("<svg"), HasSubstr("polyline")));
}

TEST_F(Cli, PlanTellsWhyThereIsNoPath) {
  const std::string map = write_map(path("small.map"));
  const Outcome blocked = run("plan " + map + " --start 0.5,2.5 --goal 0.5,0.5 -o " + path("out"));
  EXPECT_EQ(blocked.exit_code, 1);
  EXPECT_THAT(blocked.err, AllOf(HasSubstr("start_blocked: the start lies in an obstacle"),
                                 HasSubstr("the nearest free place is --start ")));
  // What is proposed is free.
  const std::string sign = "--start ";
  std::string proposed = blocked.err.substr(blocked.err.find(sign) + sign.size());
  proposed = proposed.substr(0, proposed.find('\n'));
  EXPECT_EQ(
      run("plan " + map + " --start " + proposed + " --goal " + proposed + " -o " + path("out2"))
          .exit_code,
      0)
      << proposed;
  EXPECT_THAT(run("plan " + map + " --start 0.5,0.5 --goal 9,0 -o " + path("o2")).err,
              HasSubstr("the goal lies outside of the map, which spans x 0 to "));
  EXPECT_EQ(json::parse(text_of(path("out/path.json")))["status"], "start_blocked");
  EXPECT_EQ(run("plan " + map + " --start 0.5,0.5 --goal 9,0 -o " + path("o2")).exit_code, 1);
  EXPECT_EQ(run("plan " + map + " --start 0.5 --goal 9,0 -o " + path("o3")).exit_code, 2);
  const Outcome text = run("plan " + map + " --start 0.5,x --goal 9,0 -o " + path("o3"));
  EXPECT_EQ(text.exit_code, 2);
  EXPECT_EQ(run("plan " + path("no.map") + " --start 0,0 --goal 1,1 -o " + path("o3")).exit_code,
            2);
  EXPECT_FALSE(fs::exists(path("o3")));
}

TEST_F(Cli, PlanReadsRosMaps) {
  std::ofstream(path("m.pgm")) << "P2\n5 3\n255\n254 254 254 254 254\n0 0 254 0 0\n254 254 254 205 "
                                  "254\n";
  std::ofstream(path("m.yaml")) << "image: m.pgm\nmode: trinary\nresolution: 0.5\norigin: [-1, -1, "
                                   "0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  const std::string ends = " --start -0.8,0.3 --goal 1.2,-0.8 -o " + path("out");
  EXPECT_EQ(run("plan " + path("m.yaml") + ends).exit_code, 0);
  EXPECT_EQ(json::parse(text_of(path("out/path.json")))["points"].front()[0], -0.8);
  // The only way leads through the cell of which nothing is known.
  EXPECT_EQ(run("plan " + path("m.yaml") + ends + " --unknown 1").exit_code, 1);
  EXPECT_EQ(json::parse(text_of(path("out/path.json")))["status"], "no_path");
  const Outcome image = run("plan " + path("m.pgm") + ends);
  EXPECT_EQ(image.exit_code, 2);
  EXPECT_THAT(image.err, HasSubstr("accepted: .yaml (ROS map), .map (MovingAI)"));
}

TEST_F(Cli, PlannerBenchmarkCountsOptimaAndFailsWhereOneIsMissed) {
  const std::string map = write_map(path("small.map"));
  const auto scenario = [&](const std::string& length) {
    std::ofstream(path("small.scen")) << "version 1\n0\tsmall.map\t4\t4\t0\t0\t0\t3\t" << length
                                      << "\n0\tsmall.map\t4\t4\t0\t0\t3\t0\t3.0\n";
    return run("benchmark planner --map " + map + " --scenario " + path("small.scen") + " -o " +
               path("out"));
  };
  // Along the top row, down through the gap, diagonally to the lower left.
  const Outcome met = scenario("8.41421356");
  EXPECT_EQ(met.exit_code, 0) << met.err;
  EXPECT_THAT(met.out, HasSubstr("2 of 2 problems met their optimum"));
  EXPECT_THAT(text_of(path("out/planner.html")), HasSubstr("<svg"));
  const Outcome missed = scenario("8.41");
  EXPECT_EQ(missed.exit_code, 1);
  EXPECT_THAT(missed.out, HasSubstr("1 of 2 problems met their optimum"));
  EXPECT_THAT(missed.err, HasSubstr("problem 0"));
}

TEST_F(Cli, DriveWritesWhatHappenedAndAPageThatPlaysIt) {
  const std::string drive = std::string(SOURCE_DIR) + "/scenes/robot_drive.json";
  const Outcome outcome = run("drive '" + drive + "' -o " + path("out") +
                              " --perception oracle --seed 2 --real-time --animation");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("reached with oracle"), HasSubstr("plan")));
  const json result = json::parse(text_of(path("out/drive.json")));
  EXPECT_EQ(result["format"], "blindcorner.drive/1");
  EXPECT_EQ(result["outcome"], "reached");
  EXPECT_EQ(result["seed"], 2);
  EXPECT_GT(result["clearance_m"], 0);
  // The goal is 2.8 m away as the crow flies.
  EXPECT_GT(result["length_m"], 2.7);
  EXPECT_NEAR(result["mean_speed_m_per_s"].get<double>(),
              result["length_m"].get<double>() / result["time_s"].get<double>(), 1e-9);
  ASSERT_FALSE(result["frames"].empty());
  EXPECT_EQ(result["frames"][0]["modes"].size(), 1U);
  const std::string page = text_of(path("out/drive.html"));
  EXPECT_THAT(page, HasSubstr("\"canvas\""));
  EXPECT_THAT(page, Not(HasSubstr("src=\"http")));
  EXPECT_THAT(text_of(path("out/drive.svg")), HasSubstr("<animate"));
}

// It plays by itself, says why it ended, and has its timelines; who wants nothing to move by itself
// sees the moment that explains the drive.
TEST_F(Cli, DrivePageAsDrawnByABrowser) {
  const std::string drive = std::string(SOURCE_DIR) + "/scenes/robot_drive.json";
  ASSERT_EQ(run("drive '" + drive + "' -o " + path("out") + " --perception oracle --seed 2")  //
                .exit_code,
            0);
  const std::optional<std::string> page = as_drawn(path("out/drive.html"));
  if (!page) GTEST_SKIP() << "needs chromium";
  EXPECT_THAT(*page, AllOf(HasSubstr("class=\"headline\">The robot reached its goal after"),
                           HasSubstr(">Pause</button>"), HasSubstr("nearest, 0.")));
  for (const char* strip : {"speed, m/s", "clearance, m", "probability that the sign is there",
                            "error of the place, m"}) {
    EXPECT_THAT(*page, HasSubstr(std::string(">") + strip + "</text>"));
  }
  const std::regex line("<path d=\"M[^\"]*\" class=\"line strong\"");
  EXPECT_EQ(std::distance(std::sregex_iterator(page->begin(), page->end(), line), {}), 4);
  const auto still = as_drawn(path("out/drive.html"), "--force-prefers-reduced-motion");
  EXPECT_THAT(*still, AllOf(HasSubstr(">Play</button>"), Not(HasSubstr(">0.0 / "))));
}

// Two perceptions of one seed: a file for each, and one page that plays both and says how they end.
TEST_F(Cli, DrivePlaysTwoPerceptionsSideBySide) {
  const std::string drive = std::string(SOURCE_DIR) + "/scenes/robot_drive.json";
  const Outcome outcome = run("drive '" + drive + "' -o " + path("out") +
                              " --perception los,oracle --seed 2 --animation");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_FALSE(fs::exists(path("out/drive.json")));
  const std::string page = text_of(path("out/drive.html"));
  const std::string begin = "id=\"pairs\">";
  const std::size_t at = page.find(begin) + begin.size();
  const json pairs = json::parse(page.substr(at, page.find("</script>", at) - at))["pairs"];
  ASSERT_EQ(pairs.size(), 1U);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = i == 0 ? "los" : "oracle";
    const json written = json::parse(text_of(path("out/" + name + "/drive.json")));
    const json& played = pairs[0]["drives"][i]["drive"];
    EXPECT_EQ(written["perception"], name);
    for (const char* field : {"perception", "outcome", "time_s", "length_m", "clearance_m"}) {
      EXPECT_EQ(played[field], written[field]) << field;
    }
    EXPECT_EQ(played["frames"].size(), written["frames"].size());
    EXPECT_TRUE(fs::exists(path("out/" + name + "/drive.html")));
  }
  const std::string picture = text_of(path("out/drive.svg"));
  EXPECT_THAT(picture, AllOf(HasSubstr("with direct sight only"), HasSubstr("told the truth")));
  expect_refused_beside(run("drive '" + drive + "' --perception los,los -o " + path("other")),
                        "--perception: a perception is named twice");
  const auto drawn = as_drawn(path("out/drive.html") + "#t=99");
  if (!drawn) GTEST_SKIP() << "needs chromium";
  EXPECT_THAT(*drawn, AllOf(HasSubstr("All about this drive"), HasSubstr("goal reached after"),
                            HasSubstr(">probability of presence</text>")));
}

TEST_F(Cli, IndexLinksWhatSeveralCommandsWrote) {
  const std::string drive = std::string(SOURCE_DIR) + "/scenes/robot_drive.json";
  ASSERT_EQ(run("drive '" + drive + "' -o " + path("out") + " --perception los --animation")  //
                .exit_code,
            0);
  ASSERT_EQ(run("info '" + kScene + "' -o " + path("out")).exit_code, 0);
  const std::string headline = json::parse(text_of(path("out/drive.json")))["headline"];
  EXPECT_THAT(text_of(path("out/index.html")),
              AllOf(HasSubstr("href=\"drive.html\""), HasSubstr(headline),
                    HasSubstr("href=\"tmf8828_wall.html\""), HasSubstr("href=\"drive.json\""),
                    HasSubstr("href=\"drive.svg\"")));
  // A file that is written later is listed; one that is no longer there is not.
  fs::remove(path("out/drive.html"));
  ASSERT_EQ(run("render '" + kScene + "' --model fast --random 1 -o " + path("out/one.exr"))  //
                .exit_code,
            0);
  EXPECT_THAT(text_of(path("out/index.html")),
              AllOf(HasSubstr("href=\"one.exr\""), Not(HasSubstr("drive.html"))));
}

TEST_F(Cli, IndexOfSomebodyElseIsLeftAlone) {
  fs::create_directory(path("site"));
  write_text("site/index.html", "<h1>My site</h1>");
  ASSERT_EQ(run("info '" + kScene + "' -o " + path("site")).exit_code, 0);
  EXPECT_EQ(text_of(path("site/index.html")), "<h1>My site</h1>");
  // No page, no index: captures alone need none.
  ASSERT_EQ(run("render '" + kScene + "' --model fast --random 1 -o " + path("one.exr")).exit_code,
            0);
  EXPECT_FALSE(fs::exists(path("index.html")));
}

// The sentence that README says the first fit prints.
TEST_F(Cli, TheFirstFitSaysWhatReadmeSays) {
  const Outcome outcome = run("fit '" SOURCE_DIR "/scenes/tmf8828_wall.json' '" SOURCE_DIR
                              "/scenes/captures/tmf8828_wall.exr' -o '" +
                              path("out") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::size_t from = outcome.out.find("Found at ");
  ASSERT_NE(from, std::string::npos) << outcome.out;
  const std::string headline = outcome.out.substr(from, outcome.out.find('\n', from) - from);
  std::string readme = text_of(SOURCE_DIR "/README.md");
  std::ranges::replace(readme, '\n', ' ');
  EXPECT_THAT(readme, HasSubstr("`" + headline + "`"));
}

// What README shows, as README writes it: who is hit, who is not, and the picture.
TEST_F(Cli, TheDriveThatReadmeShowsIsHitBySightAloneAndNotWithTheSolver) {
  const std::string readme = text_of(SOURCE_DIR "/README.md");
  const std::string begin = "(`blindcorner drive ";
  const std::size_t from = readme.find(begin);
  ASSERT_NE(from, std::string::npos);
  std::string command = readme.substr(from + 2 + std::string("blindcorner ").size());
  command.resize(command.find('`'));
  const auto put = [&](const std::string& what, const std::string& by) {
    const std::size_t at = command.find(what);
    ASSERT_NE(at, std::string::npos) << command;
    command.replace(at, what.size(), by);
  };
  put("scenes/", SOURCE_DIR "/scenes/");
  put("-o out", "-o '" + path("out") + "'");
  const Outcome outcome = run(command);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_EQ(json::parse(text_of(path("out/los/drive.json")))["outcome"], "collision");
  EXPECT_EQ(json::parse(text_of(path("out/solver/drive.json")))["outcome"], "reached");
  EXPECT_THAT(text_of(path("out/drive.svg")), HasSubstr("<animate"));
}

TEST_F(Cli, DriveRefusesWrongFilesAndNamesWithOneLine) {
  const std::string drive = std::string(SOURCE_DIR) + "/scenes/robot_drive.json";
  const auto refused = [&](const std::string& arguments, const std::string& message) {
    const Outcome outcome = run("drive " + arguments + " -o " + path("out"));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(message));
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1);
    EXPECT_FALSE(fs::exists(path("out")));
  };
  refused(path("none.json"), "none.json");
  refused("'" + drive + "' --perception x-ray", "x-ray");
  refused("'" + drive + "' --speed -1", "--speed");
  json wrong = json::parse(text_of(drive));
  wrong["scene"] = std::string(SOURCE_DIR) + "/scenes/robot_corridor.json";
  wrong["perception"]["use"] = "guess";
  std::ofstream(path("wrong.json")) << wrong;
  refused(path("wrong.json"), "perception.use: found \"guess\"");
}

// One line says what the file is and which command takes it, whatever the command was.
TEST_F(Cli, AFileOfAnotherKindIsNamed) {
  const std::string scenes = SOURCE_DIR "/scenes/";
  const std::string drive = scenes + "robot_drive.json", exr = scenes + "captures/tmf8828_wall.exr";
  const std::string out = " -o '" + path("out") + "'";
  const std::string result = write_text("result.json", R"({"format": "blindcorner.result/1"})");
  const std::string instrument =
      write_text("instrument.json", R"({"format": "blindcorner.instrument/1", "patch": {}})");
  const std::string is_drive =
      "robot_drive.json: is a drive file, accepted: a scene file; it is "
      "for `blindcorner drive " +
      drive + " -o DIR`";
  for (const std::string& command :
       {"fit " + drive + " " + exr + out, "render " + drive + " -o " + path("c.exr"),
        "explain " + drive, "info " + drive, "bound " + drive + out, "compare " + drive + out}) {
    expect_refused_beside(run(command), is_drive);
  }
  for (const std::string& command : {"drive " + kScene + out, "trials " + kScene + " -n 1" + out}) {
    expect_refused_beside(run(command), "is a scene file, accepted: a drive file; it is for");
  }
  expect_refused_beside(run("fit " + exr + " " + kScene + out),
                        "is a capture file, accepted: a scene file");
  expect_refused_beside(run("drive " + exr + out), "is a capture file, accepted: a drive file");
  for (const std::string& command :
       {"fit " + kScene + " " + kScene + out, "export " + kScene + out}) {
    expect_refused_beside(run(command), "is a scene file, accepted: a capture file");
  }
  expect_refused_beside(run("evaluate " + kScene), "is a scene file, accepted: a result of fit");
  expect_refused_beside(run("info " + result), "is a result of fit, accepted: a scene file");
  expect_refused_beside(run("fit " + instrument + " " + exr + out), "is an instrument file");
  expect_refused_beside(run("fit " + kScene + " " + exr + " --instrument " + kScene + out),
                        "is a scene file, accepted: an instrument file");
}

// The scene's sensor looks at the wall; the capture says that it was turned around.
TEST_F(Cli, ACapturesOwnSensorPoseIsNamedWhereNoRelayIsSeen) {
  CaptureFile file = read_captures(write_flat("turned.exr"));
  file.captures[0].T_world_sensor = Transform(Eigen::Translation3d(0, 0, 1));
  file.captures[0].T_world_sensor->linear() =
      Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  write_captures(path("turned.exr"), file);
  EXPECT_THAT(run(fit(kScene, path("turned.exr"))).err,
              AllOf(HasSubstr("found no relay surface that the sensor"),
                    HasSubstr("the capture's own sensor pose, at (0, 0, 1) m, looking along (-1, "),
                    HasSubstr("which overrides the scene's")));
}

// Scripts may ask for an exit code that says how the drive ended.
TEST_F(Cli, DriveThatStopsFailsWhereTheGoalIsRequired) {
  json drive = json::parse(text_of(SOURCE_DIR "/scenes/robot_drive.json"));
  drive["scene"] = SOURCE_DIR "/scenes/robot_corridor.json";
  drive["time_limit_s"] = 0.5;
  const std::string command = "drive '" + write_text("late.json", drive.dump()) + "' -o '" +
                              path("out") + "' --perception los --no-page";
  const Outcome usual = run(command);
  EXPECT_EQ(usual.exit_code, 0) << usual.err;
  EXPECT_THAT(usual.out, HasSubstr("timeout"));
  EXPECT_EQ(run(command + " --require-goal").exit_code, 1);
}

/// Small studies of the robot, whose drives without histograms take a fraction of a second.
std::string trials_of_robot(const std::string& output, const std::string& options) {
  return "trials '" + std::string(SOURCE_DIR) + "/scenes/robot_drive.json' -o '" + output +
         "' --perception los,oracle --replays 0 " + options;
}

TEST_F(Cli, TrialsWriteTableAndPage) {
  const Outcome result = run(trials_of_robot(path("study"), "-n 2"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string table = text_of(path("study/trials.csv"));
  EXPECT_THAT(
      table,
      StartsWith("perception,zone,seed,speed_m_per_s,outcome,clearance_m,time_s,length_m,risk,"
                 "present,impact_m_per_s,hardest_braking_m_per_s2\n"));
  EXPECT_EQ(std::ranges::count(table, '\n'), 5);
  // Zones have names with a unit, bars have intervals, and no column is empty: the published study
  // has no robot's speeds, and all drives reach the goal.
  EXPECT_THAT(text_of(path("study/trials.html")),
              AllOf(HasSubstr("Success by speed"), HasSubstr("<td>0.6 m/s<td>"),
                    HasSubstr("class=\"interval\""), Not(HasSubstr("published")),
                    Not(HasSubstr("<td>-<")), Not(HasSubstr("<th>collision<"))));
}

// As many seeds as asked are played, with the numbers of the table; a second run drives none again.
TEST_F(Cli, TrialsPagePlaysTwoPerceptionsOfASeed) {
  ASSERT_EQ(run(trials_of_robot(path("study"), "-n 3 --pairs 2")).exit_code, 0);
  const std::string page = text_of(path("study/trials.html"));
  const std::string begin = "id=\"pairs\">";
  const std::size_t at = page.find(begin) + begin.size();
  const json pairs = json::parse(page.substr(at, page.find("</script>", at) - at))["pairs"];
  ASSERT_EQ(pairs.size(), 2U);
  const std::string table = text_of(path("study/trials.csv"));
  for (const json& pair : pairs) {
    for (const json& replay : pair["drives"]) {
      std::array<char, 32> time{};
      std::snprintf(time.data(), time.size(), ",%.2f,", replay["drive"]["time_s"].get<double>());
      const std::regex row(replay["perception"].get<std::string>() + ",[^,]*," +
                           std::to_string(pair["seed"].get<int>()) + ",.*" + time.data());
      EXPECT_TRUE(std::regex_search(table, row)) << table;
    }
  }
  EXPECT_THAT(run(trials_of_robot(path("study"), "-n 3 --pairs 0")).exit_code, 0);
  EXPECT_THAT(text_of(path("study/trials.html")), HasSubstr("id=\"pairs\""));
}

// The front has a point for each risk, the numbers of the table of costs are those of trials.csv,
// and limits.json is drawn.
TEST_F(Cli, TrialsPageDrawsFrontAndLimits) {
  fs::create_directories(path("study"));
  write_text("study/limits.json",
             R"({"speed_m_per_s": [5, 10, 15], "direct_sight_s": [2, 1.5, 1.2],
                 "stop_s": [1, 1.3, 1.6], "light_s": [3, null, null],
                 "direct_sight_limit_m_per_s": 11.5, "light_limit_m_per_s": null})");
  ASSERT_EQ(run("trials '" + std::string(SOURCE_DIR) +
                "/scenes/crossing_cyclist_drive.json' -n 6 --perception los --risk 0.001,0.1 "
                "--replays 0 --pairs 0 -o '" +
                path("study") + "'")
                .exit_code,
            0);
  int came = 0, hit = 0;
  std::istringstream table(text_of(path("study/trials.csv")));
  std::map<std::string, int> risks;
  std::string line;
  std::getline(table, line);
  while (std::getline(table, line)) {
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    ASSERT_EQ(cells.size(), 12U) << line;
    ++risks[cells[8]];
    if (!cells[8].empty() || cells[9] != "1") continue;
    ++came;
    hit += cells[4] == "collision" ? 1 : 0;
  }
  EXPECT_EQ(risks, (std::map<std::string, int>{{"", 6}, {"0.001", 6}, {"0.1", 6}}));
  ASSERT_GT(came, 0);
  const std::string page = text_of(path("study/trials.html"));
  EXPECT_THAT(
      page, ::testing::ContainsRegex("<tr><td>los<td>0.02<td>[^<]*, " + std::to_string(hit) + "/" +
                                     std::to_string(came) + "<td>"));
  EXPECT_THAT(page, AllOf(HasSubstr("from here direct sight must hit"),
                          HasSubstr("the last moment to brake"),
                          Not(HasSubstr("the light comes too late")), HasSubstr(">0.001</text>")));
  expect_refused_beside(run(trials_of_robot(path("other"), "-n 1 --risk 2")), "--risk");
}

// Pairs of perceptions that were not driven have no row.
TEST_F(Cli, TrialsPageComparesWhatWasDriven) {
  ASSERT_EQ(run(trials_of_robot(path("two"), "-n 1")).exit_code, 0);
  EXPECT_THAT(text_of(path("two/trials.html")),
              AllOf(HasSubstr("<td>oracle - los<td>"), Not(HasSubstr("solver - los")),
                    Not(HasSubstr("cnn"))));
  ASSERT_EQ(run("trials '" + std::string(SOURCE_DIR) + "/scenes/robot_drive.json' -o '" +
                path("one") + "' --perception los --replays 0 -n 1")
                .exit_code,
            0);
  EXPECT_THAT(text_of(path("one/trials.html")), Not(HasSubstr("paired by seed")));
}

TEST_F(Cli, TrialsThatWereKilledGoOnToTheSameBytes) {
  ASSERT_EQ(run(trials_of_robot(path("whole"), "-n 4 --threads 1")).exit_code, 0);
  // Killed once the first trials are on disk, wherever that then happens to be.
  const std::string start = "'" + std::string(PROGRAM) + "' " +
                            trials_of_robot(path("killed"), "-n 4") + " >'" + path("log") +
                            "' 2>&1 & pid=$!; for i in $(seq 600); do [ \"$(wc -l <'" +
                            path("killed/journal.csv") +
                            "' 2>/dev/null || echo 0)\" -ge 3 ] && break; sleep 0.05; done; "
                            "kill -9 $pid; wait $pid 2>/dev/null; true";
  ASSERT_EQ(std::system(start.c_str()), 0);
  ASSERT_EQ(run(trials_of_robot(path("killed"), "-n 4 --threads 2")).exit_code, 0);
  EXPECT_EQ(text_of(path("killed/trials.csv")), text_of(path("whole/trials.csv")));
}

TEST_F(Cli, TrialsRefuseWhatTheyCannotDo) {
  const std::string drive =
      "trials '" + std::string(SOURCE_DIR) + "/scenes/robot_drive.json' -o '" + path("out") + "' ";
  for (const char* options :
       {"-n 0", "--perception x-ray", "--perception los,los", "--light 0", "--perception cnn",
        "--perception cnn --weights /nowhere.pt", "--threads -1", "--error-trials -1"}) {
    SCOPED_TRACE(options);
    expect_refused(run(drive + options));
  }
  json misspelled = json::parse(text_of(std::string(SOURCE_DIR) + "/scenes/robot_drive.json"));
  misspelled["scene"] = std::string(SOURCE_DIR) + "/scenes/robot_corridor.json";
  misspelled["perception"]["delay_s"]["slover"] = 0.1;
  std::ofstream(path("misspelled.json")) << misspelled;
  const Outcome refused =
      run("trials '" + path("misspelled.json") + "' -n 1 -o '" + path("out") + "'");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("perception.delay_s: found \"slover\""));
  ASSERT_EQ(run(trials_of_robot(path("study"), "-n 1")).exit_code, 0);
  const Outcome other = run(trials_of_robot(path("study"), "-n 1 --seed 2"));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("another study (seed differ)"));
}

TEST_F(Cli, ComparesMethodsOnTheSameCaptures) {
  const std::string command = "compare " + kScene +
                              " -n 2 --objects 4 --sensors 1 --conditions 'trained positions' -o " +
                              path("out");
  const Outcome outcome = run(command);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("back-projection"), HasSubstr("multilateration")));
  const json comparison = json::parse(text_of(path("out/comparison.json")));
  EXPECT_EQ(comparison.at("format"), "blindcorner.comparison/2");
  const json& conditions = comparison.at("scenes").at(0).at("conditions");
  ASSERT_EQ(conditions.size(), 1u);
  const json& methods = conditions[0].at("methods");
  ASSERT_EQ(methods.size(), 4u);
  EXPECT_EQ(methods[0].at("method"), "solver");
  EXPECT_EQ(methods[0].at("coverage_95").at("claims"), 2);
  EXPECT_TRUE(methods[1].at("coverage_95").is_null());
  EXPECT_THAT(text_of(path("out/comparison.csv")), HasSubstr("\"middle of the prior\",2,0,"));
  EXPECT_THAT(text_of(path("out/comparison.html")),
              AllOf(HasSubstr("<svg"), Not(HasSubstr("nan"))));
}

TEST_F(Cli, RefusesAComparisonThatMakesNoSense) {
  const auto refuses = [&](const std::string& more, const auto& what) {
    const Outcome outcome = run("compare " + more + " -o " + path("none"));
    EXPECT_EQ(outcome.exit_code, 2) << more;
    EXPECT_THAT(outcome.err, what);
    EXPECT_FALSE(fs::exists(path("none")));
  };
  refuses(kScene + " --conditions tilted",
          AllOf(HasSubstr("found \"tilted\""), HasSubstr("accepted: trained positions")));
  // A beginning that several names share is answered with these.
  refuses(kScene + " --conditions positions",
          HasSubstr("accepted: positions between the grid, positions outside of the grid\n"));
  refuses(std::string(SOURCE_DIR) + "/scenes/street_two.json", HasSubstr("found 2 objects"));
  refuses(kScene + " -n 1", HasSubstr("--captures"));
  refuses(kScene + " --network " + path("missing.pt"), HasSubstr("missing.pt"));
  refuses(kScene + " " + kScene + " --measured " + path("none.exr"), HasSubstr("found 2 scenes"));
  refuses(kScene + " --measured " + path("none.exr") + " --published 0.3",
          HasSubstr("accepted: NAME=RMSE in metres"));
  refuses(kScene + " --folds 3", HasSubstr("--measured"));
}

TEST_F(Cli, BoundsTheErrorToExpect) {
  const std::string command = "bound " + kScene + " --grid 3 --test-poses 20 ";
  const Outcome outcome = run(command + "-o " + path("out"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("An object would be noticed at"));
  const json bound = json::parse(text_of(path("out/bound.json")));
  EXPECT_EQ(bound.at("format"), "blindcorner.bound/1");
  const json& map = bound.at("maps").at(0);
  EXPECT_EQ(map.at("places").size(), map.at("x_m").size() * map.at("y_m").size());
  for (const json& place : map.at("places")) {
    EXPECT_LE(place.at("position_error_m"), 1.001 * map.at("prior_error_m").get<double>());
  }
  const std::string page = text_of(path("out/bound.html"));
  EXPECT_THAT(page, AllOf(HasSubstr("<svg"), Not(HasSubstr("nan"))));
  // Both pictures are as large as the page lets them be, and no title of a column is long.
  std::size_t large = 0;
  for (const char* size : {" width=\"566\"", " height=\"640\""}) {
    for (std::size_t at = page.find(size); at != std::string::npos; at = page.find(size, at + 1)) {
      ++large;
    }
  }
  EXPECT_GE(large, 2U);
  for (std::size_t at = page.find("<th>"); at != std::string::npos;
       at = page.find("<th>", at + 1)) {
    EXPECT_LE(page.find('<', at + 4) - at - 4, 14U) << page.substr(at, 40);
  }
  EXPECT_EQ(run(command + "--pose x=3 -o " + path("none")).exit_code, 2);
  EXPECT_FALSE(fs::exists(path("none")));
}

TEST_F(Cli, ComparesMethodsOnMeasuredCaptures) {
  const std::string scene = std::string(SOURCE_DIR) + "/scenes/cheapspad_mirrors.json";
  ASSERT_EQ(run("render " + scene + " --random 24 --model fast -o " + path("some.exr")).exit_code,
            0);
  const std::string command =
      "compare " + scene + " --measured " + path("some.exr") +
      " --schemes folds --folds 2 --train published --epochs 3 --published other=0.25 -o " +
      path("out");
  const Outcome outcome = run(command);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json comparison = json::parse(text_of(path("out/comparison.json")));
  EXPECT_EQ(comparison.at("published_rmse_m").at("other"), 0.25);
  const json& folds = comparison.at("scenes").at(0).at("conditions").at(0);
  EXPECT_EQ(folds.at("condition"), "2 folds");
  for (const json& method : folds.at("methods")) EXPECT_EQ(method.at("answers"), 24);
  const double solver = folds.at("methods").at(0).at("rmse_m").at("value");
  const double middle = folds.at("methods").at(3).at("rmse_m").at("value");
  EXPECT_LT(solver, 0.6 * middle);
  EXPECT_THAT(text_of(path("out/comparison.html")), HasSubstr("Published elsewhere"));
}

/// What needs libtorch; the rest of `cnn` is there without it.
class CliCnn : public Cli {
 protected:
  void SetUp() override {
    Cli::SetUp();
    if (!fs::exists(fs::path(PROGRAM).replace_filename("libblindcorner_cnn.so"))) {
      GTEST_SKIP() << "this build has no libtorch";
    }
  }

  /// A data set of 3 x 3 places and two sensors.
  std::string dataset(const std::string& name, const std::string& more = "") const {
    EXPECT_EQ(
        run("cnn dataset " + kScene + " --objects 9 --sensors 2 -o " + path(name) + more).exit_code,
        0);
    return path(name);
  }

  std::string train(const std::string& captures, const std::string& name,
                    const std::string& more = "") const {
    return "cnn train " + kScene + " " + captures + " --checkpoint-every 1 -o " + path(name) + more;
  }
};

TEST_F(Cli, CnnDatasetHoldsTruthAndPoses) {
  const std::string make = "cnn dataset " + kScene + " --objects 4 --sensors 2 --exposures 3";
  ASSERT_EQ(run(make + " -o " + path("a")).exit_code, 0);
  ASSERT_EQ(run(make + " --threads 1 -o " + path("b")).exit_code, 0);
  EXPECT_EQ(text_of(path("a/captures.exr")), text_of(path("b/captures.exr")));
  const CaptureFile file = read_captures(path("a/captures.exr"));
  ASSERT_EQ(file.captures.size(), 8U);
  // A grid of 2 x 2 over x 0.15 to 0.38 m and y 0.35 to 0.7 m: corners.
  EXPECT_DOUBLE_EQ(file.captures[0].truth.at("x_m"), 0.15);
  EXPECT_DOUBLE_EQ(file.captures[2].truth.at("x_m"), 0.38);
  EXPECT_DOUBLE_EQ(file.captures[4].truth.at("y_m"), 0.7);
  EXPECT_EQ(file.captures[0].truth.size(), 4U);
  EXPECT_EQ(file.captures[0].exposures, 3);
  ASSERT_TRUE(file.captures[1].T_world_sensor);
  EXPECT_FALSE(file.captures[1].T_world_sensor->isApprox(*file.captures[0].T_world_sensor));
  const json manifest = json::parse(text_of(path("a/dataset.json")));
  EXPECT_EQ(manifest["format"], "blindcorner.dataset/1");
  EXPECT_EQ(manifest["count"], 8);
  EXPECT_EQ(manifest["grid"]["columns"], 2);
  EXPECT_EQ(manifest["sensor_poses"].size(), 2U);
  const Outcome fitted = run("fit " + kScene + " " + path("a") + kQuick + " -o " + path("fit"));
  EXPECT_EQ(fitted.exit_code, 0) << fitted.err;
}

TEST_F(Cli, CnnDatasetRefusesWhatIsNoGrid) {
  const Outcome outcome = run("cnn dataset " + kScene + " --objects 7 -o " + path("a"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("objects: found 7"), HasSubstr("square number")));
  EXPECT_FALSE(fs::exists(path("a")));
}

TEST_F(Cli, CnnWithoutLibtorchSaysHowToGetIt) {
  // The library of the network is looked for beside the program.
  fs::copy_file(PROGRAM, path("blindcorner"));
  write_flat("flat.exr", 4);
  const std::string robot = std::string(SOURCE_DIR) + "/scenes/robot_drive.json";
  for (const std::string& arguments :
       {"cnn train " + kScene + " " + path("flat.exr"),
        "cnn evaluate " + kScene + " " + path("flat.exr") + " " + path("flat.exr"),
        "cnn baseline " + kScene, "compare " + kScene + " --network " + path("flat.exr"),
        "trials " + robot + " --perception cnn --weights " + path("flat.exr"),
        "drive " + robot + " --perception cnn_wide --weights " + path("flat.exr")}) {
    SCOPED_TRACE(arguments);
    const std::string command = "'" + path("blindcorner") + "' " + arguments + " -o " +
                                path("out") + " 2>'" + path("stderr") + "'";
    const int status = std::system(command.c_str());
    EXPECT_EQ(WEXITSTATUS(status), 2);
    const std::string said = text_of(path("stderr"));
    EXPECT_THAT(said, AllOf(HasSubstr("libtorch"), HasSubstr("apt-get install libtorch-dev")));
    EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
    EXPECT_FALSE(fs::exists(path("out")));
  }
}

TEST_F(CliCnn, TrainsAndEvaluates) {
  const std::string captures = dataset("data");
  const Outcome trained = run(train(captures, "net", " --epochs 3"));
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  EXPECT_EQ(trained.err, "");
  EXPECT_THAT(text_of(path("net/training.csv")), StartsWith("epoch,training_loss,validation_loss"));
  EXPECT_THAT(text_of(path("net/training.html")), HasSubstr("<svg"));
  const json training = json::parse(text_of(path("net/training.json")));
  EXPECT_EQ(training["format"], "blindcorner.training/1");
  EXPECT_EQ(training["epochs"], 3);
  EXPECT_EQ(training["validation"]["captures"].size(), 4U);  // a fifth of 18
  EXPECT_TRUE(training["validation"]["errors"].contains("position_m"));
  const std::string evaluate = "cnn evaluate " + kScene + " " + path("net/weights.pt") + " ";
  const Outcome all = run(evaluate + captures + " -o " + path("all"));
  ASSERT_EQ(all.exit_code, 0) << all.err;
  EXPECT_THAT(text_of(path("all/estimates.csv")), StartsWith("source,index,x_m,x_m_estimate"));
  EXPECT_THAT(text_of(path("all/evaluation.html")), HasSubstr("<svg"));
  const Outcome some = run(evaluate + captures + " --held-back -o " + path("some"));
  ASSERT_EQ(some.exit_code, 0) << some.err;
  EXPECT_THAT(text_of(path("some/estimates.csv")), Not(HasSubstr("sigma"))) << "none is claimed";
  const json evaluation = json::parse(text_of(path("some/evaluation.json")));
  EXPECT_EQ(evaluation["captures"], 4);
  EXPECT_EQ(evaluation["errors"], training["validation"]["errors"]);
}

TEST_F(CliCnn, BaselineMakesDataTrainsAndEvaluatesOnce) {
  const std::string command =
      "cnn baseline " + kScene + " --captures 12 --epochs 1 --network wide -o " + path("base");
  const Outcome first = run(command);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.err, StartsWith("blindcorner: step 1 of 3: captures to learn from"));
  EXPECT_TRUE(fs::exists(path("base/errors_wide/evaluation.html")));
  EXPECT_THAT(text_of(path("base/errors_wide/estimates.csv")), HasSubstr(",x_m_sigma,"));
  const auto made = fs::last_write_time(path("base/data_wide/captures.exr"));
  ASSERT_EQ(run(command).exit_code, 0);
  EXPECT_EQ(fs::last_write_time(path("base/data_wide/captures.exr")), made);
  const Outcome other = run("cnn baseline " + std::string(SOURCE_DIR) +
                            "/scenes/tmf8828_floor.json --network wide -o " + path("base"));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("dataset.json: scene"), HasSubstr("tmf8828_wall")));
  // Data of another size or seed are not taken for those that are asked for.
  const Outcome larger =
      run("cnn baseline " + kScene + " --captures 13 --epochs 1 --network wide -o " + path("base"));
  EXPECT_EQ(larger.exit_code, 2);
  EXPECT_THAT(larger.err, HasSubstr("dataset.json: count: found 12, accepted: 13"));
  EXPECT_EQ(run(command + " --seed 2").exit_code, 2);
  // A training that has ended is not trained again, and still says how long it took.
  const json training = json::parse(text_of(path("base/net_wide/training.json")));
  EXPECT_GT(training.at("run_time_s").at("processor").get<double>(), 0);
  EXPECT_GT(training.at("data_run_time_s").at("processor").get<double>(), 0);
}

// A drive file may have a finish line in the place of a route.
TEST_F(CliCnn, BaselineLearnsFromDrives) {
  const Outcome outcome =
      run("cnn baseline " + std::string(SOURCE_DIR) +
          "/scenes/published_detour_drive.json --environments 1 --epochs 1 -o " + path("drives"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(json::parse(text_of(path("drives/data/dataset.json")))["environments"], 1);
  EXPECT_TRUE(fs::exists(path("drives/net/weights.pt")));
}

TEST_F(CliCnn, TrainingGoesOnToTheSameBytes) {
  const std::string captures = dataset("data");
  ASSERT_EQ(run(train(captures, "whole", " --epochs 5")).exit_code, 0);
  ASSERT_EQ(run(train(captures, "parts", " --epochs 2")).exit_code, 0);
  EXPECT_NE(text_of(path("whole/weights.pt")), text_of(path("parts/weights.pt")));
  ASSERT_EQ(run(train(captures, "parts", " --epochs 5 --resume")).exit_code, 0);
  EXPECT_EQ(text_of(path("whole/weights.pt")), text_of(path("parts/weights.pt")));
  EXPECT_EQ(text_of(path("whole/training.csv")), text_of(path("parts/training.csv")));
}

TEST_F(CliCnn, RefusesWhatDoesNotSuitAndWritesNothing) {
  const std::string captures = dataset("data");
  ASSERT_EQ(run(train(captures, "net", " --epochs 1")).exit_code, 0);
  const auto refuses = [&](const std::string& arguments, const auto& matcher) {
    const Outcome outcome = run(arguments + " -o " + path("out"));
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_THAT(outcome.err, matcher);
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(path("out"))) << arguments;
  };
  const std::string floor = std::string(SOURCE_DIR) + "/scenes/tmf8828_floor.json ";
  const std::string street = std::string(SOURCE_DIR) + "/scenes/street_corner.json ";
  const std::string weights = path("net/weights.pt") + " ";
  // Without truth.
  const std::string flat = write_flat("flat.exr", 4);
  refuses("cnn train " + kScene + " " + flat,
          AllOf(HasSubstr("flat.exr capture 0"), HasSubstr("truth.x_m is missing")));
  refuses("cnn evaluate " + kScene + " " + weights + flat, HasSubstr("truth"));
  // Of another sensor, and for another scene.
  refuses("cnn train " + street + captures, HasSubstr("captures.exr"));
  refuses("cnn evaluate " + street + weights + captures,
          AllOf(HasSubstr("weights.pt"), HasSubstr("9 zones of 128 bins"), HasSubstr("64 zones")));
  refuses("cnn evaluate " + floor + weights + captures,
          AllOf(HasSubstr("weights.pt: metadata.unknowns"), HasSubstr("accepted")));
  // Weights that are none, and truncated ones.
  refuses("cnn evaluate " + kScene + " " + kScene + " " + captures,
          HasSubstr("no file of weights"));
  const std::string bytes = text_of(path("net/weights.pt"));
  std::ofstream(path("half.pt"), std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  refuses("cnn evaluate " + kScene + " " + path("half.pt") + " " + captures,
          AllOf(HasSubstr("half.pt"), HasSubstr("truncated")));
  // Counts that are none.
  const auto bad_capture = [&](double count) {
    CaptureFile file = read_captures(captures + "/captures.exr");
    file.captures[5].counts.zone(2)[7] = count;
    write_captures(path("bad.exr"), file);
  };
  const auto named = AllOf(HasSubstr("bad.exr capture 5"), HasSubstr("counts[zone 2][bin 7]"));
  bad_capture(std::numeric_limits<double>::quiet_NaN());
  refuses("cnn train " + kScene + " " + path("bad.exr"), named);
  bad_capture(-3);
  refuses("cnn evaluate " + kScene + " " + weights + path("bad.exr"), named);
}

/// The commands of a page: what is indented as code and begins with a program's name.
std::vector<std::string> commands_of(const std::string& page) {
  std::vector<std::string> commands;
  std::istringstream text(page);
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with("    build/release/blindcorner ") || line.starts_with("    cp ")) {
      commands.push_back(line.substr(4));
    }
  }
  return commands;
}

/// A directory that looks like the repository after it was built.
class CliTutorial : public Cli {
 protected:
  void SetUp() override {
    Cli::SetUp();
    fs::create_directories(path("build/release"));
    fs::create_symlink(PROGRAM, path("build/release/blindcorner"));
    fs::create_symlink(SOURCE_DIR "/scenes", path("scenes"));
  }

  Outcome run_here(const std::string& arguments) const {
    const std::string command =
        "cd '" + directory_.string() + "' && " + arguments + " >out.txt 2>err.txt";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_of(path("out.txt")),
            text_of(path("err.txt"))};
  }
};

TEST_F(CliTutorial, RunsAsItIsWritten) {
  const std::vector<std::string> commands = commands_of(text_of(SOURCE_DIR "/docs/tutorial.md"));
  ASSERT_GE(commands.size(), 11U);
  for (const std::string& command : commands) {
    const Outcome outcome = run_here(command);
    EXPECT_EQ(outcome.exit_code, 0) << command << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, Not(HasSubstr("hint"))) << command;
    if (command.find(" calibrate ") == std::string::npos) continue;
    // What the page promises of the calibration, and why it finds no gains.
    EXPECT_THAT(outcome.out,
                AllOf(HasSubstr("say nothing about the gains"), HasSubstr("not determined, kept")));
    EXPECT_THAT(text_of(path("instrument.html")),
                HasSubstr("The model now explains the captures to within their noise."));
  }
  // One number comes first everywhere: the page's distance of the heaviest mode from the truth.
  const double distance = json::parse(text_of(path("known/evaluation.json")))
                              .at("rows")
                              .at(0)
                              .at("mode_distance_m")
                              .at("median")
                              .get<double>();
  char first[64];
  std::snprintf(first, sizeof first, "heaviest mode to truth: %.4f m\n", distance);
  EXPECT_THAT(text_of(path("out.txt")), HasSubstr(first));
  // The object is where it was put, within what the sentence claims.
  const json result = json::parse(text_of(path("known/result.json")));
  const json& capture = result["captures"][0];
  ASSERT_EQ(result["unknowns"][0], "x_m");
  for (const auto& [i, truth] : std::vector<std::pair<std::size_t, double>>{{0, 0.28}, {1, 0.5}}) {
    EXPECT_NEAR(capture["truth"][i].get<double>(), truth, 1e-6);
    const double sigma = std::sqrt(capture["modes"][0]["covariance"][i][i].get<double>());
    EXPECT_NEAR(capture["modes"][0]["pose"][i].get<double>(), truth, 4 * sigma);
  }
  EXPECT_THAT(text_of(path("out/result.html")),
              AnyOf(HasSubstr("Found at x "), HasSubstr("explain the light")));
}

TEST_F(Cli, ImportTakesTheTruthFromATable) {
  const std::string captures = write_flat("flat.exr", 3);
  const auto import = [&](const std::string& table) {
    return run("import '" + write_npz(captures) + "' -o '" + path("in.exr") + "' --truth '" +
               write_text("truth.csv", table) + "'");
  };
  ASSERT_EQ(import("index,x_m,yaw_deg\n2,0.3,90\n0,0.1,\n").exit_code, 0);
  const CaptureFile file = read_captures(path("in.exr"));
  EXPECT_NEAR(file.captures[2].truth.at("x_m"), 0.3, 1e-9);
  EXPECT_NEAR(file.captures[2].truth.at("yaw_rad"), std::acos(0.0), 1e-9);
  EXPECT_EQ(file.captures[0].truth.count("yaw_rad"), 0U);
  EXPECT_TRUE(file.captures[1].truth.empty());
  for (const auto& [table, reason] :
       std::map<std::string, std::string>{{"x_m\n1\n2\n", "found 2 rows"},
                                          {"x_cm\n1\n2\n3\n", "found column \"x_cm\""},
                                          {"index,x_m\n7,1\n", "accepted: 0 to 2"},
                                          {"x_m\n1\nfar\n3\n", "row 2"}}) {
    fs::remove(path("in.exr"));
    const Outcome outcome = import(table);
    EXPECT_EQ(outcome.exit_code, 2) << table;
    EXPECT_THAT(outcome.err, HasSubstr(reason)) << table;
    EXPECT_FALSE(fs::exists(path("in.exr")));
  }
}

TEST_F(Cli, FitTakesOnlyTheCapturesAskedFor) {
  const std::string captures = write_flat("flat.exr", 6);
  ASSERT_EQ(run(fit(kScene, captures) + " --captures 0-1,4").exit_code, 0);
  const json result = json::parse(text_of(path("out/result.json")));
  std::vector<int> indices;
  for (const json& capture : result["captures"]) indices.push_back(capture["index"]);
  EXPECT_THAT(indices, ElementsAre(0, 1, 4));
  ASSERT_EQ(run(fit(kScene, captures) + " --captures 4-").exit_code, 0);
  EXPECT_EQ(json::parse(text_of(path("out/result.json")))["captures"].size(), 2U);
  for (const char* wrong : {"6", "3-1", "a", "1,,2", "0-9", "-1"}) {
    fs::remove_all(path("out"));
    const Outcome outcome = run(fit(kScene, captures) + " --captures=" + wrong);
    expect_refused(outcome);
    EXPECT_THAT(outcome.err, HasSubstr("places from 0 to 5")) << wrong;
  }
}

TEST_F(Cli, NoOldPageStandsBesideANewResult) {
  const std::string captures = write_flat("flat.exr");
  ASSERT_EQ(run(fit(kScene, captures)).exit_code, 0);
  ASSERT_TRUE(fs::exists(path("out/result.html")));
  write_text("out/evaluation.html", "of the old result");
  ASSERT_EQ(run(fit(kScene, captures) + " --no-page").exit_code, 0);
  EXPECT_FALSE(fs::exists(path("out/result.html")));
  EXPECT_FALSE(fs::exists(path("out/evaluation.html")));
}

TEST_F(Cli, SaysWhatTheUserCannotSee) {
  // The plate behind the wall at x = 0.6 m.
  const Outcome rendered =
      run("render " + kScene + " --model fast --pose x_m=0.9 -o '" + path("behind.exr") + "'");
  EXPECT_EQ(rendered.exit_code, 0) << rendered.err;
  EXPECT_THAT(rendered.err, HasSubstr("The object lies behind the relay surface (wall)"));

  std::string behind = text_of(kScene);
  const std::string range = "\"x_m\": [0.15, 0.38]";
  behind.replace(behind.find(range), range.size(), "\"x_m\": [0.65, 0.9]");
  const std::string position = ", \"position_m\": [0.28, 0.5, 1.05]";
  behind.erase(behind.find(position), position.size());
  const std::string scene = write_text("behind.json", behind);
  const Outcome explained = run("explain '" + scene + "'");
  EXPECT_EQ(explained.exit_code, 0) << explained.err;
  EXPECT_THAT(explained.out,
              AllOf(HasSubstr("All of the search region lies behind"),
                    HasSubstr("No light of an object at this pose"), Not(HasSubstr("e-3"))));
  const Outcome fitted = run(fit(scene, write_flat("flat.exr")));
  EXPECT_THAT(fitted.err, HasSubstr("hint: All of the search region lies behind"));
  const json result = json::parse(text_of(path("out/result.json")));
  EXPECT_THAT(result["captures"][0]["hints"][0].get<std::string>(), HasSubstr("unknowns"));
}

// A terminal is what makes the bar appear; `script` is one.
TEST_F(Cli, ProgressIsShownOnATerminalOnly) {
  const std::string captures = write_flat("flat.exr");
  EXPECT_THAT(run(fit(kScene, captures)).err, Not(HasSubstr("compiling")));
  if (std::system("command -v script >/dev/null") != 0) GTEST_SKIP() << "no script(1)";
  const std::string command = "script -qec \"'" + std::string(PROGRAM) + "' " +
                              fit(kScene, captures) + "\" '" + path("typescript") +
                              "' >/dev/null </dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_THAT(text_of(path("typescript")), HasSubstr("compiling"));
}

/// Runs the program, sends it a signal once `begun` says so (or after a minute), and waits.
int interrupted_run(const std::string& command, const std::function<bool()>& begun) {
  const pid_t child = fork();
  if (child == 0) {
    execl("/bin/sh", "sh", "-c", ("exec " + command).c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  for (int i = 0; i < 600 && !begun(); ++i) usleep(100'000);
  kill(child, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// So many captures that a signal a second after the first of them comes before the last.
TEST_F(Cli, CtrlCKeepsTheCapturesThatAreDone) {
  const std::string captures = write_flat("flat.exr", 3000);
  const std::string command = "'" + std::string(PROGRAM) + "' fit '" + kScene + "' '" + captures +
                              "' -o '" + path("out") + "' --threads 1 2>'" + path("stderr") +
                              "' >/dev/null";
  int waited = 0;
  const int code =
      interrupted_run(command, [&] { return fs::exists(path("out")) && ++waited > 20; });
  ASSERT_EQ(code, 1) << text_of(path("stderr"));
  const json result = json::parse(text_of(path("out/result.json")));
  ASSERT_EQ(result["captures"].size(), 3000U);
  std::size_t done = 0;
  for (const json& capture : result["captures"]) {
    if (capture["error"].is_null()) {
      ++done;
    } else {
      EXPECT_EQ(capture["error"], "not done: interrupted");
    }
  }
  EXPECT_LT(done, 3000U);
  EXPECT_THAT(text_of(path("stderr")),
              HasSubstr("interrupted: " + std::to_string(done) + " of 3000 captures are done"));
}

TEST_F(Cli, CtrlCKeepsTheTrialsThatAreDone) {
  const std::string command = "'" + std::string(PROGRAM) + "' trials " + std::string(SOURCE_DIR) +
                              "/scenes/street_trials_drive.json -n 5000 --perception los "
                              "--threads 1 -o '" +
                              path("out") + "' 2>'" + path("stderr") + "' >/dev/null";
  const int code = interrupted_run(command, [&] { return fs::exists(path("out/trials.csv")); });
  ASSERT_EQ(code, 1) << text_of(path("stderr"));
  EXPECT_THAT(text_of(path("stderr")), HasSubstr("the same command goes on from there"));
  EXPECT_THAT(text_of(path("out/trials.csv")), HasSubstr("\nlos,"));
  EXPECT_THAT(text_of(path("out/trials.html")), HasSubstr("The vehicle reaches its goal"));
}

// Where a command prints a table, other programs read JSON.
TEST_F(Cli, TablesAreJsonForOtherPrograms) {
  const std::string capture = path("c.exr");
  ASSERT_EQ(
      run("render '" + kScene + "' --model fast --photons 20000 -o '" + capture + "'").exit_code,
      0);
  const Outcome fitted = run(fit(kScene, capture) + " --json");
  ASSERT_EQ(fitted.exit_code, 0) << fitted.err;
  EXPECT_EQ(json::parse(fitted.out), json::parse(text_of(path("out/result.json"))));
  const json info = json::parse(run("info '" + kScene + "' '" + capture + "' --json").out);
  EXPECT_EQ(info[0]["scene"]["unknowns"][0]["name"], "x_m");
  EXPECT_EQ(info[0]["scene"]["unknowns"][0]["upper"], 0.38);
  EXPECT_EQ(info[1]["captures"]["rows"], 3);
  const CaptureFile file = read_captures(capture);
  double total = 0;
  for (const double count : file.captures[0].counts.values) total += count;
  EXPECT_NEAR(info[1]["captures"]["captures"][0]["total"].get<double>(), total, 1e-9 * total);
  const json errors =
      json::parse(run("evaluate '" + path("out/result.json") + "' --json --resamples 20").out);
  EXPECT_EQ(errors, json::parse(text_of(path("out/evaluation.json"))));
  const json plan = json::parse(run("explain '" + kScene + "' --poses 2 --json").out);
  EXPECT_EQ(plan["zones"].size(), 9u);
  EXPECT_GT(plan["zones"][0]["direct"].get<double>(), 0);
  const bool reasons = std::ranges::all_of(plan["plan"]["terms"], [](const json& term) {
    return term["reason"].is_string() && term["used"].is_boolean();
  });
  EXPECT_TRUE(reasons && plan["plan"]["terms"].size() > 5);
}

TEST_F(Cli, WrittenTablesAreJsonForOtherPrograms) {
  const auto printed = [&](const std::string& arguments) {
    const Outcome outcome = run(arguments + " --json");
    EXPECT_EQ(outcome.exit_code, 0) << arguments << ": " << outcome.err;
    return json::parse(outcome.out, nullptr, false);
  };
  const std::string out = " -o '" + path("out") + "'";
  const auto written = [&](const char* file) {
    return json::parse(text_of(path(std::string("out/") + file)));
  };
  const std::string drive = " '" SOURCE_DIR "/scenes/robot_drive.json'";
  const json bound = printed("bound '" + kScene + "' --grid 2 --test-poses 8" + out);
  EXPECT_EQ(bound, written("bound.json"));
  const json driven = printed("drive" + drive + " --perception oracle --no-page" + out);
  EXPECT_EQ(driven, written("drive.json"));
  const json shares = printed("trials" + drive + " -n 2 --perception oracle" + out);
  EXPECT_EQ(shares[0]["perception"], "oracle");
  EXPECT_LE(shares[0]["interval_95"][0], shares[0]["share"]);
  // What is written as text with commas is printed as a list of rows.
  const json rows = printed("benchmark derivatives '" + kScene + "' --poses 1" + out);
  EXPECT_EQ(rows[0]["unknown"], "x_m");
  EXPECT_NEAR(rows[5]["movement_m"].get<double>(), 1e-5, 1e-9);
  for (const char* command :
       {"stability", "compare", "calibrate", "crossvalidate", "plan", "cnn train", "cnn evaluate",
        "benchmark solver", "benchmark forward", "benchmark light", "benchmark moving",
        "benchmark planner", "benchmark vehicles", "benchmark drives", "benchmark coverage",
        "benchmark detection"}) {
    EXPECT_THAT(run(std::string(command) + " --help").out, HasSubstr("--json")) << command;
  }
}

// What a shell completes comes from the commands as they declare themselves.
TEST_F(Cli, ShellsCompleteCommandsAndOptions) {
  for (const std::string shell : {"bash", "zsh", "fish"}) {
    const Outcome script = run("completion " + shell);
    EXPECT_EQ(script.exit_code, 0) << script.err;
    std::ofstream(path(shell)) << script.out;
    for (const char* word : {"crossvalidate", "sweep", "pattern", "published-filter"}) {
      EXPECT_THAT(text_of(path(shell)), HasSubstr(word)) << shell;
    }
  }
  EXPECT_EQ(run("completion tcsh").exit_code, 2);
  // Bash itself, with what stands before the cursor.
  std::ofstream(path("try.sh")) << "source '" << path("bash") << "'\n"
                                << "try() { COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); "
                                   "_blindcorner; echo \"${COMPREPLY[*]}\"; }\n"
                                << "try blindcorner cross\ntry blindcorner fit --joi\n"
                                   "try blindcorner benchmark sol\n"
                                   "try blindcorner benchmark solver --swe\n"
                                   "try blindcorner fit file.json cap\n";
  ASSERT_EQ(std::system(("bash '" + path("try.sh") + "' > '" + path("words") + "'").c_str()), 0);
  EXPECT_EQ(text_of(path("words")), "crossvalidate\n--joint\nsolver\n--sweep\n\n");
}

TEST_F(Cli, ManualNamesAllCommands) {
  const Outcome manual = run("man");
  EXPECT_EQ(manual.exit_code, 0);
  EXPECT_THAT(manual.out, StartsWith(".TH BLINDCORNER 1"));
  const std::string help = run("--help").out;
  for (const char* command : {"fit", "render", "import", "benchmark solver", "cnn train"}) {
    EXPECT_THAT(manual.out, HasSubstr(".SS \"blindcorner " + std::string(command) + "\""));
  }
  EXPECT_THAT(manual.out, AllOf(HasSubstr("\\-\\-cache\\-bytes"), HasSubstr("tmf882x: ")));
  // No line of text begins with what roff takes for a request.
  std::istringstream lines(manual.out);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with('.')) continue;
    EXPECT_THAT(line, ::testing::MatchesRegex("\\.(TH|SH|SS|TP|PP|br|B|I)( .*)?")) << line;
  }
}

}  // namespace
}  // namespace blindcorner
