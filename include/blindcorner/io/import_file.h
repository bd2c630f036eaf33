// SPDX-License-Identifier: Apache-2.0
/// Captures from the files of other programs.
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
  std::string assumes;     ///< what the reader assumes if the file does not say it
};

/// All readers, in the order in which they are asked whether they recognise a file.
std::vector<ImportReader> import_readers();

/// The positions of the CheapSPAD data that its publication evaluates.
enum class PublishedFilter {
  none,
  without_mirrors,  ///< y >= -1.7 m
  with_mirrors  ///< these, with enough light after bin 9 of the sixth repeat at the two right spots
};

/// Information that the files do not contain. Values given here override the file's values.
struct ImportOptions {
  /// Name of a reader, or "auto": the reader that recognises the file by its content; a stated
  /// `pattern` chooses "table".
  std::string format = "auto";

  /// Order of the array's axes, slowest first: "capture,row,column,bin", "capture,zone,bin",
  /// "bin,row,column". `bin` is required. Without `capture` the array is one capture. `zone` counts
  /// row by row and stands for `row` and `column`. For NumPy and MATLAB; not needed for this
  /// project's own .npz.
  std::string axes;
  /// The array with the counts in a file that has several. For .npz or .mat: its name (empty:
  /// `counts`, or the only array). For a TMF8829 log: `mp_histo` or `mp_histo_HA`. For TMF882x
  /// lines: `HLONG` or `HSHORT`.
  std::string array;
  /// Columns of any text table: a list of `capture`, `zone`, `row`, `column`, `bin`, `count`,
  /// `counts` (all following columns are bins), `skip`, and 'words' that each line has at this
  /// place (docs/capture.md).
  std::string pattern;
  /// Layout of the zones; state both or neither. If `axes` names rows and columns, the layout must
  /// agree with the array. Otherwise the default is a square; for a TMF8828 log it is 3 x 3
  /// (default), 4 x 4 or 8 x 8.
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
  /// world z = y. Left-handed data are accepted.
  std::string axes_world = "x,y,z";
  /// Rotation of T_world_sensor when positions are given; the identity looks along world +x.
  Eigen::Quaterniond sensor_rotation = Eigen::Quaterniond::Identity();

  /// The sensor to read from a TMF8828 log with several sensors on the bus; 0: the first one in the
  /// log.
  int i2c_address = 0;

  /// CheapSPAD: number of consecutive repeats averaged into one capture; 0: all repeats of a
  /// position. With 2 they are the samples of the publication.
  int repeats_per_sample = 0;
  PublishedFilter published_filter = PublishedFilter::none;

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Reads captures from all `paths`, in this order, into one file. A capture's `source` is the path
/// that it came from, and `index` is its place in that file. `warnings` receives one line for each
/// thing that was left out or assumed. Throws Error (one line: file, place, what was found, what is
/// accepted).
///
/// docs/capture.md explains the content of each format and how it becomes captures. A damaged line
/// of a log is named and left out, together with the capture that it belongs to.
CaptureFile import_captures(const std::vector<std::string>& paths,
                            const ImportOptions& options = {},
                            std::vector<std::string>* warnings = nullptr);

}  // namespace blindcorner
