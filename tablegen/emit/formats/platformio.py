"""The manifest of a PlatformIO library, whose sources are the files of the format c."""

import json

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import packaged_files, public_headers
from tablegen.emit.package_options import options_header


class PlatformIO(Format):
    """The format platformio: ``library.json``, which makes the folder of a build a library of that scan."""

    name = "platformio"
    purpose = "PlatformIO library of the format c: the folder of the build, for lib_deps or the lib folder"
    file_names = "library.json, tablegen_options.h"
    needs = ("c",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the manifest; it names the C files, so that those of other formats are neither built nor packed."""
        options = options_header(content)
        written = [*packaged_files(content), *options]
        manifest = {
            "name": content.name,
            "version": content.version,
            "headers": public_headers(content),
            "frameworks": "*",
            "platforms": "*",
            "build": {
                "srcDir": ".",
                "includeDir": ".",
                "srcFilter": ["-<*>", *(f"+<{name}>" for name in written if name.endswith(".c"))],
            },
            "export": {"include": written},
            "description": f"Scan {content.name}, played by its sequencer. Build {content.hash}",
        }
        return {"library.json": (json.dumps(manifest, indent=2) + "\n").encode("ascii"), **options}


FORMAT = PlatformIO()
