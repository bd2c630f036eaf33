// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/fit.h"

#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>

#include "arrays.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/batch.h"
#include "blindcorner/inverse/tracking/tracker.h"
#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/scene_file.h"
#include "blindcorner/report/headline.h"
#include "blindcorner/report/index_page.h"
#include "blindcorner/report/page.h"
#include "blindcorner/report/result_file.h"
#include "interrupt.h"
#include "module.h"

namespace blindcorner::python {
namespace {

/// A result with all that its page needs.
struct Fit {
  ScenePointer scene;
  FitResult result;
  std::vector<CaptureConditions> conditions;  ///< of its captures
};
using FitPointer = std::shared_ptr<Fit>;

/// Stops fits of one fitter. The fitter's progress does not say which fit it belongs to, so a
/// request to stop disturbs all running fits. The fit that was told to stop ends; the others begin
/// again.
class Stops {
 public:
  struct Call {
    bool done = false, told = false;
  };

  /// Called by the library, from any thread.
  void check() const {
    if (told_ > 0) throw Stopped{};
  }
  void tell(Call& call) {
    const std::scoped_lock lock(mutex_);
    if (call.done) return;
    call.told = true;
    ++told_;
  }
  void end(Call& call) {
    {
      const std::scoped_lock lock(mutex_);
      call.done = true;
      if (call.told) --told_;
    }
    changed_.notify_all();
  }
  bool told(const Call& call) {
    const std::scoped_lock lock(mutex_);
    return call.told;
  }
  /// Waits until every call that was told to stop has ended.
  void wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return told_ == 0; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<int> told_{0};
};

/// What a Fitter of the package holds, shared with work that outlives a Ctrl-C.
struct FitterState {
  ScenePointer scene;  ///< suited to the captures
  std::shared_ptr<Stops> stops;
  std::unique_ptr<Fitter> fitter;
};
using FitterPointer = std::shared_ptr<FitterState>;

/// How captures change a scene and a fit's options, for fitters that are made elsewhere.
struct Suited {
  int captures_per_placement = 1;
  std::vector<std::tuple<bool, int, int>> zones;  ///< dead, first and last valid bin
  std::string left_out;                           ///< one line; empty: nothing
};

/// The captures of a file. Throws Error if the file's bins are not as wide as the scene's.
CaptureFile suiting(const SceneData& scene, const CaptureArrays& arrays) {
  CaptureFile file = captures_of(arrays);
  const std::string problem = bin_width_problem(file.bin_width, scene.nominal_bin_width);
  if (!problem.empty()) throw Error("captures", problem);
  return file;
}

Suited suit(const ScenePointer& scene, const Input<3>& counts, const std::string& metadata,
            const std::vector<std::string>& sources, const std::vector<int>& indices) {
  const CaptureFile file = suiting(*scene, {counts, metadata, sources, indices});
  Sensor sensor = scene->scene.sensor;
  FitOptions options;
  std::vector<const Capture*> captures;
  for (const Capture& capture : file.captures) captures.push_back(&capture);
  Suited suited;
  suited.left_out = suit_captures(captures, sensor, options);
  suited.captures_per_placement = options.captures_per_placement;
  for (const Zone& zone : sensor.zones) {
    suited.zones.emplace_back(zone.dead, zone.first_valid_bin, zone.last_valid_bin);
  }
  return suited;
}

FitterPointer make_fitter(const ScenePointer& scene, FitOptions options,
                          const std::optional<Suited>& suited, nb::object progress) {
  const auto state = std::make_shared<FitterState>();
  auto data = std::make_shared<SceneData>(*scene);
  if (suited) {
    options.captures_per_placement = suited->captures_per_placement;
    std::vector<Zone>& zones = data->scene.sensor.zones;
    if (zones.size() != suited->zones.size()) throw Error("suited", "is of another scene");
    for (std::size_t i = 0; i < zones.size(); ++i) {
      std::tie(zones[i].dead, zones[i].first_valid_bin, zones[i].last_valid_bin) = suited->zones[i];
    }
  }
  const auto stops = std::make_shared<Stops>();
  const Callback callback(std::move(progress));
  options.progress = [stops, callback](const char* doing, double share) {
    stops->check();
    if (callback) callback(doing, share);
  };
  options.validate();
  state->scene = std::move(data);
  state->stops = stops;
  state->fitter = interruptible(
      [scene = state->scene, options] { return std::make_unique<Fitter>(scene->scene, options); },
      [] {});
  return state;
}

/// Runs `work`, which takes the fitter's state, until it is done or Ctrl-C ends it.
template <typename Work>
auto run(const FitterPointer& state, Work work) {
  const auto call = std::make_shared<Stops::Call>();
  return interruptible(
      [state, call, work] {
        struct Ending {
          const FitterPointer& state;
          Stops::Call& call;
          ~Ending() { state->stops->end(call); }
        } ending{state, *call};
        while (true) {
          try {
            return work(*state);
          } catch (const Stopped&) {
            if (state->stops->told(*call)) throw;
            state->stops->wait();
          }
        }
      },
      [state, call] { state->stops->tell(*call); });
}

FitPointer pack(const FitterState& state, FitResult result, std::span<const Capture> captures) {
  auto fit = std::make_shared<Fit>();
  fit->scene = state.scene;
  fit->result = std::move(result);
  for (const Capture& capture : captures) {
    fit->conditions.push_back(conditions_of(state.scene->scene, capture));
  }
  return fit;
}

/// A result for each capture. The error of a result says why a capture failed.
std::vector<FitPointer> fit_each(const FitterPointer& state, const Input<3>& counts,
                                 const std::string& metadata,
                                 const std::vector<std::string>& sources,
                                 const std::vector<int>& indices, nb::object progress) {
  const auto file = std::make_shared<const CaptureFile>(
      suiting(*state->scene, {counts, metadata, sources, indices}));
  const Callback callback(std::move(progress));
  return run(state, [file, callback](FitterState& own) {
    const std::size_t count = file->captures.size();
    std::vector<FitPointer> fits(count);
    std::atomic<std::size_t> done{0};
    // One task per capture: their times differ by an order of magnitude.
    tbb::parallel_for(
        std::size_t{0}, count,
        [&](std::size_t i) {
          const Capture& capture = file->captures[i];
          own.stops->check();
          fits[i] = pack(own, fit_named(*own.fitter, capture), {&capture, 1});
          if (callback) callback(++done, count);
        },
        tbb::simple_partitioner());
    return fits;
  });
}

FitPointer fit_joint(const FitterPointer& state, const Input<3>& counts,
                     const std::string& metadata, const std::vector<std::string>& sources,
                     const std::vector<int>& indices) {
  const auto file = std::make_shared<const CaptureFile>(
      suiting(*state->scene, {counts, metadata, sources, indices}));
  return run(state, [file](FitterState& own) {
    return pack(own, fit_joint_named(*own.fitter, file->captures), file->captures);
  });
}

/// Frames of one moving object.
class TrackerState {
 public:
  TrackerState(FitterPointer state, const Motion& motion)
      : state_(std::move(state)), motion_(motion), tracker_(state_->scene->scene, motion) {}

