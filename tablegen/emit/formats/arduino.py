"""The properties of an Arduino library in the flat layout, whose sources are the files of the format c."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import public_headers
from tablegen.emit.package_options import options_header


class Arduino(Format):
    """The format arduino: ``library.properties``, which makes the folder of a build a library of that scan.

    Its options are in a header, since neither a sketch nor a library has options of a compiler.
    """

    name = "arduino"
    purpose = "Arduino library of the format c: the folder of the build, put into the libraries folder"
    file_names = "library.properties, tablegen_options.h"
    needs = ("c",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render both; Arduino's builder requires author and maintainer, which a scan does not have."""
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
        return {"library.properties": lines.encode("ascii"), **options_header(content)}


FORMAT = Arduino()
