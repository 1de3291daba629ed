"""The properties of an Arduino library in the flat layout, whose sources are the files of the format c."""

from tablegen.emit.package import CPackage
from tablegen.emit.package_format import PackageOfC
from tablegen.emit.package_options import options_header


class Arduino(PackageOfC):
    """The format arduino: ``library.properties``, which makes the folder of a build a library of that scan.

    Its options are in a header, since neither a sketch nor a library has options of a compiler.
    """

    name = "arduino"
    purpose = "Arduino library of the format c: the folder of the build, put into the libraries folder"
    file_names = "library.properties, tablegen_options.h"

    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render both; Arduino's builder requires author and maintainer, which a scan does not have."""
        properties = {
            "name": package.name,
            "version": package.version,
            "author": "tablegen",
            "maintainer": "tablegen",
            "sentence": f"Scan {package.name}, played by its sequencer.",
            "category": "Signal Input/Output",
            "architectures": "*",
            "includes": ",".join(package.headers),
            "paragraph": f"Build {package.hash}",
        }
        lines = "".join(f"{key}={value}\n" for key, value in properties.items())
        return {"library.properties": lines.encode("ascii"), **options_header(package)}


FORMAT = Arduino()
