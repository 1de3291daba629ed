; Frames: read from the ring, and sent on the line.

start:
        call forget             ; a = 0
        st1 has_session
        st1 last_type
        st1 aborting
        ld #WITHDRAW            ; 2, as the high byte of FRAME
        request
        st1 frame_at+1
        ld1 IN_RING
        st1 ring
frame_over:
        ld #0
        st1 frame_at
        st1 left
        st1 too_long

main:
        ld1 IN_SWAPPED
        jz nothing_taken
        ld #SEEN
        request
        inc4 generation
        ld1 upload
        cmp #3
        jz taken
        jmp main                ; the boot program
nothing_taken:
        ld1 upload
        cmp #3
        jnz receive
        ld1 IN_WRITABLE
        jz receive
        ld1 IN_SWAPPED          ; looked at again: it comes some clocks later
        jz gone
receive:
        ld1 ring
        cmp1 IN_RING
        jz main
        and #0x7f
        add2 ring_at
        setp
        inc1 ring
        ld1 [p]
        jz frame_ends
        st1 byte
        ld2 frame_at
        setp
        inc1 frame_at
        jnc within
        st1 too_long
within: ld1 left
        jz zero
        sub #1
        st1 left
        ld1 byte
        st1 [p]
        jmp receive
zero:   st1 [p]                 ; in its place stands the distance to the next
        ld1 byte
        sub #1
        st1 left
        jmp receive

frame_ends:
        ld1 too_long
        jnz bad
        ld1 frame_at
        jz frame_over           ; empty frame
        ld1 left
        jnz bad
        ld1 frame_at
        sub #11
        jnc bad
        st1 length
        add #6
        ldp FRAME
        call crc
        cmp4 [p]
        jz good
bad:    inc4 bad_frames
        jmp frame_over
good:   ld #0
        st1 frame_at
        st1 acts
        st1 mode
        st4 detail
        st1 reason
        ldp FRAME
        ld2 [p]
        st2 type                ; and seq
        ld4 [p]
        st4 asker
        jmp asked

; The CRC of a bytes, starting at p.
crc:    call counted
        ld4 ones
crc_byte:
        xor1 [p]
        crc
        inc2 count
        jnc crc_byte
        xor4 ones
        ret

; t0 = a, count = -a.
counted:
        st4 t0
        ld #0
        sub4 t0
        st2 count
        ret

; Copies words from p to q, less a of them; `copy_8` eight.
copy_8: ld #0xf8
copy:   st1 count
copy_word:
        ld4 [p]
        exchange
        st4 [p]
        exchange
        inc1 count
        jnc copy_word
        ret

; Copies a bytes from p to q.
copy_bytes:
        call counted
copy_byte:
        ld1 [p]
        exchange
        st1 [p]
        exchange
        inc2 count
        jnc copy_byte
        ret

; Sends the answer to the request, with a bytes.
positive:
        st1 answer_length
        ld1 type
        add #0x80
        st1 kind
        ret
; The answer is at PAYLOAD.
long_answer:
        call positive
        call send_frame
        jmp main
; The answer is at `answer`; it is stored if the request acts.
answered:
        call positive
replied:
        call reply
        jmp main
reply:  ld1 acts
        jz reply_again
        ld2 kind
        st2 last_kind
        ld4 answer
        st4 last
        ld4 answer+4
        st4 last+4
reply_again:
        ldp PAYLOAD
        ld4 answer
        st4 [p]
        ld4 answer+4
        st4 [p]

; Sends the answer at PAYLOAD.
send_frame:
        ldp FRAME
        ld1 kind
        st1 [p]
        ld1 seq
        st1 [p]
        ld4 asker
        st4 [p]
        ld1 answer_length
        add #6
        ldp FRAME
        call crc
        st4 [p]
        ld #0
        st1 [p]
        ld1 answer_length
        add #11                 ; with the zero behind it
        st1 rest
        ldp FRAME
block:  saveq
        ld #0
        st1 distance
scan:   inc1 distance
        ld1 [p]
        jnz scan
        ld1 distance
        call send_byte
        restore
emit:   ld1 [p]
        jz emitted
        call send_byte
        jmp emit
emitted:
        ld1 rest
        sub1 distance
        st1 rest
        jnz block
; Sends the byte in a.
send_byte:
        st1 byte
wait_ready:
        ld1 IN_READY
        jz wait_ready
        ld1 byte
        send
        ret
