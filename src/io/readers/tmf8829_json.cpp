// SPDX-License-Identifier: Apache-2.0
/// Log of a TMF8829 as the makers' programs write it (tmf8829_driver_python, logger version 4):
/// JSON, plain or gzipped. `Result_Set[f].mp_histo[row][column].bin` are counts, `ref_histo` is the
/// reference; `configuration` holds the registers.
///
/// Bins: with `bin_shift` b, a bin sums 2^b of the sensor's own bins, of which it uses
/// `histogram_bins`.
///
/// In logs of the evaluation program 2.2.5, all columns of a row hold the same histogram, and it
/// does not belong to that row. Its ambient light follows the noise that the results state along
/// the first row of zones (measured on a public log: correlation 0.9999, with any other row or
/// column at most 0.76). Its peaks are where the distances of these zones say, 5 mm rms. If
/// histograms repeat, the reader looks for the row or column of zones whose noise they follow. The
/// other zones get no exposures.
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "blindcorner/forward/error.h"
#include "io/readers/capture_reader.h"
#include "io/readers/text_lines.h"

namespace blindcorner {
namespace {

using Json = nlohmann::json;

/// Width of the sensor's own bins, s. The driver calls them 200 ps. The peaks of a public log (16 x
/// 16 zones, 16 distances from 1.0 to 2.8 m that the sensor states itself) ask for 204.4 +- 0.5.
constexpr double kBinWidth = 204.4e-12;

constexpr int kMostZonesAside = 64;
constexpr int kMostBins = 256;

/// Histograms and noise of one frame.
struct Frame {
  int number = 0;  ///< from 0, place in the log
  HistogramCube counts;
  std::vector<double> noise;  ///< [zones] of the results, empty where they are not in the log
};

std::string shape(const HistogramCube& cube) {
  return std::to_string(cube.rows) + " x " + std::to_string(cube.columns) + " x " +
         std::to_string(cube.bins);
}

/// The counts of a frame. Throws Json::exception or Error if it is damaged.
HistogramCube counts_of(const Json& rows) {
  const Json& first = rows.at(0).at(0).at("bin");
  const std::size_t columns = rows.at(0).size();
  if (rows.size() > kMostZonesAside || columns > kMostZonesAside || first.size() > kMostBins) {
    throw Error("histograms", "more than 64 x 64 zones of 256 bins");
  }
  HistogramCube cube(static_cast<int>(rows.size()), static_cast<int>(columns),
                     static_cast<int>(first.size()));
  double* next = cube.values.data();
  for (const Json& row : rows) {
    if (row.size() != columns) throw Error("histograms", "rows of unequal length");
    for (const Json& zone : row) {
      const Json& bins = zone.at("bin");
      if (bins.size() != first.size()) throw Error("histograms", "unequal numbers of bins");
      for (const Json& count : bins) *next++ = count.get<double>();
    }
  }
  return cube;
}

std::vector<double> noise_of(const Json& frame, const HistogramCube& counts) {
  std::vector<double> noise;
  if (!frame.contains("results")) return noise;
  for (const Json& row : frame["results"]) {
    for (const Json& zone : row) noise.push_back(zone.value("noise", std::nan("")));
  }
  if (std::ssize(noise) != counts.zones() ||
      !std::ranges::all_of(noise, [](double n) { return std::isfinite(n); })) {
    noise.clear();
  }
  return noise;
}

/// A whole number of the configuration.
std::optional<int> setting_of(const Json& configuration, const char* name) {
  if (!configuration.is_object() || !configuration.contains(name)) return std::nullopt;
  const Json& value = configuration[name];
  return value.is_number_integer() ? std::optional(value.get<int>()) : std::nullopt;
}

/// The content of a log, read frame by frame. A log that ends early gives the frames before its
/// end.
class Log {
 public:
  Log(const ImportSource& source, std::string array, ImportNotes& notes)
      : path_(source.path()), array_(std::move(array)), notes_(notes) {
    std::string key;
    const auto take = [&](int depth, Json::parse_event_t event, Json& parsed) {
      if (event == Json::parse_event_t::key && depth == 1) key = parsed.get<std::string>();
      if (event != Json::parse_event_t::object_end) return true;
      if (depth == 1 && key == "configuration") configuration_ = parsed;
      if (depth == 2 && key == "Result_Set") add(parsed);
      return depth != 2 || key != "Result_Set";  // frames are not kept
    };
    try {
      [[maybe_unused]] const Json rest = Json::parse(source.bytes(), take);
    } catch (const Json::parse_error& error) {
      const auto line =
          1 + std::count(source.bytes().begin(),
                         source.bytes().begin() +
                             std::min<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(error.byte),
                                                      std::ssize(source.bytes())),
                         '\n');
      notes_.push_back(line_place(path_, line) +
                       (source.cut() || error.byte >= source.bytes().size()
                            ? ": the log ends within a frame; what is before is kept"
                            : ": is damaged; what is before is kept"));
    }
  }

