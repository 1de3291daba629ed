"""Parameters of the modules inside the Verilog core: their ranges, what is illegal otherwise, and its legal neighbours.

A module without a range here either has none, or hands its parameters on to one that has (``HANDED_ON``).
"""

from collections.abc import Iterator, Mapping

Values = Mapping[str, int | str]
Range = tuple[int, int | None]
FLAG: Range = (0, 1)
WIDTH: Range = (1, None)
ORDER: Range = (0, 3)
WORDS: Range = (8, 24)
INDEX: Range = (2, 16)

# The lowest and the highest value of a parameter, without a highest one None.
RANGES: dict[str, dict[str, Range]] = {
    "adc_fifo": {"BITS": WIDTH, "DEPTH_BITS": (1, 16)},
    "dac_axis": {
        "INDEX_BITS": INDEX,
        "WORD_BITS": WORDS,
        "PLAIN_MULTIPLIER": FLAG,
        "SHAPING": ORDER,
        "SPLINE": FLAG,
    },
    "dac_axis_serial": {
        "INDEX_BITS": INDEX,
        "WORD_BITS": WORDS,
        "DAC_BITS": (2, 24),
        "PERIOD_BITS": (1, 31),
        "SHAPING": ORDER,
    },
    "dac_delay": {"BITS": WIDTH, "CLOCKS": (0, None)},
    "dac_direct_table": {"WORD_BITS": WIDTH, "INDEX_BITS": WIDTH},
    "dac_faults": {"FAULTS": WIDTH, "COUNT_BITS": (2, 32)},
    "dac_fit": {
        "DAC_BITS": WORDS,
        "TICK_BITS": (3, 30),
        "LINE_BITS": (1, 16),
        "HARMONICS": (0, 512),
        "SHAPING": ORDER,
    },
    "dac_interpolator": {"WORD_BITS": WORDS, "PLAIN_MULTIPLIER": FLAG},
    "dac_loader_core": {"ADDRESS_BITS": (11, 16)},
    "dac_loader_memory": {"ADDRESS_BITS": (11, 16)},
    "dac_markers": {"TICK_BITS": (3, 30), "LINE_BITS": (1, 16)},
    "dac_memory": {"BITS": WIDTH, "ADDRESS_BITS": WIDTH},
    "dac_multiply_digits": {"A_BITS": WIDTH, "DIGITS": (2, None), "DROP": (0, None), "RESULT_BITS": WIDTH},
    "dac_multiply_plain": {"A_BITS": WIDTH, "B_BITS": WIDTH, "DROP": (0, None), "BLOCK_BITS": (2, None)},
    "dac_offset": {"BITS": (20, 44), "HALF": FLAG},
    "dac_output": {"SAMPLE_BITS": (12, 25), "DAC_BITS": (2, 24), "PLAIN_MULTIPLIER": FLAG, "SHAPING": ORDER},
    "dac_phase": {"PERIOD_BITS": (1, 31)},
    "dac_pixel_table": {"TICK_BITS": (3, 30), "INDEX_BITS": INDEX},
    "dac_pixels": {"BITS": WIDTH},
    "dac_product": {"A_BITS": WIDTH, "B_BITS": WIDTH},
    "dac_register": {"BITS": (1, 64)},
    "dac_scan": {"TICK_BITS": (3, 30), "LINE_BITS": (1, 16), "FRAME_BITS": WIDTH},
    "dac_shaper": {"BITS": (2, None), "SHAPING": (1, 3)},
    "dac_skew": {"DIGITS": WIDTH},
    "dac_slew": {"BITS": (1, 64)},
    "dac_spline": {"INDEX_BITS": (3, 14), "WORD_BITS": (8, 21)},
    "dac_spline_step": {"BITS": (2, None)},
    "dac_table": {"WORD_BITS": WIDTH, "INDEX_BITS": (2, None)},
    "dac_uart_rx": {"CLOCKS_PER_BIT": (8, 65536)},
    "dac_uart_tx": {"CLOCKS_PER_BIT": (2, 65536)},
    "dac_verdict": {"DAC_BITS": WIDTH},
    "dac_whole_table": {"INDEX_BITS": INDEX, "HARMONICS": (0, 512)},
    "dac_window": {"BITS": WIDTH, "JUMPS": FLAG},
    "dac_pair": {"X_INTERPOLATED": FLAG, "Y_INTERPOLATED": FLAG, "WORD_BITS": WORDS},
    "dac_pair_delay": {"BITS": WIDTH, "CLOCKS": (2, 65)},
    "dac_pair_interpolator": {"WORD_BITS": WORDS},
    "dac_pair_output": {"SAMPLE_BITS": (12, 25), "DAC_BITS": (2, None)},
    "dac_pair_phase": {"PERIOD_BITS": (1, 31)},
    "dac_pair_ring": {"BITS": (1, 32)},
    "dac_pair_slew": {"BITS": (1, 32)},
    "dac_pair_table": {"WORD_BITS": WIDTH},
    "dac_slow_divide": {"REST_BITS": (2, None), "QUOTIENT_BITS": (2, None)},
    "dac_slow_engine": {"SLOW_INDEX_BITS": (3, 14), "LINE_BITS": (1, 16)},
    "dac_slow_fit": {"SLOW_INDEX_BITS": (3, 14), "LINE_BITS": (1, 16)},
    "dac_slow_store": {"INDEX_BITS": (1, 14), "WORD_BITS": WIDTH, "SLOW_INDEX_BITS": (1, 14)},
}
# What goes with a value of a range, so that nothing else is illegal.
BESIDE: dict[tuple[str, str, int], Values] = {
    ("dac_interpolator", "WORD_BITS", 24): {"GUARD_BITS": 1},
    ("dac_multiply_digits", "A_BITS", 1): {"DROP": 2},
    ("dac_multiply_digits", "DROP", 0): {"LOW_BITS": 1},
    ("dac_multiply_plain", "A_BITS", 1): {"RESULT_BITS": 17},
    ("dac_multiply_plain", "B_BITS", 1): {"RESULT_BITS": 18},
    ("dac_multiply_plain", "DROP", 0): {"LOW_BITS": 1},
    ("dac_offset", "BITS", 20): {"LOW_BITS": 8, "GAIN_Q": 8, "CODE_BITS": 10},
    ("dac_pair", "WORD_BITS", 8): {"DAC_BITS": 9},
    ("dac_pair_interpolator", "WORD_BITS", 24): {"GUARD_BITS": 1},
    ("dac_pair_output", "SAMPLE_BITS", 12): {"DAC_BITS": 9},
}
INTERPOLATED = ({"INTERPOLATED": 2}, "INTERPOLATED_is_not_0_1_or_3")
CODE = "64'hffff"  # the highest one of 16 bits
CUBIC = {"INTERPOLATED": 3}
# What is illegal otherwise, and the reason that a tool gives.
OTHERWISE: dict[str, list[tuple[Values, str]]] = {
    "dac_axis": [
        INTERPOLATED,
        ({"INTERPOLATED": 4}, "INTERPOLATED_is_not_0_1_or_3"),
        ({**CUBIC, "INDEX_BITS": 7, "WORD_BITS": 14, "SPLINE": 0}, "SPLINE_is_0_with_a_cubic_table"),
        ({"LATENCY": 33}, "LATENCY_follows_from_PLAIN_MULTIPLIER_SHAPING_and_SPLINE"),
        ({"POWER_UP_CODE": 65536}, "POWER_UP_CODE_has_more_than_DAC_BITS"),
    ],
    "dac_axis_serial": [
        INTERPOLATED,
        ({**CUBIC, "INDEX_BITS": 15}, "INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({**CUBIC, "INDEX_BITS": 2}, "INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({**CUBIC, "WORD_BITS": 22}, "WORD_BITS_of_a_cubic_table_is_not_8_to_21"),
        ({"POWER_UP_CODE": 65536}, "POWER_UP_CODE_has_more_than_DAC_BITS"),
    ],
    "dac_fit": [
        ({"X_INTERPOLATED": 2}, "X_or_Y_INTERPOLATED_are_not_0_1_or_3"),
        ({"Y_INTERPOLATED": 4}, "X_or_Y_INTERPOLATED_are_not_0_1_or_3"),
        ({"X_INDEX_BITS": 1}, "X_or_Y_INDEX_BITS_are_not_2_to_16"),
        ({"Y_INDEX_BITS": 17}, "X_or_Y_INDEX_BITS_are_not_2_to_16"),
        ({"X_WORD_BITS": 25}, "X_or_Y_WORD_BITS_are_not_8_to_24"),
        ({"Y_WORD_BITS": 7}, "X_or_Y_WORD_BITS_are_not_8_to_24"),
        ({"X_PERIOD_BITS": 0}, "X_or_Y_PERIOD_BITS_are_not_1_to_31"),
        ({"Y_PERIOD_BITS": 32}, "X_or_Y_PERIOD_BITS_are_not_1_to_31"),
    ],
    "dac_fourier_product": [({"DIGIT_BITS": 4}, "DIGIT_BITS_is_not_2_or_16")],
    "dac_fourier_sum": [({"DIGIT_BITS": 4}, "DIGIT_BITS_is_not_2_or_16")],
    "dac_interpolator": [
        ({"GUARD_BITS": 3}, "GUARD_BITS_follows_from_WORD_BITS"),
        ({"LATENCY": 9}, "LATENCY_follows_from_PLAIN_MULTIPLIER"),
    ],
    "dac_loader_core": [({"TARGET_BITS": 11}, "TARGET_BITS_is_not_10")],
    "dac_loader_program": [({"TARGET_BITS": 9}, "TARGET_BITS_is_not_10")],
    "dac_markers": [
        ({"PIXEL_INDEX_BITS": 1}, "PIXEL_INDEX_BITS_is_not_0_or_2_to_16"),
        ({"PIXEL_INDEX_BITS": 17}, "PIXEL_INDEX_BITS_is_not_0_or_2_to_16"),
        ({"COMMIT_MODES": 2}, "JUMPS_is_not_0_to_1"),
    ],
    "dac_multiply_digits": [({"LOW_BITS": 19}, "LOW_BITS_is_not_1_to_A_BITS_and_1")],
    "dac_multiply_plain": [
        ({"LOW_BITS": 34}, "LOW_BITS_is_not_1_to_the_bits_of_a_product"),
        ({"RESULT_BITS": 35}, "RESULT_BITS_is_not_1_to_the_bits_of_a_sum"),
    ],
    "dac_offset": [
        ({"LOW_BITS": 38}, "LOW_BITS_is_not_1_to_less_than_BITS"),
        ({"CODE_BITS": 18}, "GAIN_Q_and_CODE_BITS_are_not_less_than_BITS"),
    ],
    "dac_output": [
        ({"POWER_UP_CODE": 65536}, "POWER_UP_CODE_has_more_than_DAC_BITS"),
        ({"LATENCY": 14}, "LATENCY_follows_from_PLAIN_MULTIPLIER_and_SHAPING"),
    ],
    "dac_register": [({"BITS": 2, "POWER_UP": 4}, "POWER_UP_has_more_than_BITS")],
    "dac_slew": [({"BITS": 2, "POWER_UP": 4}, "POWER_UP_has_more_than_BITS")],
    "dac_spline": [({"SPACING": 10}, "SPACING_is_not_11")],
    "dac_verdict": [
        ({"X_POWER_UP_CODE": 65536}, "X_POWER_UP_CODE_has_more_than_DAC_BITS"),
        ({"Y_POWER_UP_CODE": 65536}, "Y_POWER_UP_CODE_has_more_than_DAC_BITS"),
    ],
    "dac_whole_table": [INTERPOLATED],
    "dac_pair": [
        ({"X_INDEX_BITS": 1}, "X_or_Y_INDEX_BITS_are_not_2_to_16"),
        ({"Y_INDEX_BITS": 17}, "X_or_Y_INDEX_BITS_are_not_2_to_16"),
        ({"LONGER_BITS": 12}, "LONGER_BITS_follows_from_X_and_Y_INDEX_BITS"),
        ({"DAC_BITS": 18}, "SAMPLE_BITS_are_less_than_DAC_BITS_takes"),
    ],
    "dac_pair_interpolator": [({"GUARD_BITS": 3}, "GUARD_BITS_follows_from_WORD_BITS")],
    "dac_pair_output": [
        ({"DAC_BITS": 18}, "SAMPLE_BITS_are_less_than_DAC_BITS_takes"),
        ({"X_POWER_UP_CODE": 65536}, "X_POWER_UP_CODE_has_more_than_DAC_BITS"),
        ({"Y_POWER_UP_CODE": 65536}, "Y_POWER_UP_CODE_has_more_than_DAC_BITS"),
    ],
    "dac_pair_slew": [
        ({"X_POWER_UP": 65536}, "X_POWER_UP_has_more_than_BITS"),
        ({"Y_POWER_UP": 65536}, "Y_POWER_UP_has_more_than_BITS"),
    ],
    "dac_pair_table": [
        ({"X_INDEX_BITS": 1}, "X_or_Y_INDEX_BITS_are_not_2_to_16"),
        ({"LONGER_BITS": 10}, "LONGER_BITS_follows_from_X_and_Y_INDEX_BITS"),
    ],
    "dac_slow_engine": [
        ({"Y_INDEX_BITS": 15}, "X_or_Y_INDEX_BITS_are_not_2_to_14"),
        ({"X_WORD_BITS": 22}, "X_or_Y_WORD_BITS_are_not_8_to_21"),
        ({"INDEX_BITS": 7}, "INDEX_BITS_follows_from_X_and_Y_INDEX_BITS"),
        ({"WORD_BITS": 17}, "WORD_BITS_follows_from_X_and_Y_WORD_BITS"),
    ],
    "dac_slow_fit": [({"X_INDEX_BITS": 15}, "X_or_Y_INDEX_BITS_are_not_2_to_14")],
    "dac_slow_part": [({"X_INTERPOLATED": 0}, "X_or_Y_INTERPOLATED_are_not_1_or_3")],
}
NEIGHBOURS: dict[str, list[Values]] = {
    "dac_axis": [
        {"INTERPOLATED": 0, "POWER_UP_CODE": CODE},
        {**CUBIC, "INDEX_BITS": 14, "WORD_BITS": 21, "SHAPING": 3},
        {"PLAIN_MULTIPLIER": 1, "LATENCY": 22},
    ],
    "dac_axis_serial": [{**CUBIC, "INDEX_BITS": 3, "WORD_BITS": 21}, {"INTERPOLATED": 0, "POWER_UP_CODE": CODE}],
    "dac_fit": [{"X_INTERPOLATED": 3, "Y_INTERPOLATED": 0, "X_INDEX_BITS": 2, "Y_INDEX_BITS": 16, "X_PERIOD_BITS": 1}],
    "dac_fourier_product": [{"DIGIT_BITS": 16}],
    "dac_fourier_sum": [{"DIGIT_BITS": 16}],
    "dac_interpolator": [{"PLAIN_MULTIPLIER": 1, "LATENCY": 5}],
    "dac_markers": [{"PIXEL_INDEX_BITS": 2, "COMMIT_MODES": 1}, {"PIXEL_INDEX_BITS": 16}],
    "dac_multiply_digits": [{"LOW_BITS": 18}],
    "dac_multiply_plain": [{"LOW_BITS": 33}, {"RESULT_BITS": 34}],
    "dac_offset": [{"LOW_BITS": 37}, {"CODE_BITS": 17}],
    "dac_output": [{"POWER_UP_CODE": CODE, "SHAPING": 1, "LATENCY": 16}],
    "dac_register": [{"BITS": 2, "POWER_UP": "64'd3"}],
    "dac_slew": [{"BITS": 2, "POWER_UP": "64'd3"}],
    "dac_verdict": [{"X_POWER_UP_CODE": CODE, "Y_POWER_UP_CODE": CODE}],
    "dac_whole_table": [{"INTERPOLATED": 0}, {"INTERPOLATED": 3}],
    "dac_pair": [{"X_INDEX_BITS": 2, "Y_INDEX_BITS": 16}, {"DAC_BITS": 17}],
    "dac_pair_output": [{"DAC_BITS": 17, "X_POWER_UP_CODE": CODE, "Y_POWER_UP_CODE": CODE}],
    "dac_pair_slew": [{"X_POWER_UP": CODE, "Y_POWER_UP": CODE}],
    "dac_pair_table": [{"X_INDEX_BITS": 2, "Y_INDEX_BITS": 16}],
    "dac_slow_engine": [{"X_INDEX_BITS": 3, "Y_INDEX_BITS": 14, "X_WORD_BITS": 8, "Y_WORD_BITS": 21}],
    "dac_slow_fit": [{"X_INDEX_BITS": 2, "Y_INDEX_BITS": 14}],
    "dac_slow_part": [{"X_INTERPOLATED": 1, "Y_INTERPOLATED": 3}],
}
# Parameters that a module only hands on, and the module that has the guard.
HANDED_ON: dict[str, dict[str, str]] = {
    "dac_axi_lite": dict.fromkeys(
        (
            "DAC_BITS", "X_INTERPOLATED", "X_INDEX_BITS", "X_WORD_BITS", "Y_INTERPOLATED", "Y_INDEX_BITS",
            "Y_WORD_BITS", "COUNT_BITS", "FOURIER", "HARMONICS", "SHAPING", "COMMIT_MODES", "PIXEL_INDEX_BITS",
            "SLOW_PART", "SLOW_INDEX_BITS",
        ),
        "dac_bus",
    ),
    "dac_axis": {"DAC_BITS": "dac_output", "PERIOD_BITS": "dac_phase", "POWER_UP_CODE": "dac_output"},
    "dac_markers": {"COMMIT_MODES": "dac_window"},
    "dac_pair": {
        "DAC_BITS": "dac_pair_output", "PERIOD_BITS": "dac_pair_phase", "X_POWER_UP_CODE": "dac_pair_output",
        "Y_POWER_UP_CODE": "dac_pair_output",
    },
    "dac_render": dict.fromkeys(
        (
            "X_INDEX_BITS", "Y_INDEX_BITS", "X_WORD_BITS", "Y_WORD_BITS", "HARMONICS", "SINE_FILE", "MULTIPLIER"
        ),
        "dac_fourier",
    ),
    "dac_sequencer": {"SINE_FILE": "dac_render"},
    "dac_slow_axis": dict.fromkeys(
        ("INTERPOLATED", "INDEX_BITS", "WORD_BITS", "DAC_BITS", "PERIOD_BITS", "SHAPING", "POWER_UP_CODE"),
        "dac_axis_serial",
    ),
    "dac_slow_part": {
        **dict.fromkeys(("DAC_BITS", "PERIOD_BITS", "SHAPING", "X_POWER_UP_CODE", "Y_POWER_UP_CODE"), "dac_slow_axis"),
        **dict.fromkeys(
            ("X_INDEX_BITS", "X_WORD_BITS", "Y_INDEX_BITS", "Y_WORD_BITS", "SLOW_INDEX_BITS", "LINE_BITS"),
            "dac_slow_engine",
        ),
    },
    "dac_verdict": {"COUNT_BITS": "dac_faults"},
    "dac_whole": dict.fromkeys(
        ("X_INTERPOLATED", "X_INDEX_BITS", "Y_INTERPOLATED", "Y_INDEX_BITS", "HARMONICS"), "dac_whole_table"
    ),
}  # fmt: skip
HANDED_ON["dac_wishbone"] = HANDED_ON["dac_axi_lite"]
# Contents, of which any will do.
ANY = {"program_loader": {"BOOT_HASH"}, "dac_loader_memory": {"NUMBERS", "DEVICE"}}
ANY["dac_pair_ring"] = {"POWER_UP_NOW", "POWER_UP_OTHER"}  # cut to the bits of the ring


def illegal() -> Iterator[tuple[str, Values, str]]:
    """Yield module, values and reason: next to both ends of each range, and what is illegal otherwise."""
    for module, ranges in RANGES.items():
        for name, (low, high) in ranges.items():
            reason = f"{name}_is_less_than_{low}" if high is None else f"{name}_is_not_{low}_to_{high}"
            yield module, {name: low - 1}, reason
            if high is not None:
                yield module, {name: high + 1}, reason
    for module, cases in OTHERWISE.items():
        for values, reason in cases:
            yield module, values, reason


def legal() -> Iterator[tuple[str, Values]]:
    """Yield module and values: both ends of each range, and the neighbours of what is illegal otherwise."""
    for module, ranges in RANGES.items():
        for name, ends in ranges.items():
            for value in ends:
                if value is not None:
                    yield module, {name: value, **BESIDE.get((module, name, value), {})}
    for module, cases in NEIGHBOURS.items():
        for values in cases:
            yield module, values
