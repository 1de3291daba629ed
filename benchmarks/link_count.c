/* What benchmarks/link.py counts the instructions of: the link of the example on a bare processor, a call at a time. */
#include "dac_link.h"
#include "annexin_200nm.h"

enum { TICKS = 256, HARMONICS = 64 };

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static dac_word x_tables[2][ANNEXIN_200NM_X_TABLE_LENGTH + 1], y_tables[2][ANNEXIN_200NM_Y_TABLE_LENGTH + 1];
static int32_t x_fourier[2 * HARMONICS + 1], y_fourier[2 * HARMONICS + 1];
static dac_sequencer sequencer;
static dac_link link;
static dac_output codes[2 * TICKS];
static uint8_t markers[TICKS];

#define AXIS(NAME, tables, words)                                                                                     \
    {                                                                                                                 \
        DAC_CONVERTER(NAME, 0), {NAME##_CODE_MIN, NAME##_CODE_MAX, NAME##_MAX_STEP, 0xFFFFFF}, NAME##_TABLE_BITS,      \
        NAME##_INDEX_BITS, NAME##_TABLE_LENGTH + 1, {tables[0], tables[1]}, words                                     \
    }

static const dac_link_config config = {
    .x = AXIS(ANNEXIN_200NM_X, x_tables, x_fourier),
    .y = AXIS(ANNEXIN_200NM_Y, y_tables, y_fourier),
    .harmonics = HARMONICS,
    .sine_index_bits = ANNEXIN_200NM_SINE_INDEX_BITS,
    .sine = annexin_200nm_sine,
};

/* A frame from the host. */
uint8_t incoming[256];
uint32_t incoming_bytes;
/* The last answer. */
uint8_t outgoing[256];
uint32_t outgoing_bytes;

void bench_main(void) {}

void count_fill(void)
{
    dac_sequencer_fill(&sequencer, codes, codes + 1, markers, TICKS);
}

/* The example plays. */
void count_start(void)
{
    dac_sequencer_init(&sequencer, &config.x.converter, &config.y.converter);
    dac_link_init(&link, &config, &sequencer, 1);
    (void)dac_sequencer_load(&sequencer, &scan);
    (void)dac_sequencer_commit(&sequencer);
    count_fill();
    (void)dac_sequencer_arm(&sequencer, 0);
    (void)dac_sequencer_trigger(&sequencer);
    count_fill();
}

void count_receive(void)
{
    for (uint32_t i = 0; i < incoming_bytes; i++)
        (void)dac_link_receive(&link, incoming[i]);
}

uint32_t count_work(void)
{
    return dac_link_work(&link);
}

/* From the ring to the wire, once there is nothing more to do. */
void count_transmit(void)
{
    int byte;

    outgoing_bytes = 0;
    while ((byte = dac_link_transmit(&link)) >= 0)
        outgoing[outgoing_bytes++ % sizeof outgoing] = (uint8_t)byte;
}
