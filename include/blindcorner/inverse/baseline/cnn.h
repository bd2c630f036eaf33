// SPDX-License-Identifier: Apache-2.0
/// The learned baseline: the published 1D convolutional network, or an ensemble of wider ones. It
/// maps a capture's histograms and the sensor's pose to the pose of the hidden object. It needs
/// libtorch, which is loaded when it is asked for: programs that do not ask for it start without
/// libtorch.
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
  published,  ///< one network that states a pose
  /// A deep ensemble (Lakshminarayanan et al. 2017): wider networks from different starts. Each
  /// states a pose and its variance.
  wide
};
/// "published", "wide".
std::string cnn_architecture_name(CnnArchitecture architecture);
std::vector<std::string> cnn_architecture_names();
/// Throws Error that names `where` for any other name.
CnnArchitecture parse_cnn_architecture(const std::string& name, const std::string& where);

/// One unknown as the network learns it.
struct CnnUnknown {
  std::string name;   ///< as in results: "x_m", "yaw_rad"
  double lower = -1;  ///< m, rad or 1
  double upper = 1;   ///< m, rad or 1
  /// > 0: the range covers a whole turn of the object's symmetry, rad. Such an angle has no ends,
  /// so the network learns cosine and sine of the turn (two outputs). 0: the range is mapped to
  /// [-1, 1].
  double period = 0;
};

/// How a network was trained. The record informs readers of the network's file, and it identifies
/// the captures that were held back.
struct CnnTrainingRecord {
  int captures = 0;  ///< all captures; the share `validation_share` was held back
  double validation_share = 0.2;
  std::uint64_t split_seed = 1;
  std::uint64_t seed = 1;
  int epoch = 0;  ///< epoch after which these weights were taken
  /// True: captures with the same truth were held back together. False: each by itself.
  bool split_by_truth = false;
};

/// Everything that is known about a network besides its weights: the JSON text of its file.
struct CnnDescription {
  CnnArchitecture network = CnnArchitecture::published;
  std::string scene;
  int zones = 0, bins = 0;
  double bin_width = 0;  ///< s
  /// A capture's counts are divided by their sum and multiplied by this factor.
  double input_scale = 1;
  /// [zones * bins] mean and standard deviation of the scaled bins over the training captures. Each
  /// bin enters as its difference from the mean over the standard deviation. Empty: as it is.
  std::vector<double> input_mean, input_deviation;
  /// Standardised values, of bins and of the sensor's pose, are clipped at this many standard
  /// deviations to either side. 0: no clipping.
  double input_bound = 0;
  /// The sensor's x (m), y (m) and yaw (rad) enter as (value - center) / scale.
  Eigen::Vector3d sensor_center = Eigen::Vector3d::Zero();
  Eigen::Vector3d sensor_scale = Eigen::Vector3d::Ones();
  std::vector<CnnUnknown> unknowns;
  CnnTrainingRecord training;

  /// Number of outputs of the network: one for each unknown, two for a whole turn.
  int outputs() const;
};

class CnnNetwork;

/// A trained network. Copies share their weights.
class CnnBaseline {
 public:
  /// Whether libtorch was present when this was built and can be loaded.
  static bool available();

  /// Reads a file of weights (docs/cnn.md). Throws Error, one line, for a file that is missing,
  /// truncated, or of another network or version. Also throws Error without libtorch.
  static CnnBaseline load(const std::string& path);
  /// The same from the file's contents; `where` names them in messages.
  static CnnBaseline parse(const std::string& bytes, const std::string& where);

  /// Contents of a file of weights. `load` and PyTorch's torch.load read such a file.
  std::string bytes() const;

  /// Pose of the hidden object, within the ranges of the unknowns, from one capture taken at a pose
  /// of the sensor. Thread safe. Throws Error for a capture of another sensor, and for a capture
  /// whose counts are not finite or do not sum to more than zero.
  PoseVector predict(const Capture& capture, const Transform& T_world_sensor) const;

  /// The same with the error that the network states: one mode, present for certain. The published
  /// network states no error, so its covariances are empty (0 x 0). The ensemble's covariances
  /// combine the variances that its members state with the members' differences from each other.
  PoseMixture posterior(const Capture& capture, const Transform& T_world_sensor) const;

  /// Throws Error that names the file unless the network suits the scene: zones, bins, bin width
  /// and unknowns.
  void check_scene(const Scene& scene) const;

  const CnnDescription& description() const { return description_; }

 private:
  CnnBaseline() = default;

  std::string where_;
  CnnDescription description_;
  std::shared_ptr<const CnnNetwork> network_;
};

}  // namespace blindcorner
