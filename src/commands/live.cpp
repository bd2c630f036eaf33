// SPDX-License-Identifier: Apache-2.0
/// `blindcorner live SCENE --input DEVICE|FILE|-|tcp://host:port|zmq://host:port`.
#include "commands/live.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <memory>
#include <optional>
#include <thread>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/scene_file.h"
#include "commands/capture_inputs.h"
#include "commands/commands.h"
#include "commands/interrupt.h"
#include "commands/number_check.h"
#include "commands/thread_limit.h"
#include "live/access.h"
#include "live/event_hub.h"
#include "live/frames.h"
#include "live/illustrator.h"
#include "live/input.h"
#include "live/line_output.h"
#include "live/page_server.h"
#include "live/recorder.h"
#include "live/tracking_loop.h"

namespace blindcorner {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kMostBrowsers = 64;
/// Most events that wait for a browser: about a second of a fast sensor.
constexpr std::size_t kEventQueue = 32;

struct LiveArguments {
  std::string scene, instrument;
  live::InputOptions input;
  std::string format = "auto";
  LineOptions lines;
  std::string record;
  live::LoopOptions loop;
  live::ServerOptions server;
  bool no_page = false;
  bool once = false;
  int threads = 0;
  FitOptions fit;
};

void say(const std::string& text) { std::fprintf(stderr, "blindcorner: %s\n", text.c_str()); }

/// Reads the input until it ends. All frames go to the recorder. The loop gets all of them only if
/// the reading is patient, else the latest ones.
class Reading {
 public:
  Reading(const LiveArguments& arguments, const Sensor& sensor, live::Recorder* recorder,
          live::Tally& tally)
      : patient_(arguments.loop.every_frame),
        input_(arguments.input, tally),
        frames_(1),
        recorder_(recorder) {
    LineOptions lines = arguments.lines;
    lines.path = arguments.input.address == "-" ? "standard input" : arguments.input.address;
    assembler_.emplace(sensor, arguments.format, lines, tally);
    patient_ = patient_ || input_.is_file();
  }
  ~Reading() { end(); }

  /// Whether input that is not read yet waits, so that every frame can be fitted.
  bool patient() const { return patient_; }
  live::Mailbox<live::Frame>& frames() { return frames_; }

  void begin() {
    thread_ = std::thread([this] { run(); });
  }
  void end() {
    ending_ = true;
    frames_.close();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run() {
    std::string bytes;
    while (!ending_) {
      switch (input_.read(bytes, 100ms)) {
        case live::Input::Event::bytes:
          assembler_->add(bytes, live::Clock::now(), [this](live::Frame f) { take(std::move(f)); });
          break;
        case live::Input::Event::interrupted:
          assembler_->interrupt();
          break;
        case live::Input::Event::ended:
          frames_.close();
          return;
        case live::Input::Event::nothing:
          break;
      }
    }
  }
  void take(live::Frame frame) {
    if (ending_) return;
    if (recorder_ != nullptr) recorder_->add(frame.capture, patient_);
    if (patient_) {
      frames_.put_patiently(std::move(frame));
    } else {
      frames_.put(std::move(frame));
    }
  }

  bool patient_;
  live::Input input_;
  live::Mailbox<live::Frame> frames_;
  live::Recorder* recorder_;
  std::optional<live::FrameAssembler> assembler_;
  std::atomic<bool> ending_ = false;
  std::thread thread_;
};

/// The page and all that feeds it; nothing with --no-page.
class Page {
 public:
  Page(const LiveArguments& arguments, const Scene& scene, live::Tally& tally) {
    if (arguments.no_page) return;
    live::ServerOptions options = arguments.server;
    if (!live::is_loopback(options.address) && options.token.empty()) {
      options.token = live::new_token();
    }
    hub_.emplace(kMostBrowsers, kEventQueue, tally);
    illustrator_.emplace(*hub_, tally);
    live::Served served{live::live_page(scene, arguments.input.address),
                        [this] { return illustrator_->greeting(); },
                        [this] { return illustrator_->status(); }};
    server_.emplace(options, std::move(served), *hub_, tally);
    say("page: " + server_->url());
  }

  void show(const std::shared_ptr<const live::Answer>& answer, const std::string& line) {
    if (!hub_) return;
    hub_->publish("answer", line);
    illustrator_->show(answer);
  }
  void tell(const std::string& state) {
    if (illustrator_) illustrator_->tell(state);
  }

