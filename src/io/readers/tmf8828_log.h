// SPDX-License-Identifier: Apache-2.0
/// Serial log of the ams OSRAM TMF8828 Arduino driver with histogram dumping switched on.
///
/// Each measurement is 30 lines `#Raw,<i2c address>,<index>,<byte of bin 0>,...,<byte of bin 127>`,
/// index 0 to 29 in this order: tens digit the byte of the 24-bit counts (0 least significant),
/// units digit the channel (0 the reference). That is what the driver's own script
/// `talk_to_arduino_combine_histograms.py` assembles. Other lines are skipped, but `#Obj` (the
/// results, after every second measurement in 8 x 8 mode) tells where in a frame the log is.
///
/// Place of channel c in measurement s of the frame (s counts from 0):
///   3 x 3  one measurement, channels 1..9 row by row.
///   4 x 4  two measurements of channels 1..8 row by row, the upper half first. SparkFun's example
///          of this SPAD map (TMF882X Arduino library, Example-09) lays them out in this way.
///   8 x 8  eight measurements of channels 1..8:
///          row = 7 - 2 ((c - 1) / 2) - s / 4, column = 4 ((c - 1) mod 2) + s mod 4.
///          Two independent drivers agree on that (camera-culture/cc-hardware,
///          KGammelgaard/TMF8828); it was not compared with a sensor here. Which way up row 0 is
///          depends on the mounting.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/io/import_file.h"

namespace blindcorner {

/// Zones of a TMF882x: `side` rows and columns, measured one after the other.
struct Tmf882xLayout {
  int side = 3;          ///< rows and columns
  int measurements = 1;  ///< per capture
  int channels = 9;      ///< used per measurement, from channel 1

  /// Place of a channel in measurement `measurement` of a capture.
  int zone(int measurement, int channel) const;
};

/// The layout that rows and columns state, or 3 x 3 if they state none. Throws Error for others
/// than 3 x 3, 4 x 4 and 8 x 8.
Tmf882xLayout tmf882x_layout(const ImportOptions& options);

/// The log of captures, as the driver prints it from i2c address 65. The reference channel and
/// unused channels are dark. Throws Error naming `path` for captures that no TMF8828 makes: other
/// than 3 x 3, 4 x 4 or 8 x 8 zones of 128 bins, or counts that are no whole numbers of 24 bits.
std::string tmf8828_log(const CaptureFile& file, const std::string& path);

}  // namespace blindcorner
