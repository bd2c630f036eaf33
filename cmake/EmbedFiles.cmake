# embed_files(target HEADER_NAME name=file ...) compiles files into the target as string views:
# namespace blindcorner::embedded, function `std::string_view file(std::string_view name)`.
function(embed_files target function)
  set(source "${CMAKE_CURRENT_BINARY_DIR}/${function}.cpp")
  set(cases "")
  foreach(entry IN LISTS ARGN)
    string(REGEX MATCH "^([^=]+)=(.+)$" _ "${entry}")
    set(name "${CMAKE_MATCH_1}")
    set(file "${CMAKE_MATCH_2}")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
    file(READ "${file}" hex HEX)
    string(LENGTH "${hex}" size)
    math(EXPR size "${size} / 2")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
    string(MAKE_C_IDENTIFIER "${name}" id)
    string(APPEND arrays "const unsigned char ${id}[] = {${bytes}0};\n")
    string(APPEND cases "  if (name == \"${name}\") return {reinterpret_cast<const char*>(${id}), ${size}};\n")
    string(APPEND names "\"${name}\", ")
  endforeach()
  file(GENERATE OUTPUT "${source}" CONTENT
"#include <string_view>
#include <vector>
namespace {
${arrays}}
namespace blindcorner::embedded {
std::string_view ${function}(std::string_view name);
std::vector<std::string_view> ${function}_names();
std::string_view ${function}(std::string_view name) {
${cases}  return {};
}
std::vector<std::string_view> ${function}_names() { return {${names}}; }
}  // namespace blindcorner::embedded
")
  target_sources(${target} PRIVATE "${source}")
endfunction()
