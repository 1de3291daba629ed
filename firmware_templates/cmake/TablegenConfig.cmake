# tablegen as a build step of CMake, with Makefiles or Ninja. In a CMakeLists.txt:
#
#     find_package(Tablegen REQUIRED)
#     tablegen_build(scan.toml TARGET scan)
#     target_link_libraries(firmware PRIVATE scan)
#
# with -DTablegen_DIR=DIRECTORY on the command line of cmake, `tablegen paths --cmake` being the directory.
#
#     tablegen_build(SCAN TARGET NAME [OUTPUT DIRECTORY])
#
# builds the scan file into DIRECTORY (by default tablegen/NAME in the binary directory), and makes a library NAME of
# its C sources: NAME.c, NAME_program.c (not if header-only), and the runtime dac_*.c. Who links to it finds the headers, and
# is compiled with the DAC_TABLE_STORAGE_BITS and DAC_OUTPUT_STORAGE_BITS that the scan needs, with its DAC_SHAPING,
# with DAC_SPLINE for cubic tables, DAC_SLOW_PART for a scan at an angle, and DAC_PIXEL_TABLE for a sine.
#
#     tablegen_runtime(TARGET NAME SCANS SCAN... [OUTPUT DIRECTORY])
#
# builds several scans, of any widths, for one runtime: a library NAME of the dac_*.c, and a library NAME_SCAN of the C
# sources of each scan file SCAN.toml. Who links to NAME has all of them, and is compiled with a header DAC_CONFIG_FILE,
# which has the highest of each option that any of the scans needs.
#
# TABLEGEN, which may be given on the command line of cmake, is the program; a list is one with its first arguments.
#
# How it works: the scan file decides the names of the sources, so CMake configures again if that file changes. The
# build itself is a command with a stamp; what else it reads, CMake learns from the dependency file of tablegen. Files
# whose content stays are not touched, so that nothing is compiled for a changed comment.

if(CMAKE_VERSION VERSION_LESS 3.20)
  set(Tablegen_FOUND FALSE)
  set(Tablegen_NOT_FOUND_MESSAGE
      "CMake ${CMAKE_VERSION} does not read dependency files of Makefiles; install 3.20 or newer")
  return()
endif()
cmake_policy(VERSION 3.20)

if(NOT TABLEGEN) # of what was given find_program() would make a path, which a list is not
  find_program(TABLEGEN tablegen DOC "The command line of tablegen")
endif()
if(NOT TABLEGEN)
  set(Tablegen_FOUND FALSE)
  set(Tablegen_NOT_FOUND_MESSAGE
      "tablegen is not found: put it on PATH ('pip install piezo-tablegen' does), or give -DTABLEGEN=PATH")
  return()
endif()

