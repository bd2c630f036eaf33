// SPDX-License-Identifier: Apache-2.0
/// Captures from other programs' files.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

enum class ImportFormat {
  automatic,          ///< by the file's name and content
  numpy,              ///< .npy or .npz with a stated order of axes, or our own .npz
  tmf8828_log,        ///< serial log of the TMF8828 Arduino driver: lines `#Raw,...`
  vl53l8ch_log,       ///< serial log of VL53L8CH firmware: `D`, then a line per zone
  cheapspad,          ///< MATLAB file of the CheapSPAD data: `datacubes` and `positions`
  st_person_tracking  ///< volume_NNNNNN.npz with `hists` and `pt_cloud`, or a folder of them
};

/// Which positions of the CheapSPAD data its publication evaluates.
enum class PublishedFilter {
  none,
  without_mirrors,  ///< y >= -1.7 m
  with_mirrors      ///< and enough light after bin 9 of the sixth repeat at the two right spots
};

/// What the files do not say themselves. Values given here override what a file says.
struct ImportOptions {
  ImportFormat format = ImportFormat::automatic;

  /// Order of the array's axes, slowest first: "capture,row,column,bin", "capture,zone,bin",
  /// "bin,row,column". `bin` is needed; without `capture` the array is one capture; `zone` counts
  /// row by row and stands for `row` and `column`. Numpy only; not needed for our own .npz.
  std::string axes;
  /// Array of a .npz that holds the counts; empty: `counts`, or the only array there is.
  std::string array;
  /// Layout of the zones, both or neither. With `axes` that name rows and columns it has to agree;
  /// with `zone` the default is a square; for a TMF8828 log it is 3 x 3 (default), 4 x 4 or 8 x 8.
  int rows = 0;
  int columns = 0;

  double bin_width = 0.0;            ///< s; 0: as the file says, or unknown
  std::optional<double> exposures;   ///< exposures averaged in each capture, > 0
  std::optional<double> dispersion;  ///< variance / mean, > 0
  std::string sensor;                ///< name; empty: as the file or the format says
  std::string description;           ///< empty: as the file or the format says

  /// Array of the same .npz with the sensor's position in each capture, [captures, 3] or [3], m.
  std::string sensor_positions;
  /// World axes in terms of the axes of these positions: "z,-x,y" means world x = z, world y = -x,
  /// world z = y. Left-handed data are fine.
  std::string axes_world = "x,y,z";
  /// Rotation of T_world_sensor when positions are given; the identity looks along world +x.
  Eigen::Quaterniond sensor_rotation = Eigen::Quaterniond::Identity();

  /// Sensor of a TMF8828 log with several on the bus; 0: the only one.
  int i2c_address = 0;

  /// CheapSPAD: repeats averaged into one capture, consecutive ones; 0: all of a position. 2 are
  /// the samples of the publication.
  int repeats_per_sample = 0;
  PublishedFilter published_filter = PublishedFilter::none;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Reads captures from all `paths`, in this order, into one file. `source` of a capture is the path
/// it came from and `index` its place there. What was left out or assumed is told in `warnings`,
/// one line each. Throws Error (one line: file, place, what was found, what is accepted).
///
/// Numpy: integers of 1 to 8 bytes and floats of 2, 4 and 8, any byte order, C or Fortran order. A
/// .npz of `export_npz` needs no options and comes back whole.
///
/// TMF8828 log: lines `#Raw,<i2c address>,<index>,<128 bytes>`; index / 10 is the byte's
/// significance (0 least), index % 10 the channel; channel 0 is the reference and left out. A 3 x 3
/// capture is one measurement of channels 1 to 9, a 4 x 4 capture two of channels 1 to 8, an 8 x 8
/// capture eight of them. docs/capture.md has the place of each channel. A damaged line is an
/// error that names the line; a capture that the log begins or ends within is left out.
///
/// VL53L8CH log: a line `D`, then one line per zone: zone, ambient light, distance, bins; see
/// docs/capture.md. Bins are 250 ps wide unless stated otherwise.
///
/// CheapSPAD: MATLAB 5 file, needs a build with matio. A zone is a relay spot in one of two phases,
/// repeats are averaged, bad ones left out; see docs/cheapspad.md.
///
/// ST person tracking: `hists` [zones, bins] and `pt_cloud` [zones, 3] in metres, in a frame with x
/// along the wall, y up and z away from the wall, which is z = 0. Relay points are turned into the
/// z-up world by (x, y, z) -> (x, -z, y), a rotation, so the wall is world y = 0 and the hidden
/// side is y < 0. Rows keep the order of the data, in which y grows with the row. Points of dead
/// zones (zero or NaN) are kept. Bins are 250 ps wide unless stated otherwise; bin 0 is light at
/// the relay wall.
CaptureFile import_captures(const std::vector<std::string>& paths,
                            const ImportOptions& options = {},
                            std::vector<std::string>* warnings = nullptr);

}  // namespace blindcorner
