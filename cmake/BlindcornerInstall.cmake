include(CMakePackageConfigHelpers)
install(DIRECTORY include/blindcorner DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/blindcorner/scenes COMPONENT program)
install(DIRECTORY schema/ DESTINATION ${CMAKE_INSTALL_DATADIR}/blindcorner/schema COMPONENT program)
install(TARGETS blindcorner_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)

# The manual page and what completes commands in shells, as the program prints them.
set(shell_dir ${CMAKE_CURRENT_BINARY_DIR}/shell)
set(shell_files ${shell_dir}/blindcorner.1 ${shell_dir}/blindcorner ${shell_dir}/_blindcorner
                ${shell_dir}/blindcorner.fish)
add_custom_command(OUTPUT ${shell_files}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${shell_dir}
  COMMAND blindcorner_program man > ${shell_dir}/blindcorner.1
  COMMAND blindcorner_program completion bash > ${shell_dir}/blindcorner
  COMMAND blindcorner_program completion zsh > ${shell_dir}/_blindcorner
  COMMAND blindcorner_program completion fish > ${shell_dir}/blindcorner.fish
  DEPENDS blindcorner_program VERBATIM)
add_custom_target(blindcorner_shell ALL DEPENDS ${shell_files})
# Optional: who builds the program alone can install it.
install(FILES ${shell_dir}/blindcorner.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1
        COMPONENT program OPTIONAL)
install(FILES ${shell_dir}/blindcorner OPTIONAL
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program)
install(FILES ${shell_dir}/_blindcorner OPTIONAL
        DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT program)
install(FILES ${shell_dir}/blindcorner.fish OPTIONAL
        DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT program)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/blindcorner)
install(EXPORT blindcornerTargets NAMESPACE blindcorner:: DESTINATION ${package_dir}
        COMPONENT development)
configure_package_config_file(cmake/blindcornerConfig.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfigVersion.cmake DESTINATION ${package_dir}
        COMPONENT development)

# The same for builds that use pkg-config.
file(RELATIVE_PATH pc_prefix "${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig" "${CMAKE_INSTALL_PREFIX}")
set(pc_optional "")
foreach(library matio hdf5)
  if(${library}_FOUND)
    string(APPEND pc_optional " ${library}")
  endif()
endforeach()
configure_file(cmake/blindcorner.pc.in ${CMAKE_CURRENT_BINARY_DIR}/blindcorner.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/blindcorner.pc
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)

# `cpack` in the build folder: blindcorner_VERSION_ARCH.deb with the program, blindcorner-learning with
# what needs libtorch (2 GB), where that was found, libblindcorner-dev with libraries and headers.
# Shared libraries that the program needs are named by dpkg-shlibdeps.
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program development)
if(TARGET blindcorner_cnn)
  list(APPEND CPACK_COMPONENTS_ALL learning)
endif()
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_CONTACT "The blindcorner authors <blindcorner@example.org>")
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME blindcorner)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS blindcorner-learning)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
    "Fits a physical model of three-bounce light to measured histograms and\n returns the hidden object's pose, its uncertainty and all rivals.")
set(CPACK_DEBIAN_LEARNING_PACKAGE_NAME blindcorner-learning)
set(CPACK_DEBIAN_LEARNING_PACKAGE_SECTION science)
set(CPACK_DEBIAN_LEARNING_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_LEARNING_PACKAGE_DEPENDS "blindcorner (= ${PROJECT_VERSION})")
set(CPACK_COMPONENT_LEARNING_DESCRIPTION
    "The learned baselines (cnn train, cnn evaluate, networks as perception), on libtorch.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libblindcorner-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "Static libraries and headers for C++20 with CMake and pkg-config files.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libeigen3-dev, libceres-dev, libembree-dev, libtbb-dev, libopenexr-dev, nlohmann-json3-dev, libzip-dev, zlib1g-dev, libpng-dev, libyaml-cpp-dev, libtinyobjloader-dev, libmatio-dev, libhdf5-dev")
include(CPack)
