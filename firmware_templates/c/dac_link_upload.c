/* Uploads: from BEGIN to the line on which the new program plays. */
#include "dac_link_parts.h"

dac_link_finding dac_link_begin(dac_link *l, const uint8_t *info, dac_link_answer *a)
{
    const dac_link_config *const c = l->config;
    const uint32_t bytes = dac_link_get(info + DAC_LINK_BYTES), most = dac_link_most_bytes(c);

    if (l->upload > DAC_LINK_RECEIVING || !dac_sequencer_writable(l->sequencer))
        return dac_link_because(DAC_LINK_BUSY, 0);
    for (unsigned axis = 0; axis < 2; axis++) {
        const dac_link_axis *const here = dac_link_axis_of(l, axis);
        const uint8_t *const shape = info + DAC_LINK_SHAPES + 4 * axis;
#if DAC_SPLINE
        const bool cubic = (shape[0] & DAC_CUBIC) != 0;
        const unsigned index_bits = shape[0] & (DAC_CUBIC - 1u);
        const bool fits = shape[0] == 0 || (index_bits >= 3 && index_bits <= here->index_bits
                                            && (!cubic || (index_bits <= 14 && shape[1] <= 21)));
#else
        const bool fits = shape[0] == 0 || (shape[0] >= 3 && shape[0] <= here->index_bits);
#endif
        if (!fits || shape[1] != here->word_bits || shape[2] != here->converter.bits)
            return dac_link_because(DAC_LINK_SHAPE, axis);
    }
    if (bytes < DAC_LINK_PROGRAM || bytes > most)
        return dac_link_because(DAC_LINK_LENGTH, most);
    if (l->upload == DAC_LINK_NONE || !dac_link_same(info, l->image[l->idle].info, sizeof l->image[0].info)) {
        const dac_link_place start = {0, 0, 0, 0};
#if DAC_MOVE
        /* Not the idle bank of the sequencer: a program that was moved has changed the bank, and not the tables. */
        l->idle = l->uploaded ? (uint8_t)(1u - l->playing) : 0;
#else
        l->idle = (uint8_t)dac_sequencer_idle(l->sequencer);
#endif
        dac_link_copy(l->image[l->idle].info, info, sizeof l->image[0].info);
        l->place = start;
        l->received = 0;
        l->upload = DAC_LINK_RECEIVING;
    }
    a->length = 4;
    dac_link_put(a->payload, l->received);
    return dac_link_fine();
}

dac_link_finding dac_link_data(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a)
{
    const uint8_t count = (uint8_t)(length - 4);

#if DAC_MOVE
    if (l->moving)
        return dac_link_because(DAC_LINK_BUSY, 0);
#endif
    if (l->upload == DAC_LINK_NONE)
        return dac_link_because(DAC_LINK_UPLOAD, 0);
    const uint32_t bytes = dac_link_get(l->image[l->idle].info + DAC_LINK_BYTES);
    if (dac_link_get(payload) == l->received && count <= bytes - l->received)
        for (uint8_t i = 0; i < count; i++) {
            const dac_link_finding found = dac_link_store(l, payload[4 + i]);
            if (found.reason != DAC_LINK_NO_REASON) {
                l->upload = DAC_LINK_NONE;
                return found;
            }
        }
    a->length = 4;
    dac_link_put(a->payload, l->received);
    return dac_link_fine();
}

static void say_taken(const dac_link *l, uint8_t *payload)
{
    dac_link_put(payload, l->taken_generation);
    dac_link_put(payload + 4, l->taken_line);
}

