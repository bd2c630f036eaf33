// SPDX-License-Identifier: Apache-2.0
/// Format: tmf8829/zeromq/TMF8829_zeromq_protocol.md of github.com/ams-OSRAM/tmf8829_driver_python,
/// "Publish port 5558". That file leaves out the five bytes before each frame's header (the
/// sensor's registers 0xFA to 0xFE: a state and the host's clock) and the order of frames in dual
/// mode, which tmf8829_application_common.py there has. It ends a frame with 0xE0F0,
/// tmf8829_application_defines.py with 0xE0F7: the last four bits are not checked. All numbers are
/// little endian.
#include "io/readers/tmf8829_message.h"

#include <array>
#include <charconv>
#include <cstdint>
#include <vector>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr std::uint32_t kMagic = 0xFE5E1234;
constexpr unsigned kProtocol = 2;
constexpr std::size_t kMessageHeader = 84, kBefore = 5, kHeader = 16, kFooter = 12;
/// Leading bytes that the stated size of a message, or of a frame, leaves out.
constexpr std::size_t kUncounted = 8, kFrameUncounted = 4;
constexpr unsigned kHistograms = 0x2, kReferenceSpads = 0x3;
constexpr std::size_t kReferenceBytes = 4UL * 64 * 3;
constexpr unsigned kValid = 0x01, kAborted = 0xC0;

/// Zones and bins of a focal plane mode. Each frame holds a half of `rows` times `columns` zones,
/// and `across` times `down` pairs of frames interleave.
struct Mode {
  std::size_t rows, columns, bins, across, down;
  std::size_t frames() const { return 2 * across * down; }
  std::size_t histogram_bytes() const { return rows * columns / 2 * bins * 3; }
};
constexpr std::array<Mode, 6> kModes{{{8, 8, 256, 1, 1},
                                      {8, 8, 256, 1, 1},
                                      {16, 16, 64, 1, 1},
                                      {16, 16, 64, 2, 2},
                                      {16, 16, 64, 2, 2},
                                      {16, 16, 64, 3, 2}}};

Error damaged(const std::string& what) { return {"message", what}; }

std::uint32_t number(std::string_view bytes, std::size_t at, std::size_t size) {
  if (bytes.size() < at + size) throw damaged("ends early");
  std::uint32_t value = 0;
  for (std::size_t i = size; i-- > 0;) {
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  }
  return value;
}

/// One frame of histograms: its part of the focal plane, and its bytes.
struct Part {
  std::size_t mode = 0, place = 0;
  std::string_view histograms;
};

/// Takes the first frame off `rest`, and adds a part if it holds histograms.
void take_frame(std::string_view& rest, std::vector<Part>& parts) {
  const std::uint32_t id = number(rest, kBefore, 1), kind = id >> 4;
  std::size_t size = kBefore + kFrameUncounted + number(rest, kBefore + 2, 2);
  if (kind == kReferenceSpads) size = kBefore + kHeader + 32 + kFooter;
  if (size < kBefore + kHeader + kFooter || size > rest.size()) {
    throw damaged("holds a frame of " + std::to_string(size) +
                  " bytes, accepted: " + std::to_string(kBefore + kHeader + kFooter) + " to " +
                  std::to_string(rest.size()));
  }
  const std::string_view frame = rest.substr(0, size);
  rest.remove_prefix(size);
  if (kind != kHistograms) return;
  if (number(frame, size - 2, 2) >> 4 != 0xE0F) throw damaged("a frame's end is not marked");
  const std::uint32_t status = number(frame, size - 4, 1);
  if ((status & kValid) == 0 || (status & kAborted) != 0) {
    throw damaged("the sensor calls a frame invalid");
  }
  Part part{id & 0xF, number(frame, kBefore + 1, 1),
            frame.substr(kBefore + kHeader, size - kBefore - kHeader - kFooter)};
  if (part.mode >= kModes.size()) {
    throw damaged("focal plane mode " + std::to_string(part.mode) + ", accepted: 0 to 5");
  }
  const std::size_t expected = kReferenceBytes + kModes[part.mode].histogram_bytes();
  if (part.histograms.size() != expected || part.place >= kModes[part.mode].frames()) {
    throw damaged("a frame has " + std::to_string(part.histograms.size()) +
                  " bytes of histograms at place " + std::to_string(part.place) +
                  ", accepted: " + std::to_string(expected) + " at 0 to " +
                  std::to_string(kModes[part.mode].frames() - 1));
  }
  part.histograms.remove_prefix(kReferenceBytes);
  parts.push_back(part);
}

