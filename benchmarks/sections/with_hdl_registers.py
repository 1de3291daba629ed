"""A build of hdl-registers: DESCRIPTION FOLDER; without them only what it imports. Run in build/bench/others."""

import sys
from pathlib import Path

from hdl_registers.generator.c.header import CHeaderGenerator
from hdl_registers.generator.vhdl.register_package import VhdlRegisterPackageGenerator
from hdl_registers.parser.toml import from_toml

if len(sys.argv) == 3:
    registers = from_toml(name="like", toml_file=Path(sys.argv[1]))
    for generator in (CHeaderGenerator, VhdlRegisterPackageGenerator):
        generator(registers, Path(sys.argv[2])).create()
