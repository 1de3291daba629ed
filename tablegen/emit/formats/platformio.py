"""The manifest of a PlatformIO library, whose sources are the files of the format c."""

import json

from tablegen.emit.package import CPackage
from tablegen.emit.package_format import PackageOfC
from tablegen.emit.package_options import options_header


class PlatformIO(PackageOfC):
    """The format platformio: ``library.json``, which makes the folder of a build a library of that scan."""

    name = "platformio"
    purpose = "PlatformIO library of the format c: the folder of the build, for lib_deps or the lib folder"
    file_names = "library.json, tablegen_options.h"

    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render the manifest; it names the C files, so that those of other formats are neither built nor packed."""
        options = options_header(package)
        written = [*package.files, *options]
        manifest = {
            "name": package.name,
            "version": package.version,
            "headers": package.headers,
            "frameworks": "*",
            "platforms": "*",
            "build": {
                "srcDir": ".",
                "includeDir": ".",
                "srcFilter": ["-<*>", *(f"+<{name}>" for name in written if name.endswith(".c"))],
            },
            "export": {"include": written},
            "description": f"Scan {package.name}, played by its sequencer. Build {package.hash}",
        }
        return {"library.json": (json.dumps(manifest, indent=2) + "\n").encode("ascii"), **options}


FORMAT = PlatformIO()
