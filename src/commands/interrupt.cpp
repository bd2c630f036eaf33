// SPDX-License-Identifier: Apache-2.0
#include "commands/interrupt.h"

#include <csignal>
#include <cstdio>

namespace blindcorner {
namespace {

volatile std::sig_atomic_t interrupt_asked = 0;

void ask_to_end(int signal) {
  interrupt_asked = 1;
  std::signal(signal, SIG_DFL);  // the next one ends the program
}

}  // namespace

Interruptible::Interruptible() {
  interrupt_asked = 0;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, ask_to_end);
}

Interruptible::~Interruptible() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
}

bool Interruptible::asked() { return interrupt_asked != 0; }

void tell_interrupted(std::size_t finished, std::size_t all, const std::string& what,
                      const std::string& rest) {
  std::fprintf(stderr, "blindcorner: interrupted: %zu of %zu %s are done%s%s\n", finished, all,
               what.c_str(), rest.empty() ? "" : "; ", rest.c_str());
}

}  // namespace blindcorner
