"""A component of ESP-IDF, whose sources are the files of the format c."""

from tablegen.emit.package import CPackage
from tablegen.emit.package_format import PackageOfC
from tablegen.emit.package_options import options_header


class EspIdf(PackageOfC):
    """The format esp-idf: ``CMakeLists.txt`` and ``idf_component.yml`` make the folder of a build a component."""

    name = "esp-idf"
    purpose = "component of ESP-IDF of the format c: the folder of the build, put into the components folder"
    file_names = "CMakeLists.txt, idf_component.yml, tablegen_options.h"
    comment = "#"

    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render the files; they name the C files, so that those of other formats are neither built nor packed."""
        head = f"# {package.name}, tablegen {package.version}, build {package.hash}"
        options = options_header(package)
        written = [*package.files, *options]
        component = [
            head,
            "idf_component_register(",
            "    SRCS",
            *(f"        {name}" for name in written if name.endswith(".c")),
            "    INCLUDE_DIRS .",
            ")",
        ]
        manifest = [
            head,
            f'version: "{package.version}"',
            f"description: Scan {package.name}, played by its sequencer",
            "files:",
            '  exclude: ["**/*"]',
            "  include:",
            *(f"    - {name}" for name in ("CMakeLists.txt", *written)),
        ]
        return {
            "CMakeLists.txt": ("\n".join(component) + "\n").encode("ascii"),
            "idf_component.yml": ("\n".join(manifest) + "\n").encode("ascii"),
            **options,
        }


FORMAT = EspIdf()
