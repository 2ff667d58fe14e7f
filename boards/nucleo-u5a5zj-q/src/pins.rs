//! Every pin of this board that the camera uses: one table for the code and for the wiring.
//!
//! A row is `name: pin => place on the Nucleo, where the wire goes;`. `README.md` shows the same
//! table, and a test compares the two. Places are those of ST's Zio connectors (UM2861) by their
//! Arduino-style numbers.

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
    // The FPGA's host port, OCTOSPI1.
    fpga_sck: PE10 => "CN10 D40", "FPGA J5.16 (PCLKT2_0) spi_sck";
    fpga_cs_n: PE11 => "CN10 D5", "FPGA J6.3 (D10) spi_cs_n";
    fpga_io0: PE12 => "CN10 D39", "FPGA J6.4 (D11) spi_io0";
    fpga_io1: PE13 => "CN10 D3", "FPGA J6.5 (D12) spi_io1";
    fpga_io2: PE14 => "CN10 D38", "FPGA J6.2 (D9) spi_io2";
    fpga_io3: PE15 => "CN10 D37", "FPGA J6.1 (D8) spi_io3";
    frame_ready: PE9 => "CN10 D6", "FPGA J3.8 (D7) frame_ready";
    raw_ready: PF13 => "CN10 D7", "FPGA J3.7 (D6) raw_ready";
    // Light.
    led_enable: PF14 => "CN10 D4", "LED array, second input of the enable's AND gate, 2.2 kilohm to ground";
    interlock: PF15 => "CN10 D2", "interlock loop, 3.3 V when closed; the FPGA's J3.3 (D2) is on the same loop";
    thermistor: PA3 => "CN9 A0", "NTC 10 kilohm at the LED array to ground, 10 kilohm to AVDD";
    // Lamps on the board.
    lamp_ready: PC7 => "LD1", "nothing: green, the camera waits for a host or has one";
    lamp_light: PB7 => "LD2", "nothing: blue, LEDs may be lit";
    lamp_fault: PG2 => "LD3", "nothing: red, flashes the number of a fault, or of restarts";
    // The ECP5's configuration port, SPI1.
    config_sck: PA5 => "CN7 D13", "ECP5 CCLK";
    config_mosi: PA7 => "CN7 D11", "ECP5 SI (MOSI)";
    config_miso: PA6 => "CN7 D12", "ECP5 SO (MISO)";
    config_cs_n: PD14 => "CN7 D10", "ECP5 SN";
    config_program_n: PD15 => "CN7 D9", "ECP5 PROGRAMN";
    config_done: PF12 => "CN7 D8", "ECP5 DONE";
    // The time-of-flight sensor, I2C1.
    tof_scl: PB8 => "CN7 D15", "VL53L5CX or VL53L8CX SCL";
    tof_sda: PB9 => "CN7 D14", "VL53L5CX or VL53L8CX SDA";
    // The connector of the board.
    usb_dp: PA12 => "user USB-C", "host D+";
    usb_dm: PA11 => "user USB-C", "host D-";
}

/// Lights `lamp_fault` before the clocks run: its port's supply and clock, then the pin.
pub fn light_fault_lamp() {
    pac::RCC.ahb3enr().modify(|enable| enable.set_pwren(true));
    pac::PWR.svmcr().modify(|supplies| supplies.set_io2sv(true));
    pac::RCC.ahb2enr1().modify(|enable| enable.set_gpiogen(true));
    pac::GPIOG.bsrr().write(|bits| bits.set_bs(2, true));
    pac::GPIOG.moder().modify(|modes| modes.set_moder(2, pac::gpio::vals::Moder::OUTPUT));
}

/// Sets `led_enable` low. This needs only the port, so it works in any state of the firmware.
pub fn leds_off() {
    pac::GPIOF.bsrr().write(|bits| bits.set_br(14, true));
}
