// SPDX-License-Identifier: Apache-2.0
/// The learned baseline: the published 1D convolutional network, or an ensemble of wider ones, from
/// a capture's histograms and the sensor's pose to the pose of the hidden object. It needs
/// libtorch, which is loaded when it is asked for: programs that do not ask for it start without
/// it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/pose_mixture.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

enum class CnnArchitecture {
  published,  ///< one network, which states a pose
  /// A deep ensemble (Lakshminarayanan et al. 2017): wider networks from different starts, each of
  /// which states a pose and its variance.
  wide
};
/// "published", "wide".
std::string cnn_architecture_name(CnnArchitecture architecture);
std::vector<std::string> cnn_architecture_names();
/// Throws Error naming `where` for another name.
CnnArchitecture parse_cnn_architecture(const std::string& name, const std::string& where);

/// One unknown as the network learns it.
struct CnnUnknown {
  std::string name;   ///< as results name it: "x_m", "yaw_rad"
  double lower = -1;  ///< m, rad or 1
  double upper = 1;   ///< m, rad or 1
  /// > 0: the range covers a whole turn of the object's symmetry, rad. Such an angle has no ends,
  /// so cosine and sine of the turn are learnt (two outputs). 0: the range is mapped to [-1, 1].
  double period = 0;
};

/// How a network was trained; for the reader of its file, and to find the captures held back again.
struct CnnTrainingRecord {
  int captures = 0;  ///< of which `validation_share` were held back
  double validation_share = 0.2;
  std::uint64_t split_seed = 1;
  std::uint64_t seed = 1;
  int epoch = 0;  ///< after which these weights were taken
  /// Captures with the same truth were held back together, or each by itself.
  bool split_by_truth = false;
};

/// All that is known about a network besides its weights: the JSON text of its file.
struct CnnDescription {
  CnnArchitecture network = CnnArchitecture::published;
  std::string scene;
  int zones = 0, bins = 0;
  double bin_width = 0;  ///< s
  /// A capture's counts are divided by their sum and multiplied by this.
  double input_scale = 1;
  /// [zones * bins] of the captures that were learnt, after that; each bin enters as its difference
  /// from the mean over the standard deviation. Empty: as it is.
  std::vector<double> input_mean, input_deviation;
  /// Standardised values, of bins and of the sensor's pose, are clipped at this many standard
  /// deviations to either side. 0: they are not.
  double input_bound = 0;
  /// x (m), y (m) and yaw (rad) of the sensor enter as (value - center) / scale.
  Eigen::Vector3d sensor_center = Eigen::Vector3d::Zero();
  Eigen::Vector3d sensor_scale = Eigen::Vector3d::Ones();
  std::vector<CnnUnknown> unknowns;
  CnnTrainingRecord training;

  /// Numbers that the network puts out: one for each unknown, two for a whole turn.
  int outputs() const;
};

class CnnNetwork;

/// A trained network. Copies share their weights.
class CnnBaseline {
 public:
  /// Whether libtorch was there when this was built and can be loaded.
  static bool available();

  /// Reads a file of weights (docs/cnn.md). Throws Error, one line, for a file that is missing,
  /// truncated, of another network or version, and without libtorch.
  static CnnBaseline load(const std::string& path);
  /// The same from the file's contents; `where` names them in messages.
  static CnnBaseline parse(const std::string& bytes, const std::string& where);

  /// Contents of a file of weights, which `load` and PyTorch's torch.load read.
  std::string bytes() const;

  /// Pose of the hidden object from one capture taken at a pose of the sensor, within the ranges of
  /// the unknowns. Thread safe. Throws Error for a capture of another sensor, and one whose
  /// counts are not finite or do not sum to more than zero.
  PoseVector predict(const Capture& capture, const Transform& T_world_sensor) const;

  /// The same with what the network claims of its error: one mode, present for certain. Of the
  /// published network, which claims nothing, covariances are empty (0 x 0); of the ensemble they
  /// hold the variances that its members state and their differences from each other.
  PoseMixture posterior(const Capture& capture, const Transform& T_world_sensor) const;

  /// Throws Error naming the file unless the network suits the scene: zones, bins and their width,
  /// unknowns.
  void check_scene(const Scene& scene) const;

  const CnnDescription& description() const { return description_; }

 private:
  CnnBaseline() = default;

  std::string where_;
  CnnDescription description_;
  std::shared_ptr<const CnnNetwork> network_;
};

}  // namespace blindcorner
