// SPDX-License-Identifier: Apache-2.0
/// Keeps the frames of a stream in capture files.
#pragma once

#include <string>
#include <thread>
#include <vector>

#include "blindcorner/io/capture_file.h"
#include "live/mailbox.h"
#include "live/tally.h"

namespace blindcorner::live {

struct RecorderOptions {
  std::string path{};  ///< of the first file, .exr; the next are <stem>_0002.exr and so on
  double bin_width = 0;
  std::string sensor{};
  std::string description{};
  /// Most bytes of counts in one file. A full file is written and its frames are let go. Memory is
  /// thus bounded by one file, the queue before it, and what writing takes.
  std::size_t most_bytes = 64UL << 20;
  double save_interval = 60;  ///< s after which a file that is not full is written all the same
};

/// A thread of its own writes the files. Each is written whole: beside its place, then renamed.
class Recorder {
 public:
  /// Throws Error if the folder of the first file does not exist.
  Recorder(RecorderOptions options, Tally& tally);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Takes a frame. If the disk is slow, a `patient` call waits; otherwise the frame is left out
  /// and counted.
  void add(Capture capture, bool patient);

  /// Writes what is left. Returns the files that hold the recording.
  std::vector<std::string> finish();

 private:
  void run();
  void save();
  std::string name_of(int part) const;

  RecorderOptions options_;
  Tally& tally_;
  Mailbox<Capture> frames_;
  CaptureFile part_;
  std::size_t saved_ = 0;    ///< frames of the part that its file holds
  std::size_t unsaved_ = 0;  ///< frames of the part that could not be written yet
  int number_ = 1;           ///< of the part
  std::vector<std::string> files_;
  std::thread thread_;
};

}  // namespace blindcorner::live
