// SPDX-License-Identifier: Apache-2.0
/// Trained networks for the perceptions that use them.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/io/drive_file.h"

namespace blindcorner {

/// Networks by the name of the perception that uses them.
using PerceptionNetworks = std::map<std::string, std::shared_ptr<const CnnBaseline>>;

/// Names of the perceptions that need weights.
std::vector<std::string> network_names();
bool is_network(const std::string& perception);
/// Name of the perception that uses this network.
std::string perception_of(const CnnBaseline& network);

/// Files of the weights that perceptions need, by the perception's name. The files come from
/// `files`, each of which names its own network, and otherwise from the drive file. Throws Error,
/// one line, if a perception of the list needs weights and has none, for two files of the same
/// network, and for names in the drive file that need no weights. Also throws as CnnBaseline::load
/// does.
std::map<std::string, std::string> weight_files(const Drive& drive,
                                                const std::vector<std::string>& files,
                                                const std::vector<std::string>& perceptions);

/// Reads the files of weights. Throws Error for weights of another network than the name says, and
/// of another sensor or search region than the drive's scene has.
PerceptionNetworks load_networks(const Drive& drive,
                                 const std::map<std::string, std::string>& files);

}  // namespace blindcorner
