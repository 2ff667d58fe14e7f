/// 124.8 MHz from the board's 12 MHz, in place of the ADC's data clock.
///
/// VCO = 12 MHz x 13 x 4 = 624 MHz (400 to 800 MHz allowed), fed back from `CLKOP` (divided by 4), and divided by 5
/// at `CLKOS`. Exactly 125 MHz would need a phase detector at 6 MHz or below; 10 MHz is the least that LiteX and
/// Amaranth give for it.
module board_pll (
    input  logic clk_12mhz,
    input  logic restart, /// Starts the search for lock anew
    output logic clk,
    output logic locked
);
    logic feedback;
    (* FREQUENCY_PIN_CLKI = "12" *)
    (* FREQUENCY_PIN_CLKOP = "156" *)
    (* FREQUENCY_PIN_CLKOS = "124.8" *)
    (* ICP_CURRENT = "12" *)
    (* LPF_RESISTOR = "8" *)
    (* MFG_ENABLE_FILTEROPAMP = "1" *)
    (* MFG_GMCREF_SEL = "2" *)
    EHXPLLL #(
        .PLLRST_ENA      ("ENABLED"),
        .INTFB_WAKE      ("DISABLED"),
        .STDBY_ENABLE    ("DISABLED"),
        .DPHASE_SOURCE   ("DISABLED"),
        .OUTDIVIDER_MUXA ("DIVA"),
        .OUTDIVIDER_MUXB ("DIVB"),
        .OUTDIVIDER_MUXC ("DIVC"),
        .OUTDIVIDER_MUXD ("DIVD"),
        .CLKI_DIV        (1),
        .CLKFB_DIV       (13),
        .FEEDBK_PATH     ("CLKOP"),
        .CLKOP_ENABLE    ("ENABLED"),
        .CLKOP_DIV       (4),
        .CLKOP_CPHASE    (2),
        .CLKOP_FPHASE    (0),
        .CLKOS_ENABLE    ("ENABLED"),
        .CLKOS_DIV       (5),
        .CLKOS_CPHASE    (2),
        .CLKOS_FPHASE    (0)
    ) pll (
        .CLKI        (clk_12mhz),
        .CLKFB       (feedback),
        .RST         (restart),
        .STDBY       (1'b0),
        .PHASESEL0   (1'b0),
        .PHASESEL1   (1'b0),
        .PHASEDIR    (1'b1),
        .PHASESTEP   (1'b1),
        .PHASELOADREG(1'b1),
        .PLLWAKESYNC (1'b0),
        .ENCLKOP     (1'b0),
        .ENCLKOS     (1'b0),
        .CLKOP       (feedback),
        .CLKOS       (clk),
        .LOCK        (locked)
    );
endmodule