  const FitterPointer& fitter() const { return state_; }

  /// `dt` in s since the frame before; empty: as the scene's motion says.
  FitPointer advance(const Capture& capture, std::optional<double> dt) {
    const std::scoped_lock lock(mutex_);
    const bool first = fits_.empty();
    const double step = dt.value_or(motion_.frame_interval);
    if (!first) {
      since_ += step;
      time_ += step;
      regular_ = regular_ && !dt;
    }
    FitResult result;
    try {
      result = track_frame(*state_->fitter, tracker_, capture, since_);
      const double now = static_cast<double>(fits_.size()) * motion_.frame_interval;
      if (result.track) result.track->time = regular_ ? now : time_;
      since_ = 0;
    } catch (const std::exception& error) {
      result = {};
      result.error = error.what();
    }
    const Capture* const only = &capture;
    name_captures({&only, 1}, result);
    fits_.push_back(pack(*state_, std::move(result), {&capture, 1}));
    return fits_.back();
  }

  /// All frames so far, with the smoothed poses that later frames give earlier ones.
  std::vector<FitPointer> smoothed() {
    const std::scoped_lock lock(mutex_);
    std::vector<FitPointer> all;
    std::vector<FitResult> tracked;
    for (const FitPointer& fit : fits_) {
      all.push_back(std::make_shared<Fit>(*fit));
      if (fit->result.track) tracked.push_back(fit->result);
    }
    add_smoothed(state_->scene->scene, tracker_, tracked);
    auto next = tracked.begin();
    for (const FitPointer& fit : all) {
      if (fit->result.track) fit->result = std::move(*next++);
    }
    return all;
  }

