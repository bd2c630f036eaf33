// SPDX-License-Identifier: Apache-2.0
/// From captures and poses to the numbers that the network takes and puts out, and back.
#pragma once

#include <span>
#include <string>

#include "inverse/baseline/cnn_backend.h"

namespace blindcorner {

/// "blindcorner.cnn/2": rises when the network or the meaning of its numbers changes.
inline constexpr const char* kCnnFormat = "blindcorner.cnn/2";

/// What a network for these captures takes and puts out. The sensor's poses are normalised by their
/// mean and standard deviation.
CnnDescription describe_cnn(const Scene& scene, std::span<const Capture> captures,
                            const CnnTrainingOptions& options);

/// Sets mean and standard deviation of each bin from the captures that will be learnt.
void standardise_inputs(std::span<const Capture* const> captures, CnnDescription& description);

/// The metadata of a file of weights, JSON, and back. `where` names the file in messages.
std::string description_text(const CnnDescription& description);
CnnDescription parse_description(const std::string& text, const std::string& where);

CnnShape shape_of(const CnnDescription& description);

/// Adds one capture to what the network takes. Throws Error as CnnBaseline::predict does.
void add_capture(const CnnDescription& description, const Capture& capture,
                 const Transform& T_world_sensor, CnnData& data);

/// What the outputs for one capture say.
struct CnnStatement {
  std::vector<float> mean;     ///< [outputs]
  Eigen::MatrixXd covariance;  ///< [outputs, outputs]; 0 x 0 of the published network
};
/// `values` of CnnNetwork::evaluate for one capture: the moments of the members' mixture.
CnnStatement statement_of(const CnnDescription& description, const std::vector<float>& values);

/// The covariance of the outputs as one of the pose.
Eigen::MatrixXd decode_covariance(const CnnDescription& description, const CnnStatement& statement);

/// A pose as the network's outputs [outputs], and back, into the ranges of the unknowns.
std::vector<float> encode_pose(const CnnDescription& description, const PoseVector& pose);
PoseVector decode_pose(const CnnDescription& description, std::span<const float> outputs);

}  // namespace blindcorner
