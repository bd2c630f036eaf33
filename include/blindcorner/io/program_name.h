// SPDX-License-Identifier: Apache-2.0
/// The program, with its version, that wrote a file: the field `program` of results, drives and
/// journals.
#pragma once

#include <string>

namespace blindcorner {

/// "blindcorner 0.1.0", with this library's version, unless set_program_name has changed it.
const std::string& program_name();

/// Sets the name that files carry from now on, for example "blindcorner 0.1.0 (1a2b3c4)". A program
/// calls it once at its start, before threads read the name. Throws Error if the name is empty,
/// does not begin with a letter, or contains a comma or a line end, because the name is a cell of
/// tables.
void set_program_name(const std::string& name);

}  // namespace blindcorner
