# Read by CMake where scripts/shaderc.sh builds shaderc: most of the time of a file of glslang or SPIRV-Tools went to the same headers.
# Here SPIRV-Tools' are compiled once, those that it compiles so itself with Microsoft's compiler, and eight files are one.
if(PROJECT_NAME STREQUAL "native-shaderc" AND NOT CMAKE_VERSION VERSION_LESS 3.19)
  set(tools "${CMAKE_CURRENT_SOURCE_DIR}/spirv-tools/source")
  cmake_language(DEFER CALL target_precompile_headers SPIRV-Tools-static PRIVATE "${tools}/pch_source.h")
  cmake_language(DEFER CALL target_precompile_headers SPIRV-Tools-opt PRIVATE "${tools}/opt/pch_source_opt.h")
  cmake_language(DEFER CALL set_target_properties glslang SPIRV-Tools-static SPIRV-Tools-opt PROPERTIES
    UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
  # These have names that others have as well.
  cmake_language(DEFER CALL set_source_files_properties "${CMAKE_CURRENT_SOURCE_DIR}/glslang/SPIRV/SpvBuilder.cpp"
    TARGET_DIRECTORY glslang PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  cmake_language(DEFER CALL set_source_files_properties
    "${tools}/spirv_reducer_options.cpp" "${tools}/val/validate_ray_tracing_reorder.cpp"
    TARGET_DIRECTORY SPIRV-Tools-static PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  cmake_language(DEFER CALL set_source_files_properties
    "${tools}/opt/basic_block.cpp" "${tools}/opt/local_single_block_elim_pass.cpp"
    "${tools}/opt/local_single_store_elim_pass.cpp" "${tools}/opt/mem_pass.cpp" "${tools}/opt/reduce_load_size.cpp"
    TARGET_DIRECTORY SPIRV-Tools-opt PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endif()
