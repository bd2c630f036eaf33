// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/report/index_page.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <optional>
#include <vector>

#include "blindcorner/io/atomic_file.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "index.html";
/// Number of bytes at the beginning of a file that are read. They hold a page's head.
constexpr std::size_t kLookedAt = 4096;

struct Kind {
  const char* ending;
  const char* meaning;
};

/// What files are, by the end of their names; the first that fits counts.
constexpr std::array kKinds{
    Kind{"result.json", "result of a fit: modes, covariances, presence"},
    Kind{"evaluation.json", "errors, coverage and normalised errors"},
    Kind{"drive.json", "all frames of a drive: what was known, decided and done"},
    Kind{"path.json", "the path, point by point"},
    Kind{"journal.csv", "trials in the order in which they ended"},
    Kind{"trials.csv", "a row for each trial"},
    Kind{"errors.csv", "a row for each trial with an injected error"},
    Kind{"estimates.csv", "a row for each capture: truth and estimate"},
    Kind{"training.csv", "losses by epoch"},
    Kind{".json", "figures and settings, for other programs"},
    Kind{".csv", "table"},
    Kind{".svg", "picture"},
    Kind{".png", "picture"},
    Kind{".exr", "captures: histograms, for fit and for viewers of OpenEXR"},
    Kind{".npz", "captures: histograms, for numpy"},
    Kind{".hdf5", "captures: histograms, for tal"},
    Kind{".pt", "weights of a network"},
};

std::optional<std::string> meaning_of(const std::string& name) {
  const auto kind = std::ranges::find_if(
      kKinds, [&name](const Kind& known) { return name.ends_with(known.ending); });
  return kind == kKinds.end() ? std::nullopt : std::optional<std::string>(kind->meaning);
}

std::string beginning_of(const fs::path& path) {
  std::string text(kLookedAt, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return text;
}

/// The text between two words. Empty: one of them is missing.
std::string between(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t at = text.find(begin);
  if (at == std::string::npos) return "";
  const std::size_t from = at + begin.size(), to = text.find(end, from);
  return to == std::string::npos ? "" : text.substr(from, to - from);
}

/// A path within the directory as a link's target, so that no character means anything else.
std::string link_target(const fs::path& path) {
  std::string target;
  for (const char character : path.generic_string()) {
    const bool plain = (character >= 'a' && character <= 'z') || character == '/' ||
                       (character >= 'A' && character <= 'Z') || character == '-' ||
                       (character >= '0' && character <= '9') || character == '_' ||
                       character == '.';
    target +=
        plain ? std::string(1, character)
              : formatted("%%%02X", static_cast<unsigned>(static_cast<unsigned char>(character)));
  }
  return target;
}

/// One line of a list; `what` is HTML already.
std::string entry(const fs::path& path, const std::string& what) {
  return "<p><a href=\"" + link_target(path) + "\">" + html_safe(path.generic_string()) + "</a> " +
         what + "</p>\n";
}

/// The line of a page: its title and headline, as they stand in its head.
std::string page_entry(const fs::path& directory, const fs::path& page) {
  const std::string head = beginning_of(directory / page);
  const std::string headline = between(head, "<meta name=\"description\" content=\"", "\">");
  return entry(page, "<b>" + between(head, "<title>", "</title>") + "</b>" +
                         (headline.empty() ? "" : "<br>" + headline));
}

struct Listing {
  std::vector<fs::path> pages, files, directories;
};

/// Names in order. Hidden entries, and those that cannot be read, are left out.
Listing listing_of(const fs::path& directory) {
  Listing listing;
  std::error_code unreadable;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, unreadable)) {
    const fs::path name = entry.path().filename();
    std::error_code unimportant;
    if (name.string().starts_with(".") || name == kName) continue;
    if (entry.is_directory(unimportant)) {
      if (!entry.is_symlink(unimportant)) listing.directories.push_back(name);
    } else if (is_own_page(entry.path().string())) {
      listing.pages.push_back(name);
    } else if (meaning_of(name.string())) {
      listing.files.push_back(name);
    }
  }
  for (auto* names : {&listing.pages, &listing.files, &listing.directories}) {
    std::ranges::sort(*names);
  }
  return listing;
}

std::string pages_below(const fs::path& directory, const fs::path& below, int levels) {
  const Listing listing = listing_of(directory / below);
  std::string entries;
  for (const fs::path& page : listing.pages) entries += page_entry(directory, below / page);
  if (levels == 1) return entries;
  for (const fs::path& deeper : listing.directories) {
    entries += pages_below(directory, below / deeper, levels - 1);
  }
  return entries;
}

std::string section(const std::string& title, const std::string& entries) {
  return entries.empty() ? "" : "<h2>" + title + "</h2>\n" + entries;
}

}  // namespace

bool is_own_page(const std::string& path) {
  return path.ends_with(".html") && beginning_of(path).find(kGenerator) != std::string::npos;
}

void write_index(const std::string& directory) {
  constexpr int kLevels = 2;  // trials have replay/<perception>_<seed>/drive.html
  const fs::path index = fs::path(directory) / kName;
  std::error_code unimportant;
  const bool there = fs::exists(fs::symlink_status(index, unimportant));
  if (there && !is_own_page(index.string())) return;
  const Listing listing = listing_of(directory);
  std::string pages, files, below;
  for (const fs::path& page : listing.pages) pages += page_entry(directory, page);
  for (const fs::path& file : listing.files) files += entry(file, *meaning_of(file.string()));
  for (const fs::path& path : listing.directories) below += pages_below(directory, path, kLevels);
  if (pages.empty() && below.empty() && !there) return;
  const fs::path name = fs::absolute(fs::path(directory) / "", unimportant).lexically_normal();
  write_atomically(index.string(),
                   plain_page("Results in " + name.parent_path().filename().string(), "",
                              section("Pages", pages) + section("Files", files) +
                                  section("In directories below", below)));
}

void refresh_index(const std::string& directory) {
  if (is_own_page((fs::path(directory) / kName).string())) write_index(directory);
}

}  // namespace blindcorner
