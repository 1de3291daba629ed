/* Moves: new gain and offset words of the program that plays, which keeps its tables (docs/protocol.md, "Moves"). */
#include "dac_link_parts.h"

#if DAC_MOVE

enum { MOVED_IMAGE = 2, AXIS_BYTES = 12 }; /* gain, offset low and high of an axis */

static uint8_t *words_of(dac_link_image *image, unsigned axis)
{
    return image->program + 64 * (axis + 1) + 4 * DAC_LINK_GAIN;
}

#if DAC_LINK_MOVES_SLOW
/* The gains of an axis as they were uploaded, times a factor of which 16 bits are fraction, in the memory of a move. */
static dac_link_finding scale_gains(dac_link *l, unsigned axis, int32_t factor)
{
    const dac_link_image *const image = &l->image[MOVED_IMAGE];
    const dac_link_axis *const here = dac_link_axis_of(l, axis);
    const unsigned move = 1u - l->moved_slow;
    const int32_t *const gains = here->slow[l->playing].gains;
    int32_t *const scaled = here->moved_gains[move];
    dac_slow_part *const slow = &l->slow[DAC_LINK_MOVED_SLOW + move][axis];

    *slow = l->slow[l->playing][axis];
    const uint32_t before = 2 * dac_link_table_words(image, axis) + (UINT32_C(1) << slow->index_bits);
    for (unsigned i = 0; i < slow->gain_knots; i++) {
        const int64_t gain = ((int64_t)gains[i] * factor + (1 << 15)) >> 16;
        if (gain < -(INT32_C(1) << 17) || gain >= INT32_C(1) << 17)
            return dac_link_because(DAC_LINK_WORD, axis + 2 * (before + i));
        scaled[i] = (int32_t)gain;
    }
    slow->gains = scaled;
    slow->gain_word = (int32_t)dac_link_program_word(image, axis + 1, DAC_LINK_GAIN);
    slow->offset_word = dac_link_offset_word(image, axis);
    return dac_link_fine();
}
#endif

dac_link_finding dac_link_move(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a)
{
    const bool has_factors = dac_link_move_bytes(l->config, length) != DAC_LINK_MOVE_BYTES;
    const uint32_t generation = dac_sequencer_status(l->sequencer).swaps;
    dac_link_image *const image = &l->image[MOVED_IMAGE];

    if (l->upload > DAC_LINK_RECEIVING || !dac_sequencer_writable(l->sequencer))
        return dac_link_because(DAC_LINK_BUSY, 0);
    if (!l->uploaded)
        return dac_link_because(DAC_LINK_READBACK, 0);
    if (dac_link_get(payload) != generation)
        return dac_link_because(DAC_LINK_GENERATION, generation);
    for (unsigned axis = 0; axis < 2; axis++)
        if ((dac_link_program_word(&l->image[l->playing], axis + 1, DAC_LINK_SLOW_WORD) != 0) != has_factors)
            return dac_link_because(DAC_LINK_SLOW_PART, axis);
    *image = l->image[l->playing];
    for (unsigned i = 0; i < DAC_LINK_BYTES; i++)
        image->info[DAC_LINK_HASH + i] = 0; /* no plan has these words */
    for (unsigned axis = 0; axis < 2; axis++)
        dac_link_copy(words_of(image, axis), payload + 4 + AXIS_BYTES * axis, AXIS_BYTES);
#if DAC_LINK_MOVES_SLOW
    for (unsigned axis = 0; axis < 2 && has_factors; axis++) {
        const uint32_t factor = dac_link_get(payload + DAC_LINK_MOVE_BYTES + 4 * axis);
        const dac_link_finding found = scale_gains(l, axis, (int32_t)factor);
        if (found.reason != DAC_LINK_NO_REASON)
            return found;
    }
#endif
    if (!dac_link_permits(l))
        return dac_link_because(DAC_LINK_INTERLOCK, 0);
    l->upload_before = l->upload;
    l->upload = DAC_LINK_CHECKING;
    l->idle = MOVED_IMAGE;
    l->moving = l->committing = l->commit_is_last = true;
    l->commit_seq = l->last.seq;
    l->commit_session = l->session;
    l->commit_mode = DAC_COMMIT_KEEP;
    dac_link_start_check(&l->check);
    a->type = DAC_LINK_SILENT;
    return dac_link_fine();
}

void dac_link_take_move(dac_link *l)
{
    l->image[l->playing] = l->image[MOVED_IMAGE];
    l->moved_slow = (uint8_t)(1u - l->moved_slow);
    l->moved = true;
    dac_link_end_move(l, false);
}

void dac_link_end_move(dac_link *l, bool withdrawn)
{
    l->moving = false;
    l->idle = (uint8_t)(1u - l->playing);
    l->upload = withdrawn ? (uint8_t)DAC_LINK_NONE : l->upload_before;
}

#endif