 private:
  FitterPointer state_;
  Motion motion_;
  Tracker tracker_;
  std::mutex mutex_;
  std::vector<FitPointer> fits_;
  double since_ = 0, time_ = 0;
  bool regular_ = true;
};

FitPointer advance(const std::shared_ptr<TrackerState>& tracker, const Input<3>& counts,
                   const std::string& metadata, const std::vector<std::string>& sources,
                   const std::vector<int>& indices, std::optional<double> dt) {
  const auto file = std::make_shared<const CaptureFile>(
      suiting(*tracker->fitter()->scene, {counts, metadata, sources, indices}));
  // A frame that was half taken in would leave the track in an invalid state. A frame takes little
  // time, so it is finished.
  return interruptible([tracker, file, dt] { return tracker->advance(file->captures.at(0), dt); },
                       [] {});
}

nb::list histograms(nb::handle_t<Fit> self) {
  const Fit& fit = nb::cast<const Fit&>(self);
  nb::list list;
  for (const FittedHistograms& fitted : fit.result.histograms) {
    const std::array<std::size_t, 2> shape{static_cast<std::size_t>(fitted.measured.zones()),
                                           static_cast<std::size_t>(fitted.measured.bins)};
    nb::dict entry;
    entry["measured"] = view_of<2>(fitted.measured.values, shape, self);
    entry["model"] = view_of<2>(fitted.model.values, shape, self);
    entry["object"] = view_of<2>(fitted.object.values, shape, self);
    nb::list used;
    for (const bool zone : fitted.zone_used) used.append(zone);
    entry["zone_used"] = used;
    entry["first_bin"] = fitted.first_bin;
    entry["end_bin"] = fitted.end_bin;
    list.append(entry);
  }
  return list;
}

/// result.json from entries of its captures, as the program writes it.
std::string result_text(const SceneData& data, const std::vector<std::string>& captures) {
  nlohmann::json document = result_json(data.scene, {});
  for (const std::string& text : captures) {
    document["captures"].push_back(nlohmann::json::parse(text));
  }
  return dump_json(document, 1) + "\n";
}

std::string page(const std::vector<FitPointer>& fits) {
  if (fits.empty()) throw Error("page", "found no result, accepted: one or more");
  std::vector<FitResult> results;
  std::vector<std::vector<CaptureConditions>> conditions;
  for (const FitPointer& fit : fits) {
    results.push_back(fit->result);
    conditions.push_back(fit->conditions);
  }
  return result_page(fits.front()->scene->scene, results, conditions);
}

}  // namespace

void add_fit(nb::module_& m) {
  nb::class_<Fit>(m, "Fit", "What one fit found, as the library has it.")
      .def_prop_ro(
          "text",
          [](const Fit& fit) { return dump_json(capture_json(fit.scene->scene, fit.result)); },
          "Its entry in the list `captures` of result.json.")
      .def_prop_ro(
          "headline",
          [](const Fit& fit) {
            return fit.result.error.empty() ? fit_headline(fit.scene->scene, fit.result)
                                            : fit.result.error;
          },
          "What was found, in a sentence.")
      .def_prop_ro(
          "renders", [](const Fit& fit) { return fit.result.renders; },
          "Histograms of one capture rendered by fast models.")
      .def_prop_ro("histograms", &histograms,
                   "For each capture arrays [zones, bins] that look at the result's own memory.");

  nb::class_<Suited>(m, "Suited", "What captures make of a scene and of a fit's options.")
      .def_ro("captures_per_placement", &Suited::captures_per_placement)
      .def_ro("left_out", &Suited::left_out, "Which bins are left out as saturated; or empty.")
      .def(
          "__getstate__",
          [](const Suited& s) { return std::tuple(s.captures_per_placement, s.zones, s.left_out); })
      .def("__setstate__",
           [](Suited& s,
              const std::tuple<int, std::vector<std::tuple<bool, int, int>>, std::string>& state) {
             new (&s) Suited{std::get<0>(state), std::get<1>(state), std::get<2>(state)};
           });
  m.def("suit", &suit, nb::arg("scene"), nb::arg("counts"), nb::arg("metadata"), nb::arg("sources"),
        nb::arg("indices"), "What captures make of a scene.");

  nb::class_<FitterState>(m, "Fitter", "Fits captures of one scene.")
      .def_static(
          "make",
          [](const ScenePointer& scene, const std::optional<Suited>& suited,
             std::optional<double> tolerance, int scored_poses, int starts, int importance_samples,
             int empty_captures, std::size_t cache_bytes, std::uint64_t seed, nb::object progress) {
            FitOptions options;
            options.model_tolerance = tolerance;
            options.max_scored_poses = scored_poses;
            options.max_starts = starts;
            options.importance_samples = importance_samples;
            options.empty_captures = empty_captures;
            options.cache_bytes = cache_bytes;
            options.seed = seed;
            return make_fitter(scene, options, suited, std::move(progress));
          },
          nb::arg("scene"), nb::arg("suited").none(), nb::arg("tolerance").none(),
          nb::arg("scored_poses"), nb::arg("starts"), nb::arg("importance_samples"),
          nb::arg("empty_captures"), nb::arg("cache_bytes"), nb::arg("seed"),
          nb::arg("progress").none(), "A fitter, suited to captures or to none.")
      .def("fit_each", &fit_each, nb::arg("counts"), nb::arg("metadata"), nb::arg("sources"),
           nb::arg("indices"), nb::arg("progress").none(), "A result of each capture.")
      .def("fit_joint", &fit_joint, nb::arg("counts"), nb::arg("metadata"), nb::arg("sources"),
           nb::arg("indices"), "One result of all captures together.");

  nb::class_<TrackerState>(m, "Tracker", "Frames of one moving object.")
      .def_static(
          "make",
          [](const FitterPointer& fitter) {
            const SceneData& data = *fitter->scene;
            return std::make_shared<TrackerState>(fitter,
                                                  parse_motion_text(data.text, data.scene.path));
          },
          nb::arg("fitter"), "A tracker with the motion that the scene states.")
      .def("advance", &advance, nb::arg("counts"), nb::arg("metadata"), nb::arg("sources"),
           nb::arg("indices"), nb::arg("dt").none(), "The next frame's result.")
      .def(
          "smoothed",
          [](const std::shared_ptr<TrackerState>& tracker) {
            return interruptible([tracker] { return tracker->smoothed(); }, [] {});
          },
          "All frames, with what later ones say of earlier ones.");
  const FitOptions defaults;
  nb::dict options;
  options["scored_poses"] = defaults.max_scored_poses;
  options["starts"] = defaults.max_starts;
  options["importance_samples"] = defaults.importance_samples;
  options["empty_captures"] = defaults.empty_captures;
  options["cache_bytes"] = defaults.cache_bytes;
  options["seed"] = defaults.seed;
  m.attr("fit_defaults") = options;
  m.def("write_atomically", &write_atomically, nb::arg("path"), nb::arg("text"),
        "Writes a file completely or not at all.");
  m.def("write_index", &write_index, nb::arg("directory"),
        "Writes index.html, which links what the directory holds.");
  m.def("result_text", &result_text, nb::arg("scene"), nb::arg("captures"),
        "Text of result.json from the texts of its captures.");
  m.def("result_page", &page, nb::arg("fits"), "The page of results, HTML.");
}

}  // namespace blindcorner::python