  std::vector<Frame>& frames() { return frames_; }

  std::optional<int> setting(const char* name) const { return setting_of(configuration_, name); }

 private:
  void add(const Json& frame) {
    const int number = next_++;
    const std::string where = path_ + ": Result_Set[" + std::to_string(number) + "]";
    try {
      if (!frame.contains(array_)) {
        notes_.push_back(where + ": holds no " + array_ + "; left out");
        return;
      }
      Frame read{number, counts_of(frame[array_]), {}};
      read.noise = noise_of(frame, read.counts);
      if (!frames_.empty() && shape(read.counts) != shape(frames_.front().counts)) {
        throw Error(where, "has " + shape(read.counts) + " rows x columns x bins, those before " +
                               shape(frames_.front().counts));
      }
      frames_.push_back(std::move(read));
    } catch (const std::exception& damage) {  // a value is not what it should be
      notes_.push_back(where + ": is damaged (" + damage.what() + "); left out");
    }
  }

  std::string path_;
  std::string array_;
  ImportNotes& notes_;
  Json configuration_;
  std::vector<Frame> frames_;
  int next_ = 0;
};

/// Bins that the sensor uses of `all`, as configured; nothing where the configuration does not say.
std::optional<int> configured_bins(std::optional<int> bins, std::optional<int> shift, int all) {
  if (!bins || !shift || *bins <= 0 || *shift < 0 || *shift >= 8) return std::nullopt;
  return std::clamp(*bins >> *shift, 1, all);
}

/// Bins that the sensor uses: as configured, else up to the last that ever held a count.
int used_bins(const std::vector<Frame>& frames, const Log& log) {
  const int all = frames.front().counts.bins;
  if (const auto bins =
          configured_bins(log.setting("histogram_bins"), log.setting("bin_shift"), all)) {
    return *bins;
  }
  int last = 0;
  for (const Frame& frame : frames) {
    for (int zone = 0; zone < frame.counts.zones(); ++zone) {
      for (int bin = last; bin < all; ++bin) {
        if (frame.counts.zone(zone)[bin] != 0) last = bin;
      }
    }
  }
  return last + 1;
}

/// Whether all columns of every row hold the same counts, in all frames.
bool rows_repeat(const std::vector<Frame>& frames) {
  return std::ranges::all_of(frames, [](const Frame& frame) {
    const HistogramCube& cube = frame.counts;
    for (int row = 0; row < cube.rows; ++row) {
      const double* first = cube.zone(row * cube.columns);
      for (int column = 1; column < cube.columns; ++column) {
        const double* other = cube.zone(row * cube.columns + column);
        if (!std::equal(first, first + cube.bins, other)) return false;
      }
    }
    return cube.columns > 1;
  });
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto n = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / n;
  const double mean_b = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0.0;
}

/// Ambient light in a bin, counts: the median over the bins.
double median(const double* bins, int count) {
  std::vector<double> sorted(bins, bins + count);
  std::nth_element(sorted.begin(), sorted.begin() + count / 2, sorted.end());
  return sorted[static_cast<std::size_t>(count / 2)];
}

/// Zones to which the rows of repeated histograms belong, [rows].
struct RepeatedZones {
  std::vector<int> zones;
  std::string text;  ///< "row 0"
};

/// The row or column of zones whose noise the histograms' ambient light follows; nothing where none
/// stands out.
std::optional<RepeatedZones> zones_of_repeats(const std::vector<Frame>& frames, int bins) {
  const HistogramCube& cube = frames.front().counts;
  const auto side = static_cast<std::size_t>(cube.rows);
  std::vector<double> ambient(side);
  std::vector<double> noise(static_cast<std::size_t>(cube.zones()));
  for (const Frame& frame : frames) {
    if (frame.noise.empty()) return std::nullopt;
    for (std::size_t row = 0; row < side; ++row) {
      ambient[row] += median(frame.counts.zone(static_cast<int>(row) * cube.columns), bins);
    }
    for (std::size_t zone = 0; zone < noise.size(); ++zone) noise[zone] += frame.noise[zone];
  }
  constexpr double kAlike = 0.98;  // row 0 of the public log has 0.9999, all others less than 0.77
  RepeatedZones best;
  double highest = kAlike;
  const auto consider = [&](const std::vector<int>& zones, const std::string& text) {
    std::vector<double> here;
    for (const int zone : zones) here.push_back(noise[static_cast<std::size_t>(zone)]);
    const double alike = correlation(ambient, here);
    if (alike <= highest) return;
    highest = alike;
    best = {zones, text};
  };
  for (int column = 0; column < cube.columns; ++column) {
    std::vector<int> zones;
    for (int row = 0; row < cube.rows; ++row) zones.push_back(row * cube.columns + column);
    consider(zones, "column " + std::to_string(column));
  }
  for (int row = 0; row < cube.rows && cube.rows == cube.columns; ++row) {
    std::vector<int> zones(side);
    std::iota(zones.begin(), zones.end(), row * cube.columns);
    consider(zones, "row " + std::to_string(row));
  }
  if (best.zones.empty()) return std::nullopt;
  return best;
}

Capture capture_of(const Frame& frame, int bins, const std::vector<int>& zones) {
  const HistogramCube& cube = frame.counts;
  Capture capture;
  capture.counts = HistogramCube(cube.rows, cube.columns, bins);
  if (zones.empty()) {
    for (int zone = 0; zone < cube.zones(); ++zone) {
      std::copy(cube.zone(zone), cube.zone(zone) + bins, capture.counts.zone(zone));
    }
    return capture;
  }
  capture.zone_exposures.emplace(static_cast<std::size_t>(cube.zones()), 0.0);
  for (int row = 0; row < cube.rows; ++row) {
    const int zone = zones[static_cast<std::size_t>(row)];
    const double* from = cube.zone(row * cube.columns);
    std::copy(from, from + bins, capture.counts.zone(zone));
    (*capture.zone_exposures)[static_cast<std::size_t>(zone)] = 1.0;
  }
  return capture;
}

/// The zones to which repeated histograms belong, with a note; empty if each zone has its own.
std::vector<int> place_repeats(const std::vector<Frame>& frames, int bins, const std::string& path,
                               ImportNotes& notes) {
  if (!rows_repeat(frames)) return {};
  const HistogramCube& cube = frames.front().counts;
  const std::string what = path + ": all " + std::to_string(cube.columns) +
                           " columns of a row hold the same histogram; ";
  if (auto found = zones_of_repeats(frames, bins)) {
    notes.push_back(what + "its ambient light is the noise that the results state for " +
                    found->text + " of the zones, so that these " + std::to_string(cube.rows) +
                    " zones get it and the others no exposures");
    return found->zones;
  }
  std::vector<int> zones;
  for (int row = 0; row < cube.rows; ++row) zones.push_back(row * cube.columns);
  notes.push_back(
      what + "nothing says of which column it is: column 0 gets it and the others no exposures");
  return zones;
}

bool recognise(const ImportSource& source) {
  const std::string& text = source.beginning();
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string::npos && text[first] == '{' &&
         text.find("\"Result_Set\"") != std::string::npos &&
         (text.find("\"mp_histo") != std::string::npos ||
          text.find("\"results\"") != std::string::npos);
}

CaptureFile read(const ImportSource& source, const ImportOptions& options, ImportNotes& notes) {
  const std::string& path = source.path();
  const std::string array = options.array.empty() ? "mp_histo" : options.array;
  Log log(source, array, notes);
  const std::vector<Frame>& frames = log.frames();
  if (frames.empty()) {
    throw Error(path, "holds no frame with " + array +
                          ", accepted: a log with histograms, mp_histo or mp_histo_HA");
  }
  const int bins = used_bins(frames, log);
  const std::vector<int> zones = place_repeats(frames, bins, path, notes);
  CaptureFile file;
  for (const Frame& frame : frames) file.captures.push_back(capture_of(frame, bins, zones));
  const HistogramCube& cube = frames.front().counts;
  file.sensor = "tmf8829_" + std::to_string(cube.columns) + "x" + std::to_string(cube.rows);
  const auto shift = log.setting("bin_shift");
  if (shift && *shift >= 0 && *shift < 8) file.bin_width = std::ldexp(kBinWidth, *shift);
  return file;
}

bool recognise_line(std::string_view line) {
  return line.starts_with('{') && (line.find("\"mp_histo") != std::string_view::npos ||
                                   line.find("\"Result_Set\"") != std::string_view::npos ||
                                   line.find("\"bin_shift\"") != std::string_view::npos);
}

/// A stream with one object per line: an element of a log's Result_Set, or an object that holds
/// Result_Set and configuration as a log does.
class LineStream : public LineReader {
 public:
  explicit LineStream(LineOptions options) : options_(std::move(options)) {
    if (options_.array.empty()) options_.array = "mp_histo";
  }