 private:
  std::optional<live::EventHub> hub_;
  std::optional<live::Illustrator> illustrator_;
  std::optional<live::PageServer> server_;
};

std::optional<live::RecorderOptions> recording(const LiveArguments& arguments, const Scene& scene) {
  if (arguments.record.empty()) return std::nullopt;
  require_exr(arguments.record);
  live::RecorderOptions options;
  options.path = arguments.record;
  options.bin_width = scene.sensor.bin_width;
  options.sensor = scene.sensor.name;
  options.description = "recorded by blindcorner live from " + arguments.input.address;
  return options;
}

void tell_recording(live::Recorder& recorder) {
  const std::vector<std::string> files = recorder.finish();
  if (files.empty()) return say("no frame came, nothing was recorded");
  say("recorded in " + files.front() +
      (files.size() > 1 ? " to " + files.back() + " (" + std::to_string(files.size()) + " files)"
                        : ""));
}

int run_live(LiveArguments arguments) {
  std::signal(SIGPIPE, SIG_IGN);  // a reader that is gone is noticed when it is written to
  arguments.fit.validate();
  arguments.loop.validate();
  arguments.input.waits = !arguments.once;
  const ThreadLimit threads(arguments.threads);
  const Scene scene = read_scene(arguments.scene, arguments.instrument);
  live::Tally tally(say);
  std::optional<live::Recorder> recorder;
  if (const auto options = recording(arguments, scene)) recorder.emplace(*options, tally);
  Reading reading(arguments, scene.sensor, recorder ? &*recorder : nullptr, tally);
  arguments.loop.every_frame = reading.patient();
  live::TrackingLoop loop(scene, read_motion(arguments.scene), arguments.fit, arguments.loop,
                          tally);
  Page page(arguments, scene, tally);
  const Interruptible interruptible;
  {
    live::LineOutput output(STDOUT_FILENO, tally);
    output.put(live::header_line(scene));
    reading.begin();
    const auto stop = [&] {
      const bool nobody_listens = output.broken() && arguments.no_page && !recorder;
      return Interruptible::asked() || nobody_listens;
    };
    loop.run(
        reading.frames(), stop,
        [&](const std::shared_ptr<const live::Answer>& answer) {
          std::string line = live::answer_line(*answer);
          output.put(line);
          page.show(answer, line);
        },
        [&](const std::string& state) { page.tell(state); });
    reading.end();
  }
  if (recorder) tell_recording(*recorder);
  say("ended: " + tally.text());
  const bool lost =
      tally.of(live::Count::dropped_answers) > 0 || tally.of(live::Count::unrecorded_frames) > 0;
  if (tally.of(live::Count::frames) == 0 && !Interruptible::asked()) {
    throw Error(arguments.input.address, "held no whole frame that suits the scene");
  }
  return lost ? kSomeFailed : kAllWell;
}

void add_input_options(CLI::App& command, LiveArguments& arguments) {
  command
      .add_option("-i,--input", arguments.input.address,
                  "serial device, file, - (standard input), tcp://host:port, or zmq://host:port "
                  "(the TMF8829 makers' publisher)")
      ->required()
      ->type_name("INPUT");
  command.add_option("--baud", arguments.input.baud, "speed of a serial device")
      ->capture_default_str();
  std::vector<std::string> formats = live::stream_formats();
  formats.insert(formats.begin(), "auto");
  command
      .add_option("--format", arguments.format,
                  "format of the lines: tmf8828, tmf882x, vl53l8ch, tmf8829, json_lines or auto")
      ->check(CLI::IsMember(formats).description(""))
      ->type_name("NAME")
      ->capture_default_str();
  command.add_option("--array", arguments.lines.array,
                     "mp_histo_HA (tmf8829) or HSHORT (tmf882x), where lines hold several arrays");
  command.add_option("--i2c-address", arguments.lines.i2c_address,
                     "sensor of TMF8828 lines with several; 0: the first");
  command.add_flag("--every-frame", arguments.loop.every_frame,
                   "fit every frame in its turn, the scene's frame interval apart; as for a file");
  command.add_flag("--once", arguments.once,
                   "end when the input goes away; else wait for it to come back");
}

void add_page_options(CLI::App& command, LiveArguments& arguments) {
  command.add_flag("--no-page", arguments.no_page, "serve no page");
  command.add_option("--port", arguments.server.port, "of the page; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command
      .add_option("--listen", arguments.server.address,
                  "address that the page is served on; beyond this machine with a token")
      ->type_name("ADDRESS")
      ->capture_default_str();
  command.add_option(
      "--token", arguments.server.token,
      "what the page's address has to say; default beyond this machine: a random one");
}

}  // namespace

void add_live_command(CLI::App& app, int& exit_code) {
  CLI::App& command = *app.add_subcommand(
      "live", "track the hidden object while frames arrive; answers as JSON lines and as a page");
  const auto arguments = std::make_shared<LiveArguments>();
  command.add_option("SCENE", arguments->scene, "scene file")->required();
  command
      .add_option("--instrument", arguments->instrument,
                  "what `calibrate` found out about the instrument")
      ->type_name("FILE");
  add_input_options(command, *arguments);
  command
      .add_option("--empty-first", arguments->loop.empty_first,
                  "seconds at the beginning in which the scene is empty, to calibrate on")
      ->check(number_in({.lower = 0, .upper = 3600}, "SECONDS"));
  command
      .add_option("--fps", arguments->loop.most_per_second, "most answers in a second; 0: no limit")
      ->check(number_from_zero());
  command.add_option("--answers", arguments->loop.most_answers, "end after this many; 0: go on")
      ->check(CLI::NonNegativeNumber);
  command
      .add_option("--record", arguments->record,
                  "capture file of all frames, .exr; further ones beside it when it is full")
      ->type_name("FILE");
  add_page_options(command, *arguments);
  command.add_option("--seed", arguments->fit.seed, "seed of everything random")
      ->capture_default_str();
  command.add_option("--threads", arguments->threads, "threads; 0: one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command.callback([arguments, &exit_code] { exit_code = run_live(*arguments); });
}

}  // namespace blindcorner
