// SPDX-License-Identifier: Apache-2.0
#include "module.h"

#include <tbb/global_control.h>

#include <memory>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/program_name.h"
#include "interrupt.h"

namespace nb = nanobind;

namespace blindcorner {
const char* commit();  // cmake/GitCommit.cmake
}

namespace {

/// Sets the number of threads that the library may use; 0: one per processor.
void set_threads(int count) {
  static std::unique_ptr<tbb::global_control> limit;
  if (count < 0 || count > 1024) {
    throw blindcorner::Error("threads", "found " + std::to_string(count) + ", accepted: 0 to 1024");
  }
  limit.reset();
  if (count > 0) {
    limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                  static_cast<std::size_t>(count));
  }
}

}  // namespace

NB_MODULE(_core, m) {
  m.doc() = "The C++ part of blindcorner; use the package blindcorner itself.";
  nb::exception<blindcorner::Error> error(m, "Error", PyExc_RuntimeError);
  error.doc() =
      "Wrong input: one line that names the place (file, field), what was found there and what is "
      "accepted; for a scene with several problems, a line for each.";
  nb::exception<blindcorner::OutputError> output_error(m, "OutputError", error);
  output_error.doc() = "Nothing wrong with the input: what came of it could not be written.";
  m.attr("version") = BLINDCORNER_VERSION;
  blindcorner::set_program_name(std::string("blindcorner " BLINDCORNER_VERSION " (") +
                                blindcorner::commit() + ")");
  m.def("set_threads", &set_threads, nb::arg("count"),
        "Lets the library use at most `count` threads; 0: one per processor.");
  blindcorner::python::add_scene(m);
  blindcorner::python::add_captures(m);
  blindcorner::python::add_fit(m);
  blindcorner::python::add_studies(m);
  blindcorner::python::add_drive(m);
  blindcorner::python::add_places(m);
  nb::module_::import_("atexit").attr("register")(
      nb::cpp_function(&blindcorner::python::join_abandoned));
}
