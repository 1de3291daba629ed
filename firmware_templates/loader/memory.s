; Addresses in the memory of the loader. program_loader.v writes those that it also defines.

.equ INFO, 0x00           ; what BEGIN announced, 48 bytes
.equ info_bytes, 0x20
.equ info_crc, 0x24

; Constants of the device, by its parameters
.equ most_ticks, 0x30     ; ticks per line
.equ most_lines, 0x34     ; lines per frame
.equ most_bytes, 0x38     ; bytes per image
.equ half_gain, 0x3c      ; 2^17
.equ top_code, 0x40
.equ steps_end, 0x44      ; 2^24
.equ ones, 0x48
.equ x_shape, 0x4c        ; as BEGIN has it
.equ y_shape, 0x50
.equ image_at, 0x54       ; IMAGE
.equ ring_at, 0x56        ; RING
.equ x_page, 0x58         ; PAGE_X
.equ x_word_bytes, 0x5a
.equ y_word_bytes, 0x5b
.equ commit_now, 0x6c     ; 1, the request of a commit, with the mode behind it
.equ mode, 0x6d           ; of the COMMIT
.equ with_mode, 0x6e      ; bytes of a COMMIT with a mode; 255: this device has none
.equ lengths, 0x5c        ; of payloads by type; + 0x80: acts, 0x7f: not of this device

; Inputs
.equ IN_BOOT, 0xe0
.equ IN_SWAP_LINE, 0xe4   ; 2 bytes, as IN_LINE
.equ IN_LINE, 0xe6
.equ IN_COUNTS, 0xe8      ; 4 times 2 bytes
.equ IN_FAULTS, 0xf0
.equ IN_RING, 0xf1        ; where the receiver writes next
.equ IN_PERMIT, 0xf2      ; 0 or 1, as the next three
.equ IN_READY, 0xf3       ; ready to send a byte
.equ IN_SWAPPED, 0xf4     ; a program was taken, and the processor has not seen it
.equ IN_WRITABLE, 0xf5
.equ IN_STATE, 0xf6       ; state as in STATUS, except 0
.equ IN_NO_KEEP, 0xf7     ; 1 while a scan plays whose frame the written program cannot continue, else 3
.equ IN_GONE, 0xf8        ; the reason why a program that waited is gone: withdrawn or refused

; Requests; PARK to CLEAR are types of the link less 5
.equ WITHDRAW, 2
.equ ARM, 4
.equ SEEN, 7

.equ DEVICE, 0x100        ; as HELLO tells it, 56 bytes
.equ LIMITS_X, 0x114
.equ LIMITS_Y, 0x124
.equ HASH, 0x138          ; hash of the active program, 32 bytes
.equ AXIS, 0x158          ; for x and y: half of the offset's range >> 18, words of a table (0: as many as the period
                          ; has), most words, most harmonics, half of the range of a word; 20 bytes each
.equ FRAME, 0x201         ; a frame, in front of it the 0 that COBS does not end with
.equ PAYLOAD, 0x207
.equ IMAGE, 0x300
.equ PAGE_X, 0x340

.equ FORWARD_COUNT, 0x314
.equ BACKWARD_COUNT, 0x31c

; Variables
.at 0x6a
.var has_session 1
.var ring 1               ; the next byte that is read
.at 0x6f
.var stop 1               ; number of checks
.var session 4            ; session of the host
.var asker 4              ; session of the request
.var pending_asker 4      ; session of the COMMIT in progress
.var received 4
.var generation 4
.var bad_frames 4
.var done_generation 4    ; generation of the last upload that was taken, 0: none
.var done_line 4
.var done_crc 4
.var done_bytes 4         ; 0: the image is not in memory any more
.var answer 8
.var kind 1               ; type of the request
.var answer_length 1
.var type 1
.var seq 1
.var last 8               ; answer to the last request that acts
.var last_kind 1          ; 0: in progress
.var last_length 1
.var last_type 1          ; 0: none
.var last_seq 1
.var detail 4
.var y_at 4               ; bytes of x
.var t0 4
.var t1 4
.var t2 4
.var t3 4
.var t4 4
.var count 2              ; up to 0
.var at 2
.var frame_at 2           ; the next byte from the line
.var left 1               ; bytes to the next zero
.var too_long 1
.var length 1             ; length of the payload
.var size 1               ; bytes of a word: 4 of Fourier words
.var byte 1
.var distance 1
.var rest 1
.var reason 1
.var upload 1             ; as STATUS tells it
.var acts 1
.var pending_seq 1
.var pending_acts 1       ; its answer will be stored
.var aborting 1
.var check 1
