"""A module around ``NAME_top`` whose samples go out on the pins of serial converters."""

from tablegen.base.input_errors import Unphysical
from tablegen.emit.converter_top import ConverterTop
from tablegen.emit.package import VerilogPackage

_LEAST_REST_CLOCKS = 1


class Spi(ConverterTop):
    """The format spi: ``NAME_spi.v``, which is ``NAME_top`` with ``dac_spi``."""

    name = "spi"
    purpose = "NAME_top of the format verilog with the pins of two serial converters; parameters of dac_spi"
    file_names = "NAME_spi.v"
    output = "spi"
    what = "an output to serial converters"

    def package_files(self, package: VerilogPackage) -> dict[str, bytes]:
        """Render the module.

        Raises
        ------
        Unphysical
            If the clocks of a tick are fewer than the shortest frame takes.
        """
        bits, clocks = max(package.word_bits), package.clocks_per_tick
        least = 2 * bits + 1 + _LEAST_REST_CLOCKS  # with a half period of one clock
        if 0 < clocks < least:
            raise Unphysical(
                f"emit.clock_hz has {clocks} clocks a tick, and the shortest frame of {bits} bits takes {least}; take "
                "a faster clock or a lower update_rate_hz"
            )
        return super().package_files(package)

    def pins(self, word_bits: int) -> list[str]:
        """Return the pins of ``dac_spi``."""
        outputs = ("sclk", "cs_x_n", "cs_y_n", "mosi_x", "mosi_y", "ldac_n")
        return [f"output wire{' ' * 20}{name}" for name in (*outputs, "sending")]


FORMAT = Spi()
