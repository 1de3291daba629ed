"""The description of a CMSIS-Pack, whose component has the files of the format c."""

from tablegen.emit.c_text import option_lines
from tablegen.emit.package import CPackage
from tablegen.emit.package_format import PackageOfC

_CATEGORIES = {"c": "sourceC", "h": "header"}


class CmsisPack(PackageOfC):
    """The format cmsis-pack: ``tablegen.NAME.pdsc``, which makes the folder of a build a pack with one component.

    Packs of all scans have the component ``Scan:Sequencer``: names of components have 32 characters, those of scans 48,
    and a project takes one of them, since every build has a sequencer.
    """

    name = "cmsis-pack"
    purpose = "CMSIS-Pack of the format c: the folder of the build, with the component tablegen::Scan:Sequencer"
    file_names = "tablegen.NAME.pdsc"

    def package_files(self, package: CPackage) -> dict[str, bytes]:
        """Render the description; nothing in it needs to be escaped in XML."""
        files = package.files
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<package schemaVersion="1.6.0" xmlns:xs="http://www.w3.org/2001/XMLSchema-instance" '
            'xs:noNamespaceSchemaLocation="PACK.xsd">',
            "  <vendor>tablegen</vendor>",
            f"  <name>{package.name}</name>",
            f"  <description>Scan {package.name}, played by its sequencer. Build {package.hash}</description>",
            "  <url></url>",
            "  <releases>",
            f'    <release version="{package.version}">Build {package.hash}</release>',
            "  </releases>",
            "  <taxonomy>",
            '    <description Cclass="Scan">Scan of a piezo scanner</description>',
            "  </taxonomy>",
            "  <components>",
            f'    <component Cclass="Scan" Cgroup="Sequencer" Cversion="{package.version}">',
            f"      <description>Tables of {package.name}, and the sequencer that plays them</description>",
            "      <Pre_Include_Global_h>",
            *option_lines(package.options),
            "      </Pre_Include_Global_h>",
            "      <files>",
            *(f'        <file category="{_CATEGORIES[name[-1]]}" name="{name}"/>' for name in files),
            "      </files>",
            "    </component>",
            "  </components>",
            "</package>",
        ]
        return {f"tablegen.{package.name}.pdsc": ("\n".join(lines) + "\n").encode("ascii")}


FORMAT = CmsisPack()
