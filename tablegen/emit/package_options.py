"""The header of options in packages for tools whose libraries set no flags of the compiler for a whole project."""

from tablegen.emit.c_text import option_lines
from tablegen.emit.package import CPackage

OPTIONS_HEADER = "tablegen_options.h"
"""The name of the header, which ``dac_config.h`` includes where it finds it beside itself."""


def options_header(package: CPackage) -> dict[str, bytes]:
    """Render the header of options of a package, by its name.

    Its values are those that the scan needs, so that the tables have the same widths as the runtime. Options that the
    project defines itself keep their values. An AVR copies constants into its RAM unless they are read from flash,
    where the runtime has no slow parts and no tables of pixels.
    """
    lines = [
        f"/* What the runtime needs to play {package.name}. dac_config.h includes it, after DAC_CONFIG_FILE. */",
        *option_lines(package.options),
    ]
    if not {"DAC_SLOW_PART", "DAC_PIXEL_TABLE"} & package.options.keys():
        lines += [
            "#if defined(__AVR__) && !defined(DAC_PROGMEM)",
            "#define DAC_PROGMEM 1 /* tables stay in flash; 0 for the serial link, whose tables are in RAM */",
            "#endif",
        ]
    return {OPTIONS_HEADER: ("\n".join(lines) + "\n").encode("ascii")}
