// adc_pixels at the input of its FIFO, whatever the samples, the markers and the sink do: one word for each pixel that
// begins, with the sum of the samples from its pulse up to its end, and no sample in two words; what the words say of
// line, column, direction, validity and loss.

`default_nettype none

module pixels_properties (
    input wire       clock,
    input wire       reset,
    input wire       sample,
    input wire [1:0] samples,
    input wire       pixel,
    input wire       line,
    input wire       frame,
    input wire       backward,
    input wire       valid,
    input wire       playing,
    input wire       fault,
    input wire       ready
);
    wire [15:0] lost_words;
    adc_pixels #(.SAMPLE_BITS(2), .COUNT_BITS(2), .DEPTH_BITS(1)) adc (
        .clock(clock), .reset(reset), .sample(sample), .samples(samples), .pixel(pixel), .line(line), .frame(frame),
        .backward(backward), .valid(valid), .playing(playing), .fault(fault), .m_axis_tdata(), .m_axis_tuser(),
        .m_axis_tlast(), .m_axis_tvalid(), .m_axis_tready(ready), .lost_words(lost_words)
    );
    // The word that ends on this clock, and whether it is lost.
    wire adc__ends, adc__full;
    wire [5:0] adc__flags;
    wire [15:0] adc__its_line, adc__its_column;
    wire [1:0] adc__count;
    wire [3:0] adc__sums;
    wire word = adc__ends && !reset;
    wire is_valid = adc__flags[0], is_backward = adc__flags[1], is_first = adc__flags[2], is_after_loss = adc__flags[3];
    wire is_overfull = adc__flags[4], is_last = adc__flags[5];

    // The pixel under way, by what the inputs were since its pulse.
    wire begins = pixel && playing && !reset;
    wire sound = valid && !fault;
    reg open, all_sound, its_direction, was_backward, frame_waits, its_first, sweep_waits, its_fresh;
    wire sweep_ends = line || frame || backward != was_backward || !playing;
    reg [2:0] number;                  // samples, up to 4
    reg signed [4:0] total;            // of the first three
    wire signed [4:0] term = {{3{samples[1]}}, samples};
    // The word before.
    reg any, was_last, loss, first_loss, was_word, was_lost;
    reg [15:0] was_line, was_column, was_lost_words;
    reg was_direction;
    initial begin
        open = 0;
        all_sound = 0;
        its_direction = 0;
        was_backward = 0;
        frame_waits = 0;
        its_first = 0;
        sweep_waits = 1;
        its_fresh = 0;
        number = 0;
        total = 0;
        any = 0;
        was_last = 0;
        loss = 0;
        first_loss = 0;
        was_word = 0;
        was_lost = 0;
        was_lost_words = 0;
    end
    always @(posedge clock) begin
        was_backward <= backward;
        open <= !reset && (begins || (open && !word));
        all_sound <= (begins || all_sound) && sound;
        frame_waits <= !reset && (frame || frame_waits) && !begins;
        sweep_waits <= reset || ((sweep_ends || sweep_waits) && !begins);
        if (begins) begin
            its_fresh <= sweep_ends || sweep_waits;
            its_direction <= backward;
            its_first <= frame || frame_waits;
            number <= sample;
            total <= sample ? term : 0;
        end else if (sample && number != 4) begin
            number <= number + 1;
            if (number != 3) total <= total + term;
        end
        if (word) begin
            was_line <= adc__its_line;
            was_column <= adc__its_column;
            was_direction <= is_backward;
            was_last <= is_last;
            loss <= adc__full;
            first_loss <= adc__full && (its_first || first_loss);
        end
        if (reset) begin
            loss <= 0;
            first_loss <= 0;
        end
        any <= !reset && (any || word);
        was_lost <= word && adc__full;
        was_word <= !reset;
        was_lost_words <= lost_words;
    end

    // The properties.
    always @* begin
        // One word for each pulse; it ends by the next pulse, the end of its sweep, or that of the window.
        if (word) assert (open);
        if (begins && open) assert (word);
        if (open && !reset && sweep_ends) assert (word && is_last);
        if (open && !reset && all_sound && !valid && !fault) assert (word);
        if (word && !sweep_ends) begin
            assert (begins || (!valid && !fault));
            assert (is_last == !begins);
        end
        // What belongs to it.
        if (word) begin
            assert (adc__count == (number == 4 ? 3 : number) && $signed(adc__sums) == total);
            assert (is_overfull == (number == 4));
            assert (is_valid == (all_sound && playing && number != 0));
            assert (is_backward == its_direction);
            assert (is_first == (its_first || first_loss));
        end
        // Pixels of a sweep follow each other.
        if (word && its_fresh) assert (adc__its_column == 0);
        if (word && any && !was_last)
            assert (adc__its_line == was_line && adc__its_column == was_column + 16'd1
                && is_backward == was_direction);
        // A loss is counted, and marked in the next word.
        if (word) assert (is_after_loss == loss);
        if (was_word && was_lost_words != 16'hffff) assert (lost_words == was_lost_words + was_lost);
        cover (word && is_after_loss && is_first && !adc__full);
        cover (word && is_valid && is_overfull && is_last && adc__its_column == 1);
    end

`ifndef PROPERTIES_ALONE
    // What makes them inductive.
    wire adc__open, adc__complete, adc__is_backward, adc__is_first, adc__overfull, adc__lost, adc__first_lost;
    wire adc__was_backward, adc__frame_waits;
    wire [15:0] adc__next_column, adc__line_number;
    always @* begin
        assert (adc__open == open && adc__was_backward == was_backward && adc__frame_waits == frame_waits);
        assert (adc__lost == loss && adc__first_lost == first_loss);
        if (sweep_waits) assert (adc__next_column == 0);
        if (open && its_fresh) assert (adc__its_column == 0);
        if (open) begin
            assert (adc__complete == all_sound && adc__is_backward == its_direction && adc__is_first == its_first);
            assert (adc__count == (number == 4 ? 3 : number) && $signed(adc__sums) == total && number <= 4);
            assert (adc__overfull == (number == 4));
            assert (total <= $signed({3'd0, adc__count}) && total >= -2 * $signed({3'd0, adc__count}));
            assert (adc__next_column == adc__its_column + 16'd1 && adc__line_number == adc__its_line);
            assert (its_direction == was_backward);
        end
        if (any && !open) assert (was_last);
        if (open && any && !was_last)
            assert (adc__its_line == was_line && adc__its_column == was_column + 16'd1
                && its_direction == was_direction);
        if (!was_word) assert (!was_lost);
    end
`endif
endmodule

`default_nettype wire
