// SPDX-License-Identifier: Apache-2.0
/// Interface to the library that computes the network. The implementation is a shared library of
/// its own, loaded at the first use: libtorch takes most of a second to load, and a program that
/// does not use a network should not spend that time.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn_training.h"

namespace blindcorner {

/// Number of networks of the ensemble, as in Lakshminarayanan et al. (2017).
inline constexpr int kWideMembers = 5;

struct CnnShape {
  int zones = 0, bins = 0, outputs = 0;
  CnnArchitecture network = CnnArchitecture::published;
};

/// Captures as the network takes them.
struct CnnData {
  std::vector<float> histograms;  ///< [captures][zones][bins]
  std::vector<float> sensors;     ///< [captures][3]
  std::vector<float> targets;     ///< [captures][outputs]; empty where nothing is learnt

  std::size_t count() const { return sensors.size() / 3; }
};

/// A network with its weights, in evaluation mode. Thread safe.
class CnnNetwork {
 public:
  virtual ~CnnNetwork() = default;
  /// Outputs [captures][outputs]. For the ensemble [members][captures][2][outputs], means and
  /// logarithms of variances.
  virtual std::vector<float> evaluate(const CnnData& data) const = 0;
  /// Contents of a file of these weights.
  virtual std::string bytes(const std::string& metadata) const = 0;
};

/// A training that stands between two epochs.
class CnnTrainer {
 public:
  virtual ~CnnTrainer() = default;
  /// Runs epoch `number`. Its random numbers depend only on `number` and the seed.
  virtual CnnEpoch run_epoch(int number) = 0;
  /// Keeps the present weights as the best so far.
  virtual void remember() = 0;
  /// Contents of a file of the present weights, or of the remembered ones.
  virtual std::string weights(const std::string& metadata, bool remembered) const = 0;
  /// Contents of a file that holds this training: present weights, remembered weights, the
  /// optimiser's state.
  virtual std::string checkpoint(const std::string& metadata) const = 0;
};

class CnnBackend {
 public:
  virtual ~CnnBackend() = default;
  /// The text `metadata` of a file of weights. Throws Error for one that is damaged.
  virtual std::string metadata(const std::string& bytes, const std::string& where) const = 0;
  /// Throws Error where names or shapes of the weights are not the network's.
  virtual std::unique_ptr<CnnNetwork> network(const std::string& bytes, const CnnShape& shape,
                                              const std::string& where) const = 0;
  /// Starts with new weights or, if not empty, from the contents of a checkpoint. The first
  /// `training` of the captures are learnt, the others held back. `data` must outlive the trainer.
  virtual std::unique_ptr<CnnTrainer> trainer(const CnnShape& shape, const CnnData& data,
                                              std::size_t training,
                                              const CnnTrainingOptions& options,
                                              const std::string& checkpoint,
                                              const std::string& where) const = 0;
};

/// The one function of the shared library; its name is kCnnBackendFunction.
using CnnBackendFunction = const CnnBackend* (*)();
inline constexpr const char* kCnnBackendFunction = "blindcorner_cnn_backend";

/// The backend; null if it cannot be loaded.
const CnnBackend* find_cnn_backend();
/// The backend. Throws Error that says how to get it.
const CnnBackend& cnn_backend();

}  // namespace blindcorner
