// SPDX-License-Identifier: Apache-2.0
/// What OpenEXR believes of a file's header before it is looked at.
#pragma once

#include <string>

namespace blindcorner {

/// Throws Error when an attribute of an OpenEXR header claims more bytes than the file has, or
/// others than its type takes, or when a file has several headers: OpenEXR would allocate what it
/// then finds. `bytes` holds the file, `path` names it in messages.
void check_exr_header(const std::string& bytes, const std::string& path);

}  // namespace blindcorner
