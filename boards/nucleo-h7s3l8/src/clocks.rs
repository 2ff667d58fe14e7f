//! Clocks: 600 MHz for the core and 300 MHz for buses, from the board's 24 MHz crystal. USB
//! High-Speed needs the crystal.

use embassy_stm32::Config;
use embassy_stm32::pac::{FLASH, PWR};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, HSIPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv,
    PllSource, Sysclk, VoltageScale, mux,
};
use embassy_stm32::time::Hertz;

/// Frequency of AHB and XSPI.
pub const BUS_HZ: u32 = 300_000_000;

pub fn config() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz(24_000_000), mode: HseMode::Oscillator });
    rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV12,
        mul: PllMul::MUL300,
        divp: Some(PllDiv::DIV1),
        divq: None,
        divr: None,
        divs: None,
        divt: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    rcc.apb5_pre = APBPrescaler::DIV2;
    rcc.voltage_scale = VoltageScale::HIGH;
    rcc.mux.usbphycsel = mux::Usbphycsel::HSE;
    rcc.mux.xspi1sel = mux::Xspisel::HCLK5;
    // The converter runs on the internal oscillator, at 32 MHz.
    rcc.hsi = Some(HSIPrescaler::DIV2);
    rcc.mux.adcsel = mux::Adcsel::PER;
    config
}

/// Starts the watchdog before anything waits, with the chip's setting after a reset: 4096 clocks of
/// LSI / 4, 0.5 s. A crystal that does not start or a supply that stays low restarts the chip, and
/// the LEDs' enable is low meanwhile.
pub fn start_watchdog() {
    use embassy_stm32::pac::{IWDG, iwdg::vals::Key};
    IWDG.kr().write(|key| key.set_key(Key::START));
}

/// Enables the instruction cache, because flash needs several wait states. The data cache stays
/// off, so that the processor reads what DMA has written.
pub fn enable_cache() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SCB.enable_icache();
    }
}

/// Monitors the supply: below 2.85 V the levels of LED drivers and FPGA are not reliable.
pub fn watch_supply() {
    use embassy_stm32::pac::flash::vals::BorLev;
    use embassy_stm32::pac::pwr::vals::Pls;
    PWR.cr1().modify(|monitor| {
        monitor.set_pls(Pls::LEVEL7);
        monitor.set_pvde(true);
    });
    if FLASH.obw1sr().read().bor_lev() == BorLev::DISABLED {
        defmt::warn!("no brown-out reset: set the option byte BOR_LEV to 3 (2.7 V)");
    }
}

/// Waits until the supply is good. The watchdog restarts a chip that waits for long.
pub fn wait_for_supply() {
    if supply_is_low() {
        defmt::warn!("the supply is below 2.85 V");
    }
    while supply_is_low() {}
}

/// Whether the supply is below 2.85 V.
pub fn supply_is_low() -> bool {
    use embassy_stm32::pac::pwr::vals::Pvdo;
    PWR.sr1().read().pvdo() == Pvdo::BELOW
}
