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
# is compiled with the DAC_TABLE_STORAGE_BITS and DAC_OUTPUT_STORAGE_BITS that the scan needs, with its DAC_SHAPING, and
# with DAC_SPLINE for cubic tables.
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

function(tablegen_build scan)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TARGET;OUTPUT" "")
  if(DEFINED arg_UNPARSED_ARGUMENTS OR DEFINED arg_KEYWORDS_MISSING_VALUES OR NOT DEFINED arg_TARGET)
    message(FATAL_ERROR "tablegen_build(${ARGV}): write tablegen_build(SCAN TARGET NAME [OUTPUT DIRECTORY])")
  endif()
  if(NOT DEFINED arg_OUTPUT)
    set(arg_OUTPUT "tablegen/${arg_TARGET}")
  endif()
  cmake_path(ABSOLUTE_PATH scan BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" NORMALIZE)
  cmake_path(ABSOLUTE_PATH arg_OUTPUT BASE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" NORMALIZE OUTPUT_VARIABLE folder)
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
  set(kinds TABLE OUTPUT)
  set(parts table output)
  set(keys bits word_bits)
  set(sources ${files})
  list(FILTER sources INCLUDE REGEX "\\.c$")
  if(NOT sources)
    message(FATAL_ERROR "tablegen_build(${scan}): makes a library of C sources; add \"c\" to emit.formats")
  endif()

  # The stamp is removed first: nothing looks built that an interrupted or failed tablegen has left.
  set(outdated "${stamp}")
  if(CMAKE_GENERATOR MATCHES "Makefiles")
    # CMake before 3.27.9 only adds to what it knows a command to read (its issue 25428), and a file that is no longer
    # read, and was removed, would have it run for ever. What it knows stands here; without it, it reads DEPFILE alone.
    list(APPEND outdated "${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/${arg_TARGET}_tablegen.dir/compiler_depend.internal")
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
  add_custom_target("${arg_TARGET}_tablegen" DEPENDS "${stamp}")

  add_library("${arg_TARGET}" STATIC ${sources})
  target_include_directories("${arg_TARGET}" PUBLIC "${folder}")
  foreach(kind part key IN ZIP_LISTS kinds parts keys)
    set(storage 16)
    foreach(axis x y)
      string(JSON bits GET "${manifest}" axes ${axis} ${part} ${key})
      if(bits GREATER 16)
        set(storage 32)
      endif()
    endforeach()
    target_compile_definitions("${arg_TARGET}" PUBLIC DAC_${kind}_STORAGE_BITS=${storage})
  endforeach()
  foreach(axis x y)
    string(JSON mode GET "${manifest}" axes ${axis} table mode)
    if(mode STREQUAL "cubic")
      target_compile_definitions("${arg_TARGET}" PUBLIC DAC_SPLINE=1)
    endif()
  endforeach()
  set(shaping 0)
  foreach(axis x y)
    string(JSON order ERROR_VARIABLE none GET "${manifest}" axes ${axis} output shaping order)
    if(order GREATER shaping) # what is not there is no number
      set(shaping ${order})
    endif()
  endforeach()
  if(shaping)
    target_compile_definitions("${arg_TARGET}" PUBLIC DAC_SHAPING=${shaping})
  endif()
  add_dependencies("${arg_TARGET}" "${arg_TARGET}_tablegen")
endfunction()