/// The bytes of each zone's histogram, [rows][columns]. `parts` are those of one array.
std::vector<std::string_view> zones_of(const Mode& mode, const std::vector<Part>& parts) {
  const std::size_t columns = mode.columns * mode.across, size = mode.bins * 3;
  std::vector<std::string_view> zones(mode.rows * mode.down * columns);
  for (const Part& part : parts) {
    const std::size_t pair = part.place / 2;
    const std::size_t right = part.place % 2 * columns / 2 + pair % mode.across;
    std::string_view bytes = part.histograms;
    for (std::size_t row = 0; row < mode.rows; ++row) {
      for (std::size_t column = 0; column < mode.columns / 2; ++column) {
        const std::size_t down = row * mode.down + pair / mode.across;
        zones[down * columns + right + column * mode.across] = bytes.substr(0, size);
        bytes.remove_prefix(size);
      }
    }
  }
  for (const std::string_view zone : zones) {
    if (zone.empty()) throw damaged("lacks histograms of some zones");
  }
  return zones;
}

void append(std::string& line, const char* name, const Mode& mode, const std::vector<Part>& parts) {
  const std::vector<std::string_view> zones = zones_of(mode, parts);
  const std::size_t columns = mode.columns * mode.across;
  line.append(line.size() > 1 ? ",\"" : "\"").append(name).append("\":[");
  std::array<char, 16> digits{};
  for (std::size_t zone = 0; zone < zones.size(); ++zone) {
    if (zone % columns == 0) line += zone == 0 ? "[" : "],[";
    line += zone % columns == 0 ? "{\"bin\":[" : ",{\"bin\":[";
    for (std::size_t bin = 0; bin < mode.bins; ++bin) {
      if (bin > 0) line += ',';
      const auto end = std::to_chars(digits.data(), digits.data() + digits.size(),
                                     number(zones[zone], 3 * bin, 3));
      line.append(digits.data(), end.ptr);
    }
    line += "]}";
  }
  line += "]]";
}

}  // namespace

std::string tmf8829_line(std::string_view message) {
  if (number(message, 0, 4) != kMagic) throw damaged("does not begin with 0xFE5E1234");
  if (const auto version = number(message, 4, 1); version != kProtocol) {
    throw damaged("is of protocol " + std::to_string(version) + ", accepted: 2");
  }
  const std::size_t size = kUncounted + number(message, 8, 4);
  if (size != message.size() || size < kMessageHeader) {
    throw damaged("states " + std::to_string(size) + " bytes and has " +
                  std::to_string(message.size()));
  }
  std::vector<Part> parts;
  std::string_view rest = message.substr(kMessageHeader);
  while (!rest.empty()) take_frame(rest, parts);
  if (parts.empty()) {
    throw damaged("holds no histograms; the makers' program has them with \"histograms\": 1");
  }
  const Mode& mode = kModes[parts.front().mode];
  for (const Part& part : parts) {
    if (part.mode != parts.front().mode) throw damaged("mixes focal plane modes");
  }
  const bool dual = parts.size() == 2 * mode.frames();
  if (!dual && parts.size() != mode.frames()) {
    throw damaged("holds " + std::to_string(parts.size()) + " frames of histograms, accepted: " +
                  std::to_string(mode.frames()) + ", or twice as many in dual mode");
  }
  // In dual mode the frames of high accuracy come first. In modes with `down` 2, this holds for
  // each half of the rows.
  const std::size_t turn = dual ? mode.frames() / mode.down : parts.size();
  std::array<std::vector<Part>, 2> arrays;
  for (std::size_t i = 0; i < parts.size(); ++i) arrays[i / turn % 2].push_back(parts[i]);
  std::string line = "{";
  if (dual) append(line, "mp_histo_HA", mode, arrays[0]);
  append(line, "mp_histo", mode, arrays[dual ? 1 : 0]);
  return line + "}\n";
}

}  // namespace blindcorner
