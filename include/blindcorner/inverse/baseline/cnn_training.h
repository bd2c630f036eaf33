// SPDX-License-Identifier: Apache-2.0
/// Training of the learned baseline as published: mean squared error, Adam.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/forward/run_time.h"
#include "blindcorner/inverse/baseline/cnn.h"

namespace blindcorner {

/// The defaults are the published values, except `standardise` and `input_bound`.
struct CnnTrainingOptions {
  CnnArchitecture network = CnnArchitecture::published;
  int epochs = 2000;
  int batch = 16;               ///< captures per step
  double learning_rate = 1e-3;  ///< of Adam
  /// Share of the captures that is held back for validation, drawn at random.
  double validation_share = 0.2;
  /// Training ends after this many epochs without a smaller loss on the captures held back, and the
  /// weights of the smallest loss are kept. 0: all epochs are run, and the last weights are kept.
  int early_stopping = 0;
  /// Whether each bin is standardised over the training captures. Without this, bins enter as
  /// published; on tmf8828_wall the loss then stays that of always answering the middle.
  bool standardise = true;
  /// Number of standard deviations at which standardised values are clipped, > 0; 0: no clipping. A
  /// bin that hardly changed in training changes by hundreds of its deviations when the sensor
  /// moves by a few centimetres, and the network's answer changes with it. On tmf8828_wall, at
  /// sensor poses other than trained, the median error was 16.7 cm without clipping and 11.0 cm
  /// with it (360 epochs).
  double input_bound = 5;
  std::uint64_t seed = 1;        ///< for weights, order of captures and dropout
  std::uint64_t split_seed = 1;  ///< for the choice of captures held back

  /// Options for each network: the defaults for the published network, or those of the ensemble.
  /// For the ensemble, captures with the same truth are held back together. The ensemble learns its
  /// variances until the loss on the captures held back rises, so that loss must not come from
  /// places that the ensemble knows.
  static CnnTrainingOptions of(CnnArchitecture network);

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Losses of one epoch on the normalised outputs. The published network has the mean squared error.
/// The ensemble has the negative logarithm of the Gaussian likelihood, less its constant, as mean
/// over its members.
struct CnnEpoch {
  double training = 0;    ///< mean over the steps, dropout included
  double validation = 0;  ///< on the captures held back; NaN without any
};

struct CnnTrainingResult {
  std::string weights;            ///< contents of the file of weights
  std::vector<CnnEpoch> history;  ///< [epochs that were run]
  int epoch = 0;                  ///< epoch after which the weights were taken, from 1
  RunTime run_time;               ///< of all runs of this training, interrupted ones included
};

/// Functions with which a caller follows or saves a running training.
struct CnnTrainingCallbacks {
  /// Called after each epoch; `number` counts from 1. `make_checkpoint` gives the contents of a
  /// file from which training continues to the same weights.
  std::function<void(int number, const CnnEpoch&,
                     const std::function<std::string()>& make_checkpoint)>
      epoch;
};

/// Indices of the captures that are held back, ascending: the same for the same arguments.
std::vector<std::size_t> validation_captures(std::size_t count, double share, std::uint64_t seed);

/// Indices of the captures that were or will be held back from a network's training, by its record.
std::vector<std::size_t> validation_captures(std::span<const Capture> captures,
                                             const CnnTrainingRecord& record);

/// Throws Error unless the capture is of the scene's sensor and its counts are finite, and not
/// negative where photons are counted. A full bin is valid data for a network.
void check_cnn_capture(const Scene& scene, const Capture& capture);

/// Trains on captures that carry the true values of the scene's unknowns. The same captures and
/// options give the same weights, bit for bit on one machine. `checkpoint`, if not empty, comes
/// from an interrupted training with equal captures and options (the new training may ask for more
/// epochs). Throws Error for captures of another sensor, captures without truth, and captures with
/// counts that are not finite, are negative where the sensor counts photons, or sum to zero. Also
/// throws Error without libtorch.
CnnTrainingResult train_cnn(const Scene& scene, std::span<const Capture> captures,
                            const CnnTrainingOptions& options,
                            const CnnTrainingCallbacks& callbacks = {},
                            const std::string& checkpoint = {});

}  // namespace blindcorner
