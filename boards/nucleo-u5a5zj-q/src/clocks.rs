//! Clocks: 160 MHz for core and buses, from the board's 16 MHz crystal. USB High-Speed needs the
//! crystal.

use embassy_stm32::Config;
use embassy_stm32::pac::{FLASH, ICACHE, PWR, RCC};
use embassy_stm32::rcc::{
    Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale, mux,
};
use embassy_stm32::time::Hertz;

/// Frequency of core, AHB and OCTOSPI.
pub const SYSTEM_HZ: u32 = 160_000_000;

pub fn config() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz(16_000_000), mode: HseMode::Oscillator });
    rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV1,
        mul: PllMul::MUL10,
        divp: None,
        divq: None,
        divr: Some(PllDiv::DIV1),
    });
    rcc.sys = Sysclk::PLL1_R;
    rcc.voltage_range = VoltageScale::RANGE1;
    rcc.mux.octospisel = mux::Octospisel::SYS;
    rcc.mux.otghssel = mux::Otghssel::HSE;
    config
}

/// Starts the watchdog before anything waits, with the chip's setting after a reset: 4096 clocks of
/// LSI / 4, 0.5 s. A crystal that does not start or a supply that stays low restarts the chip, and
/// the LEDs' enable is low meanwhile.
pub fn start_watchdog() {
    use embassy_stm32::pac::{DBGMCU, IWDG, iwdg::vals::Key};
    // A debugger that stops the processor stops the watchdog too; the FPGA's own ends a run then.
    DBGMCU.apb1lfzr().modify(|freeze| freeze.set_dbg_iwdg_stop(true));
    IWDG.kr().write(|key| key.set_key(Key::START));
}

/// Lets the chip watch the crystal. When the crystal stops, the chip goes over to its own oscillator and enters
/// `NonMaskableInt`, which ends the firmware (`crash.rs`). Otherwise a PLL without its input would coast, and the time by which
/// the firmware judges everything would run slow.
pub fn watch_crystal() {
    RCC.cr().modify(|control| control.set_csson(true));
}

/// Enables the instruction cache: flash needs four wait states, the cache mostly none (RM0456, 8).
pub fn enable_cache() {
    ICACHE.cr().modify(|cache| cache.set_en(true));
}

/// Monitors the supply: below 2.8 V the levels of LED drivers and FPGA are not reliable.
pub fn watch_supply() {
    use embassy_stm32::pac::flash::vals::BorLev;
    use embassy_stm32::pac::pwr::vals::Pvdls;
    PWR.svmcr().modify(|monitor| {
        monitor.set_pvdls(Pvdls::V28);
        monitor.set_pvde(true);
    });
    if FLASH.optr().read().bor_lev() == BorLev::LEVEL0 {
        defmt::warn!("brown-out reset at 1.7 V: set the option byte BOR_LEV to 4 (2.8 V)");
    }
}

/// Waits until the supply is good. The watchdog restarts a chip that waits for long.
pub fn wait_for_supply() {
    if supply_is_low() {
        defmt::warn!("the supply is below 2.8 V");
    }
    while supply_is_low() {}
}

/// Whether the supply is below 2.8 V.
pub fn supply_is_low() -> bool {
    use embassy_stm32::pac::pwr::vals::Pvdo;
    PWR.svmsr().read().pvdo() == Pvdo::BELOW
}
