//! Every pin of this board that the camera uses: one table for the code and for the wiring.
//!
//! A row is `name: pin => place on the Nucleo, where the wire goes;`. `README.md` shows the same
//! table, and a test compares the two. Places are those of ST's Zio connectors (UM3276) by their
//! Arduino-style numbers and, for the host port, signals of the chip's ports P and O.

use embassy_stm32::{Peri, pac, peripherals};

macro_rules! pin_table {
    (($d:tt) $($name:ident: $pin:ident => $place:literal, $wire:literal;)*) => {
        /// The pins, by their function.
        pub struct Pins {
            $(#[doc = concat!($place, " to ", $wire)] pub $name: Peri<'static, peripherals::$pin>,)*
        }

        /// Takes the table's pins out of the peripherals.
        macro_rules! take_pins {
            ($d peripherals:ident) => {
                $crate::pins::Pins { $($name: $d peripherals.$pin,)* }
            };
        }
        pub(crate) use take_pins;
    };
}

pin_table! { ($)
    // The FPGA's host port, XSPI1.
    fpga_sck: PO4 => "XSPIM_P1_CLK", "FPGA J5.16 (PCLKT2_0) spi_sck";
    fpga_cs_n: PO0 => "XSPIM_P1_NCS1", "FPGA J6.3 (D10) spi_cs_n";
    fpga_io0: PP0 => "XSPIM_P1_IO0", "FPGA J6.4 (D11) spi_io0";
    fpga_io1: PP1 => "XSPIM_P1_IO1", "FPGA J6.5 (D12) spi_io1";
    fpga_io2: PP2 => "XSPIM_P1_IO2", "FPGA J6.2 (D9) spi_io2";
    fpga_io3: PP3 => "XSPIM_P1_IO3", "FPGA J6.1 (D8) spi_io3";
    frame_ready: PE9 => "CN10 D6", "FPGA J3.8 (D7) frame_ready";
    raw_ready: PF4 => "CN10 D7", "FPGA J3.7 (D6) raw_ready";
    // Light.
    led_enable: PF3 => "CN10 D4", "LED array, second input of the enable's AND gate, 2.2 kilohm to ground";
    interlock: PF15 => "CN10 D2", "interlock loop, 3.3 V when closed; the FPGA's J3.3 (D2) is on the same loop";
    thermistor: PA3 => "CN9 A0", "NTC 10 kilohm at the LED array to ground, 10 kilohm to AVDD";
    // Lamps on the board.
    lamp_ready: PD10 => "LD1", "nothing: green, the camera waits for a host or has one";
    lamp_light: PD13 => "LD2", "nothing: yellow, LEDs may be lit";
    lamp_fault: PB7 => "LD3", "nothing: red, flashes the number of a fault";
    // The ECP5's configuration port, SPI1.
    config_sck: PA5 => "CN7 D13", "ECP5 CCLK";
    config_mosi: PB5 => "CN7 D11", "ECP5 SI (MOSI)";
    config_miso: PA6 => "CN7 D12", "ECP5 SO (MISO)";
    config_cs_n: PD14 => "CN7 D10", "ECP5 SN";
    config_program_n: PD15 => "CN7 D9", "ECP5 PROGRAMN";
    config_done: PF5 => "CN7 D8", "ECP5 DONE";
    // The connector of the board.
    usb_dp: PM6 => "user USB-C", "host D+";
    usb_dm: PM5 => "user USB-C", "host D-";
}

/// Sets `led_enable` low. This needs only the port, so it works in any state of the firmware.
pub fn leds_off() {
    pac::GPIOF.bsrr().write(|bits| bits.set_br(3, true));
}
