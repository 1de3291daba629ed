/* What the tests cannot reach of the C sequencer from outside: sizes, many steps in one call, positions and runs of an
 * axis. */
#include "dac_arithmetic.h"
#include "dac_axis.h"

size_t probe_size(unsigned which)
{
    const size_t sizes[] = {sizeof(dac_sequencer), sizeof(dac_program), sizeof(dac_axis_program), sizeof(dac_converter),
                            sizeof(dac_tick),      sizeof(dac_status),  sizeof(dac_word),         sizeof(dac_output),
                            DAC_STRIDE,            DAC_SHAPING,            DAC_SLOW_PART,
                            DAC_WORDS_BEHIND,      DAC_PIXEL_TABLE};
    return sizes[which];
}

void probe_steps(dac_sequencer *s, dac_output *x, dac_output *y, uint8_t *markers, uint8_t *faults, size_t ticks)
{
    for (size_t i = 0; i < ticks; i++) {
        dac_tick tick;
        dac_sequencer_step(s, &tick);
        x[i] = tick.x;
        y[i] = tick.y;
        markers[i] = tick.markers;
        faults[i] = tick.faults;
    }
}

void probe_set_count(dac_sequencer *s, unsigned fault, uint32_t count)
{
    s->fault_counts[fault] = count;
}

/* The step of y of a bank. */
void probe_step_of(const dac_sequencer *s, unsigned bank, uint64_t *low, uint32_t *high)
{
    *low = s->bank[bank].y.step.low;
    *high = s->bank[bank].y.step.high;
}

/* A position plus a step. */
void probe_advance(uint64_t *low, uint32_t *high, uint64_t step_low, uint32_t step_high)
{
    dac_position at, step;
    step.low = step_low;
    step.high = step_high;
    at.low = *low;
    at.high = *high;
    dac_advance(&at, &step);
    *low = at.low;
    *high = at.high;
}

/* A position of y of a bank `ticks` ticks on. */
void probe_skip(dac_sequencer *s, unsigned bank, uint32_t ticks, uint64_t *low, uint32_t *high)
{
    s->y.at.low = *low;
    s->y.at.high = *high;
    dac_axis_skip(&s->y, &s->bank[bank].y, ticks);
    *low = s->y.at.low;
    *high = s->y.at.high;
}

/* Ticks of y of a bank, played at once from a position and a code; both are moved on. */
uint32_t probe_run(dac_sequencer *s, unsigned bank, uint64_t *low, uint32_t *high, int32_t *code, dac_output *out,
                   uint32_t ticks)
{
    uint32_t done;
    s->y.at.low = *low;
    s->y.at.high = *high;
    s->y.code = *code;
    done = dac_axis_run(&s->y, &s->bank[bank].y, out, ticks);
    *low = s->y.at.low;
    *high = s->y.at.high;
    *code = s->y.code;
    return done;
}