dac_link_finding dac_link_commit(dac_link *l, const uint8_t *payload, uint8_t length, dac_link_answer *a)
{
    const uint32_t crc = dac_link_get(payload);

#if DAC_MOVE
    if (l->moving)
        return dac_link_because(DAC_LINK_BUSY, 0);
    if (l->upload == DAC_LINK_NONE && l->moved) /* what plays is no image that was uploaded */
        return dac_link_because(DAC_LINK_UPLOAD, 0);
#endif
    if (l->upload == DAC_LINK_NONE) {
        if (!l->uploaded || dac_link_get(l->image[l->playing].info + DAC_LINK_IMAGE_CRC) != crc)
            return dac_link_because(DAC_LINK_UPLOAD, 0);
        a->length = 8;
        say_taken(l, a->payload);
        return dac_link_fine();
    }
    if (dac_link_get(l->image[l->idle].info + DAC_LINK_IMAGE_CRC) != crc)
        return dac_link_because(DAC_LINK_UPLOAD, 0);
    if (l->upload != DAC_LINK_RECEIVING)
        return dac_link_because(DAC_LINK_BUSY, 0);
    if (l->received != dac_link_get(l->image[l->idle].info + DAC_LINK_BYTES))
        return dac_link_because(DAC_LINK_INCOMPLETE, l->received);
    if (!dac_link_permits(l))
        return dac_link_because(DAC_LINK_INTERLOCK, 0);
    l->upload = DAC_LINK_CHECKING;
    l->committing = l->commit_is_last = true;
    l->commit_seq = l->last.seq;
    l->commit_session = l->session;
    l->commit_challenged = l->challenged;
    l->challenged = false;
    dac_link_copy(l->commit_nonce, l->nonce, sizeof l->nonce);
    const uint8_t plain = dac_link_commit_bytes(length);
#if DAC_COMMIT_MODES
    l->commit_has_mode = plain == 5;
    l->commit_mode = plain == 5 ? payload[4] : (uint8_t)DAC_COMMIT_LINE;
#endif
    l->commit_tagged = length == plain + DAC_LINK_TAG;
    if (l->commit_tagged)
        dac_link_copy(l->commit_tag, payload + plain, DAC_LINK_TAG);
    dac_link_start_check(&l->check);
    a->type = DAC_LINK_SILENT;
    return dac_link_fine();
}

/* The COMMIT in progress has an answer; the upload is kept or discarded. */
static void conclude(dac_link *l, uint8_t upload, uint8_t type, const uint8_t *payload, uint8_t length)
{
#if DAC_LIBRARY > 1
    if (l->asked) { /* by a PLAY, whose program is no upload that a host could continue */
        upload = DAC_LINK_NONE;
        l->loading = l->asked = false;
    }
#endif
#if DAC_LIBRARY
    if (l->loading) { /* no host waits for this */
        l->upload = DAC_LINK_NONE;
        l->committing = l->loading = false;
        return;
    }
#endif
    l->upload = upload;
    l->committing = false;
    l->commit_due = true;
    l->commit_type = type;
    l->commit_length = length;
    dac_link_copy(l->commit_payload, payload, length);
    if (l->commit_is_last)
        dac_link_remember(l, type, payload, length);
    l->commit_is_last = false;
}

static void conclude_refused(dac_link *l, dac_link_finding why)
{
    const bool stays = why.reason == DAC_LINK_INTERLOCK || why.reason == DAC_LINK_KEY || why.reason == DAC_LINK_TICKS
#if DAC_LINK_Z
                       || why.reason == DAC_LINK_NOT_PARKED
#endif
                       || why.reason == DAC_LINK_KEEP;
    uint8_t payload[6], upload = stays ? DAC_LINK_RECEIVING : DAC_LINK_NONE, request = DAC_LINK_COMMIT;
    dac_link_answer a = {0, 0, 0, 0, payload};

    if (why.reason == DAC_LINK_KEY && l->commit_is_last) { /* its number is still free */
        l->last = l->before_commit;
        l->commit_is_last = false;
    }
#if DAC_LIBRARY > 1
    if (l->asked)
        request = DAC_LINK_PLAY;
#endif
#if DAC_MOVE
    if (l->moving) {
        dac_link_end_move(l, why.reason == DAC_LINK_WITHDRAWN);
        upload = l->upload;
        request = DAC_LINK_MOVE;
    }
#endif
    dac_link_refuse(&a, request, why);
    conclude(l, upload, a.type, payload, a.length);
}

/* Commits the loaded program with the mode that was asked for. A frame that cannot go on is not restarted. */
static dac_link_finding commit_loaded(const dac_link *l)
{
#if DAC_COMMIT_MODES
    if (l->commit_mode == DAC_COMMIT_KEEP && (dac_sequencer_status(l->sequencer).markers & DAC_PLAYING) != 0
        && !dac_sequencer_can_keep(l->sequencer))
        return dac_link_because(DAC_LINK_KEEP, 0);
    const bool passed = l->commit_mode == (uint8_t)DAC_COMMIT_LINE
                      ? dac_sequencer_commit(l->sequencer)
                      : dac_sequencer_commit_at(l->sequencer, (dac_commit_mode)l->commit_mode);
#else
    const bool passed = dac_sequencer_commit(l->sequencer);
#endif
    return passed ? dac_link_fine() : dac_link_because(DAC_LINK_TICKS, 0);
}

