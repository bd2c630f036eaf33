# blindcorner_commit(target) compiles `const char* blindcorner::commit()` into the target: the commit
# of the sources, as "1a2b3c4" or "1a2b3c4-modified", "unknown" where they are in no git repository of
# their own. Every build asks git; the one object is compiled again, and the target linked again, only
# where the answer has changed. Libraries do not know the commit, so that they stay as they are.
#
# As a script (cmake -DSOURCE_DIR=... -DOUTPUT=... -P GitCommit.cmake) this file writes that source.
if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  set(commit "unknown")
  find_program(git git)
  if(git)
    execute_process(COMMAND ${git} rev-parse --show-toplevel WORKING_DIRECTORY ${SOURCE_DIR}
                    OUTPUT_VARIABLE top ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    get_filename_component(source "${SOURCE_DIR}" REALPATH)
    if(top STREQUAL source)
      execute_process(COMMAND ${git} rev-parse --short=7 HEAD WORKING_DIRECTORY ${SOURCE_DIR}
                      OUTPUT_VARIABLE head RESULT_VARIABLE status ERROR_QUIET
                      OUTPUT_STRIP_TRAILING_WHITESPACE)
      # What the program is made of; documents and measured figures change nothing of it.
      execute_process(COMMAND ${git} --no-optional-locks status --porcelain --untracked-files=no --
                              CMakeLists.txt cmake include forward inverse planner src schema
                      WORKING_DIRECTORY ${SOURCE_DIR} OUTPUT_VARIABLE changes ERROR_QUIET)
      if(status EQUAL 0)
        set(commit "${head}")
        if(changes)
          string(APPEND commit "-modified")
        endif()
      endif()
    endif()
  endif()
  set(text "namespace blindcorner {\nconst char* commit();\nconst char* commit() { return \"${commit}\"; }\n}  // namespace blindcorner\n")
  set(there "")
  if(EXISTS "${OUTPUT}")
    file(READ "${OUTPUT}" there)
  endif()
  if(NOT there STREQUAL text)
    file(WRITE "${OUTPUT}" "${text}")
  endif()
  return()
endif()

set(blindcorner_commit_script ${CMAKE_CURRENT_LIST_FILE})
get_filename_component(blindcorner_commit_source_dir ${CMAKE_CURRENT_LIST_DIR} DIRECTORY)

function(blindcorner_commit target)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${target}_commit.cpp)
  set(write ${CMAKE_COMMAND} -DSOURCE_DIR=${blindcorner_commit_source_dir} -DOUTPUT=${output}
            -P ${blindcorner_commit_script})
  execute_process(COMMAND ${write})  # so that the source is there when the build is planned
  add_custom_target(${target}_commit COMMAND ${write} BYPRODUCTS ${output} VERBATIM)
  add_dependencies(${target} ${target}_commit)
  target_sources(${target} PRIVATE ${output})
  set_source_files_properties(${output} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
