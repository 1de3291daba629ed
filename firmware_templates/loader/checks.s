; The checks of a program, in the order of the protocol.

schedule:
        ldp IMAGE
        ld4 [p]                 ; line_ticks; the sequencer plays no line of less than 8
        cmp #8
        jnc no_schedule
        st4 t2
        ld4 most_ticks
        cmp4 t2
        jnc no_schedule
        ld4 [p]                 ; frame_lines
        jz no_schedule
        st4 t3
        st4 t0
        ld4 most_lines
        cmp4 t3
        jnc no_schedule
        ld4 t2
        st4 t1
        call multiply
        add a
        jc no_schedule          ; 2^31 or more
        ld1 rest
        jnz no_schedule
        ld4 answer
        st4 answer+4            ; the period of y, unless it steps
        ld #255
        cmp4 [p]                ; settle_lines, which the sequencer counts in 8 bits
        jnc no_schedule
        ld4 t2
        cmp4 [p]                ; turn_tick
        jnc no_schedule
        call windows
        ld4 t3
        st4 t1
        call windows
        ld4 [p]                 ; pixels
        st4 t0
        ld4 [p]                 ; y_steps
        jz of_frame
        cmp #2
        jc no_schedule
        ld4 t3
        st4 answer+4
of_frame:
        ldp FORWARD_COUNT
        call ticks_of_pixels
        ldp BACKWARD_COUNT
        call ticks_of_pixels

        ld #9
; The first a checks, each of x and of y.
look:   st1 stop
        ld #0
        st1 check
both:   ld #0
one:    st4 detail
        ld1 check
        jz harmonics
        sub #1
        jz lengths_of
        sub #1
        jz period
        sub #1
        jz output
        cmp #3
        jnc codes               ; 1 or 2
        sub #3
        jz fourier
        sub #1
        jz words

; Not a check: the words of the axis, and before x those of the program, go into the sequencer.
load_axis:
        ld1 detail
        jnz tables
        ld #WITHDRAW            ; the sequencer commits nothing after a program that did not fit, until it is discarded
        request
        ld #0
        setregion
        setp
        saveq
        ld #4
        st1 size
        ldp IMAGE
        ld #48
        call counted
        call load
tables: call words_at
        saveq
        ld #0
        setp
        exchange
        ld1 size
        cmp #4
        ld1 detail
        jnc of_table
        add #2
of_table:
        add #1
        setregion
        call load
        jmp checked
load:   call word
        exchange
        write
        exchange
        inc2 count
        jnc load
        ret

; p is where byte a of the page of the axis is, or of its constants.
page:   add2 x_page
        st2 at
        ld1 detail
        jz place
        ld #64
        jmp place
constants:
        add2 ring_at
        sub #40
        st2 at
        ld1 detail
        jz place
        ld #20
place:  add2 at
        setp
        ret

; Checks the two windows at p against t1, the number of their ticks or lines; `window` one of them.
windows:
        call window
window: ld4 [p]
        add4 [p]
        jc no_schedule
        st4 t0
        ld4 t1
at_least:
        cmp4 t0
        jnc no_schedule
        ret

; Checks that a window, whose ticks are at p, has one for each of t0 pixels, or none at all.
ticks_of_pixels:
        ld4 [p]
        jnz at_least
        ret

; answer = t0 times t1, the lower 32 bits; rest is 0 if those are all.
multiply:
        ld #0
        st4 answer
        st1 rest
        ld #0xe0                ; 32 digits
        st1 distance
digit:  ld4 answer
        add a
        jnc digit_1
        inc1 rest
digit_1:
        st4 answer
        ld4 t0
        add a
        st4 t0
        jnc digit_2
        ld4 answer
        add4 t1
        st4 answer
        jnc digit_2
        inc1 rest
digit_2:
        inc1 distance
        jnc digit
        ld4 answer
        ret

; Checks that the device has that many harmonics.
harmonics:
        ld #12
        call constants
        ld4 [p]
        st4 t1
        ld #40
        call page
        ld4 t1
        cmp4 [p]
        jc checked
        st4 detail
        call forget
        jmp no_harmonics

; Checks that the device has that many words, and computes the bytes of the words of x.
lengths_of:
        call words_of
        ld1 detail
        jnz checked
        ld4 t1
        st4 y_at
        jmp checked

; For the axis: number of words in t0, bytes per word in size, bytes of all words in t1.
words_of:
        ld1 x_word_bytes
        st1 size
        ld1 detail
        jz by_harmonics
        ld1 y_word_bytes
        st1 size
by_harmonics:
        ld #40
        call page
        ld4 [p]
        jz table
        add a
        add #1
        st4 t0
        ld #4
        st1 size
        ld4 t0
        add a
        jmp doubled
