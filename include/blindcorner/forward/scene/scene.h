// SPDX-License-Identifier: Apache-2.0
/// Everything that is known before a capture is evaluated.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/pose.h"
#include "blindcorner/forward/scene/shape.h"
#include "blindcorner/forward/sensor/sensor.h"

namespace blindcorner {

/// A known surface. A relay surface scatters light to the hidden side; an occluder blocks light. A
/// surface may be both. Every surface gives a direct return.
struct Surface {
  std::string name;
  Shape shape;
  /// Transforms the shape's own centred axes to the world (rectangle: x normal, z up).
  Transform T_world_surface = Transform::Identity();
  double albedo = 0.5;  ///< 0..1, Lambertian
  bool relay = false;
  bool occluder = false;
};

struct LambertianMaterial {};
/// Reflects light back to where it came from, in a Gaussian lobe.
struct RetroreflectiveMaterial {
  double lobe_sigma = 0.017;  ///< rad, standard deviation per axis
};
/// A small object that sends light back to the relay spot it came from. Its brightness was measured
/// instead of derived: cos^n / (d / 1 m)^m, where d is the distance from the spot to the object's
/// position and cos the cosine to the law's axis. The axis is the relay's normal unless the object
/// faces a little aside. The law is for zones that are spots on a relay (confocal, or a
/// retroreflector under any light), and for a single object. The object's shape is for drawing
/// only.
struct MeasuredLawMaterial {
  double cosine_exponent = 2.0;    ///< n
  double distance_exponent = 4.0;  ///< m
  /// Tangents of the axis against the relay's normal, along the relay's surface_axes (relay.h).
  double axis_across = 0.0, axis_up = 0.0;
};
/// How a surface scatters light: its bidirectional reflectance distribution function.
class Brdf {
 public:
  virtual ~Brdf() = default;
  /// Share of the light from `in` that leaves towards `out`, 1/sr, at an albedo of 1 (Lambertian:
  /// 1/pi). Unit vectors away from the surface, on the side of the `normal`. The same where `in`
  /// and `out` change places (Helmholtz reciprocity). Thread safe.
  virtual double value(const Eigen::Vector3d& normal, const Eigen::Vector3d& in,
                       const Eigen::Vector3d& out) const = 0;
  /// Standard deviation of its narrowest lobe, rad; pi / 2 without one. Relay and object are
  /// sampled by it.
  virtual double narrowest_lobe() const = 0;
};
/// Any material that has a BRDF. Its light is a sum over pairs of a way in and a way out, which
/// takes longer than the sums for the materials above.
struct BrdfMaterial {
  std::string name;
  std::shared_ptr<const Brdf> brdf;
};
using Material =
    std::variant<LambertianMaterial, RetroreflectiveMaterial, MeasuredLawMaterial, BrdfMaterial>;

/// "Lambertian", "retroreflective", "measured law", or the name of a material with a BRDF.
std::string material_name(const Material& material);

struct HiddenObject {
  std::string name = "object";
  Shape shape;
  Anchor anchor = Anchor::center;
  Placement placement;  ///< known components, and default values of the unknown ones for rendering
  Material material;
  double albedo = 0.5;  ///< Lambertian albedo or retroreflectance, 0..1
};

/// How a linear unknown is treated.
enum class LinearMode { fixed, shared, per_zone };

/// Log-normal prior of the amplitude.
struct AmplitudePrior {
  double median = 1.0;
  double sigma_log = 1.5;
};

/// Linear unknowns of the model gain * (a S + b static) + ambient. A free b also scales the zones'
/// measured background.
struct LinearUnknowns {
  LinearMode amplitude = LinearMode::shared;
  double fixed_amplitude = 1.0;
  AmplitudePrior amplitude_prior;
  LinearMode ambient = LinearMode::per_zone;  ///< fixed or per_zone
  double fixed_ambient = 0.0;                 ///< counts per bin
  /// [zones] prior of the ambient light where it is per_zone, counts per bin; empty: unknown.
  std::vector<NormalPrior> ambient_prior;
  LinearMode direct = LinearMode::fixed;  ///< fixed or per_zone: scale of the static return
  double fixed_direct = 1.0;              ///< 0: the static return is absent from captures
};

struct Scene {
  std::string name;
  std::string path;  ///< file that the scene was read from, for messages; may be empty
  Sensor sensor;
  Transform T_world_sensor = Transform::Identity();
  std::optional<Eigen::Matrix<double, 6, 6>> sensor_covariance;  ///< x, y, z (m), rotation (rad)
  std::vector<Surface> surfaces;
  HiddenObject hidden;
  std::vector<HiddenObject> further_hidden;  ///< more hidden objects; usually none
  std::vector<Unknown> unknowns;
  LinearUnknowns linear;
  double presence_prior = 0.5;  ///< prior probability that an object is present
  /// Probability that something which the scene does not model disturbs a capture. Mean and
  /// covariance of the posterior are mixed with those of the prior in this share.
  double outlier_probability = 0.0;
};

/// Number of hidden objects, and one of them: index 0 is `hidden`, then `further_hidden` follow.
int object_count(const Scene& scene);
const HiddenObject& hidden_object(const Scene& scene, int object);

/// Placements of all hidden objects: at a pose, and as the scene itself states them.
std::vector<Placement> placements_at(const Scene& scene, const PoseVector& pose);
std::vector<Placement> stated_placements(const Scene& scene);

/// The scene's file, or its name where it has no file. Messages begin with it.
std::string scene_place(const Scene& scene);

/// The scene with one of its hidden objects alone: that object and its unknowns only.
Scene only_object(const Scene& scene, int object);

/// Name of an unknown with its unit: "x_m"; with several objects "front.x_m".
std::string unknown_name(const Scene& scene, const Unknown& unknown);

/// Names of the unknowns in order.
std::vector<std::string> unknown_names(const Scene& scene);

/// Period of each unknown: for yaw the symmetry of its object's shape, rad; else 0.
std::vector<double> periods(const Scene& scene);

/// Estimate minus truth. For yaw, the shortest way around, modulo the symmetry of the shape.
PoseVector pose_error(const Scene& scene, const PoseVector& estimate, const PoseVector& truth);

}  // namespace blindcorner
