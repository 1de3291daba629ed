// Bench of the emitted memory files: reads them as a design would, by the names that the header gives, and prints
// every word as a signed number, one a line: the table and the Fourier words of x, then those of y.
module memory_bench;
    `include "annexin_200nm.vh"

    reg signed [ANNEXIN_200NM_X_TABLE_BITS-1:0] x_table [0:ANNEXIN_200NM_X_TABLE_LENGTH-1];
    reg signed [ANNEXIN_200NM_Y_TABLE_BITS-1:0] y_table [0:ANNEXIN_200NM_Y_TABLE_LENGTH-1];
    reg signed [31:0] x_fourier [0:ANNEXIN_200NM_X_FOURIER_LENGTH-1];
    reg signed [31:0] y_fourier [0:ANNEXIN_200NM_Y_FOURIER_LENGTH-1];
    integer i;

    initial begin
        $readmemh(ANNEXIN_200NM_X_TABLE_FILE, x_table);
        $readmemh(ANNEXIN_200NM_X_FOURIER_FILE, x_fourier);
        $readmemh(ANNEXIN_200NM_Y_TABLE_FILE, y_table);
        $readmemh(ANNEXIN_200NM_Y_FOURIER_FILE, y_fourier);
        for (i = 0; i < ANNEXIN_200NM_X_TABLE_LENGTH; i = i + 1) $display("%0d", x_table[i]);
        for (i = 0; i < ANNEXIN_200NM_X_FOURIER_LENGTH; i = i + 1) $display("%0d", x_fourier[i]);
        for (i = 0; i < ANNEXIN_200NM_Y_TABLE_LENGTH; i = i + 1) $display("%0d", y_table[i]);
        for (i = 0; i < ANNEXIN_200NM_Y_FOURIER_LENGTH; i = i + 1) $display("%0d", y_fourier[i]);
    end
endmodule
