include(CMakePackageConfigHelpers)
install(DIRECTORY include/blindcorner DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/blindcorner/scenes)
install(TARGETS blindcorner_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/blindcorner)
install(EXPORT blindcornerTargets NAMESPACE blindcorner:: DESTINATION ${package_dir})
configure_package_config_file(cmake/blindcornerConfig.cmake.in
  ${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/blindcornerConfigVersion.cmake DESTINATION ${package_dir})

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
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
