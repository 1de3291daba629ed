"""The header of options in packages for tools whose libraries set no flags of the compiler for a whole project."""

from tablegen.emit.c_text import option_lines
from tablegen.emit.content import Content
from tablegen.emit.formats.c import runtime_options

OPTIONS_HEADER = "tablegen_options.h"
"""The name of the header, which ``dac_config.h`` includes where it finds it beside itself."""


def options_header(content: Content) -> dict[str, bytes]:
    """Render the header of options of a package, by its name.

    Its values are those that the scan needs, so that the tables have the same widths as the runtime. Options that the
    project defines itself keep their values. An AVR copies constants into its RAM unless they are read from flash.
    """
    lines = [
        f"/* What the runtime needs to play {content.name}. dac_config.h includes it, after DAC_CONFIG_FILE. */",
        *option_lines(runtime_options(content)),
        "#if defined(__AVR__) && !defined(DAC_PROGMEM)",
        "#define DAC_PROGMEM 1 /* tables stay in flash; 0 for the serial link, whose tables are in RAM */",
        "#endif",
    ]
    return {OPTIONS_HEADER: ("\n".join(lines) + "\n").encode("ascii")}
