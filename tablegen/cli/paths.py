"""``tablegen paths``: print the paths of installed files that other tools need."""

import os

import click

from tablegen.cli.shared.exit_status import ExitStatus


@click.command(short_help="Print the paths of the make, CMake, FuseSoC, C and Verilog files.")
@click.option("--make", is_flag=True, help="Print the path of the make include file, tablegen.mk.")
@click.option("--cmake", is_flag=True, help="Print the directory of TablegenConfig.cmake.")
@click.option("--fusesoc", is_flag=True, help="Print the directory of the generator for FuseSoC.")
@click.option("--runtime-c", is_flag=True, help="Print the directory of dac_*.h and dac_*.c.")
@click.option("--runtime-verilog", is_flag=True, help="Print the directory of dac_*.v.")
def paths(**options: bool) -> int:
    """Print the paths of installed files that other tools need. Without an option, print all of them as a table.

    \b
    In a Makefile, this runs `tablegen build` as a build step:
      include $(shell tablegen paths --make)
      $(eval $(call tablegen_build,scan.toml,build/scan))    # $(build/scan_SOURCES): C files

    \b
    In a CMakeLists.txt; then run cmake -DTablegen_DIR="$(tablegen paths --cmake)":
      find_package(Tablegen REQUIRED)
      tablegen_build(scan.toml TARGET scan)                  # makes the library "scan"

    \b
    For FuseSoC, whose cores then name a scan.toml and depend on tablegen:utils:generator:
      fusesoc library add tablegen "$(tablegen paths --fusesoc)"
      fusesoc gen show tablegen                              # prints the parameters

    \b
    To read or lint the sequencers, which every build also contains:
      less "$(tablegen paths --runtime-c)/dac_sequencer.h"
      cppcheck "$(tablegen paths --runtime-c)"

    \b
      less "$(tablegen paths --runtime-verilog)/dac_sequencer.v"
      iverilog -g2005 -Wall -t null "$(tablegen paths --runtime-verilog)"/dac_*.v
    """
    from tablegen.base.resources import resource_folder

    folder = resource_folder("firmware_templates")
    places = {
        "make": folder / "make" / "tablegen.mk",
        "cmake": folder / "cmake",
        "fusesoc": folder / "fusesoc",
        "runtime-c": folder / "c",
        "runtime-verilog": folder / "verilog",
    }
    selection = [name for name in places if options[name.replace("-", "_")]]
    width = max(map(len, places))
    for name in selection or places:
        # As bytes: the path is printed unchanged, even if the terminal cannot show it.
        click.echo((b"" if selection else f"{name:<{width}}  ".encode()) + os.fsencode(places[name]))
    return ExitStatus.OK
