"""A module of Zephyr, whose sources are the files of the format c."""

from tablegen.emit.package import CPackage
from tablegen.emit.package_format import PackageOfC


class Zephyr(PackageOfC):
    """The format zephyr: ``zephyr/module.yml``, ``Kconfig`` and ``CMakeLists.txt`` make the folder of a build a module.

    The application turns it on with ``CONFIG_TABLEGEN_NAME``. Its options have the least values that the scan needs.
    """

    name = "zephyr"
    purpose = "module of Zephyr of the format c: the folder of the build, for ZEPHYR_EXTRA_MODULES or a west manifest"
    file_names = "zephyr/module.yml, zephyr/Kconfig, zephyr/CMakeLists.txt"
    comment = "#"

    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render the three files; paths of sources are relative to the folder ``zephyr``."""
        lines = {
            "module.yml": _module(package),
            "Kconfig": _kconfig(package),
            "CMakeLists.txt": _cmake(package),
        }
        head = f"# {package.name}, tablegen {package.version}, build {package.hash}"
        return {f"zephyr/{name}": ("\n".join([head, *own]) + "\n").encode("ascii") for name, own in lines.items()}


FORMAT = Zephyr()


def _module(package: CPackage) -> list[str]:
    return [f"name: {package.name}", "build:", "  cmake: zephyr", "  kconfig: zephyr/Kconfig"]


def _kconfig(package: CPackage) -> list[str]:
    """Return the symbol of the module, and the options that an application may raise for uploads of other programs."""
    symbol, options = _symbol(package), package.options
    order = options.get("DAC_SHAPING", 0)
    spline = ["\tdefault y"] if "DAC_SPLINE" in options else ['\tprompt "Cubic tables"']
    return [
        f"config {symbol}",
        f'\tbool "Scan {package.name}, played by its sequencer"',
        "\thelp",
        f"\t  Build {package.hash}.",
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


def _cmake(package: CPackage) -> list[str]:
    """Return the library of the C files; the options of the runtime are those of the application too."""
    symbol, options = _symbol(package), package.options
    chosen = ("DAC_SHAPING", "DAC_SPLINE")
    widths = [f"    {name}={value}" for name, value in options.items() if name not in chosen]
    return [
        f"if(CONFIG_{symbol})",
        "  zephyr_include_directories(..)",
        "  zephyr_compile_definitions(",
        *widths,
        f"    DAC_SHAPING=${{CONFIG_{symbol}_SHAPING}}",
        f"    DAC_SPLINE=$<BOOL:${{CONFIG_{symbol}_SPLINE}}>",
        "  )",
        f"  zephyr_library_named({package.name})",
        "  zephyr_library_sources(",
        *(f"    ../{name}" for name in package.files if name.endswith(".c")),
        "  )",
        "endif()",
    ]


def _symbol(package: CPackage) -> str:
    return f"TABLEGEN_{package.name.upper()}"
