"""A module around ``NAME_top`` whose samples are beats of AXI4-Stream."""

from tablegen.emit.converter_top import ConverterTop, lane_bits
from tablegen.emit.verilog_top import port_range


class AxiStream(ConverterTop):
    """The format axi-stream: ``NAME_axi_stream.v``, which is ``NAME_top`` with ``dac_axi_stream``."""

    name = "axi-stream"
    purpose = "NAME_top of the format verilog with an output in AXI4-Stream: words of both axes, markers in tuser"
    file_names = "NAME_axi_stream.v"
    output = "axi_stream"
    what = "an output in AXI4-Stream"

    def pins(self, word_bits: int) -> list[str]:
        """Return the ports of a source of AXI4-Stream."""
        return [
            f"output wire {port_range(2 * lane_bits(word_bits))} m_axis_tdata",
            f"output wire {port_range(5)} m_axis_tuser",
            "output wire                    m_axis_tvalid",
            "input  wire                    m_axis_tready",
        ]


FORMAT = AxiStream()
