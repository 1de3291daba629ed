"""The properties of an Arduino library in the flat layout, whose sources are the files of the format c."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import public_headers

# An AVR copies constants into its RAM unless they are read from flash.
_OPTIONS = """\
/* Options of the runtime on an AVR, which dac_config.h includes, since a library has no options of a compiler. */
#ifndef DAC_PROGMEM
#define DAC_PROGMEM 1 /* tables stay in flash; 0 for the serial link, whose tables are in RAM */
#endif
"""


class Arduino(Format):
    """The format arduino: ``library.properties``, which makes the folder of a build a library of that scan.

    On an AVR the tables of the library stay in flash.
    """

    name = "arduino"
    purpose = "Arduino library of the format c: the folder of the build, put into the libraries folder"
    file_names = "library.properties, tablegen_options.h"
    needs = ("c",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the properties; Arduino's builder requires author and maintainer, which a scan does not have."""
        properties = {
            "name": content.name,
            "version": content.version,
            "author": "tablegen",
            "maintainer": "tablegen",
            "sentence": f"Scan {content.name}, played by its sequencer.",
            "category": "Signal Input/Output",
            "architectures": "*",
            "includes": ",".join(public_headers(content)),
            "paragraph": f"Build {content.hash}",
        }
        lines = "".join(f"{key}={value}\n" for key, value in properties.items())
        return {"library.properties": lines.encode("ascii"), "tablegen_options.h": _OPTIONS.encode("ascii")}


FORMAT = Arduino()