table:  ld #8
        call page
        ld4 [p]                 ; period
        st4 t0
        ld #4
        call constants
        ld4 [p]
        jz as_period
        st4 t0
as_period:
        ld4 [p]
        cmp4 t0
        jnc too_many
        ld1 size
        cmp #3
        ld4 t0
        jnc doubled
        add a
        add4 t0
        jmp sized
doubled:
        add a
sized:  st4 t1
        ret
too_many:
        call forget
        jmp no_shape

; p is where the words of the axis begin, count less their number.
words_at:
        call words_of
        ld4 t0
        call counted
        ld2 image_at
        add #192
        st2 at
        ld1 detail
        jz place
        ld4 y_at
        jmp place

; period = N, remainder < N, and step N + remainder = 2^32; of the last, less 1, no part is more than 32 bits.
period: ld4 t2
        st4 t1
        ld1 detail
        jz as_wanted
        ld4 answer+4
        st4 t1
as_wanted:
        ld #0
        call page
        ld4 [p]
        sub #1
        st4 t0
        ld4 [p]
        st4 t4
        cmp4 t1
        jc no_period
        ld4 [p]
        cmp4 t1
        jnz no_period
        call multiply
        ld1 rest
        jnz no_period
        ld4 t1
        sub #1
        add4 answer
        jc no_period
        add4 t4
        add #1
        jnz no_period
        jmp checked

output: ld #0
        call constants
        ld4 [p]
        st4 t3                  ; half of the range of the offset's high word
        ld4 half_gain
        add a
        st4 t1
        ld #12
        call page
        ld4 [p]                 ; gain
        add4 half_gain
        cmp4 t1
        jc no_output
        ld4 [p]                 ; offset_low
        cmp4 t1
        jc no_output
        st4 t0
        ld4 [p]                 ; offset_high
        add4 t3
        st4 t2
        ld4 t3
        add a
        st4 t3
        ld4 t2
        cmp4 t3
        jc no_output
        ld4 t2
        jnz inside
        ld4 t0
        jz no_output
inside: ld4 [p]                 ; code_min
        st4 t0
        ld4 [p]                 ; code_max
        st4 t1
        ld4 top_code
        cmp4 t1
        jnc no_output
        ld4 [p]                 ; max_step
        jz no_output
        cmp4 steps_end
        jc no_output
        ld4 [p]                 ; park_code
        cmp4 t0
        jnc no_output
        st4 t2
        ld4 t1
        cmp4 t2
        jnc no_output
        jmp checked

; Codes, then the step, against the limits.
codes:  ld #24
        call page
        ld4 [p]
        st4 t0
        ld4 [p]
        st4 t1
        ld4 [p]
        st4 t2
        ldp LIMITS_X
        ld1 detail
        jz limits_of_x
        ldp LIMITS_Y
limits_of_x:
        ld1 check
        cmp #5
        jz step
        ld4 t0
        cmp4 [p]
        jnc no_codes
        ld4 [p]
        cmp4 t1
        jnc no_codes
        jmp checked
step:   ld4 [p]
        ld4 [p]
        ld4 [p]
        cmp4 t2
        jnc no_step
checked:
        ld1 detail
        jnz next_check
        ld #1
        jmp one
next_check:
        inc1 check
        ld1 check
        cmp1 stop
        jnz both
        cmp #2
        jz looked
        jmp accepted

; The magnitudes of Fourier words sum to less than 2^32.
fourier:
        call words_at
        ld1 size
        cmp #4
        jnz checked
        ld #0
        st4 t3
magnitude:
        ld4 [p]
        st4 t2
        add a
        jnc positive_word
        ld #0
        sub4 t2
        st4 t2
positive_word:
        ld4 t2
        add4 t3
        jc no_fourier
        st4 t3
        inc2 count
        jnc magnitude
        jmp checked

; Table words have no more bits than they should.
words:  ld #16
        call constants
        ld4 [p]
        st4 t2
        add a
        st4 t3
        call words_at
        ld1 size
        cmp #4
        jz checked
next_word:
        call word
        add4 t2
        cmp4 t3
        jc wide_word
        inc2 count
        jnc next_word
        jmp checked
wide_word:
        ld4 t0                  ; its index
        add2 count
        st4 t0
        ld2 t0
        add a
        add4 detail
        st4 detail
        jmp no_word

; Loads the word of size bytes at p.
word:   ld1 size
        sub #3
        jz word_3
        jc word_4
        lds2 [p]
        ret
word_3: lds3 [p]
        ret
word_4: ld4 [p]
        ret
