// SPDX-License-Identifier: Apache-2.0
/// What the page draws beside the answers: histograms, grid and history, a few times a second.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "blindcorner/planner/grid/grid_geometry.h"
#include "live/event_hub.h"
#include "live/mailbox.h"
#include "live/tally.h"
#include "live/tracking_loop.h"

namespace blindcorner::live {

/// The page itself; `input` names the stream.
std::string live_page(const Scene& scene, const std::string& input);

/// Square cells over the search region of the first hidden object, widened on all sides by the
/// reach of the objects: 60 cells along the longer side.
GridGeometry region_grid(const Scene& scene);

/// Draws the newest answer in a thread of its own, so that the tracking loop never waits for it.
class Illustrator {
 public:
  Illustrator(EventHub& hub, const Tally& tally);
  ~Illustrator();
  Illustrator(const Illustrator&) = delete;
  Illustrator& operator=(const Illustrator&) = delete;

  void show(std::shared_ptr<const Answer> answer);
  void tell(const std::string& state);
  /// The first events for a new browser: the history and the current state.
  std::string greeting() const;
  /// State, counts and rate as JSON.
  std::string status() const;

 private:
  void run();
  void draw(const Answer& answer);

  EventHub& hub_;
  const Tally& tally_;
  Mailbox<std::shared_ptr<const Answer>> newest_;
  mutable std::mutex mutex_;
  std::deque<std::string> history_;  ///< JSON of the latest answers, a bounded number
  std::string state_ = "starting";
  std::atomic<double> rate_ = 0;
  std::atomic<bool> end_ = false;
  std::thread thread_;
};

}  // namespace blindcorner::live