  void add(const TextLine& line, LineYield& yield) override {
    if (!line.text.starts_with('{')) return;
    const std::string where = line_place(options_.path, line.number);
    try {
      const Json object = Json::parse(line.text);
      if (object.contains("configuration")) configuration_ = object["configuration"];
      if (object.contains("Result_Set")) {
        for (const Json& frame : object["Result_Set"]) add(frame, where, yield);
      } else if (object.contains(options_.array)) {
        add(object, where, yield);
      }
    } catch (const std::exception& damage) {  // no JSON, or values that are not what they should be
      yield.notes.push_back({LineFault::damaged_line,
                             where + ": is damaged (" + damage.what() + "); the line is left out"});
    }
  }

  void interrupt(LineYield&) override { last_ = {}; }

 private:
  void add(const Json& frame, const std::string& where, LineYield& yield) {
    if (!frame.contains(options_.array)) return;
    Frame read{0, counts_of(frame[options_.array]), {}};
    if (read.counts.values == last_.values && read.counts.rows == last_.rows) {
      yield.notes.push_back(
          {LineFault::repeated_line, where + ": comes twice; the second is left out"});
      return;
    }
    last_ = read.counts;
    read.noise = noise_of(frame, read.counts);
    const int all = read.counts.bins;
    const int bins = configured_bins(setting_of(configuration_, "histogram_bins"),
                                     setting_of(configuration_, "bin_shift"), all)
                         .value_or(std::min(all, options_.bins));
    if (!zones_) {
      ImportNotes said;
      zones_ = place_repeats({read}, bins, options_.path, said);
      for (const std::string& text : said) yield.notes.push_back({LineFault::assumption, text});
    }
    yield.captures.push_back(capture_of(read, bins, *zones_));
  }

