// SPDX-License-Identifier: Apache-2.0
#include "interrupt.h"

#include <atomic>
#include <mutex>
#include <vector>

namespace blindcorner::python {
namespace {

struct Abandoned {
  std::mutex mutex;
  std::vector<std::thread> threads;
};

Abandoned& abandoned() {
  static Abandoned all;
  return all;
}

}  // namespace

bool on_main_thread() {
  const nb::object threading = nb::module_::import_("threading");
  return threading.attr("current_thread")().is(threading.attr("main_thread")());
}

void abandon(std::thread thread) {
  const std::scoped_lock lock(abandoned().mutex);
  abandoned().threads.push_back(std::move(thread));
}

void join_abandoned() {
  const nb::gil_scoped_release released;
  std::vector<std::thread> threads;
  {
    const std::scoped_lock lock(abandoned().mutex);
    threads.swap(abandoned().threads);
  }
  for (std::thread& thread : threads) thread.join();
}

Callback::Callback(nb::object callable) {
  if (callable.is_none()) return;
  callable_ = {new nb::object(std::move(callable)), [](nb::object* object) {
                 const nb::gil_scoped_acquire held;
                 delete object;
               }};
}

}  // namespace blindcorner::python
