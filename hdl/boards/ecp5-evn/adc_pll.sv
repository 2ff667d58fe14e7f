/// The ADC's data clock, without the delay of pin and clock tree.
///
/// 125 MHz in and out: VCO = 125 MHz x 1 x 5 = 625 MHz (400 to 800 MHz allowed), fed back from the clock tree,
/// so that the registers in the input cells see the edge that the pin saw. Parameters as `ecppll -i 125 -o 125`.
module adc_pll (
    input  logic dco,
    input  logic restart, /// Starts the search for lock anew
    output logic clk,
    output logic locked
);
    (* FREQUENCY_PIN_CLKI = "125" *)
    (* FREQUENCY_PIN_CLKOP = "125" *)
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
        .CLKFB_DIV       (1),
        .FEEDBK_PATH     ("CLKOP"),
        .CLKOP_ENABLE    ("ENABLED"),
        .CLKOP_DIV       (5),
        .CLKOP_CPHASE    (2),
        .CLKOP_FPHASE    (0)
    ) pll (
        .CLKI        (dco),
        .CLKFB       (clk),
        .RST         (restart),
        .STDBY       (1'b0),
        .PHASESEL0   (1'b0),
        .PHASESEL1   (1'b0),
        .PHASEDIR    (1'b1),
        .PHASESTEP   (1'b1),
        .PHASELOADREG(1'b1),
        .PLLWAKESYNC (1'b0),
        .ENCLKOP     (1'b0),
        .CLKOP       (clk),
        .LOCK        (locked)
    );
endmodule
