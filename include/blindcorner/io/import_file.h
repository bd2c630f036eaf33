// SPDX-License-Identifier: Apache-2.0
/// Captures from other programs' files.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/io/capture_file.h"

namespace blindcorner {

/// A format that `import_captures` reads.
struct ImportReader {
  std::string name;        ///< as `ImportOptions::format` takes it
  std::string recognises;  ///< what its files are
  std::string assumes;     ///< what is taken for granted where such a file does not say it
};

/// All of them, in the order in which they are asked whether they recognise a file.
std::vector<ImportReader> import_readers();

/// Which positions of the CheapSPAD data its publication evaluates.
enum class PublishedFilter {
  none,
  without_mirrors,  ///< y >= -1.7 m
  with_mirrors      ///< and enough light after bin 9 of the sixth repeat at the two right spots
};

/// What the files do not say themselves. Values given here override what a file says.
struct ImportOptions {
  /// Name of a reader, or "auto": the one that recognises the file by its content; a stated
  /// `pattern` chooses "table".
  std::string format = "auto";

  /// Order of the array's axes, slowest first: "capture,row,column,bin", "capture,zone,bin",
  /// "bin,row,column". `bin` is needed; without `capture` the array is one capture; `zone` counts
  /// row by row and stands for `row` and `column`. NumPy and MATLAB; not needed for our own .npz.
  std::string axes;
  /// Array of a file with several that holds the counts: of a .npz or .mat (empty: `counts`, or the
  /// only one), `mp_histo` or `mp_histo_HA` of a TMF8829 log, `HLONG` or `HSHORT` of lines of
  /// these.
  std::string array;
  /// Columns of any text table, a list of `capture`, `zone`, `row`, `column`, `bin`, `count`,
  /// `counts` (all that follow are bins), `skip` and 'words' that a line has there
  /// (docs/capture.md).
  std::string pattern;
  /// Layout of the zones, both or neither. With `axes` that name rows and columns it has to agree;
  /// else the default is a square; for a TMF8828 log it is 3 x 3 (default), 4 x 4 or 8 x 8.
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

  /// Sensor of a TMF8828 log with several on the bus; 0: the first in the log.
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
/// What each format holds and how it becomes captures is said in docs/capture.md. A damaged line of
/// a log is left out and named, and with it the capture that it belongs to.
CaptureFile import_captures(const std::vector<std::string>& paths,
                            const ImportOptions& options = {},
                            std::vector<std::string>* warnings = nullptr);

}  // namespace blindcorner
