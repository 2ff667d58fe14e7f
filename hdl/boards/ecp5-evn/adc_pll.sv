/// The ADC's data clock, without the delay of pin and clock tree.
///
/// 125 MHz in and out: VCO = 125 MHz x 1 x 5 = 625 MHz (400 to 800 MHz allowed). `CLKOP` is fed back by a clock tree
/// of its own, so that at step 0 the registers in the input cells see the edge that the pin saw. `CLKOS` is the clock,
/// which each fall of `phase_step` moves by an eighth of the VCO's period, 0.2 ns: 40 steps are a period. Parameters
/// as `ecppll -i 125 -o 125 --clkout1 125`; the ports of the phase as Project Trellis and its users have them, since
/// the vendor's guide (FPGA-TN-02200) was not at hand: `PHASESEL` 0 is `CLKOS`, a step is taken when `PHASESTEP` falls,
/// and it stands for four periods of the VCO or more before and after.
module adc_pll (
    input  logic dco,
    input  logic restart,    /// Starts the search for lock anew
    input  logic phase_step, /// Moves `clk` by a step when it falls
    output logic clk,
    output logic locked
);
    logic fed_back;
    logic at_tree;
    // Without it nextpnr takes a short way back, and the delay of the clock tree stays.
    (* keep *) DCCA tree (
        .CLKI(fed_back),
        .CE  (1'b1),
        .CLKO(at_tree)
    );
    (* FREQUENCY_PIN_CLKI = "125" *)
    (* FREQUENCY_PIN_CLKOP = "125" *)
    (* FREQUENCY_PIN_CLKOS = "125" *)
    (* ICP_CURRENT = "12" *)
    (* LPF_RESISTOR = "8" *)
    (* MFG_ENABLE_FILTEROPAMP = "1" *)
    (* MFG_GMCREF_SEL = "2" *)
    EHXPLLL #(
        .PLLRST_ENA      ("ENABLED"),
        .INTFB_WAKE      ("DISABLED"),
        .STDBY_ENABLE    ("DISABLED"),
        .DPHASE_SOURCE   ("ENABLED"),
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
        .CLKOP_FPHASE    (0),
        .CLKOS_ENABLE    ("ENABLED"),
        .CLKOS_DIV       (5),
        .CLKOS_CPHASE    (2),
        .CLKOS_FPHASE    (0)
    ) pll (
        .CLKI        (dco),
        .CLKFB       (at_tree),
        .RST         (restart),
        .STDBY       (1'b0),
        .PHASESEL0   (1'b0),
        .PHASESEL1   (1'b0),
        .PHASEDIR    (1'b1),
        .PHASESTEP   (phase_step),
        .PHASELOADREG(1'b1),
        .PLLWAKESYNC (1'b0),
        .ENCLKOP     (1'b0),
        .ENCLKOS     (1'b0),
        .CLKOP       (fed_back),
        .CLKOS       (clk),
        .LOCK        (locked)
    );
endmodule