/* A slice of the checks; behind the last the program is loaded and committed. */
void dac_link_check_on(dac_link *l)
{
    bool passed = false;
    dac_program program;
#if DAC_LINK_Z
    dac_link_finding found = dac_link_check_both(l, &passed);
#else
    dac_link_finding found = dac_link_check_work(l, &passed);
#endif

    if (passed) {
        dac_link_program_of(l, &program);
        const dac_loaded loaded = dac_sequencer_load(l->sequencer, &program);
        const dac_status status = dac_sequencer_status(l->sequencer);
        l->swaps = status.swaps;
        l->line = status.line;
        if (!dac_link_permits(l))
            found = dac_link_because(DAC_LINK_INTERLOCK, 0);
        else if (loaded != DAC_LOADED)
            found = dac_link_because(DAC_LINK_REFUSED, (uint32_t)loaded);
        else
#if DAC_LINK_Z
            found = dac_link_hand_over(l, commit_loaded);
#else
            found = commit_loaded(l);
#endif
        if (found.reason == DAC_LINK_NO_REASON)
            l->upload = DAC_LINK_WAITING;
    }
    if (found.reason != DAC_LINK_NO_REASON)
        conclude_refused(l, found);
}

static void say_aborted(dac_link *l, uint32_t generation)
{
    l->aborts_due = true;
    l->abort_generation = generation;
    if (l->abort_is_last) {
        uint8_t payload[4];
        dac_link_put(payload, generation);
        dac_link_remember(l, DAC_LINK_ABORT | DAC_LINK_ANSWER, payload, sizeof payload);
    }
    l->abort_is_last = false;
}

/* Finds out whether a committed program was taken. */
void dac_link_settle(dac_link *l)
{
    const dac_status status = dac_sequencer_status(l->sequencer);

    /* Another look: if there was no swap even now, the line was one of the old program. */
    if (dac_sequencer_status(l->sequencer).swaps != l->swaps) {
        uint8_t payload[8], upload = DAC_LINK_NONE, request = DAC_LINK_COMMIT;
        l->taken_generation = l->swaps + 1;
        l->taken_line = l->line;
#if DAC_LIBRARY > 1
        if (l->asked)
            request = DAC_LINK_PLAY;
#endif
#if DAC_MOVE
        if (l->moving) {
            dac_link_take_move(l);
            upload = l->upload;
            request = DAC_LINK_MOVE;
        } else {
            l->playing = l->idle;
            l->moved = false;
        }
#else
        l->playing = l->idle;
#endif
        l->uploaded = true;
#if DAC_LINK_Z
        dac_link_settle_z(l, true);
#endif
        say_taken(l, payload);
        conclude(l, upload, request | DAC_LINK_ANSWER, payload, sizeof payload);
    } else if (dac_sequencer_writable(l->sequencer) && dac_sequencer_status(l->sequencer).swaps == l->swaps) {
#if DAC_LINK_Z
        dac_link_settle_z(l, false);
#endif
        conclude_refused(l, dac_link_because(DAC_LINK_WITHDRAWN, 0));
    } else {
        l->line = status.line;
        return;
    }
    if (l->aborts != 0)
        say_aborted(l, dac_sequencer_status(l->sequencer).swaps);
}

dac_link_finding dac_link_abort(dac_link *l, dac_link_answer *a)
{
    if (l->upload == DAC_LINK_CHECKING || l->upload == DAC_LINK_WAITING) {
#if DAC_LINK_Z
        if (l->upload == DAC_LINK_WAITING && (l->aborts == DAC_LINK_ABORTS || !dac_link_withdraw(l)))
#else
        if (l->upload == DAC_LINK_WAITING && (l->aborts == DAC_LINK_ABORTS || !dac_sequencer_withdraw(l->sequencer)))
#endif
            return dac_link_because(DAC_LINK_TICKS, 0);
        l->abort_seq[l->aborts] = l->last.seq;
        l->abort_session[l->aborts] = l->session;
        l->aborts++;
        l->abort_is_last = true;
        a->type = DAC_LINK_SILENT;
        if (l->upload == DAC_LINK_CHECKING) {
            conclude_refused(l, dac_link_because(DAC_LINK_WITHDRAWN, 0));
            say_aborted(l, dac_sequencer_status(l->sequencer).swaps);
        }
        return dac_link_fine();
    }
    l->upload = DAC_LINK_NONE;
    a->length = 4;
    dac_link_put(a->payload, dac_sequencer_status(l->sequencer).swaps);
    return dac_link_fine();
}

dac_link_finding dac_link_readback(const dac_link *l, const uint8_t *payload, dac_link_answer *a)
{
    const uint32_t offset = dac_link_get(payload);

    if (!l->uploaded)
        return dac_link_because(DAC_LINK_READBACK, 0);
    dac_link_put(a->payload, offset);
    a->length = (uint8_t)(4 + dac_link_read_back(l, offset, a->payload + 4, payload[4]));
    return dac_link_fine();
}
