// SPDX-License-Identifier: Apache-2.0
/// Trained networks as perceptions ask them.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/inverse/baseline/cnn.h"
#include "blindcorner/io/drive_file.h"

namespace blindcorner {

/// By the name of the perception that asks it.
using PerceptionNetworks = std::map<std::string, std::shared_ptr<const CnnBaseline>>;

/// Perceptions that need weights.
std::vector<std::string> network_names();
bool is_network(const std::string& perception);
/// The perception that asks this network.
std::string perception_of(const CnnBaseline& network);

/// Files of weights that perceptions need, by the perception's name: those of `files`, each of
/// which says itself whose it is, and else the drive file's. Throws Error, one line, where a
/// perception of the list needs weights and has none, for two files of the same network, and for
/// names in the drive file that need no weights; and as CnnBaseline::load does.
std::map<std::string, std::string> weight_files(const Drive& drive,
                                                const std::vector<std::string>& files,
                                                const std::vector<std::string>& perceptions);

/// Reads them. Throws Error for weights of another network, sensor or search region than the
/// drive's scene has.
PerceptionNetworks load_networks(const Drive& drive,
                                 const std::map<std::string, std::string>& files);

}  // namespace blindcorner