# Adds the command that builds a scan, and sets in the caller's scope: scan, folder, stamp, files, sources, manifest.
function(tablegen_add_scan command scan_file target output)
  set(folder "${output}")
  cmake_path(ABSOLUTE_PATH scan_file BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE OUTPUT_VARIABLE scan)
  cmake_path(ABSOLUTE_PATH folder BASE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" NORMALIZE)
  # A hyphen is in no name of a scan: these cannot meet a file of the build.
  set(stamp "${folder}/tablegen-build.stamp")
  set(depfile "${folder}/tablegen-build.d")

  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${scan}")
  execute_process(COMMAND ${TABLEGEN} show "${scan}" --json OUTPUT_VARIABLE manifest RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    file(REMOVE "${stamp}")
    message(FATAL_ERROR "tablegen cannot build ${scan} (${status}); what is wrong with it stands above. "
                        "TABLEGEN is ${TABLEGEN}")
  endif()
  string(JSON listed GET "${manifest}" files)
  string(JSON count LENGTH "${listed}")
  math(EXPR last "${count} - 1")
  set(files "${folder}/manifest.json")
  foreach(i RANGE ${last})
    string(JSON name MEMBER "${listed}" ${i})
    list(APPEND files "${folder}/${name}")
  endforeach()
  set(sources ${files})
  list(FILTER sources INCLUDE REGEX "\\.c$")
  if(NOT sources)
    message(FATAL_ERROR "${command}(${scan}): makes a library of C sources; add \"c\" to emit.formats")
  endif()

  # The stamp is removed first: nothing looks built that an interrupted or failed tablegen has left.
  set(outdated "${stamp}")
  if(CMAKE_GENERATOR MATCHES "Makefiles")
    # CMake before 3.27.9 only adds to what it knows a command to read (its issue 25428), and a file that is no longer
    # read, and was removed, would have it run for ever. What it knows stands here; without it, it reads DEPFILE alone.
    list(APPEND outdated "${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/${target}_tablegen.dir/compiler_depend.internal")
  endif()
  add_custom_command(
    OUTPUT "${stamp}"
    BYPRODUCTS ${files}
    COMMAND "${CMAKE_COMMAND}" -E rm -f ${outdated}
    COMMAND ${TABLEGEN} build "${scan}" --output "${folder}" --quiet --depfile "${depfile}" --depfile-target "${stamp}"
    COMMAND "${CMAKE_COMMAND}" -E touch "${stamp}"
    DEPENDS "${scan}"
    DEPFILE "${depfile}"
    COMMENT "tablegen build ${scan}"
    VERBATIM)
  # A target of its own runs once, however many targets use the files.
  add_custom_target("${target}_tablegen" DEPENDS "${stamp}")
  foreach(result scan folder stamp files sources manifest)
    set(${result} "${${result}}" PARENT_SCOPE)
  endforeach()
endfunction()

function(tablegen_build scan)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TARGET;OUTPUT" "")
  if(DEFINED arg_UNPARSED_ARGUMENTS OR DEFINED arg_KEYWORDS_MISSING_VALUES OR NOT DEFINED arg_TARGET)
    message(FATAL_ERROR "tablegen_build(${ARGV}): write tablegen_build(SCAN TARGET NAME [OUTPUT DIRECTORY])")
  endif()
  if(NOT DEFINED arg_OUTPUT)
    set(arg_OUTPUT "tablegen/${arg_TARGET}")
  endif()
  tablegen_add_scan(tablegen_build "${scan}" "${arg_TARGET}" "${arg_OUTPUT}")

  add_library("${arg_TARGET}" STATIC ${sources})
  target_include_directories("${arg_TARGET}" PUBLIC "${folder}")
  set(axes axes)
  set(shaping 0)
  string(JSON turned ERROR_VARIABLE straight GET "${manifest}" turned)
  if(NOT straight)
    set(axes turned axes)
    target_compile_definitions("${arg_TARGET}" PUBLIC DAC_SLOW_PART=1 DAC_SPLINE=1)
  endif()
  set(TABLE 16)
  set(OUTPUT 16)
  set(spline FALSE)
  foreach(axis x y)
    string(JSON bits ERROR_VARIABLE none GET "${manifest}" ${axes} ${axis} table bits)
    if(bits GREATER 16) # what is not there is no number
      set(TABLE 32)
    endif()
    string(JSON bits GET "${manifest}" ${axes} ${axis} output word_bits)
    if(bits GREATER 16)
      set(OUTPUT 32)
    endif()
    string(JSON mode ERROR_VARIABLE none GET "${manifest}" ${axes} ${axis} table mode)
    if(mode STREQUAL "cubic")
      set(spline TRUE)
    endif()
    string(JSON order ERROR_VARIABLE none GET "${manifest}" ${axes} ${axis} output shaping order)
    if(order GREATER shaping)
      set(shaping ${order})
    endif()
  endforeach()
  target_compile_definitions("${arg_TARGET}" PUBLIC DAC_TABLE_STORAGE_BITS=${TABLE} DAC_OUTPUT_STORAGE_BITS=${OUTPUT})
  if(spline)
    target_compile_definitions("${arg_TARGET}" PUBLIC DAC_SPLINE=1)
  endif()
  if(shaping)
    target_compile_definitions("${arg_TARGET}" PUBLIC DAC_SHAPING=${shaping})
  endif()
  string(JSON pixels ERROR_VARIABLE equal LENGTH "${manifest}" sequence pixel_table)
  if(NOT equal)
    target_compile_definitions("${arg_TARGET}" PUBLIC DAC_PIXEL_TABLE=1)
  endif()
  add_dependencies("${arg_TARGET}" "${arg_TARGET}_tablegen")
endfunction()

function(tablegen_runtime)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "TARGET;OUTPUT" "SCANS")
  if(DEFINED arg_UNPARSED_ARGUMENTS OR DEFINED arg_KEYWORDS_MISSING_VALUES OR NOT DEFINED arg_TARGET
     OR NOT DEFINED arg_SCANS)
    message(FATAL_ERROR
      "tablegen_runtime(${ARGV}): write tablegen_runtime(TARGET NAME SCANS SCAN... [OUTPUT DIRECTORY])")
  endif()
  if(NOT DEFINED arg_OUTPUT)
    set(arg_OUTPUT "tablegen/${arg_TARGET}")
  endif()
  cmake_path(ABSOLUTE_PATH arg_OUTPUT BASE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" NORMALIZE OUTPUT_VARIABLE common)
  set(options "${common}/dac_options.h")
  set(options_stamp "${common}/tablegen-runtime.stamp")
  set(libraries "")
  set(folders "")
  set(stamps "")
  foreach(one IN LISTS arg_SCANS)
    cmake_path(GET one STEM LAST_ONLY stem)
    string(MAKE_C_IDENTIFIER "${stem}" stem)
    set(library "${arg_TARGET}_${stem}")
    if(library IN_LIST libraries)
      message(FATAL_ERROR "tablegen_runtime(TARGET ${arg_TARGET}): two scans would be the library ${library}, "
                          "by the names of their files; rename one, for example ${one}")
    endif()
    tablegen_add_scan(tablegen_runtime "${one}" "${library}" "${common}/${stem}")
    set(own ${sources})
    list(FILTER own EXCLUDE REGEX "/dac_[a-z_]*\\.c$")
    if(own)
      add_library("${library}" STATIC ${own})
      set(reach PUBLIC)
    else()
      add_library("${library}" INTERFACE) # header-only
      set(reach INTERFACE)
    endif()
    target_include_directories("${library}" ${reach} "${folder}")
    target_link_libraries("${library}" ${reach} "${arg_TARGET}")
    add_dependencies("${library}" "${library}_tablegen" "${arg_TARGET}_tablegen")
    if(NOT libraries) # all have the same runtime
      set(runtime ${sources})
      list(FILTER runtime INCLUDE REGEX "/dac_[a-z_]*\\.c$")
    endif()
    list(APPEND libraries "${library}")
    list(APPEND folders "${folder}")
    list(APPEND stamps "${stamp}")
  endforeach()

  add_custom_command(
    OUTPUT "${options_stamp}"
    BYPRODUCTS "${options}"
    COMMAND ${TABLEGEN} runtime ${folders} --output "${options}" --quiet
    COMMAND "${CMAKE_COMMAND}" -E touch "${options_stamp}"
    DEPENDS ${stamps}
    COMMENT "tablegen runtime ${arg_TARGET}"
    VERBATIM)
  add_custom_target("${arg_TARGET}_tablegen" DEPENDS "${options_stamp}")
  foreach(library IN LISTS libraries)
    add_dependencies("${arg_TARGET}_tablegen" "${library}_tablegen")
  endforeach()

  add_library("${arg_TARGET}" STATIC ${runtime})
  target_include_directories("${arg_TARGET}" PUBLIC "${common}")
  target_compile_definitions("${arg_TARGET}" PUBLIC "DAC_CONFIG_FILE=\"dac_options.h\"")
  target_link_libraries("${arg_TARGET}" INTERFACE ${libraries})
  add_dependencies("${arg_TARGET}" "${arg_TARGET}_tablegen")
endfunction()
