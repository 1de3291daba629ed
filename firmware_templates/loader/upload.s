; An upload, from BEGIN to the line on which it is taken.

; No program waits, and the idle bank may be written.
is_free:
        ld1 upload
        cmp #3
        jz busy
        ld1 IN_WRITABLE
        jz busy
        ret

begin:  call is_free
        ldp PAYLOAD+40          ; compares the shape of the image with the device
        ld3 [p]
        cmp4 x_shape
        jnz no_shape
        inc1 detail
        ld1 [p]
        ld3 [p]
        cmp4 y_shape
        jnz no_shape
        ld4 most_bytes
        st4 detail
        ldp PAYLOAD+32
        ld4 [p]
        cmp #192
        jnc no_length
        cmp4 most_bytes
        jz in_room
        jc no_length
in_room:
        call announced          ; is it the upload in progress?
        st1 count
        ld1 upload
        jz another
compare:
        ld4 [p]
        exchange
        cmp4 [p]
        exchange
        jnz another
        inc1 count
        jnc compare
        jmp begun
another:
        call announced
        call copy
        ld #0
        st4 received
        st4 done_bytes          ; from now on the memory belongs to the new upload
        ld #1
        st1 upload
begun:  ld4 received
number: st4 answer
        ld #4
        jmp answered

; q is where the announced upload is kept, p where it has come, and a less its words.
announced:
        ldp INFO
        saveq
        ldp PAYLOAD
        ld #0xf4
        ret

data:   ld1 length
        sub #5
        cmp #240
        jc no_payload
        ld1 upload
        jz no_upload
        ldp PAYLOAD
        ld4 [p]
        cmp4 received
        jnz begun
        ld1 length
        sub #4
        st1 rest
        add4 received
        st4 t3
        ld4 info_bytes
        cmp4 t3
        jnc begun
        saveq
        ld2 image_at
        add4 received
        setp
        exchange
        ld1 rest
        call copy_bytes
        ld4 t3
        st4 received
        sub #192
        jnc begun
        cmp1 rest
        jc begun                ; the program words were complete before

; The program words are complete: compute the length of the image.
        ld #2
        jmp look
looked: ld4 t1
        add4 y_at
        add #192
        st4 detail
        cmp4 info_bytes
        jz begun
        call forget
        jmp no_length

forget: ld #0
        st1 upload
        st4 received
        st4 info_crc
        ret

commit: ldp PAYLOAD
        ld1 upload
        jnz in_hand
        ld4 done_generation
        jz no_upload
        ld4 [p]
        cmp4 done_crc
        jnz no_upload
        call commit_answer
        jmp replied
in_hand:
        ld4 [p]
        cmp4 info_crc
        jnz no_upload
        call is_free
        ld4 received
        cmp4 info_bytes
        jz complete
        st4 detail
        jmp incomplete
complete:
        ld1 IN_PERMIT
        jz not_permitted
        ldp IMAGE
        ld4 info_bytes
        call crc
        cmp4 info_crc
        jz schedule
        jmp not_whole

; All checks are passed, and the sequencer has its words.
accepted:
        ld #0
        st4 detail
        ld1 IN_PERMIT
        jz not_permitted
        ld1 IN_NO_KEEP
        cmp1 mode
        jz no_keep
        ld2 commit_now
        request
        ld #3
        st1 upload
        st1 pending_acts
        ld1 seq
        st1 pending_seq
        ld4 asker
        st4 pending_asker
        jmp main

; The sequencer has taken it.
taken:  ldp HASH
        saveq
        ldp INFO
        call copy_8
        ld4 info_crc
        st4 done_crc
        ld4 info_bytes
        st4 done_bytes
        ld4 generation
        st4 done_generation
        ld2 IN_SWAP_LINE
        st4 done_line
        call commit_ended
        call commit_answer
ended:  call reply
        ld1 aborting
        jz main
        ld #0
        st1 aborting
        ld #5
        st1 type
        st1 acts
        ld1 last_seq
        st1 seq
        ld4 session
        st4 asker
        jmp aborted

; The sequencer has neither taken it, nor does it wait: it was withdrawn, or the sequencer has refused it.
gone:   call commit_ended
        ld #25
        st1 reason
        ld1 aborting
        jnz by_abort
        ld1 IN_GONE
        st1 reason
by_abort:
        call refusal
        jmp ended

commit_answer:
        ld4 done_generation
        st4 answer
        ld4 done_line
        st4 answer+4
        ld #8
        st1 answer_length
        ld #0x84
        st1 kind
        ret

; The request is the COMMIT in progress.
commit_ended:
        call forget
        st4 detail
        ld #4
        st1 type
        ld4 pending_asker
        st4 asker
        ld1 pending_seq
        st1 seq
        ld1 pending_acts
        st1 acts
        ret

; Where a program waits the sequencer knows within some clocks whether it was taken.
abort:  ld1 upload
        cmp #3
        jnz aborted
        st1 aborting
        ld #WITHDRAW
        request
withdrawing:
        ld1 IN_WRITABLE
        jz withdrawing
        jmp main
aborted:
        call forget
        ld4 generation
        jmp number
