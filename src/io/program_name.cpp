// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/program_name.h"

#include <cctype>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

std::string& name_now() {
  static std::string name = "blindcorner " BLINDCORNER_VERSION;
  return name;
}

}  // namespace

const std::string& program_name() { return name_now(); }

void set_program_name(const std::string& name) {
  if (name.empty() || std::isalpha(static_cast<unsigned char>(name.front())) == 0 ||
      name.find_first_of(",\r\n") != std::string::npos) {
    throw Error("program name", "found \"" + name +
                                    "\", accepted: text that begins with a letter, without commas "
                                    "and line ends");
  }
  name_now() = name;
}

}  // namespace blindcorner
