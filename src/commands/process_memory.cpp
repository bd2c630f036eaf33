// SPDX-License-Identifier: Apache-2.0
#include "commands/process_memory.h"

#include <malloc.h>

#include <fstream>
#include <string>

namespace blindcorner {

ProcessMemory process_memory() {
  constexpr double kMegabytes = 1024e-6;  // the file counts in units of 1024 bytes
  ProcessMemory memory;
  std::ifstream status("/proc/self/status");
  for (std::string name; status >> name;) {
    double value = 0;
    if (name == "VmRSS:" && status >> value) memory.resident = kMegabytes * value;
    if (name == "VmHWM:" && status >> value) memory.peak = kMegabytes * value;
    status.ignore(1 << 20, '\n');
  }
  return memory;
}

void reset_peak_memory() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // see proc(5)
}

}  // namespace blindcorner