  LineOptions options_;
  Json configuration_;
  HistogramCube last_;
  std::optional<std::vector<int>> zones_;  ///< of repeated histograms; empty: each zone has its own
};

std::string print(const Capture& capture, const std::string& where) {
  const HistogramCube& counts = capture.counts;
  Json rows = Json::array();
  for (int zone = 0; zone < counts.zones(); ++zone) {
    if (zone % counts.columns == 0) rows.push_back(Json::array());
    Json bins = Json::array();
    for (int bin = 0; bin < counts.bins; ++bin) {
      const double count = counts.zone(zone)[bin];
      if (!(count >= 0 && count == std::floor(count) && count < 4294967296.0)) {
        throw Error(where, "found a count of " + std::to_string(count) +
                               ", accepted: whole numbers from 0 to 4294967295");
      }
      bins.push_back(static_cast<std::uint32_t>(count));
    }
    rows.back().push_back({{"bin", std::move(bins)}});
  }
  return Json({{"mp_histo", std::move(rows)}}).dump() + "\n";
}

}  // namespace

CaptureReader tmf8829_json_reader() {
  return {
      .name = "tmf8829",
      .recognises = "TMF8829 log of the makers' programs, JSON with Result_Set, plain or gzipped",
      .assumes = "bins of 204.4 ps times 2^bin_shift, zones as the log has them",
      .options = {"array"},
      .recognise = recognise,
      .read = read,
      .recognise_line = recognise_line,
      .lines = stream_of<LineStream>,
      .print = print};
}

}  // namespace blindcorner
