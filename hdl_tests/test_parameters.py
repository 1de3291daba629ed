"""Illegal parameters stop the elaboration with their reason, in Icarus, Verilator and yosys; legal ones do not.

An illegal value is one beyond the range that a guard gives; the values at both ends of it elaborate. No parameter of
any module is without its guard; those of the modules inside the core are in ``inner_parameters``.
"""

import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from building import REPOSITORY, tool
from inner_parameters import ANY, HANDED_ON, illegal, legal
from sets import one_of
from test_lint import MODULES, SOURCES, complete, lint, path_of

MODULE = re.compile(r"^module (\w+) #\((.*?)^\)", re.MULTILINE | re.DOTALL)
GUARD = re.compile(r"^ +(\w+) stop \(\);$", re.MULTILINE)
Values = Mapping[str, int | str]
SLOW_PART = {"SLOW_PART": 1, "LOW_AREA": 1}
ALTERNATE = {"ALTERNATE": 1}
ALTERNATE_HAS_NO = "ALTERNATE_has_no_LOW_AREA_PLAIN_MULTIPLIER_FOURIER_or_SHAPING"

FOURIER = {"FOURIER": 1, "X_WORD_BITS": 32, "Y_WORD_BITS": 32, "X_WORDS": 3, "Y_WORDS": 3, "X_HARMONICS": 1}
CUBIC = {"X_INTERPOLATED": 3, "Y_INTERPOLATED": 3}
BOOT = FOURIER | {"Y_HARMONICS": 1}
EMPTY = '""'  # the name of a file
# What is illegal, and the reason that a tool gives.
ILLEGAL: dict[str, list[tuple[Values, str]]] = {
    "dac_sequencer": [
        ({"DAC_BITS": 7}, "DAC_BITS_is_not_8_to_24"),
        ({"DAC_BITS": 25}, "DAC_BITS_is_not_8_to_24"),
        ({"X_INTERPOLATED": 2}, "X_INTERPOLATED_is_not_0_1_or_3"),
        ({"Y_INTERPOLATED": 4}, "Y_INTERPOLATED_is_not_0_1_or_3"),
        ({"X_INDEX_BITS": 17}, "X_INDEX_BITS_is_not_2_to_16"),
        ({"Y_INDEX_BITS": 1}, "Y_INDEX_BITS_is_not_2_to_16"),
        ({"X_WORD_BITS": 25}, "X_WORD_BITS_is_not_8_to_24"),
        ({"Y_WORD_BITS": 7}, "Y_WORD_BITS_is_not_8_to_24"),
        ({"TICK_BITS": 2}, "TICK_BITS_is_not_3_to_30"),
        ({"TICK_BITS": 31}, "TICK_BITS_is_not_3_to_30"),
        ({"LINE_BITS": 0}, "LINE_BITS_is_not_1_to_16"),
        ({"LINE_BITS": 17}, "LINE_BITS_is_not_1_to_16"),
        ({"PERIOD_BITS": 0}, "PERIOD_BITS_is_not_1_to_31"),
        ({"PERIOD_BITS": 32}, "PERIOD_BITS_is_not_1_to_31"),
        ({"COUNT_BITS": 1}, "COUNT_BITS_is_not_2_to_32"),
        ({"COUNT_BITS": 33}, "COUNT_BITS_is_not_2_to_32"),
        ({"PLAIN_MULTIPLIER": 2}, "PLAIN_MULTIPLIER_is_not_0_to_1"),
        ({"LOW_AREA": 2}, "LOW_AREA_is_not_0_to_1"),
        ({"COMMIT_MODES": 2}, "COMMIT_MODES_is_not_0_to_1"),
        ({"FOURIER": 2}, "FOURIER_is_not_0_to_1"),
        ({"HARMONICS": 0}, "HARMONICS_is_not_1_to_512"),
        ({"HARMONICS": 513, "FOURIER": 1}, "HARMONICS_is_not_1_to_512"),
        ({"X_INDEX_BITS": 2, "FOURIER": 1}, "X_INDEX_BITS_is_not_3_to_16"),
        ({"SHAPING": 4}, "SHAPING_is_not_0_to_3"),
        ({**CUBIC, "X_INDEX_BITS": 2}, "X_INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({**CUBIC, "X_WORD_BITS": 22}, "X_WORD_BITS_of_a_cubic_table_is_not_8_to_21"),
        ({**CUBIC, "Y_INDEX_BITS": 15}, "Y_INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({**CUBIC, "Y_WORD_BITS": 24}, "Y_WORD_BITS_of_a_cubic_table_is_not_8_to_21"),
        ({"X_POWER_UP_CODE": 65536}, "X_POWER_UP_CODE_has_more_than_DAC_BITS"),
        ({"Y_POWER_UP_CODE": 256, "DAC_BITS": 8}, "Y_POWER_UP_CODE_has_more_than_DAC_BITS"),
        ({"LOW_AREA": 1, "PLAIN_MULTIPLIER": 1}, "PLAIN_MULTIPLIER_has_no_use_in_LOW_AREA_without_FOURIER"),
        ({"FOURIER": 1, "X_INTERPOLATED": 0, "Y_INTERPOLATED": 0}, "FOURIER_renders_no_direct_table"),
        (
            {"FOURIER": 1, "HARMONICS": 16, "X_INDEX_BITS": 5, "Y_INDEX_BITS": 4},
            "HARMONICS_is_not_less_than_half_of_the_longer_table",
        ),
        ({"FOURIER": 1, "SINE_FILE": EMPTY}, "SINE_FILE_is_not_set"),
        ({"SLOW_PART": 2}, "SLOW_PART_is_not_0_to_1"),
        ({"SLOW_PART": 1}, "SLOW_PART_needs_LOW_AREA_and_has_no_FOURIER"),
        ({**SLOW_PART, "FOURIER": 1}, "SLOW_PART_needs_LOW_AREA_and_has_no_FOURIER"),
        ({**SLOW_PART, "SHAPING": 4}, "SHAPING_is_not_0_to_3"),
        ({**SLOW_PART, "X_INTERPOLATED": 0}, "SLOW_PART_plays_no_direct_table"),
        ({**SLOW_PART, "Y_WORD_BITS": 22}, "X_or_Y_WORD_BITS_with_SLOW_PART_are_not_8_to_21"),
        ({**SLOW_PART, "X_INDEX_BITS": 15}, "X_or_Y_INDEX_BITS_with_SLOW_PART_are_more_than_14"),
        ({**SLOW_PART, "SLOW_INDEX_BITS": 2}, "SLOW_INDEX_BITS_is_not_3_to_14"),
        ({**SLOW_PART, "SLOW_INDEX_BITS": 15}, "SLOW_INDEX_BITS_is_not_3_to_14"),
        ({"PIXEL_INDEX_BITS": 1}, "PIXEL_INDEX_BITS_is_not_0_or_2_to_16"),
        ({"PIXEL_INDEX_BITS": 17}, "PIXEL_INDEX_BITS_is_not_0_or_2_to_16"),
        ({**SLOW_PART, "PIXEL_INDEX_BITS": 9}, "PIXEL_INDEX_BITS_has_no_SLOW_PART"),
        ({"ALTERNATE": 2}, "ALTERNATE_is_not_0_to_1"),
        ({**ALTERNATE, "LOW_AREA": 1}, ALTERNATE_HAS_NO),
        ({**ALTERNATE, "PLAIN_MULTIPLIER": 1}, ALTERNATE_HAS_NO),
        ({**ALTERNATE, "FOURIER": 1}, ALTERNATE_HAS_NO),
        ({**ALTERNATE, "SHAPING": 1}, ALTERNATE_HAS_NO),
        ({**ALTERNATE, "Y_INTERPOLATED": 3}, "ALTERNATE_plays_no_cubic_table"),
        ({**ALTERNATE, "Y_WORD_BITS": 15}, "X_and_Y_WORD_BITS_with_ALTERNATE_are_not_the_same"),
        ({**ALTERNATE, "DAC_BITS": 18}, "X_WORD_BITS_with_ALTERNATE_are_less_than_DAC_BITS_takes"),
    ],
    "program_loader": [
        ({"CLOCKS_PER_BIT": 7}, "CLOCKS_PER_BIT_is_not_8_to_65536"),
        ({"MEMORY_BYTES": 1024}, "MEMORY_BYTES_is_no_power_of_two"),
        ({"MEMORY_BYTES": 3000}, "MEMORY_BYTES_is_no_power_of_two"),
        ({"WINDOW": 0}, "WINDOW_is_not_1_to_255"),
        ({"DAC_BITS": 7}, "DAC_BITS_is_not_8_to_24"),
        ({"X_INTERPOLATED": 2}, "X_INTERPOLATED_is_not_0_1_or_3"),
        ({"X_INTERPOLATED": 4}, "X_INTERPOLATED_is_not_0_1_or_3"),
        ({"Y_INTERPOLATED": 2}, "Y_INTERPOLATED_is_not_0_1_or_3"),
        ({"Y_INTERPOLATED": 4}, "Y_INTERPOLATED_is_not_0_1_or_3"),
        ({"X_INDEX_BITS": 17}, "X_INDEX_BITS_is_not_2_to_16"),
        ({"Y_INDEX_BITS": 17}, "Y_INDEX_BITS_is_not_2_to_16"),
        ({"X_WORD_BITS": 25}, "X_WORD_BITS_is_not_8_to_24"),
        ({"Y_WORD_BITS": 25}, "Y_WORD_BITS_is_not_8_to_24"),
        ({"TICK_BITS": 31}, "TICK_BITS_is_not_3_to_30"),
        ({"LINE_BITS": 17}, "LINE_BITS_is_not_1_to_16"),
        ({"COMMIT_MODES": 2}, "COMMIT_MODES_is_not_0_to_1"),
        ({"FOURIER": 2}, "FOURIER_is_not_0_to_1"),
        ({"HARMONICS": 0}, "HARMONICS_is_not_1_to_512"),
        ({"SHAPING": 4}, "SHAPING_is_not_0_to_3"),
        ({"X_INTERPOLATED": 3, "X_INDEX_BITS": 2}, "X_INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({"X_INTERPOLATED": 3, "X_INDEX_BITS": 15}, "X_INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({"X_INTERPOLATED": 3, "X_WORD_BITS": 22}, "X_WORD_BITS_of_a_cubic_table_is_not_8_to_21"),
        ({"Y_INTERPOLATED": 3, "Y_INDEX_BITS": 2}, "Y_INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({"Y_INTERPOLATED": 3, "Y_INDEX_BITS": 15}, "Y_INDEX_BITS_of_a_cubic_table_is_not_3_to_14"),
        ({"Y_INTERPOLATED": 3, "Y_WORD_BITS": 22}, "Y_WORD_BITS_of_a_cubic_table_is_not_8_to_21"),
        ({"CONVERTER": 15}, "CONVERTER_is_no_word_of_DAC_BITS_or_more"),
        ({"X_CODE_MIN": 5, "X_CODE_MAX": 4}, "X_CODE_MIN_to_X_CODE_MAX_is_no_range_of_DAC_BITS"),
        ({"Y_CODE_MAX": 65536}, "Y_CODE_MIN_to_Y_CODE_MAX_is_no_range_of_DAC_BITS"),
        ({"X_MAX_STEP": 0}, "X_MAX_STEP_is_not_1_to_the_highest_code"),
        ({"Y_MAX_STEP": 65536}, "Y_MAX_STEP_is_not_1_to_the_highest_code"),
        ({"UPDATE_RATE": 0}, "UPDATE_RATE_is_not_set"),
    ],
    "dac_boot": [
        ({"FOURIER": 2}, "FOURIER_is_not_0_to_1"),
        ({"X_WORDS": 0}, "X_WORDS_is_not_1_to_65536"),
        ({"Y_WORDS": 65537}, "Y_WORDS_is_not_1_to_65536"),
        ({"X_WORD_BITS": 7}, "X_WORD_BITS_of_a_table_is_not_8_to_24"),
        ({"Y_WORD_BITS": 25}, "Y_WORD_BITS_of_a_table_is_not_8_to_24"),
        ({**BOOT, "X_WORD_BITS": 16}, "X_WORD_BITS_of_Fourier_words_is_not_32"),
        ({**BOOT, "Y_WORD_BITS": 31}, "Y_WORD_BITS_of_Fourier_words_is_not_32"),
        ({**BOOT, "X_HARMONICS": 0}, "X_HARMONICS_is_not_1_to_512"),
        ({**BOOT, "Y_HARMONICS": 513, "Y_WORDS": 1027}, "Y_HARMONICS_is_not_1_to_512"),
        ({**BOOT, "X_WORDS": 4}, "X_WORDS_is_not_two_X_HARMONICS_and_one"),
        ({**BOOT, "Y_HARMONICS": 2}, "Y_WORDS_is_not_two_Y_HARMONICS_and_one"),
        ({"START_CLOCKS": 16777217}, "START_CLOCKS_is_not_0_to_16777216"),
        ({"PROGRAM_FILE": EMPTY}, "PROGRAM_FILE_is_not_set"),
        ({"X_FILE": EMPTY}, "X_FILE_is_not_set"),
        ({"Y_FILE": EMPTY}, "Y_FILE_is_not_set"),
    ],
    "dac_slow_boot": [
        ({"X_TABLE_WORDS": 7}, "X_TABLE_WORDS_is_not_8_to_16384"),
        ({"X_SLOW_WORDS": 16385}, "X_SLOW_WORDS_is_not_8_to_16384"),
        ({"X_KNOTS": 1}, "X_KNOTS_is_not_2_to_65"),
        ({"Y_TABLE_WORDS": 16385}, "Y_TABLE_WORDS_is_not_8_to_16384"),
        ({"Y_SLOW_WORDS": 7}, "Y_SLOW_WORDS_is_not_8_to_16384"),
        ({"Y_KNOTS": 66}, "Y_KNOTS_is_not_2_to_65"),
        ({"WORD_BITS": 17}, "WORD_BITS_is_not_18_to_21"),
        ({"START_CLOCKS": 16777217}, "START_CLOCKS_is_not_0_to_16777216"),
        ({"SLOW_FILE": EMPTY}, "SLOW_FILE_is_not_set"),
    ],
    "dac_pixel_boot": [
        ({"PIXELS": 0}, "PIXELS_is_not_1_to_32768"),
        ({"PIXELS": 32769}, "PIXELS_is_not_1_to_32768"),
        ({"START_CLOCKS": 16777217}, "START_CLOCKS_is_not_0_to_16777216"),
        ({"PIXEL_FILE": EMPTY}, "PIXEL_FILE_is_not_set"),
    ],
    "dac_fourier": [
        ({"X_INDEX_BITS": 2}, "X_INDEX_BITS_is_not_3_to_16"),
        ({"Y_INDEX_BITS": 17}, "Y_INDEX_BITS_is_not_3_to_16"),
        ({"X_WORD_BITS": 7}, "X_WORD_BITS_is_not_8_to_24"),
        ({"Y_WORD_BITS": 25}, "Y_WORD_BITS_is_not_8_to_24"),
        ({"HARMONICS": 0}, "HARMONICS_is_not_1_to_512"),
        ({"MULTIPLIER": 2}, "MULTIPLIER_is_not_0_to_1"),
        ({"SINE_FILE": EMPTY}, "SINE_FILE_is_not_set"),
    ],
    "dac_coding": [
        ({"BITS": 1}, "BITS_is_not_2_to_32"),
        ({"BITS": 18}, "WORD_BITS_is_not_BITS_to_64"),
        ({"TWOS_COMPLEMENT": 2}, "TWOS_COMPLEMENT_is_not_0_to_1"),
        ({"LEFT_ALIGNED": 2}, "LEFT_ALIGNED_is_not_0_to_1"),
    ],
    "dac_spi": [
        ({"FRAME_BITS": 33}, "FRAME_BITS_is_not_2_to_32"),
        ({"WORD_BITS": 17}, "word_is_not_inside_FRAME_BITS"),
        ({"DATA_LSB": 1}, "word_is_not_inside_FRAME_BITS"),
        ({"X_PREFIX": 65536}, "X_PREFIX_has_more_than_FRAME_BITS"),
        ({"Y_PREFIX": 65536}, "Y_PREFIX_has_more_than_FRAME_BITS"),
        ({"TOPOLOGY": 4}, "TOPOLOGY_is_not_0_to_3"),
        ({"Y_FIRST": 2}, "Y_FIRST_is_not_0_to_1"),
        ({"CPOL": 2}, "CPOL_is_not_0_to_1"),
        ({"CPHA": 2}, "CPHA_is_not_0_to_1"),
        ({"HALF_PERIOD": 0}, "HALF_PERIOD_is_not_1_to_65536"),
        ({"GAP": 0}, "GAP_is_not_1_to_65536"),
        ({"LDAC_CLOCKS": 65537}, "LDAC_CLOCKS_is_not_0_to_65536"),
        ({"LDAC_DELAY": 0}, "LDAC_DELAY_is_not_1_to_65536"),
        ({"LDAC_HELD": 2}, "LDAC_HELD_is_not_0_to_1"),
    ],
    "dac_axi_stream": [
        ({"WORD_BITS": 0}, "WORD_BITS_is_not_1_to_64"),
        ({"MARKER_BITS": 65}, "MARKER_BITS_is_not_1_to_64"),
        ({"LANE_BITS": 17}, "LANE_BITS_follows_from_WORD_BITS"),
    ],
    "dac_bus": [
        ({"DAC_BITS": 25}, "DAC_BITS_is_not_8_to_24"),
        ({"X_INTERPOLATED": 2}, "X_INTERPOLATED_is_not_0_1_or_3"),
        ({"X_INDEX_BITS": 1}, "X_INDEX_BITS_is_not_2_to_16"),
        ({"X_WORD_BITS": 25}, "X_WORD_BITS_is_not_8_to_24"),
        ({"Y_INTERPOLATED": 4}, "Y_INTERPOLATED_is_not_0_1_or_3"),
        ({"Y_INDEX_BITS": 17}, "Y_INDEX_BITS_is_not_2_to_16"),
        ({"Y_WORD_BITS": 7}, "Y_WORD_BITS_is_not_8_to_24"),
        ({"COUNT_BITS": 33}, "COUNT_BITS_is_not_2_to_32"),
        ({"FOURIER": 2}, "FOURIER_is_not_0_to_1"),
        ({"HARMONICS": 513}, "HARMONICS_is_not_1_to_512"),
        ({"SHAPING": 4}, "SHAPING_is_not_0_to_3"),
        ({"COMMIT_MODES": 2}, "COMMIT_MODES_is_not_0_to_1"),
        ({"PIXEL_INDEX_BITS": 1}, "PIXEL_INDEX_BITS_is_not_0_or_2_to_14"),
        ({"PIXEL_INDEX_BITS": 15}, "PIXEL_INDEX_BITS_is_not_0_or_2_to_14"),
        ({"SLOW_PART": 2}, "SLOW_PART_is_not_0_to_1"),
        ({"SLOW_PART": 1, "SLOW_INDEX_BITS": 14}, "SLOW_INDEX_BITS_is_not_3_to_13"),
        ({"SLOW_PART": 1, "Y_INDEX_BITS": 14}, "X_or_Y_INDEX_BITS_with_SLOW_PART_are_more_than_13"),
    ],
    "dac_synchronise": [
        ({"STAGES": 1}, "STAGES_is_not_2_to_8"),
        ({"STAGES": 0}, "STAGES_is_not_2_to_8"),
        ({"STAGES": 9}, "STAGES_is_not_2_to_8"),
        ({"PULSE": 3}, "PULSE_is_not_0_to_2"),
        ({"POWER_UP": 2}, "POWER_UP_is_not_0_to_1"),
    ],
    "adc_pixels": [
        ({"CHANNELS": 0}, "CHANNELS_is_not_1_to_2"),
        ({"CHANNELS": 3}, "CHANNELS_is_not_1_to_2"),
        ({"SAMPLE_BITS": 1}, "SAMPLE_BITS_is_not_2_to_30"),
        ({"SAMPLE_BITS": 31, "COUNT_BITS": 2}, "SAMPLE_BITS_is_not_2_to_30"),
        ({"SIGNED": 2}, "SIGNED_is_not_0_to_1"),
        ({"COUNT_BITS": 1}, "COUNT_BITS_is_not_2_to_16"),
        ({"COUNT_BITS": 17, "SAMPLE_BITS": 8}, "COUNT_BITS_is_not_2_to_16"),
        ({"SAMPLE_BITS": 17}, "SAMPLE_BITS_and_COUNT_BITS_are_more_than_32"),
        ({"DEPTH_BITS": 0}, "DEPTH_BITS_is_not_1_to_16"),
        ({"DEPTH_BITS": 17}, "DEPTH_BITS_is_not_1_to_16"),
        ({"DATA_BITS": 128}, "DATA_BITS_follows_from_CHANNELS"),
    ],
    "dac_marker_delay": [
        ({"SIGNALS": 0}, "SIGNALS_is_not_1_to_64"),
        ({"SIGNALS": 65}, "SIGNALS_is_not_1_to_64"),
        ({"DELAY_BITS": 1}, "DELAY_BITS_is_not_2_to_16"),
        ({"DELAY_BITS": 17}, "DELAY_BITS_is_not_2_to_16"),
    ],
    "dac_axi_lite": [({"ADDRESS_BITS": 19}, "ADDRESS_BITS_is_not_20_to_64")],
    "dac_wishbone": [({"ADDRESS_BITS": 65}, "ADDRESS_BITS_is_not_20_to_64")],
}
# Everything at the lower end of its range, and at the upper.
SMALL = {"X_INDEX_BITS": 2, "Y_INDEX_BITS": 2, "X_WORD_BITS": 8, "Y_WORD_BITS": 8, "DAC_BITS": 8}
LARGE = {"X_INDEX_BITS": 16, "Y_INDEX_BITS": 16, "X_WORD_BITS": 24, "Y_WORD_BITS": 24, "DAC_BITS": 24}
LONG_SPLINE = {"X_INDEX_BITS": 14, "Y_INDEX_BITS": 14, "X_WORD_BITS": 21, "Y_WORD_BITS": 21}
TOP = "64'hffffff"
LEGAL: dict[str, list[Values]] = {
    "dac_sequencer": [
        {**SMALL, "TICK_BITS": 3, "LINE_BITS": 1, "PERIOD_BITS": 1, "COUNT_BITS": 2, "HARMONICS": 1},
        {**SMALL, "TICK_BITS": 3, "LINE_BITS": 1, "PERIOD_BITS": 1, "COUNT_BITS": 2, "LOW_AREA": 1},
        {**SMALL, "X_INDEX_BITS": 3, "Y_INDEX_BITS": 3, "FOURIER": 1, "HARMONICS": 1, "X_INTERPOLATED": 0},
        {**LARGE, "TICK_BITS": 30, "LINE_BITS": 16, "PERIOD_BITS": 31, "COUNT_BITS": 32, "X_POWER_UP_CODE": TOP},
        {**SMALL, "X_INDEX_BITS": 3, "Y_INDEX_BITS": 5, "FOURIER": 1, "HARMONICS": 15},
        {"LOW_AREA": 1, "PLAIN_MULTIPLIER": 1, "FOURIER": 1, "COMMIT_MODES": 1},
        {**SMALL, **SLOW_PART, "SLOW_INDEX_BITS": 3, "LINE_BITS": 1},
        {**LARGE, **SLOW_PART, **CUBIC, **LONG_SPLINE, "SLOW_INDEX_BITS": 14, "SHAPING": 3},
        {**SMALL, "TICK_BITS": 3, "PIXEL_INDEX_BITS": 2, "COMMIT_MODES": 1},
        {**LARGE, "TICK_BITS": 30, "PIXEL_INDEX_BITS": 16, "LOW_AREA": 1},
        {**SMALL, **ALTERNATE, "TICK_BITS": 3, "LINE_BITS": 1, "PERIOD_BITS": 1, "COUNT_BITS": 2},
        {**LARGE, **ALTERNATE, "DAC_BITS": 22, "TICK_BITS": 30, "COMMIT_MODES": 1},
        {**SMALL, "SHAPING": 1},
        {**LARGE, "SHAPING": 3, "PLAIN_MULTIPLIER": 1},
        {**SMALL, **CUBIC, "X_INDEX_BITS": 3, "Y_INDEX_BITS": 3, "TICK_BITS": 3, "PERIOD_BITS": 1},
        {**SMALL, **CUBIC, "X_INDEX_BITS": 3, "Y_INDEX_BITS": 3, "LOW_AREA": 1},
        {**LARGE, **CUBIC, **LONG_SPLINE, "TICK_BITS": 30, "SHAPING": 3, "FOURIER": 1},
        {**LARGE, **CUBIC, **LONG_SPLINE, "TICK_BITS": 30, "LOW_AREA": 1, "SHAPING": 1},
        {**LARGE, "TICK_BITS": 30, "LOW_AREA": 1, "FOURIER": 1, "HARMONICS": 512, "Y_POWER_UP_CODE": TOP},
    ],
    "program_loader": [
        {**SMALL, "CLOCKS_PER_BIT": 8, "MEMORY_BYTES": 2048, "WINDOW": 1, "TICK_BITS": 3, "LINE_BITS": 1},
        {**LARGE, "MEMORY_BYTES": 65536, "WINDOW": 255, "TICK_BITS": 30, "FOURIER": 1, "HARMONICS": 512, "SHAPING": 3},
        {**SMALL, "X_INTERPOLATED": 3, "X_INDEX_BITS": 3, "Y_INTERPOLATED": 3, "Y_INDEX_BITS": 3},
        {**LARGE, "X_INTERPOLATED": 3, "X_INDEX_BITS": 14, "X_WORD_BITS": 21, "Y_INTERPOLATED": 0},
        {**LARGE, "Y_INTERPOLATED": 3, "Y_INDEX_BITS": 14, "Y_WORD_BITS": 21},
    ],
    "dac_boot": [
        {"X_WORDS": 1, "Y_WORDS": 1, "X_WORD_BITS": 8, "Y_WORD_BITS": 24, "START_CLOCKS": 0},
        BOOT,
        {"X_WORDS": 65536, "Y_WORDS": 65536},
    ],
    "dac_slow_boot": [
        {
            "X_TABLE_WORDS": 8,
            "X_SLOW_WORDS": 8,
            "X_KNOTS": 2,
            "Y_TABLE_WORDS": 16384,
            "Y_SLOW_WORDS": 16384,
            "Y_KNOTS": 65,
            "WORD_BITS": 21,
            "START_CLOCKS": 0,
        }
    ],
    "dac_pixel_boot": [{"PIXELS": 1, "START_CLOCKS": 0}, {"PIXELS": 32768}],
    "dac_fourier": [
        {"X_INDEX_BITS": 3, "Y_INDEX_BITS": 3, "X_WORD_BITS": 8, "Y_WORD_BITS": 8, "HARMONICS": 1},
        {"X_INDEX_BITS": 16, "Y_INDEX_BITS": 16, "X_WORD_BITS": 24, "Y_WORD_BITS": 24, "HARMONICS": 512},
    ],
    "dac_coding": [{"BITS": 2, "WORD_BITS": 2}, {"BITS": 32, "WORD_BITS": 64, "LEFT_ALIGNED": 1}],
    "dac_spi": [
        {"WORD_BITS": 2, "FRAME_BITS": 2, "LDAC_CLOCKS": 0, "LDAC_DELAY": 1, "GAP": 1},
        {"WORD_BITS": 32, "FRAME_BITS": 32, "X_PREFIX": "32'hffffffff", "TOPOLOGY": 3, "GAP": 65536},
    ],
    "dac_axi_stream": [{"WORD_BITS": 1, "MARKER_BITS": 1}, {"WORD_BITS": 64, "MARKER_BITS": 64}],
    "dac_synchronise": [{"PULSE": 1}, {"STAGES": 8, "PULSE": 2, "POWER_UP": 1}],
    "adc_pixels": [
        {"CHANNELS": 2, "SAMPLE_BITS": 2, "COUNT_BITS": 2, "DEPTH_BITS": 1, "SIGNED": 0},
        {"CHANNELS": 2, "SAMPLE_BITS": 30, "COUNT_BITS": 2, "DEPTH_BITS": 16},
        {"SAMPLE_BITS": 2, "COUNT_BITS": 16},
    ],
    "dac_marker_delay": [{"SIGNALS": 1, "DELAY_BITS": 2}, {"SIGNALS": 64, "DELAY_BITS": 2}, {"DELAY_BITS": 16}],
    "dac_axi_lite": [
        {**SMALL, "ADDRESS_BITS": 64, "COUNT_BITS": 2, "HARMONICS": 1, "FOURIER": 1},
        {**LARGE, "COUNT_BITS": 32, "HARMONICS": 512, "FOURIER": 1, "SHAPING": 3},
    ],
    "dac_wishbone": [{**SMALL, "ADDRESS_BITS": 20, "COUNT_BITS": 2}, {**LARGE, "ADDRESS_BITS": 64}],
}


def icarus(top: str, values: Values, folder: Path) -> str:
    """What it says; nothing where it compiles."""
    given = [f"-P{top}.{name}={value}" for name, value in complete(top, values).items()]
    command = ["iverilog", "-g2005", "-Wall", "-o", folder / "out", "-s", top, *given, *SOURCES]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode == 0) == (done.stderr == ""), done.stderr
    return done.stderr


# Yosys takes minutes to fill the largest memories word by word, in loops that no parameter's range depends on.
FILLS = {
    "dac_fourier.v": "for (i = 0; i < 1 << QUARTER_BITS; i = i + 1) quarter_sine[i] = {1'b1, 30'd0};",
    "dac_marker_delay.v": "for (k = 0; k < 1 << DELAY_BITS; k = k + 1) past[k] = 1'b0;",
    "dac_loader_memory.v": "for (i = 0; i < 1 << ADDRESS_BITS; i = i + 1) bytes[i] = 8'd0;",
}


@pytest.fixture(scope="module")
def unfilled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The modules without these loops."""
    folder = tmp_path_factory.mktemp("modules")
    for path in SOURCES:
        text, fill = path.read_text("utf-8"), FILLS.get(path.name, "")
        assert not fill or text.count(fill) == 1
        (folder / path.name).write_text(text.replace(fill, "") if fill else text, "utf-8")
    return folder


def written(value: int | str) -> int | str:
    """Return a value as the command line of yosys takes it: a string as the bits of its characters."""
    if not isinstance(value, str) or '"' not in value:
        return value
    text = value.strip('"').encode("ascii") or b"\0"
    return f"{8 * len(text)}'h{text.hex()}"


def yosys(top: str, values: Values, modules: Path) -> str:
    given = " ".join(f"-chparam {name} {written(value)}" for name, value in complete(top, values).items())
    script = f"read_verilog -defer {modules}/*.v; hierarchy -check -top {top} {given}"
    (modules / "words.mem").write_text("0\n", "ascii")
    done = subprocess.run([tool("yosys"), "-q", "-p", script], capture_output=True, text=True, cwd=modules)
    assert (done.returncode == 0) == ("ERROR" not in done.stderr), done.stderr
    return done.stderr


CASES = [(top, values, reason) for top, cases in ILLEGAL.items() for values, reason in cases] + list(illegal())


def names_of(cases: Sequence[tuple[str, Values, str]]) -> list[str]:
    """Return the names of tests of illegal parameters."""
    return [f"{top}-{reason}-{index}" for index, (top, _, reason) in enumerate(cases)]


NAMES = names_of(CASES)
# The command line of yosys has no number below 0.
WRITTEN = [case for case in CASES if not any(isinstance(value, int) and value < 0 for value in case[1].values())]
# Yosys 0.23 ends by an assertion of its own where these are the top and have parameters, whatever their values.
NO_TOP_OF_YOSYS = ("dac_multiply_plain", "dac_output")


@pytest.mark.common
@pytest.mark.parametrize(("top", "values", "reason"), CASES, ids=NAMES)
def test_an_illegal_parameter_is_refused_by_icarus(top: str, values: Values, reason: str, tmp_path: Path) -> None:
    assert re.search(rf"error: Unknown module type: \w*{reason}", icarus(top, values, tmp_path))


@pytest.mark.rest
@pytest.mark.parametrize(("top", "values", "reason"), one_of(4, CASES, 3), ids=NAMES)
def test_an_illegal_parameter_is_refused_by_verilator(top: str, values: Values, reason: str) -> None:
    assert re.search(rf"%Error-MODMISSING: .*Cannot find file containing module: '\w*{reason}", lint(top, values))


@pytest.mark.rest
@pytest.mark.parametrize(("top", "values", "reason"), one_of(4, WRITTEN, 3), ids=names_of(WRITTEN))
def test_an_illegal_parameter_is_refused_by_yosys(top: str, values: Values, reason: str, unfilled: Path) -> None:
    assert re.search(rf"ERROR: Module `\\\w*{reason}\w*' referenced in module", yosys(top, values, unfilled))


LEGAL_CASES = [(top, values) for top, cases in LEGAL.items() for values in cases] + list(legal())


@pytest.mark.common
@pytest.mark.parametrize(("top", "values"), one_of(2, LEGAL_CASES, 2))
def test_legal_ones_at_both_ends_are_taken(top: str, values: Values, tmp_path: Path) -> None:
    assert lint(top, values) == ""
    assert icarus(top, values, tmp_path) == ""


@pytest.mark.rest
@pytest.mark.parametrize(
    ("top", "values"), one_of(2, [case for case in LEGAL_CASES if case[0] not in NO_TOP_OF_YOSYS], 2)
)
def test_legal_ones_at_both_ends_are_taken_by_yosys(top: str, values: Values, unfilled: Path) -> None:
    assert "ERROR" not in yosys(top, values, unfilled)


def parameters_of(text: str) -> set[str]:
    """Return the parameters that a module declares."""
    found = MODULE.search(text)
    return set(re.findall(r"parameter (?:\[[^]]*\] )?(\w+)", found[2])) if found else set()


def guarded(text: str, name: str) -> bool:
    """Return True if a guard of the module has the parameter in its name or in its condition."""
    conditions = "".join(re.findall(r"if \(([^\n]*(?:\n[^\n]*)?)\) begin : guard_", text))
    return any(name in guard for guard in GUARD.findall(text)) or re.search(rf"\b{name}\b", conditions) is not None


def unguarded(text: str, handed_on: Mapping[str, str]) -> set[str]:
    """Return the parameters of a module that neither it nor the module to which it hands them on has a guard for."""
    left = set()
    for name in parameters_of(text):
        if name in handed_on:
            target = handed_on[name]
            formal = re.search(rf"\b{target} #\([^;]*?\.(\w+)\({name}\)", text)
            further = unguarded(path_of(target).read_text("utf-8"), HANDED_ON.get(target, {}))
            if formal is None or formal[1] in further:
                left.add(name)
        elif not guarded(text, name):
            left.add(name)
    return left


ALL = sorted({*SOURCES, *(MODULES / "ecp5").glob("*.v")})


@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_parameter_has_its_guard_and_every_guard_its_case(path: Path) -> None:
    """But contents, of which any will do."""
    text = path.read_text("utf-8")
    assert unguarded(text, HANDED_ON.get(path.stem, {})) == ANY.get(path.stem, set())
    if path.parent.name == "ecp5":  # which has the guards of the module of the same name, or narrower ones
        return
    reasons = [reason for top, _, reason in CASES if top == path.stem]
    for guard in GUARD.findall(text):
        assert any(guard.startswith(f"{path.stem}_{reason}") for reason in reasons), guard


def test_a_parameter_without_a_guard_would_be_seen() -> None:
    """Be it the parameter of the module, or one that it hands on."""
    text = path_of("dac_table").read_text("utf-8")
    assert unguarded(text.replace("INDEX_BITS < 2", "WORD_BITS < 2").replace("table_INDEX_BITS", "table"), {}) == {
        "INDEX_BITS"
    }
    axis = path_of("dac_axis").read_text("utf-8")
    assert unguarded(axis, {}) == set(HANDED_ON["dac_axis"])
    assert unguarded(axis.replace(".DAC_BITS(DAC_BITS)", ".DAC_BITS(16)"), HANDED_ON["dac_axis"]) == {"DAC_BITS"}


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("dac_memory", {"BITS": 0}, "BITS_is_less_than_1"),
        ("dac_direct_table", {"INDEX_BITS": 0}, "INDEX_BITS_is_less_than_1"),
        ("dac_product", {"A_BITS": 19}, "A_BITS_is_not_2_to_18"),
        ("dac_product", {"B_BITS": 1}, "B_BITS_is_not_2_to_18"),
    ],
)
def test_the_modules_of_an_ecp5_have_guards_of_their_own(
    name: str, values: Values, reason: str, tmp_path: Path
) -> None:
    given = [f"-P{name}.{key}={value}" for key, value in values.items()]
    sources = sorted((MODULES / "ecp5").glob("*.v"))
    command = ["iverilog", "-g2005", "-o", tmp_path / "out", "-s", name, *given, *sources]
    said = subprocess.run(command, capture_output=True, text=True).stderr
    assert f"Unknown module type: {name}_{reason}" in said


def test_the_page_lists_every_parameter_and_its_range() -> None:
    page = (REPOSITORY / "docs" / "verilog.md").read_text("utf-8")
    for top in ("dac_sequencer", "program_loader"):
        found = MODULE.search((MODULES / f"{top}.v").read_text("utf-8"))
        assert found is not None
        for name in re.findall(r"parameter (?:\[[^]]*\] )?(\w+)", found[2]):
            assert f"`{name}`" in page, name
