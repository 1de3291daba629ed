/* Answers: refusals, repeated answers, and how they are sent. */
#include "dac_barriers.h"
#include "dac_link_parts.h"

void dac_link_refuse(dac_link_answer *a, uint8_t request, dac_link_finding why)
{
    a->type = DAC_LINK_REFUSAL;
    a->length = 6;
    a->payload[0] = request;
    a->payload[1] = why.reason;
    dac_link_put(a->payload + 2, why.detail);
}

void dac_link_remember(dac_link *l, uint8_t type, const uint8_t *payload, uint8_t length)
{
    l->last.type = type;
    l->last.length = length;
    dac_link_copy(l->last.payload, payload, length);
}

void dac_link_recall(const dac_link *l, dac_link_answer *a)
{
    a->type = l->last.type;
    a->length = l->last.length;
    dac_link_copy(a->payload, l->last.payload, a->length);
}

/* Output. `out` belongs to dac_link_transmit() while `sending` is set, otherwise to the main loop. */

void dac_link_send(dac_link *l, const dac_link_answer *a)
{
    l->out[1] = a->type;
    l->out[2] = a->seq;
    dac_link_put(l->out + 3, a->session);
    l->out_length = dac_link_seal(l->out, (uint16_t)(a->length + DAC_LINK_HEADER));
    l->out_at = 0;
    DAC_RELEASE();
    l->sending = 1;
}

void dac_link_send_late(dac_link *l)
{
    dac_link_answer a = {l->commit_type, l->commit_seq, l->commit_length, l->commit_session,
                         l->out + 1 + DAC_LINK_HEADER};

    if (l->commit_due) {
        dac_link_copy(a.payload, l->commit_payload, a.length);
        l->commit_due = false;
    } else {
        a.type = DAC_LINK_ABORT | DAC_LINK_ANSWER;
        a.seq = l->abort_seq[l->aborts_said];
        a.session = l->abort_session[l->aborts_said];
        a.length = 4;
        dac_link_put(a.payload, l->abort_generation);
        l->aborts_said++;
        if (l->aborts_said == l->aborts) {
            l->aborts = l->aborts_said = 0;
            l->aborts_due = false;
        }
    }
    dac_link_send(l, &a);
}

int dac_link_transmit(dac_link *l)
{
    if (!l->sending)
        return -1;
    DAC_ACQUIRE();
    const uint8_t byte = l->out[l->out_at];
    if (++l->out_at == l->out_length) {
        DAC_RELEASE();
        l->sending = 0;
    }
    return byte;
}
