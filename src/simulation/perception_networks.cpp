// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/perception_networks.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/forward/error.h"
#include "io/json_reader.h"
#include "simulation/network_perception.h"

namespace blindcorner {
namespace {

/// Tolerance for ranges that went through a file as text.
constexpr double kSameBound = 1e-9;  // m, rad or 1

std::string range_text(double lower, double upper) {
  return std::to_string(lower) + " to " + std::to_string(upper);
}

/// Refuses a network for another search region: it answers within the one that it was trained for.
void check_region(const CnnBaseline& network, const Scene& scene, const std::string& file) {
  const std::vector<CnnUnknown>& learnt = network.description().unknowns;
  for (std::size_t i = 0; i < learnt.size(); ++i) {
    const Unknown& wanted = scene.unknowns[i];
    if (std::abs(learnt[i].lower - wanted.lower) <= kSameBound &&
        std::abs(learnt[i].upper - wanted.upper) <= kSameBound) {
      continue;
    }
    throw Error(file + ": metadata.unknowns." + learnt[i].name,
                "found " + range_text(learnt[i].lower, learnt[i].upper) + " (trained for " +
                    network.description().scene + "), accepted: " + scene.name + "'s " +
                    range_text(wanted.lower, wanted.upper));
  }
}

}  // namespace

std::map<std::string, std::string> weight_files(const Drive& drive,
                                                const std::vector<std::string>& files,
                                                const std::vector<std::string>& perceptions) {
  std::map<std::string, std::string> named;
  for (const std::string& file : files) {
    const auto [entry, first] = named.emplace(perception_of(CnnBaseline::load(file)), file);
    if (!first) {
      throw Error("--weights", "found " + entry->second + " and " + file + ", both of " +
                                   entry->first + ", accepted: one file of each network");
    }
  }
  for (const auto& [name, file] : drive.weights) {
    const std::string field = drive.path + ": perception.weights";
    if (!is_network(name)) {
      throw Error(field, "found \"" + name + "\", accepted: " + list_words(network_names()));
    }
    named.emplace(name, file);
  }
  std::map<std::string, std::string> wanted;
  for (const std::string& name : perceptions) {
    if (!is_network(name)) continue;
    if (!named.contains(name)) {
      throw Error("--perception", name +
                                      " has no weights, accepted: --weights FILE of cnn train, "
                                      "or perception.weights." +
                                      name + " in " + drive.path);
    }
    wanted[name] = named[name];
  }
  return wanted;
}

PerceptionNetworks load_networks(const Drive& drive,
                                 const std::map<std::string, std::string>& files) {
  PerceptionNetworks networks;
  for (const auto& [name, file] : files) {
    auto network = std::make_shared<const CnnBaseline>(CnnBaseline::load(file));
    if (perception_of(*network) != name) {
      throw Error(
          file, "found the network of " + perception_of(*network) + ", accepted: that of " + name);
    }
    network->check_scene(drive.scene);
    check_region(*network, drive.scene, file);
    networks[name] = std::move(network);
  }
  return networks;
}

}  // namespace blindcorner
