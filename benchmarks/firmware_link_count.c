/* What benchmarks/firmware_link.py counts the instructions of: the link of the shipped example, a call at a time. */
#include "annexin_200nm.h"
#include "dac_link.h"

enum { HARMONICS = 64 };

static const dac_program scan = DAC_PROGRAM(ANNEXIN_200NM, annexin_200nm);
static dac_word x_table[2][ANNEXIN_200NM_X_TABLE_LENGTH + 1], y_table[2][ANNEXIN_200NM_Y_TABLE_LENGTH + 1];
static int32_t x_fourier[2 * HARMONICS + 1], y_fourier[2 * HARMONICS + 1];
static const uint8_t key[32] = {7}, identity[8] = {1};

static uint32_t milliseconds(void)
{
    return 0;
}

#define AXIS(NAME, table, fourier)                                                                                    \
    {                                                                                                                 \
        DAC_CONVERTER(NAME, 0), {NAME##_CODE_MIN, NAME##_CODE_MAX, NAME##_MAX_STEP, 0xFFFFFF}, NAME##_TABLE_BITS,     \
        NAME##_INDEX_BITS, NAME##_TABLE_LENGTH + 1, {table[0], table[1]}, fourier                                     \
    }

static dac_link_config config = {
    .x = AXIS(ANNEXIN_200NM_X, x_table, x_fourier),
    .y = AXIS(ANNEXIN_200NM_Y, y_table, y_fourier),
    .harmonics = HARMONICS,
    .sine_index_bits = ANNEXIN_200NM_SINE_INDEX_BITS,
    .sine = annexin_200nm_sine,
    .key = key,
    .identity = identity,
    .identity_bytes = sizeof identity,
    .boot_persists = true,
    .milliseconds = milliseconds,
};
static dac_sequencer sequencer;
static dac_link link;

uint8_t incoming[512], outgoing[256];
uint32_t incoming_bytes, outgoing_bytes;
const uint32_t sizes[] = {sizeof(dac_link), DAC_LINK_RING};

void bench_main(void);
void link_start(uint32_t keyed);
void link_receive_one(void);
void link_feed(void);
uint32_t link_work(void);
void link_drain(void);
void link_tick(void);

void bench_main(void) { }

void link_start(uint32_t keyed)
{
    config.key_bytes = keyed ? sizeof key : 0;
    dac_sequencer_init(&sequencer, &config.x.converter, &config.y.converter);
    dac_link_init(&link, &config, &sequencer, 1);
    (void)dac_sequencer_load(&sequencer, &scan);
    (void)dac_sequencer_commit(&sequencer);
    link_tick();
}

void link_receive_one(void)
{
    dac_link_receive(&link, 0);
}

void link_feed(void)
{
    for (uint32_t i = 0; i < incoming_bytes; i++)
        dac_link_receive(&link, incoming[i]);
}

uint32_t link_work(void)
{
    return dac_link_work(&link);
}

void link_drain(void)
{
    int byte;
    for (outgoing_bytes = 0; (byte = dac_link_transmit(&link)) >= 0; outgoing_bytes++)
        outgoing[outgoing_bytes] = (uint8_t)byte;
}

void link_tick(void)
{
    dac_tick tick;
    dac_sequencer_step(&sequencer, &tick);
}
