// SPDX-License-Identifier: Apache-2.0
// Whole drives of the robot: what perceptions know when, what happens to frames that fail, and how
// drives end. The corridor's sensor takes some 50 ms a frame.
#include "blindcorner/simulation/drive_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/true_world.h"
#include "bundled.h"
#include "simulation/convex_distance.h"

namespace blindcorner {
namespace {

const Drive& robot_drive() { return bundled_drive("robot"); }

const SimulatedSensor& robot_sensor() {
  static const SimulatedSensor made(robot_drive().scene);
  return made;
}

DriveResult run_drive(const Drive& drive, const std::string& perception, std::uint64_t seed = 1) {
  DriveOptions options;
  options.perception = perception;
  options.seed = seed;
  options.keep_pictures = false;
  return drive_through(drive, robot_sensor(), options);
}

TEST(ConvexDistance, OfSquaresAndLines) {
  const Polygon square{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const Polygon diamond{{3, 0.5}, {4, -0.5}, {5, 0.5}, {4, 1.5}};
  EXPECT_DOUBLE_EQ(convex_distance(square, diamond), 2);
  EXPECT_DOUBLE_EQ(convex_distance(square, {{2, 2}, {3, 3}}), std::sqrt(2.0));
  EXPECT_EQ(convex_distance(square, {{0.5, -1}, {0.5, 2}}), 0);              // through it
  EXPECT_EQ(convex_distance(square, {{0.5, 0.5}}), 0);                       // inside
  EXPECT_DOUBLE_EQ(convex_distance({{0, 0}, {2, 0}}, {{3, 0}, {4, 0}}), 1);  // in line
}

TEST(TrueWorld, MovesOnBeyondTheRegionsBorder) {
  Drive drive = robot_drive();
  drive.truth.components = {TrueComponent{0.4, 0.4}, TrueComponent{1.9, 1.9}};
  drive.truth.velocity[0] = {0.1, 0};
  const TrueWorld world(drive, 1);
  EXPECT_NEAR((*world.hidden(2))[0], 0.6, 1e-12);
  EXPECT_NEAR((*world.hidden(10))[0], 1.4, 1e-12);
  drive.truth.velocity_upper = {{0.2, 0}};
  const double drawn = (*TrueWorld(drive, 1).hidden(1))[0];
  EXPECT_GT(drawn, 0.5);
  EXPECT_LT(drawn, 0.6);
  EXPECT_NE(drawn, (*TrueWorld(drive, 2).hidden(1))[0]);
  drive.truth.present = 0;
  EXPECT_FALSE(TrueWorld(drive, 1).hidden(0));
}

TEST(TrueWorld, VehicleAndObjectMeetWhereTheDriveSays) {
  Drive drive = bundled_drive("crossing_cyclist");
  drive.truth.present = 1;
  drive.truth.meeting->spread = 0;
  const DriveMeeting& meeting = *drive.truth.meeting;
  for (const double speed : {6.0, 15.0}) {
    const TrueWorld world(drive, 3, speed);
    const PoseVector there = *world.hidden(meeting.time);
    EXPECT_NEAR((there.head<2>() - meeting.point).norm(), 0, 1e-9);
    EXPECT_NEAR((world.vehicle_start() - meeting.point).norm(), speed * meeting.time, 1e-9);
  }
}

/// From the vehicle everything stands where it stood: only its map is displaced.
TEST(TrueWorld, BeliefMovesVehicleAndObjectsTogether) {
  Drive drive = robot_drive();
  const TrueWorld exact(drive, 7);
  drive.vehicle.localization_sigma = 0.1;
  drive.vehicle.localization_yaw_sigma = 0.2;
  const TrueWorld world(drive, 7);
  EXPECT_EQ(*world.hidden(0), *exact.hidden(0));
  VehicleState state;
  state.position = {-0.3, 0.5};
  state.yaw = 0.4;
  const VehicleState believed = world.believed(state);
  EXPECT_GT((believed.position - state.position).norm(), 0.01);
  EXPECT_GT(std::abs(believed.yaw - state.yaw), 0.01);
  const auto from = [](const VehicleState& vehicle, const PoseVector& pose) {
    return Eigen::Vector3d(T_world_vehicle(vehicle).inverse() *
                           Eigen::Vector3d(pose[0], pose[1], 0));
  };
  const Eigen::Vector3d seen = from(state, *world.hidden(0));
  EXPECT_LT((from(believed, *world.believed_hidden(state, 0)) - seen).norm(), 1e-12);
  EXPECT_EQ(exact.believed(state).position, state.position);
}

// The cells that are looked at are all that there are to find.
TEST(TrueWorld, WallCellsAreThoseThatWallsReachInto) {
  const TrueWorld world(robot_drive(), 1);
  const GridGeometry& map = robot_drive().map;
  std::vector<bool> found(map.cells());
  for (const Cell& cell : world.wall_cells()) {
    EXPECT_FALSE(found[map.index(cell)]) << "twice";
    found[map.index(cell)] = true;
  }
  for (std::size_t i = 0; i < map.cells(); ++i) {
    const Polygon center{map.center(map.cell(i))};
    const bool reached = std::ranges::any_of(world.walls(), [&](const Polygon& wall) {
      return convex_distance(center, wall) <= map.cell_size * std::sqrt(0.5);
    });
    EXPECT_EQ(found[i], reached) << "cell " << i;
  }
}

TEST(Perception, KnownByNameOnly) {
  const PerceptionSetup setup{robot_drive().scene, robot_drive().motion, {}, [](double) {
                                return std::optional<PoseVector>();
                              }};
  EXPECT_THROW(make_perception("x-ray", setup), Error);
  const auto los = make_perception("los", setup);
  EXPECT_FALSE(los->perceive({}, Transform::Identity(), 0).mixture);
  const auto oracle = make_perception("oracle", setup);
  const auto answer = oracle->perceive({}, Transform::Identity(), 0);
  ASSERT_TRUE(answer.mixture);
  EXPECT_EQ(answer.mixture->presence_probability, 0);
}

TEST(Perception, SolverSaysWhatIsWrongWithAFrame) {
  const PerceptionSetup setup{robot_drive().scene, robot_drive().motion, {}, {}};
  const auto solver = make_perception("solver", setup);
  const auto answer = solver->perceive({}, Transform::Identity(), 0);  // no histograms
  EXPECT_FALSE(answer.mixture);
  EXPECT_FALSE(answer.error.empty());
}

/// It ends where the robot takes the goal to be: off by the error, which it cannot know.
TEST(DriveLoop, ALocalizationErrorDisplacesTheDrive) {
  Drive drive = robot_drive();
  drive.vehicle.localization_sigma = 0.03;
  const DriveResult result = run_drive(drive, "oracle");
  EXPECT_EQ(result.outcome, DriveOutcome::reached);
  const TrueWorld world(drive, 1);
  VehicleState end;
  end.position = result.trace.back().head<2>();
  EXPECT_LE((world.believed(end).position - drive.route.back()).norm(), drive.goal_tolerance);
  EXPECT_GT((world.believed(end).position - end.position).norm(), 0.005);
}

TEST(DriveLoop, OracleReachesTheGoal) {
  const DriveResult result = run_drive(robot_drive(), "oracle");
  EXPECT_EQ(result.outcome, DriveOutcome::reached);
  EXPECT_GT(result.clearance, 0);
  ASSERT_FALSE(result.frames.empty());
  EXPECT_TRUE(result.frames.front().mixture);  // it knows from the first frame on
}

TEST(DriveLoop, LineOfSightKnowsOnlyWhatItSees) {
  const DriveResult result = run_drive(robot_drive(), "los");
  ASSERT_FALSE(result.frames.empty());
  bool sighted = false;
  for (const DriveFrame& frame : result.frames) {
    sighted = sighted || frame.fate == FrameFate::in_sight;
    EXPECT_TRUE(sighted || !frame.mixture) << "at " << frame.time << " s";
  }
  EXPECT_TRUE(sighted);
}

TEST(DriveLoop, SolverFindsTheObjectBeforeItIsInSight) {
  const DriveResult result = run_drive(robot_drive(), "solver");
  double best = 1;
  for (const DriveFrame& frame : result.frames) {
    if (frame.fate != FrameFate::used || !frame.mixture || frame.mixture->modes.empty()) continue;
    EXPECT_EQ(frame.error, "");
    best = std::min(best, (frame.mixture->modes[0].pose - *frame.truth).norm());
  }
  EXPECT_LT(best, 0.1);  // published: 5 to 10 cm
}

TEST(DriveLoop, SameSeedSameDrive) {
  const DriveResult a = run_drive(robot_drive(), "oracle", 3),
                    b = run_drive(robot_drive(), "oracle", 3);
  ASSERT_EQ(a.trace.size(), b.trace.size());
  for (std::size_t i = 0; i < a.trace.size(); ++i) EXPECT_EQ(a.trace[i], b.trace[i]);
}

TEST(DriveLoop, ADelayHoldsAnswersBack) {
  Drive drive = robot_drive();
  drive.delay["oracle"] = 0.5;  // of a frame each 0.2 s
  drive.time_limit = 1.0;
  const DriveResult result = run_drive(drive, "oracle");
  ASSERT_GE(result.frames.size(), 5U);
  EXPECT_FALSE(result.frames[0].mixture && result.frames[0].mixture_age < 0);
  EXPECT_EQ(result.frames[1].fate, FrameFate::busy);
  EXPECT_EQ(result.frames[2].fate, FrameFate::busy);
  EXPECT_EQ(result.frames[3].fate, FrameFate::used);
}

// The solver's answers come after its own run time; meanwhile frames are passed over, not queued.
TEST(DriveLoop, InRealTimeFramesArePassedOverWhileTheSolverIsBusy) {
  Drive drive = robot_drive();
  drive.sensor.rate = 200;
  drive.time_limit = 1.0;
  DriveOptions options;
  options.seed = 1;
  options.real_time = true;
  const DriveResult result = drive_through(drive, robot_sensor(), options);
  bool first = true;
  std::size_t passed = 0;
  for (std::size_t i = 0; i < result.frames.size(); ++i) {
    const DriveFrame& frame = result.frames[i];
    if (frame.fate != FrameFate::used) continue;
    const double ready =
        frame.time + (first ? drive.delay["solver"] : frame.time_ms.perceive / 1000);
    first = false;
    for (std::size_t k = i + 1; k < result.frames.size(); ++k) {
      if (result.frames[k].time + 1e-3 > ready) break;
      EXPECT_EQ(result.frames[k].fate, FrameFate::busy) << k;
      ++passed;
    }
  }
  EXPECT_GT(passed, 0U);
}

TEST(DriveLoop, FramesThatNeverArriveLeaveTheVehicleWaiting) {
  Drive drive = robot_drive();
  drive.sensor.missing_share = 1;
  drive.time_limit = 1;
  const DriveResult result = run_drive(drive, "los");
  for (const DriveFrame& frame : result.frames) EXPECT_EQ(frame.fate, FrameFate::missing);
  EXPECT_EQ(result.outcome, DriveOutcome::timeout);
}

TEST(DriveLoop, LateFramesArriveInOrder) {
  Drive drive = robot_drive();
  drive.sensor.late_share = 0.5;
  drive.sensor.late_by = 0.3;
  const DriveResult result = run_drive(drive, "oracle");
  EXPECT_EQ(result.outcome, DriveOutcome::reached);
}

// Statistics of the map read one frame's; which one does not depend on what else is kept, nor on
// frames that arrive late.
TEST(DriveLoop, KeepsTheMapThatStatisticsRead) {
  Drive drive = robot_drive();
  drive.sensor.late_share = 0.5;
  drive.sensor.late_by = 0.3;
  drive.time_limit = 3;
  DriveOptions options;
  options.perception = "oracle";
  const DriveResult all = drive_through(drive, robot_sensor(), options);
  options.keep_pictures = false;
  options.keep_last_map = true;
  const DriveResult one = drive_through(drive, robot_sensor(), options);
  const DriveFrame* there = last_map(all);
  const DriveFrame* kept = last_map(one);
  ASSERT_NE(there, nullptr);
  ASSERT_NE(kept, nullptr);
  EXPECT_EQ(kept->time, there->time);
  ASSERT_EQ(kept->occupancy.size(), there->occupancy.size());
  EXPECT_EQ(std::memcmp(kept->occupancy.data(), there->occupancy.data(),
                        kept->occupancy.size() * sizeof(double)),
            0);  // bytes: NaN where nothing is known
  const auto maps = [](const DriveResult& result) {
    return std::ranges::count_if(result.frames,
                                 [](const DriveFrame& frame) { return !frame.occupancy.empty(); });
  };
  EXPECT_LT(maps(one), maps(all) / 2);
}

TEST(DriveLoop, NoWayEndsInAStop) {
  Drive drive = robot_drive();
  drive.route = {{-1.5, 3.5}};  // within the inner corner's block
  const DriveResult result = run_drive(drive, "oracle");
  EXPECT_EQ(result.outcome, DriveOutcome::stopped);
  EXPECT_GT(result.clearance, 0);
}

double relative_difference(const HistogramCube& a, const HistogramCube& b) {
  const auto va = Eigen::Map<const Eigen::VectorXd>(a.values.data(), std::ssize(a.values));
  const auto vb = Eigen::Map<const Eigen::VectorXd>(b.values.data(), std::ssize(b.values));
  return (va - vb).norm() / vb.norm();
}

/// The reference renderer at half its density is itself within 0.5 % (L2), which is within the 2 %
/// that a simulated frame may be off.
TEST(SimulatedSensor, AgreesWithTheReferenceRenderer) {
  Transform T = Transform::Identity();
  T.translation() = Eigen::Vector3d(-0.6, 0.4, 0.15);
  const PoseVector pose =
      pose_of(stated_placements(robot_drive().scene), robot_drive().scene.unknowns);
  const SensedLight light = robot_sensor().light(T, pose);
  const auto reference =
      make_reference_renderer(robot_drive().scene, SensorPlacement{T, {}}, reference_sampling(0.5));
  EXPECT_LT(relative_difference(light.three_bounce, reference->three_bounce(pose)), 0.02);
  EXPECT_LT(relative_difference(light.static_background, reference->shadowed_background(pose)),
            0.005);
}

TEST(SimulatedSensor, SamplesElsewhereThanTheFit) {
  const Transform T = robot_drive().scene.T_world_sensor;
  const PoseVector pose =
      pose_of(stated_placements(robot_drive().scene), robot_drive().scene.unknowns);
  const SensedLight light = robot_sensor().light(T, pose);
  const auto fitted = make_fast_model(robot_drive().scene, SensorPlacement{T, {}});
  // Far above rounding: no fit meets its own model in these captures.
  EXPECT_GT(relative_difference(light.three_bounce, fitted->three_bounce(pose)), 1e-4);
  EXPECT_GT(relative_difference(light.static_background, fitted->static_background()), 1e-5);
}

TEST(SimulatedSensor, MoreLightIsMoreSignalOverTheSameDaylight) {
  const Scene& scene = robot_drive().scene;
  const Scene brighter = with_light(scene, 10);
  EXPECT_DOUBLE_EQ(brighter.sensor.radiant_intensity, 10 * scene.sensor.radiant_intensity);
  EXPECT_DOUBLE_EQ(brighter.linear.fixed_ambient, scene.linear.fixed_ambient);
}

// The reference point of a car goes ahead of its rear axle, so that in a turn its front is outside
// of the path. Plans that took the path's direction for the car's touched this cyclist.
TEST(BlindTurn, TheFrontStaysClearOfWhoStandsBesideTheTurn) {
  const Drive drive = bundled_drive("blind_turn");
  DriveOptions options;
  options.perception = "los";
  options.keep_pictures = false;
  options.seed = 10;
  options.speed = 7.138;
  const DriveResult result = drive_through(drive, SimulatedSensor(drive.scene), options);
  EXPECT_EQ(result.outcome, DriveOutcome::reached);
  EXPECT_GT(result.clearance, 0.25);
}

// Without light there is nothing to tell. Through a background ten times as bright the robot's own
// light tells nothing either; what is said with ten times the light is true.
TEST(DriveLoop, ClaimsNothingInTheDarkAndNothingWrongInFog) {
  for (const double light : {1e-6, 1.0, 10.0}) {
    int claims = 0;
    Drive drive = robot_drive();
    drive.scene = with_light(drive.scene, light, 10);
    drive.time_limit = 2;
    const DriveResult result = drive_through(drive, SimulatedSensor(drive.scene), {});
    EXPECT_NE(result.outcome, DriveOutcome::collision);
    for (const DriveFrame& frame : result.frames) {
      if (frame.fate != FrameFate::used || !frame.mixture) continue;
      if (frame.mixture->presence_probability < 0.95) continue;
      ++claims;
      EXPECT_GE(light, 1) << "at " << frame.time << " s";
      const PoseVector off = frame.mixture->modes[0].pose - *frame.truth;
      // chi-squared of three unknowns: 1 of 100,000 is above 26.
      EXPECT_LT(off.dot(frame.mixture->modes[0].covariance.ldlt().solve(off)), 26) << frame.time;
    }
    EXPECT_EQ(claims > 0, light > 1) << light;
  }
}

// Somebody comes; who is told so stops for him, and says it.
TEST(CrossingDrive, WhoKnowsBrakesForTheCyclistAndReachesTheGoal) {
  Drive drive = bundled_drive("crossing_cyclist");
  drive.truth.present = 1;
  const SimulatedSensor street(drive.scene);
  DriveOptions options;
  options.keep_pictures = false;
  options.perception = "oracle";
  options.speed = 14;
  const DriveResult result = drive_through(drive, street, options);
  EXPECT_EQ(result.outcome, DriveOutcome::reached);
  int braking = 0;
  for (const DriveFrame& frame : result.frames) {
    if (frame.braking_for != "cyclist") continue;
    ++braking;
    EXPECT_GT(frame.braking, 0.5);
    EXPECT_LE(frame.braking, 0.9 * 9.81 + 1e-9);
  }
  EXPECT_GE(braking, 5);
  drive.truth.present = 0;
  const DriveResult alone = drive_through(drive, street, options);
  EXPECT_EQ(alone.outcome, DriveOutcome::reached);
  for (const DriveFrame& frame : alone.frames) EXPECT_EQ(frame.braking_for, "") << frame.time;
  EXPECT_LT(alone.time, result.time - 0.5);
}

/// Slowest speed of the vehicle within 10 m of the corner, m/s.
double slowest_at_the_corner(const Drive& drive, const DriveResult& result) {
  double slowest = 1e9;
  for (const DriveFrame& frame : result.frames) {
    const double distance = (frame.vehicle.position - drive.trials.corner).norm();
    if (distance < 10) slowest = std::min(slowest, frame.vehicle.speed);
  }
  return slowest;
}

// With the cyclist in sight the plans of this world turn more quickly than the car steers. One that
// heeds its paths alone touches him at 3 m/s.
TEST(SafeSpeedDrive, StopsForWhatItWouldTouchBesideItsPath) {
  const Drive drive = bundled_drive("street_safe");
  const SimulatedSensor street(drive.scene);
  DriveOptions options;
  options.keep_pictures = false;
  options.perception = "los";
  options.seed = 65;
  options.speed = 8.102;
  const DriveResult result = drive_through(drive, street, options);
  EXPECT_TRUE(result.outcome == DriveOutcome::reached || result.outcome == DriveOutcome::stopped)
      << outcome_word(result.outcome);
  EXPECT_GT(result.clearance, 0.3);
}

TEST(SafeSpeedDrive, WhoKnowsThatNothingIsThereNeedNotSlowDown) {
  Drive drive = bundled_drive("street_safe");
  drive.truth.present = 0;
  const SimulatedSensor street(drive.scene);
  DriveOptions options;
  options.keep_pictures = false;
  options.speed = 12;
  std::map<std::string, DriveResult> results;
  for (const char* perception : {"los", "oracle"}) {
    options.perception = perception;
    results[perception] = drive_through(drive, street, options);
    EXPECT_EQ(results[perception].outcome, DriveOutcome::reached) << perception;
  }
  const double blind = slowest_at_the_corner(drive, results["los"]);
  EXPECT_LT(blind + 0.5, slowest_at_the_corner(drive, results["oracle"]));
  EXPECT_LT(results["oracle"].time, results["los"].time);
  drive.speed_mode = SpeedMode::wanted;  // what the mode costs is all of it
  EXPECT_LT(blind + 0.5, slowest_at_the_corner(drive, drive_through(drive, street, options)));
}

TEST(SafeSpeedDrive, SlowsDownACarThatDoesNotBrakeForCurves) {
  Drive drive = bundled_drive("street_safe");
  drive.truth.present = 0;
  drive.vehicle.brakes_for_curves = false;
  const SimulatedSensor street(drive.scene);
  DriveOptions options;
  options.keep_pictures = false;
  options.speed = 12;
  options.perception = "los";
  const double safe = slowest_at_the_corner(drive, drive_through(drive, street, options));
  drive.speed_mode = SpeedMode::wanted;
  EXPECT_LT(safe + 0.5, slowest_at_the_corner(drive, drive_through(drive, street, options)));
}

Drive published_turn() { return bundled_drive("published_turn"); }

TEST(PublishedDrive, HoldsItsSpeedThroughAnEmptyTurn) {
  Drive drive = published_turn();
  drive.truth.present = 0;
  const SimulatedSensor street(drive.scene);
  DriveOptions options;
  options.keep_pictures = false;
  options.perception = "los";
  options.speed = 8;
  const DriveResult result = drive_through(drive, street, options);
  EXPECT_EQ(result.outcome, DriveOutcome::reached);
  for (const DriveFrame& frame : result.frames) {
    EXPECT_NEAR(frame.vehicle.speed, 8, 0.8) << frame.time;
    EXPECT_EQ(frame.braking_for, "");
    EXPECT_EQ(frame.plan_text, "replan: published");
  }
}

/// The frame of the last map of a drive that is told the truth.
DriveFrame frame_of_last_map(const Drive& drive) {
  const SimulatedSensor sensor(drive.scene);
  DriveOptions options;
  options.keep_pictures = false;
  options.keep_last_map = true;
  options.perception = "oracle";
  const DriveResult result = drive_through(drive, sensor, options);
  const DriveFrame* last = last_map(result);
  return last == nullptr ? DriveFrame{} : *last;
}

/// The cyclist is 0.6 m wide; on the map he is a disc of 1 m, whoever perceives him.
TEST(PublishedDrive, TakesWhatIsHiddenForADisc) {
  for (const bool published : {true, false}) {
    Drive drive = published_turn();
    drive.controller = published ? DriveController::published : DriveController::own;
    drive.truth.components = {TrueComponent{6.5, 6.5}, TrueComponent{27.5, 27.5},
                              TrueComponent{kPi / 2, kPi / 2}};
    const DriveFrame last = frame_of_last_map(drive);
    ASSERT_FALSE(last.occupancy.empty());
    const auto occupied = [&](double x, double y) {
      return last.occupancy[drive.map.index(drive.map.cell_at({x, y}))];
    };
    EXPECT_GT(occupied(6.55, 27.55), 0.9);
    EXPECT_EQ(occupied(7.2, 27.55) > 0.9, published);
  }
}

/// Before a robot a sign 0.2 m wide and 0.3 m high is a disc of 0.18 m: one of 1 m would close the
/// corridor.
TEST(PublishedDrive, TheDiscIsNoLargerThanTheObject) {
  const Drive drive = bundled_drive("published_detour");
  const DriveFrame last = frame_of_last_map(drive);
  ASSERT_FALSE(last.occupancy.empty());
  ASSERT_TRUE(last.truth);
  const Eigen::Vector2d sign = last.truth->head<2>();
  for (const double off : {0.1, 0.3}) {
    const Cell cell = drive.map.cell_at(sign + Eigen::Vector2d(off, 0));
    EXPECT_EQ(last.occupancy[drive.map.index(cell)] > 0.9, off < 0.18) << off;
  }
}

}  // namespace
}  // namespace blindcorner
