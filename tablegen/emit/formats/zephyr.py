"""A module of Zephyr, whose sources are the files of the format c."""

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import packaged_files, runtime_options

_SETTINGS = ("DAC_SHAPING", "DAC_SPLINE")  # options of the runtime that an application may raise


class Zephyr(Format):
    """The format zephyr: ``zephyr/module.yml``, ``Kconfig`` and ``CMakeLists.txt`` make the folder of a build a module.

    The application turns it on with ``CONFIG_TABLEGEN_NAME``. Its options have the least values that the scan needs.
    """

    name = "zephyr"
    purpose = "module of Zephyr of the format c: the folder of the build, for ZEPHYR_EXTRA_MODULES or a west manifest"
    file_names = "zephyr/module.yml, zephyr/Kconfig, zephyr/CMakeLists.txt"
    needs = ("c",)
    comment = "#"

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the three files; paths of sources are relative to the folder ``zephyr``."""
        lines = {
            "module.yml": _module(content),
            "Kconfig": _kconfig(content),
            "CMakeLists.txt": _cmake(content),
        }
        head = f"# {content.name}, tablegen {content.version}, build {content.hash}"
        return {f"zephyr/{name}": ("\n".join([head, *own]) + "\n").encode("ascii") for name, own in lines.items()}


FORMAT = Zephyr()


def _module(content: Content) -> list[str]:
    return [f"name: {content.name}", "build:", "  cmake: zephyr", "  kconfig: zephyr/Kconfig"]


def _kconfig(content: Content) -> list[str]:
    """Return the symbol of the module, and the options that an application may raise for uploads of other programs."""
    symbol, options = _symbol(content), runtime_options(content)
    order = options.get("DAC_SHAPING", 0)
    spline = ["\tdefault y"] if "DAC_SPLINE" in options else ['\tprompt "Cubic tables"']
    return [
        f"config {symbol}",
        f'\tbool "Scan {content.name}, played by its sequencer"',
        "\thelp",
        f"\t  Build {content.hash}.",
        "",
        f"if {symbol}",
        "",
        f"config {symbol}_SHAPING",
        '\tint "Highest order of shaped output"',
        f"\trange {order} 3",
        f"\tdefault {order}",
        "",
        f"config {symbol}_SPLINE",
        "\tbool",
        *spline,
        "",
        "endif",
    ]


def _cmake(content: Content) -> list[str]:
    """Return the library of the C files; the options of the runtime are those of the application too."""
    symbol, options = _symbol(content), runtime_options(content)
    fixed = [f"    {name}={value}" for name, value in options.items() if name not in _SETTINGS]
    return [
        f"if(CONFIG_{symbol})",
        "  zephyr_include_directories(..)",
        "  zephyr_compile_definitions(",
        *fixed,
        f"    DAC_SHAPING=${{CONFIG_{symbol}_SHAPING}}",
        f"    DAC_SPLINE=$<BOOL:${{CONFIG_{symbol}_SPLINE}}>",
        "  )",
        f"  zephyr_library_named({content.name})",
        "  zephyr_library_sources(",
        *(f"    ../{name}" for name in packaged_files(content) if name.endswith(".c")),
        "  )",
        "endif()",
    ]


def _symbol(content: Content) -> str:
    return f"TABLEGEN_{content.name.upper()}"
