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

/// Defaults are the published ones.
struct CnnTrainingOptions {
  CnnArchitecture network = CnnArchitecture::published;
  int epochs = 2000;
  int batch = 16;               ///< captures of a step
  double learning_rate = 1e-3;  ///< of Adam
  /// Share of the captures that is held back, drawn at random.
  double validation_share = 0.2;
  /// Training ends after so many epochs without a smaller loss on the captures held back, and the
  /// weights of the smallest are kept. 0: all epochs are run, and the last weights are kept.
  int early_stopping = 0;
  /// Whether each bin is standardised over the captures that are learnt. Without, they enter
  /// as published; on tmf8828_wall the loss then stays that of always answering the middle.
  bool standardise = true;
  /// Standard deviations at which standardised values are clipped, > 0; 0: they are not. A bin that
  /// hardly changed in training changes by hundreds of its deviations when the sensor moves by a
  /// few centimetres, and the network's answer with it: on tmf8828_wall, elsewhere than trained,
  /// the median error was 16.7 cm without, 11.0 cm with it (360 epochs).
  double input_bound = 5;
  std::uint64_t seed = 1;        ///< of weights, order of captures and dropout
  std::uint64_t split_seed = 1;  ///< of which captures are held back

  /// What each network is trained with: the published values, or those of the ensemble, of which
  /// captures with the same truth are held back together: its variances are learnt until the loss
  /// on what was held back rises, which must not be of places that it knows.
  static CnnTrainingOptions of(CnnArchitecture network);

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Losses of one epoch, of the normalised outputs: mean squared error; of the ensemble the negative
/// logarithm of the Gaussian likelihood, less its constant, mean over its members.
struct CnnEpoch {
  double training = 0;    ///< mean over the steps, dropout included
  double validation = 0;  ///< over the captures held back; NaN without any
};

struct CnnTrainingResult {
  std::string weights;            ///< contents of the file of weights
  std::vector<CnnEpoch> history;  ///< [epochs that were run]
  int epoch = 0;                  ///< after which the weights were taken, from 1
  RunTime run_time;               ///< all runs that led here, interrupted ones included
};

/// What a caller may want to know or keep while training runs.
struct CnnTrainingCallbacks {
  /// After each epoch, `number` from 1; `make_checkpoint` gives the contents of a file from which
  /// training goes on to the same weights.
  std::function<void(int number, const CnnEpoch&,
                     const std::function<std::string()>& make_checkpoint)>
      epoch;
};

/// Places of the captures that are held back, ascending: the same for the same arguments.
std::vector<std::size_t> validation_captures(std::size_t count, double share, std::uint64_t seed);

/// Those that a network was trained without, or will be: as its record says.
std::vector<std::size_t> validation_captures(std::span<const Capture> captures,
                                             const CnnTrainingRecord& record);

/// Throws Error unless the capture is of the scene's sensor and its counts are finite, and not
/// negative where photons are counted. A bin that is full is data to a network.
void check_cnn_capture(const Scene& scene, const Capture& capture);

/// Trains on captures that carry the true values of the scene's unknowns. The same captures and
/// options give the same weights, bit for bit on one machine. `checkpoint`, if not empty, is what
/// an interrupted training with equal captures and options left behind (it may ask for more
/// epochs). Throws Error for captures of another sensor, without truth, or with counts that are not
/// finite, are negative where the sensor counts photons, or sum to zero; and without libtorch.
CnnTrainingResult train_cnn(const Scene& scene, std::span<const Capture> captures,
                            const CnnTrainingOptions& options,
                            const CnnTrainingCallbacks& callbacks = {},
                            const std::string& checkpoint = {});

}  // namespace blindcorner
