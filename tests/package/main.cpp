// SPDX-License-Identifier: Apache-2.0
/// The shortest program that fits a capture, and drives a car: consumer SCENE CAPTURE.
#include <blindcorner/inverse/fit.h>
#include <blindcorner/io/capture_file.h>
#include <blindcorner/io/scene_file.h>
#include <blindcorner/planner/vehicles/vehicle.h>

#include <iostream>

int main(int /*argc*/, char** argv) {
  const blindcorner::Scene scene = blindcorner::read_scene(argv[1]);
  const blindcorner::Capture capture = blindcorner::read_captures(argv[2]).captures.at(0);
  const blindcorner::FitResult result = blindcorner::fit(scene, capture);
  std::cout << "pose: " << result.posterior.modes.at(0).pose.transpose() << '\n';

  blindcorner::Vehicle car(blindcorner::make_vehicle_model("car"));
  car.step(blindcorner::DriveRequest{.acceleration = 2}, 0.1);
  std::cout << "speed: " << car.state().speed << '\n';
}
