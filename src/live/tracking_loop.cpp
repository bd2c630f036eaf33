// SPDX-License-Identifier: Apache-2.0
#include "live/tracking_loop.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/batch.h"
#include "blindcorner/inverse/calibration/calibration.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/result_file.h"

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;

constexpr auto kFramePatience = 100ms;
/// Most empty frames that are kept, so that memory is bounded. With so many, the static background
/// is known to a sixteenth of one frame's noise. The noise of a later frame hides so small an
/// error.
constexpr std::size_t kMostEmpty = 256;
/// Fewest frames for a calibration, which estimates the noise from their differences.
constexpr std::size_t kLeastEmpty = 4;
/// Expected captures of one sensor placement: so many that preparation pays.
constexpr int kMany = 1'000'000;
/// Frames of the tracker's history: a live answer is never smoothed.
constexpr int kLag = 1;
/// Regular searches of the whole region may take kSearchShare of the time. Looking back at the
/// frames of a young track may take kLookBack, s. By judgement: frames are passed over meanwhile.
constexpr double kSearchShare = 0.05;
constexpr double kLookBack = 1.0;

TrackerOptions tracker_options() {
  TrackerOptions options;
  options.lag = kLag;
  return options;
}

/// Tracker options if a search takes `search_time` s.
TrackerOptions tracker_options_for(double search_time) {
  TrackerOptions options = tracker_options();
  options.search_interval = std::max(options.search_interval, search_time / kSearchShare);
  // Looking at one frame of a young track takes about as long as a search.
  const double frames = kLookBack / std::max(search_time, 1e-6);
  options.young_frames = static_cast<int>(std::min<double>(options.young_frames, frames));
  return options;
}

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

}  // namespace

std::string answer_line(const Answer& answer) {
  nlohmann::json line = capture_json(*answer.scene, answer.result);
  line["time_s"] = answer.time;
  line["frame"] = answer.frame;
  line["skipped"] = answer.skipped;
  line["latency_ms"] = 1e3 * seconds(Clock::now() - answer.arrived);
  return dump_json(line, -1);
}

std::string header_line(const Scene& scene) {
  return dump_json({{"format", "blindcorner.live/1"},
                    {"scene", scene_place(scene)},
                    {"unknowns", unknown_names(scene)}},
                   -1);
}

void LoopOptions::validate() const {
  if (!(empty_first >= 0 && empty_first <= 3600)) {
    throw Error("empty_first", "found " + std::to_string(empty_first) + ", accepted: 0 to 3600 s");
  }
  if (!(most_per_second >= 0 && std::isfinite(most_per_second))) {
    throw Error("most_per_second", "accepted: 0 or more");
  }
  if (most_answers < 0) throw Error("most_answers", "accepted: 0 or more");
}

Scene calibrated_on_empty(const Scene& scene, const std::vector<Capture>& empty) {
  if (empty.size() < kLeastEmpty) {
    throw Error("empty_first", "found " + std::to_string(empty.size()) +
                                   " frames of the empty scene, accepted: at least " +
                                   std::to_string(kLeastEmpty));
  }
  CalibrationOptions options;
  options.permutations = options.wraps = false;  // take seconds; settled before anybody goes live
  options.variance_scale = false;                // needs fits of known objects
  return calibrate(scene, empty, options, true).scene;
}

TrackingLoop::TrackingLoop(Scene scene, const Motion& motion, FitOptions fit, LoopOptions options,
                           Tally& tally)
    : motion_(motion), fit_(std::move(fit)), options_(options), tally_(tally) {
  options_.validate();
  fit_.captures_per_placement = kMany;
  fit_.empty_captures = 0;  // a tracker states no false alarms
  calibrating_ = options_.empty_first > 0;
  begin(scene);
}

void TrackingLoop::begin(const Scene& scene) {
  scene_ = std::make_shared<const Scene>(scene);
  tracker_.reset();
  fitter_ = std::make_unique<Fitter>(scene, fit_);
  tracker_.emplace(scene, motion_, tracker_options());
}

double TrackingLoop::time_of(const Frame& frame) const {
  if (!options_.every_frame) return seconds(frame.arrived - *first_arrival_);
  return static_cast<double>(frame.number) * motion_.frame_interval;
}

/// Whether the frame is one of the empty ones at the beginning.
bool TrackingLoop::keep_empty(Frame& frame) {
  if (time_of(frame) >= options_.empty_first) return false;
  if (empty_.size() < kMostEmpty) empty_.push_back(std::move(frame.capture));
  return true;
}

