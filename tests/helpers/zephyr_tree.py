"""A stand-in for Zephyr's tree, as far as a module of a build uses it: Kconfiglib, and functions of CMake.

``find_package(Zephyr)`` finds it in an application's own CMakeLists.txt. It does what Zephyr documents of modules: it
reads the values of Kconfig as variables, keeps one list of macros and of folders of headers for the whole application,
and links the libraries of modules whether the application asks for them or not.
"""

import tempfile
from pathlib import Path

import kconfiglib
import yaml
from building import run_clean

_CONFIG = """
project(Zephyr-Kernel C)
set(CMAKE_C_STANDARD 99)
file(STRINGS ${CMAKE_BINARY_DIR}/zephyr/.config settings REGEX "^CONFIG_")
foreach(setting ${settings})
    string(REGEX MATCH "^([^=]+)=(.*)$" _ ${setting})
    set(${CMAKE_MATCH_1} ${CMAKE_MATCH_2})
endforeach()
file(WRITE ${CMAKE_BINARY_DIR}/empty.c "")
add_library(zephyr_interface INTERFACE)
add_library(app STATIC)
add_executable(zephyr_final ${CMAKE_BINARY_DIR}/empty.c)
target_link_libraries(app PUBLIC zephyr_interface)
target_link_libraries(zephyr_final app)
function(zephyr_include_directories)
    foreach(folder ${ARGN})
        get_filename_component(whole ${folder} ABSOLUTE)
        target_include_directories(zephyr_interface INTERFACE ${whole})
    endforeach()
endfunction()
function(zephyr_compile_definitions)
    target_compile_definitions(zephyr_interface INTERFACE ${ARGN})
endfunction()
macro(zephyr_library_named name)
    set(ZEPHYR_CURRENT_LIBRARY ${name})
    add_library(${name} STATIC)
    target_link_libraries(${name} PUBLIC zephyr_interface)
    target_link_libraries(app PUBLIC ${name})
endmacro()
function(zephyr_library_sources)
    target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
foreach(module ${ZEPHYR_EXTRA_MODULES})
    file(STRINGS ${module}/zephyr/module.yml place REGEX "^  cmake: ")
    string(REPLACE "  cmake: " "" place ${place})
    add_subdirectory(${module}/${place} ${CMAKE_BINARY_DIR}/modules/${place})
endforeach()
"""


def options(module: Path, *settings: str) -> kconfiglib.Kconfig:
    """Evaluate the options of a module in a tree as Zephyr makes one, with the settings of an application."""
    described = yaml.safe_load((module / "zephyr" / "module.yml").read_bytes())
    generated = f"config ZEPHYR_{described['name'].upper()}_MODULE\n\tbool\n\tdefault y\n"
    source = module / described["build"]["kconfig"]
    with tempfile.TemporaryDirectory() as folder:
        tree, own = Path(folder) / "Kconfig", Path(folder) / "prj.conf"
        tree.write_text(f'menu "{described["name"]}"\nosource "{source}"\n{generated}endmenu\n', "ascii")
        own.write_text("".join(f"{setting}\n" for setting in settings), "ascii")
        loaded = kconfiglib.Kconfig(str(tree), warn_to_stderr=False)
        loaded.load_config(str(own))
    return loaded


def compiled(application: Path, module: Path, folder: Path, *settings: str) -> Path:
    """Compile an application whose CMakeLists.txt names the module, into a folder; return its program."""
    loaded = options(module, *settings)
    assert loaded.warnings == []
    (folder / "zephyr").mkdir(parents=True)
    loaded.write_config(str(folder / "zephyr" / ".config"))
    (folder / "tree").mkdir()
    (folder / "tree" / "ZephyrConfig.cmake").write_text(_CONFIG, "ascii")
    run_clean(["cmake", "-S", application, "-B", folder, f"-DZephyr_DIR={folder}/tree"])
    run_clean(["cmake", "--build", folder])
    return folder / "zephyr_final"
