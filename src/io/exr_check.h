// SPDX-License-Identifier: Apache-2.0
/// Checks what OpenEXR takes from a file's header without a check of its own.
#pragma once

#include <string>

namespace blindcorner {

/// Throws Error if an attribute of an OpenEXR header claims more bytes than the file has, or
/// another number of bytes than its type takes, or if the file has several headers. OpenEXR would
/// allocate whatever it finds there. `bytes` holds the file, `path` names it in messages.
void check_exr_header(const std::string& bytes, const std::string& path);

}  // namespace blindcorner