void TrackingLoop::calibrate(const TellState& tell) {
  calibrating_ = false;
  tell("calibrating on " + std::to_string(empty_.size()) + " empty frames");
  try {
    Scene scene = calibrated_on_empty(*scene_, empty_);
    std::vector<const Capture*> captures;
    for (const Capture& capture : empty_) captures.push_back(&capture);
    FitOptions fit = fit_;
    if (const std::string said = suit_captures(captures, scene.sensor, fit); !said.empty()) {
      tally_.say(said);
    }
    begin(scene);
  } catch (const std::exception& error) {
    tally_.say(std::string("the empty frames could not be used, the scene file's values stand: ") +
               error.what());
  }
  empty_ = {};
}

/// Does the work that the first frame would wait for, and measures how long a search takes.
void TrackingLoop::prepare(const Capture& capture) {
  try {
    Clock::time_point begun{};
    TrackerOptions searching = tracker_options();
    searching.worth_a_search = 0;  // search in any case
    for (int i = 0; i < 2; ++i) {  // the first run compiles
      begun = Clock::now();
      Tracker(*scene_, motion_, searching).advance(0, fitter_->frame(capture));
    }
    tracker_.emplace(*scene_, motion_, tracker_options_for(seconds(Clock::now() - begun)));
  } catch (const std::exception&) {  // the frame's answer reports it
  }
}

void TrackingLoop::measure_rate() {
  constexpr double kWindow = 1.0;
  const Clock::time_point now = Clock::now();
  if (rate_answers_++ == 0) rate_since_ = now;
  const double passed = seconds(now - rate_since_);
  if (passed < kWindow) return;
  rate_ = static_cast<double>(rate_answers_ - 1) / passed;
  rate_since_ = now;
  rate_answers_ = 1;
}

std::shared_ptr<Answer> TrackingLoop::answer(const Frame& frame) {
  auto answer = std::make_shared<Answer>();
  answer->scene = scene_;
  answer->time = time_of(frame);
  answer->frame = frame.number;
  answer->skipped = frame.number - last_number_ - 1;
  answer->arrived = frame.arrived;
  last_number_ = frame.number;
  double since = last_tracked_ ? std::max(answer->time - *last_tracked_, 0.0) : 0.0;
  if (options_.every_frame && last_tracked_) {
    // The same time as in `fit --track`, so that both search in the same frames.
    since = motion_.frame_interval * static_cast<double>(frame.number - last_tracked_number_);
  }
  try {
    answer->result = track_frame(*fitter_, *tracker_, frame.capture, since);
    answer->result.track->time = answer->time;
    last_tracked_ = answer->time;
    last_tracked_number_ = frame.number;
  } catch (const std::exception& error) {
    answer->result = FitResult{};
    answer->result.error = error.what();
    tally_.note(Count::failed_frames,
                "frame " + std::to_string(frame.number) + ": " + error.what());
  }
  const Capture* const only = &frame.capture;
  name_captures({&only, 1}, answer->result);
  tally_.add(Count::answers);
  tally_.add(Count::skipped_frames, answer->skipped);
  measure_rate();
  answer->rate = rate_;
  return answer;
}

void TrackingLoop::run(Mailbox<Frame>& frames, const std::function<bool()>& stop,
                       const std::function<void(std::shared_ptr<const Answer>)>& use,
                       const TellState& tell) {
  tell("waiting for frames");
  Clock::time_point next{};
  bool prepared = false;
  while (!stop() && !frames.finished()) {
    if (const auto early = next - Clock::now(); early > 0ms) {
      std::this_thread::sleep_for(std::min<Clock::duration>(early, kFramePatience));
      continue;
    }
    std::optional<Frame> frame = frames.take(kFramePatience);
    if (!frame) continue;
    if (!first_arrival_) {
      first_arrival_ = frame->arrived;
      if (calibrating_) tell("taking in the empty scene");
    }
    if (calibrating_) {
      if (keep_empty(*frame)) {
        last_number_ = frame->number;
        continue;
      }
      calibrate(tell);
    }
    if (!std::exchange(prepared, true)) {
      tell("preparing");
      if (!options_.every_frame) {
        prepare(frame->capture);
        if (auto newer = frames.take(0ms)) frame = std::move(newer);
      }
      tell("tracking");
    }
    if (options_.most_per_second > 0) {
      next = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                std::chrono::duration<double>(1 / options_.most_per_second));
    }
    use(answer(*frame));
    if (options_.most_answers > 0 && tally_.of(Count::answers) >= options_.most_answers) break;
  }
}

}  // namespace blindcorner::live
