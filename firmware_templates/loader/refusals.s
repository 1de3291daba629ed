; Refusals. The reason is counted: one more from each of these to the next.

no_word:
        inc1 reason
no_fourier:
        inc1 reason
no_step:
        inc1 reason
no_codes:
        inc1 reason
no_output:
        inc1 reason
no_period:
        inc1 reason
no_schedule:
        inc1 reason
not_whole:
        inc1 reason
        call forget             ; a check that fails is the end of the upload
not_permitted:
        inc1 reason
incomplete:
        inc1 reason
no_harmonics:
        inc1 reason
no_length:
        inc1 reason
no_shape:
        inc1 reason
no_upload:
        inc1 reason
busy:   inc1 reason
        inc1 reason
overtaken:
        inc1 reason
no_session:
        inc1 reason
no_version:
        inc1 reason
no_payload:
        inc1 reason
no_type:
        inc1 reason
refuse: call refusal
        jmp replied
no_keep:
        ld #30
        jmp other_reason
not_readable:
        ld #26
other_reason:
        st1 reason
        jmp refuse
refusal:
        ldp answer
        ld1 type
        st1 [p]
        ld1 reason
        st1 [p]
        ld4 detail
        st4 [p]
        ld #6
        st1 answer_length
        ld #0xff
        st1 kind
        ret
