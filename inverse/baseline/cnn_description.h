// SPDX-License-Identifier: Apache-2.0
/// Converts captures and poses to the numbers that the network takes and gives, and back.
#pragma once

#include <span>
#include <string>

#include "inverse/baseline/cnn_backend.h"

namespace blindcorner {

/// Format of a file of weights. The number rises when the network or the meaning of its numbers
/// changes.
inline constexpr const char* kCnnFormat = "blindcorner.cnn/2";

/// Description of what a network for these captures takes and gives. The sensor's poses are
/// normalised by their mean and standard deviation.
CnnDescription describe_cnn(const Scene& scene, std::span<const Capture> captures,
                            const CnnTrainingOptions& options);

/// Sets mean and standard deviation of each bin from the captures that will be learnt.
void standardise_inputs(std::span<const Capture* const> captures, CnnDescription& description);

/// A description as the metadata of a file of weights, JSON, and back. `where` names the file in
/// messages.
std::string description_text(const CnnDescription& description);
CnnDescription parse_description(const std::string& text, const std::string& where);

CnnShape shape_of(const CnnDescription& description);

/// Adds one capture to the network's input. Throws Error as CnnBaseline::predict does.
void add_capture(const CnnDescription& description, const Capture& capture,
                 const Transform& T_world_sensor, CnnData& data);

/// What the outputs for one capture say.
struct CnnStatement {
  std::vector<float> mean;     ///< [outputs]
  Eigen::MatrixXd covariance;  ///< [outputs, outputs]; 0 x 0 for the published network
};
/// Moments of the members' mixture, from the `values` of CnnNetwork::evaluate for one capture.
CnnStatement statement_of(const CnnDescription& description, const std::vector<float>& values);

/// Covariance of the pose that follows from that of the outputs.
Eigen::MatrixXd decode_covariance(const CnnDescription& description, const CnnStatement& statement);

/// A pose as the network's outputs [outputs], and back, into the ranges of the unknowns.
std::vector<float> encode_pose(const CnnDescription& description, const PoseVector& pose);
PoseVector decode_pose(const CnnDescription& description, std::span<const float> outputs);

}  // namespace blindcorner
