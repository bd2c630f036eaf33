// SPDX-License-Identifier: Apache-2.0
/// libFuzzer's side of the readers: `blindcorner_fuzz --reader=NAME [libFuzzer's options]
/// [CORPUS]`.
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string_view>

#include "blindcorner/forward/error.h"
#include "fuzz/readers.h"

namespace {

using namespace blindcorner;

const fuzzing::Reader* chosen = nullptr;
std::unique_ptr<fuzzing::Folder> folder;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* count, char*** arguments) {
  constexpr std::string_view kOption = "--reader=";
  for (int i = 1; i < *count; ++i) {
    const std::string_view argument = (*arguments)[i];
    if (!argument.starts_with(kOption)) continue;
    const auto found = fuzzing::readers().find(argument.substr(kOption.size()));
    if (found != fuzzing::readers().end()) chosen = &found->second;
  }
  if (chosen == nullptr) {
    std::fprintf(stderr, "accepted: --reader=NAME, one of");
    for (const auto& [name, reader] : fuzzing::readers()) std::fprintf(stderr, " %s", name.c_str());
    std::fprintf(stderr, "\n");
    std::exit(2);
  }
  folder = std::make_unique<fuzzing::Folder>(*chosen);
  std::atexit([] { folder.reset(); });
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  const std::string file = folder->write(*chosen, {reinterpret_cast<const char*>(data), size});
  try {
    chosen->read(file);
  } catch (const Error&) {
  }
  return 0;
}
