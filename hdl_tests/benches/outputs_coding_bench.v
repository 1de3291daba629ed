`default_nettype none

// Bench of one dac_coding: words of the codes of a file, one hexadecimal number a line.
module outputs_coding_bench #(
    parameter CODES = "codes.hex",
    parameter WORDS = "words.txt",
    parameter COUNT = 1,
    parameter BITS = 16,
    parameter WORD_BITS = 16,
    parameter TWOS_COMPLEMENT = 0,
    parameter LEFT_ALIGNED = 0
) (
    output reg done
);
    reg [BITS-1:0] codes [0:COUNT-1];
    reg [BITS-1:0] code;
    wire [WORD_BITS-1:0] word;
    integer i, words;

    initial begin
        done = 1'b0;
        $readmemh(CODES, codes);
        words = $fopen(WORDS, "w");
        for (i = 0; i < COUNT; i = i + 1) begin
            code = codes[i];
            #1 $fwrite(words, "%h\n", word);
        end
        $fclose(words);
        done = 1'b1;
    end

    dac_coding #(.BITS(BITS), .WORD_BITS(WORD_BITS), .TWOS_COMPLEMENT(TWOS_COMPLEMENT), .LEFT_ALIGNED(LEFT_ALIGNED))
        coding (.code(code), .word(word));
endmodule

`default_nettype wire
