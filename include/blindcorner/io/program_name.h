// SPDX-License-Identifier: Apache-2.0
/// Which program, of which version, has written a file: the field `program` of results, drives and
/// journals.
#pragma once

#include <string>

namespace blindcorner {

/// "blindcorner 0.1.0" with this library's version, unless set_program_name has said otherwise.
const std::string& program_name();

/// Files name this program from now on, "blindcorner 0.1.0 (1a2b3c4)" say. A program calls it once
/// at its start, before threads read the name. Throws Error where the name is empty, does not begin
/// with a letter, or holds a comma or a line's end, because it is a cell of tables.
void set_program_name(const std::string& name);

}  // namespace blindcorner
