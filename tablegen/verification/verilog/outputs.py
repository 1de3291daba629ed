"""The modules of a build with all that its scan needs: ``NAME_top``, and those of an output around it, in a bench."""

from collections.abc import Iterable
from typing import Literal

from tablegen.device.dual_program import ScanProgram

Output = Literal["top", "spi", "axi_stream"]
"""A module of a build with all that its scan needs: ``NAME_top``, or the one of an output around it."""
OUTPUTS: dict[str, Output] = {"spi": "spi", "axi-stream": "axi_stream"}
"""The modules around ``NAME_top`` by their formats."""
_MOST_OUTPUT_TICKS = 1000  # of a module around the top, which was played itself
_REST_OF_A_FRAME = 7  # clocks between two frames of dac_spi with its defaults

# What an output has beside the ports of NAME_top: its connections, its signals, what writes them down, and when.
PINS: dict[Output, str] = {
    "top": "",
    "spi": """, .sclk(sclk), .cs_x_n(cs_n), .cs_y_n(), .mosi_x(mosi_x), .mosi_y(mosi_y), .ldac_n(ldac_n),
        .sending()""",
    "axi_stream": """, .m_axis_tdata(beat), .m_axis_tuser(user), .m_axis_tvalid(valid_beat), .m_axis_tready(1'b1)""",
}
SIGNALS: dict[Output, str] = {
    "top": "",
    "spi": """
    wire sclk, cs_n, mosi_x, mosi_y, ldac_n;
    reg [63:0] held = 0;
    reg [31:0] x_shift = 0, y_shift = 0;
    always @(posedge sclk)
        if (!cs_n) begin
            x_shift <= {x_shift[30:0], mosi_x};
            y_shift <= {y_shift[30:0], mosi_y};
        end
    always @(negedge cs_n) begin
        x_shift <= 0;
        y_shift <= 0;
    end
    always @(negedge ldac_n)
        if (cs_n) $fwrite(played, "%016x\\n%016x\\n", held, {y_shift, x_shift});
""",
    "axi_stream": """
    wire [2*LANE_BITS-1:0] beat;
    wire [4:0] user;
    wire valid_beat;
    reg [63:0] held = 0;
    wire [31:0] x_lane = beat[LANE_BITS-1:0], y_lane = beat[2*LANE_BITS-1:LANE_BITS];
""",
}
WRITTEN: dict[Output, str] = {
    "top": """if (strobe) $fwrite(played, "%016x\\n%016x\\n", sample, {y_sent, x_sent});""",
    "spi": "if (strobe) held = sample;",
    "axi_stream": """if (valid_beat)
                $fwrite(played, "%016x\\n%016x\\n", {held[63:53], user, held[47:0]}, {y_lane, x_lane});
            if (strobe) held = sample;""",
}


def played_outputs(formats: Iterable[str]) -> list[Output]:
    """Return the modules that are played of a build in these formats."""
    return ["top", *(OUTPUTS[each] for each in formats if each in OUTPUTS)]


def output_pace(pace: int, program: ScanProgram, output: Output) -> int:
    """Return the clocks from tick to tick of a module whose sequencer takes ``pace``."""
    return max(pace, 2 * max(word_bits(program)) + 1 + _REST_OF_A_FRAME) if output == "spi" else pace


def output_ticks(ticks: int, output: Output) -> int:
    """Return how many of the ticks of a top a module of a build plays."""
    return ticks if output == "top" else min(ticks, _MOST_OUTPUT_TICKS)


def word_bits(program: ScanProgram) -> tuple[int, int]:
    """Return the bits of the words that the converters of x and y take."""
    return program.x.output.word_bits, program.y.output.word_bits
