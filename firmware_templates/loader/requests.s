; The checks of a request, and requests that change no program.

asked:  ld1 type                ; of an answer that came back nothing is said
        cmp #0x80
        jc main
        cmp #1
        jz hello
        ld1 has_session
        jz no_session
        ld4 asker
        cmp4 session
        jnz no_session
        ld1 type
        cmp #14
        jc no_type
        cmp #3
        jz data
        add #lengths
        setp
        ld1 [p]
        cmp #0x7f
        jz no_type
        st1 check
        and #0x7f
        cmp1 length
        jz of_length
        ld1 length
        cmp1 with_mode
        jnz no_payload
        ld1 type
        cmp #4
        jnz no_payload
        ldp PAYLOAD+4
        ld1 [p]
        cmp #3
        jc no_payload
        st1 mode
of_length:
        ld1 type
        cmp #9
        jnz in_order
        ldp PAYLOAD+2           ; frames that the sequencer cannot count
        ld2 [p]
        jnz no_payload
in_order:
        ld1 check
        and #0x80
        jz as_asked
        ld1 last_type
        jz fresh
        ld1 seq
        sub1 last_seq
        and #0xff
        jz same
        cmp #129
        jc overtaken
fresh:  ld2 type
        st2 last_type           ; and last_seq
        st1 acts
        ld #0
        st1 last_kind
        st1 pending_acts
as_asked:
        ld1 type
        sub #2
        jz begin
        sub #2
        jz commit
        sub #1
        jz abort
        cmp #1
        jz status
        cmp #2
        jz readback
        cmp #8
        jz limits
        cmp #ARM
        jnz requested           ; PARK, TRIGGER or CLEAR
        ldp PAYLOAD
        ld2 [p]
        st2 t0+2
        ld #ARM
        st2 t0
        ld4 t0
requested:
        request
        ld #0
        jmp answered

limits: ldp PAYLOAD
        saveq
        ldp LIMITS_X
        call copy_8
        ld #32
        jmp long_answer

same:   ld1 type
        cmp1 last_type
        jnz overtaken
        ld1 last_kind
        jz main                 ; in progress
        ld2 last_kind
        st2 kind
        ld4 last
        st4 answer
        ld4 last+4
        st4 answer+4
        jmp replied             ; repeats the stored answer

hello:  ld1 length
        jz no_payload
        ldp PAYLOAD
        ld1 [p]
        sub #1
        jz version_1
        inc1 detail             ; 1, the version of this device
        jmp no_version
version_1:
        ld1 length
        cmp #1
        jnz no_payload
        ld1 has_session
        jz new_session
        ld4 asker
        cmp4 session
        jz told
new_session:
        ld4 asker
        st4 session
        ld #1
        st1 has_session
        ld #0
        st1 last_type
        st1 pending_acts
told:   ldp PAYLOAD
        saveq
        ldp DEVICE
        ld #0xf2
        call copy
        restore
        ld #132
        jmp status_at

status: ldp PAYLOAD
        ld #76
; Writes the status at p, in an answer of a bytes.
status_at:
        st1 answer_length
        ld4 generation
        jz state
        ld1 IN_STATE
state:  st1 [p]
        ld1 upload
        st1 [p]
        ld1 IN_FAULTS
        st1 [p]
        ld1 IN_PERMIT
        st1 [p]
        ld4 IN_BOOT
        st4 [p]
        ld4 generation
        st4 [p]
        ld2 IN_LINE
        st4 [p]
        ld4 received
        st4 [p]
        ld4 info_crc
        st4 [p]
        ld2 IN_COUNTS
        st4 [p]
        ld2 IN_COUNTS+2
        st4 [p]
        ld2 IN_COUNTS+4
        st4 [p]
        ld2 IN_COUNTS+6
        st4 [p]
        ld4 bad_frames
        st4 [p]
        saveq
        ldp HASH
        call copy_8
        ld1 answer_length
        jmp long_answer

readback:
        ldp PAYLOAD
        ld4 [p]
        st4 t0                  ; offset
        ld1 [p]
        jz no_payload
        cmp #241
        jc no_payload
        st1 rest
        ld4 done_bytes
        jz not_readable
        sub4 t0
        jc some
        ld #0
some:   st4 t1                  ; bytes from the offset to the end
        ld1 rest
        cmp4 t1
        jnc asked_less
        ld4 t1
asked_less:
        st1 rest
        jz no_bytes
        ldp PAYLOAD+4
        saveq
        ld4 t0
        add2 image_at
        setp
        ld1 rest
        call copy_bytes
no_bytes:
        ld1 rest
        add #4
        jmp long_answer
