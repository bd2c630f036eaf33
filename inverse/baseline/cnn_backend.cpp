// SPDX-License-Identifier: Apache-2.0
#include "inverse/baseline/cnn_backend.h"

#include <dlfcn.h>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Found by the program's run path, or where the system keeps its libraries.
constexpr const char* kLibrary = "libblindcorner_cnn.so";

const CnnBackend* load_backend() {
  void* library = ::dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return nullptr;
  // POSIX has dlsym return functions as void*.
  const auto function = reinterpret_cast<CnnBackendFunction>(::dlsym(library, kCnnBackendFunction));
  return function == nullptr ? nullptr : function();
}

}  // namespace

const CnnBackend* find_cnn_backend() {
  static const CnnBackend* const backend = load_backend();
  return backend;
}

const CnnBackend& cnn_backend() {
  const CnnBackend* backend = find_cnn_backend();
  if (backend == nullptr) {
    throw Error("cnn",
                "this build has no libtorch, which the network needs; on Debian: apt-get install "
                "libtorch-dev, then configure and build again (cmake --preset release && cmake "
                "--build --preset release)");
  }
  return *backend;
}

}  // namespace blindcorner
