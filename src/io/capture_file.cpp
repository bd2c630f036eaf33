// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/capture_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>
#include <ImfTestFile.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/atomic_file.h"
#include "io/capture_metadata.h"
#include "io/exr_check.h"
#include "io/file_bytes.h"
#include "io/file_kind.h"

namespace blindcorner {
namespace {

constexpr const char* kAttribute = "blindcorner";
constexpr const char* kChannel = "Y";

bool is_lossless(Imf::Compression compression) {
  switch (compression) {
    case Imf::NO_COMPRESSION:
    case Imf::RLE_COMPRESSION:
    case Imf::ZIPS_COMPRESSION:
    case Imf::ZIP_COMPRESSION:
    case Imf::PIZ_COMPRESSION:
      return true;
    default:
      return false;
  }
}

const char* type_name(Imf::PixelType type) {
  return type == Imf::HALF ? "HALF" : type == Imf::UINT ? "UINT" : "an unknown type";
}

void check_channel(const Imf::Header& header, const std::string& path) {
  const Imf::Channel* channel = header.channels().findChannel(kChannel);
  if (channel == nullptr) {
    std::string found;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
      found += (found.empty() ? "" : ", ") + std::string(it.name());
    }
    throw Error(path, "channel Y is missing, found " + (found.empty() ? "none" : found));
  }
  if (channel->type != Imf::FLOAT) {
    throw Error(
        path, std::string("channel Y is of type ") + type_name(channel->type) + ", accepted FLOAT");
  }
  if (channel->xSampling != 1 || channel->ySampling != 1) {
    throw Error(path, "channel Y is subsampled, accepted sampling 1 x 1");
  }
  if (!is_lossless(header.compression())) {
    throw Error(path, "compression is lossy, accepted NONE, RLE, ZIPS, ZIP and PIZ");
  }
}

std::string metadata_attribute(const Imf::Header& header, const std::string& path) {
  if (header.find(kAttribute) == header.end()) {
    throw Error(path,
                "string attribute blindcorner is missing, so this EXR file is no capture file");
  }
  const auto* attribute = header.findTypedAttribute<Imf::StringAttribute>(kAttribute);
  if (attribute == nullptr) throw Error(path, "attribute blindcorner is not a string");
  return attribute->value();
}

/// Throws unless metadata and image agree on the number of counts, and the file can hold so many.
void check_extent(const CaptureFile& file, const Imath::Box2i& gate, double file_bytes,
                  const std::string& path) {
  const HistogramCube& cube = file.captures.front().counts;
  const double width = 1.0 + gate.max.x - double(gate.min.x);
  const double height = 1.0 + gate.max.y - double(gate.min.y);
  const double rows = double(cube.rows) * cube.columns * double(file.captures.size());
  auto whole = [](double value) { return std::to_string(static_cast<long long>(value)); };
  if (width != cube.bins) {
    throw Error(path, "the image is " + whole(width) + " pixels wide, but attribute blindcorner " +
                          "declares " + std::to_string(cube.bins) + " bins");
  }
  if (height != rows) {
    throw Error(path, "the image has " + whole(height) + " rows, but attribute blindcorner " +
                          "declares " + std::to_string(file.captures.size()) + " captures of " +
                          std::to_string(cube.rows) + " x " + std::to_string(cube.columns) +
                          " zones, " + whole(rows) + " rows");
  }
  if (width * height * sizeof(float) > kDeflateExpansion * file_bytes) {
    throw Error(path, "is truncated: " + whole(file_bytes) + " bytes cannot hold " + whole(width) +
                          " x " + whole(height) + " pixels");
  }
}

CaptureFile read_checked(const std::string& path) {
  Imf::InputFile image(path.c_str());
  const Imf::Header& header = image.header();
  check_channel(header, path);
  CaptureFile file =
      parse_metadata(metadata_attribute(header, path), path + ": attribute blindcorner");
  const Imath::Box2i gate = header.dataWindow();
  check_extent(file, gate, static_cast<double>(std::filesystem::file_size(path)), path);
  // OpenEXR may fill what is missing with zeros or rebuild a lost table of rows; neither is data.
  if (!image.isComplete()) throw Error(path, "is truncated: rows of histograms are missing");

  const std::size_t bins = static_cast<std::size_t>(file.captures.front().counts.bins);
  const std::size_t zones = static_cast<std::size_t>(file.captures.front().counts.zones());
  std::vector<float> pixels(bins * zones * file.captures.size());
  Imf::FrameBuffer buffer;
  buffer.insert(kChannel, Imf::Slice::Make(Imf::FLOAT, pixels.data(), gate, sizeof(float),
                                           bins * sizeof(float)));
  image.setFrameBuffer(buffer);
  image.readPixels(gate.min.y, gate.max.y);

  auto next = pixels.cbegin();
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    Capture& capture = file.captures[i];
    const auto end = next + static_cast<std::ptrdiff_t>(bins * zones);
    capture.counts.values.assign(next, end);
    next = end;
    capture.source = path;
    capture.index = static_cast<int>(i);
  }
  return file;
}

std::vector<float> pixels_of(const CaptureFile& file, const std::string& path) {
  std::vector<float> pixels;
  for (std::size_t i = 0; i < file.captures.size(); ++i) {
    for (const double value : file.captures[i].counts.values) {
      if (std::isfinite(value) && std::abs(value) > std::numeric_limits<float>::max()) {
        throw Error(path, "captures[" + std::to_string(i) + "] holds a count of " +
                              std::to_string(value) + ", more than a FLOAT pixel can hold");
      }
      pixels.push_back(static_cast<float>(value));
    }
  }
  return pixels;
}

std::string exr_bytes(const CaptureFile& file, const std::string& path) {
  const HistogramCube& cube = file.captures.front().counts;
  const std::vector<float> pixels = pixels_of(file, path);
  const std::size_t height = pixels.size() / static_cast<std::size_t>(cube.bins);
  if (height > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    throw Error(path, "too many histograms for one file");
  }
  Imf::Header header(cube.bins, static_cast<int>(height));
  header.compression() = Imf::ZIP_COMPRESSION;
  header.channels().insert(kChannel, Imf::Channel(Imf::FLOAT));
  header.insert(kAttribute, Imf::StringAttribute(metadata_text(file)));

  Imf::StdOSStream stream;
  {
    Imf::OutputFile image(stream, header);
    Imf::FrameBuffer buffer;
    buffer.insert(kChannel,
                  Imf::Slice::Make(Imf::FLOAT, pixels.data(), header.dataWindow(), sizeof(float),
                                   static_cast<std::size_t>(cube.bins) * sizeof(float)));
    image.setFrameBuffer(buffer);
    image.writePixels(static_cast<int>(height));
  }  // the destructor writes the table of rows
  return stream.str();
}

}  // namespace

CaptureFile read_captures(const std::string& path) {
  check_readable(path);
  if (!Imf::isOpenExrFile(path.c_str())) {
    check_file_kind(FileKind::capture, read_bytes(path), path);
    throw Error(path,
                "is not an OpenEXR file; accepted is a capture file (other formats have to "
                "be imported first)");
  }
  check_exr_header(read_bytes(path), path);
  try {
    return read_checked(path);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path, "is damaged or truncated: " + one_line(error.what()));
  }
}

void write_captures(const std::string& path, const CaptureFile& file) {
  check_captures(file, path);
  std::string bytes;
  try {
    bytes = exr_bytes(file, path);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path, "cannot be encoded as OpenEXR: " + one_line(error.what()));
  }
  write_atomically(path, bytes);
}

}  // namespace blindcorner
