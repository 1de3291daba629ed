"""A module around ``NAME_top`` with an output for the converters behind it."""

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from tablegen.base.resources import resource_folder
from tablegen.emit.package import VerilogPackage
from tablegen.emit.package_format import PackageOfVerilog
from tablegen.emit.templates import template
from tablegen.emit.verilog_top import port_range

_FOLDER = "verilog"


class ConverterTop(PackageOfVerilog):
    """A format of one file, ``NAME_OUTPUT.v``: ``NAME_top`` with an output module; a subclass adds its ports."""

    comment = "//"
    output: ClassVar[str]
    """The output as it is called in the names of file and template."""
    what: ClassVar[str]
    """The output in words."""

    def package_files(self, package: VerilogPackage) -> dict[str, bytes]:
        """Render the module."""
        word_bits = max(package.word_bits)
        module = f"{package.name}_{self.output}"
        context = {
            "module": module,
            "name": package.name,
            "version": package.version,
            "hash": package.hash,
            "what": self.what,
            "parameters": package.parameters,
            "code_range": port_range(package.code_bits),
            "axes": [_axis(axis, bits, word_bits) for axis, bits in zip("xy", package.word_bits, strict=True)],
            "word_bits": word_bits,
            "lane_bits": lane_bits(word_bits),
            "pins": self.pins(word_bits),
        }
        return {f"{module}.v": template(f"{_FOLDER}/{self.output}.v.j2", context, str)}

    @abstractmethod
    def pins(self, word_bits: int) -> Sequence[str]:
        """Return the ports that ``NAME_top`` has not, as Verilog declares them, for words of so many bits."""

    def sources(self) -> list[Path]:
        """Return the templates."""
        return list((resource_folder("firmware_templates") / _FOLDER).glob("*.j2"))


def _axis(axis: str, bits: int, word_bits: int) -> dict[str, str]:
    word = f"{axis}_word"
    wide = word if bits == word_bits else f"{{{word_bits - bits}'d0, {word}}}"
    return {"word_range": port_range(bits), "wide": wide}


def lane_bits(word_bits: int) -> int:
    """Return the bits of a lane of AXI-Stream that holds a word: whole bytes."""
    return 8 * ((word_bits + 7) // 8)
