// SPDX-License-Identifier: Apache-2.0
/// Frames in, answers out: the loop of `blindcorner live`.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/inverse/fit.h"
#include "blindcorner/inverse/tracking/tracker.h"
#include "live/frames.h"
#include "live/mailbox.h"
#include "live/tally.h"

namespace blindcorner::live {

/// What is known after one frame.
struct Answer {
  FitResult result;
  double time = 0;            ///< s, from the first frame to this one
  long frame = 0;             ///< Frame::number
  long skipped = 0;           ///< frames passed over since the answer before
  Clock::time_point arrived;  ///< of the frame's last byte
  double rate = 0;            ///< answers/s, over the last second or so
  std::shared_ptr<const Scene> scene;
};

/// One JSON object: an element of `captures` as in result.json, with `time_s`, `frame`, `skipped`
/// and `latency_ms` (from the last byte to this call).
std::string answer_line(const Answer& answer);
/// The line before all answers.
std::string header_line(const Scene& scene);

struct LoopOptions {
  /// Seconds at the beginning in which the scene is empty. Their frames calibrate the static
  /// background, the ambient light and the noise. 0: none.
  double empty_first = 0;
  double most_per_second = 0;  ///< answers per second; 0: as many as possible
  /// Fits every frame in turn, and takes frames to be the scene's frame interval apart. Otherwise
  /// the newest frame is fitted, and the times of arrival say how far frames are apart.
  bool every_frame = false;
  long most_answers = 0;  ///< after which the loop ends; 0: it goes on

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// What the loop is doing: "waiting for frames", "calibrating on 48 empty frames", "tracking".
using TellState = std::function<void(const std::string&)>;

class TrackingLoop {
 public:
  TrackingLoop(Scene scene, const Motion& motion, FitOptions fit, LoopOptions options,
               Tally& tally);

  /// Ends when `frames` is finished, `stop` says so, or there are enough answers. `use` gets each
  /// answer as soon as it is there.
  void run(Mailbox<Frame>& frames, const std::function<bool()>& stop,
           const std::function<void(std::shared_ptr<const Answer>)>& use, const TellState& tell);

 private:
  double time_of(const Frame& frame) const;
  bool keep_empty(Frame& frame);
  void calibrate(const TellState& tell);
  void begin(const Scene& scene);
  void prepare(const Capture& capture);
  std::shared_ptr<Answer> answer(const Frame& frame);
  void measure_rate();

  Motion motion_;
  FitOptions fit_;
  LoopOptions options_;
  Tally& tally_;
  std::shared_ptr<const Scene> scene_;
  std::unique_ptr<Fitter> fitter_;
  std::optional<Tracker> tracker_;
  std::vector<Capture> empty_;  ///< frames of the empty scene, a bounded number
  bool calibrating_ = false;
  std::optional<Clock::time_point> first_arrival_;
  long last_number_ = -1;
  std::optional<double> last_tracked_;  ///< time of the last frame that was tracked
  long last_tracked_number_ = 0;
  Clock::time_point rate_since_{};
  long rate_answers_ = 0;
  double rate_ = 0;
};

/// The scene with background, ambient light and noise calibrated on captures of it without the
/// object. Throws Error.
Scene calibrated_on_empty(const Scene& scene, const std::vector<Capture>& empty);

}  // namespace blindcorner::live
