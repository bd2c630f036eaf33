// SPDX-License-Identifier: Apache-2.0
/// Replays the saved corpus through a reader with the compiler of the normal build, and some
/// damaged copies of each file, always the same ones: `blindcorner_replay READER CORPUS MUTANTS`.
/// Ends with 1 where a reader throws anything but an Error.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"
#include "fuzz/readers.h"

namespace {

namespace fs = std::filesystem;
using namespace blindcorner;

/// Files beyond this size are replayed, but not damaged.
constexpr std::size_t kMaxBytes = 65536;

/// One of the ways in which files are damaged: cut off, a few bytes changed, a part repeated or
/// left out, a number replaced by an extreme one.
std::string damaged(const std::string& bytes, std::mt19937& random) {
  static const std::vector<std::string> kExtreme{
      "-1", "0",  "1e308",  "99999999999999999999", "null", "nan", "[[[[[[",
      "\"", "{}", "1e-320", "4294967296",           "-0.5"};
  std::string text = bytes;
  const auto place = [&] { return random() % std::max<std::size_t>(text.size(), 1); };
  switch (random() % 5) {
    case 0:
      text.resize(place());
      break;
    case 1:
      for (unsigned i = 0; i < 1 + random() % 8 && !text.empty(); ++i) {
        text[place()] = static_cast<char>(random());
      }
      break;
    case 2: {
      const std::string part = text.substr(place(), random() % 256);
      text.insert(place(), part);
      break;
    }
    case 3:
      text.erase(place(), random() % 64);
      break;
    default: {
      const std::size_t digit = text.find_first_of("0123456789", place());
      if (digit == std::string::npos) break;
      const std::size_t end = text.find_first_not_of("0123456789.eE+-", digit);
      text.replace(digit, std::min(end, text.size()) - digit, kExtreme[random() % kExtreme.size()]);
    }
  }
  return text;
}

/// Whether the reader returned or threw an Error.
bool holds(const fuzzing::Reader& reader, const fuzzing::Folder& folder, const std::string& bytes) {
  try {
    reader.read(folder.write(reader, bytes));
  } catch (const Error&) {
  } catch (const std::exception& error) {
    std::fprintf(stderr, "threw no Error: %s\n", error.what());
    return false;
  }
  return true;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4 || !fuzzing::readers().contains(std::string_view(arguments[1]))) {
    std::fprintf(stderr, "accepted: blindcorner_replay READER CORPUS MUTANTS\n");
    return 2;
  }
  const fuzzing::Reader& reader = fuzzing::readers().find(std::string_view(arguments[1]))->second;
  const fuzzing::Folder folder(reader);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(arguments[2])) files.push_back(entry.path());
  std::ranges::sort(files);
  int failed = 0, replayed = 0;
  for (const fs::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    std::mt19937 random(1);
    const int mutants = bytes.size() <= kMaxBytes ? std::atoi(arguments[3]) : 0;
    for (int i = 0; i <= mutants; ++i, ++replayed) {
      const std::string text = i == 0 ? bytes : damaged(bytes, random);
      if (holds(reader, folder, text)) continue;
      ++failed;
      const std::string kept = std::string(arguments[1]) + "_" + std::to_string(failed);
      std::ofstream(kept, std::ios::binary) << text;
      std::fprintf(stderr, "%s, copy %d, kept as %s\n", file.c_str(), i, kept.c_str());
    }
  }
  std::printf("%d files and damaged copies, %d failed\n", replayed, failed);
  return failed > 0 || files.empty() ? 1 : 0;
}
