"""Formats that are packages around the format c or verilog: they render what they name of one, of any scan."""

from abc import abstractmethod

from tablegen.emit.content import Content
from tablegen.emit.format import Format
from tablegen.emit.formats.c import c_package
from tablegen.emit.formats.verilog import verilog_package
from tablegen.emit.package import CPackage, VerilogPackage


class PackageOfC(Format):
    """A package around the format c, of a scan with or without an angle."""

    needs = ("c",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the files of the package."""
        return self.package_files(c_package(content))

    @abstractmethod
    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render the files of a package, by name."""


class PackageOfVerilog(Format):
    """A package around the format verilog, of a scan with or without an angle."""

    needs = ("verilog",)

    def files(self, content: Content) -> dict[str, bytes]:
        """Render the files of the package."""
        return self.package_files(verilog_package(content))

    @abstractmethod
    def package_files(self, package: VerilogPackage) -> dict[str, bytes]:
        """Render the files of a package, by name."""
