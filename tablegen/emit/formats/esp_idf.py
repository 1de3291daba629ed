"""A component of ESP-IDF, whose sources are the files of the format c."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import packaged_files
from tablegen.emit.package_options import options_header


class EspIdf(Format):
    """The format esp-idf: ``CMakeLists.txt`` and ``idf_component.yml`` make the folder of a build a component."""

    name = "esp-idf"
    purpose = "component of ESP-IDF of the format c: the folder of the build, put into the components folder"
    file_names = "CMakeLists.txt, idf_component.yml, tablegen_options.h"
    needs = ("c",)
    comment = "#"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the files; they name the C files, so that those of other formats are neither built nor packed."""
        head = f"# {content.name}, tablegen {content.version}, build {content.hash}"
        options = options_header(content)
        written = [*packaged_files(content), *options]
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
            f'version: "{content.version}"',
            f"description: Scan {content.name}, played by its sequencer",
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
