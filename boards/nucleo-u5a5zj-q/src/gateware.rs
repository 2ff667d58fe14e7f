//! A board's gateware loader, which remembers what the FPGA runs.
//!
//! The memory of what the FPGA runs survives a restart of the firmware and is lost with the power.

use core::sync::atomic::{AtomicU32, Ordering};
use embassy_futures::yield_now;
use nirspi_mcu::ecp5::{Configuration, ConfigureError, IDCODE_LFE5UM5G_85F, SlaveSpi, must_load};
use nirspi_mcu::staging::StagingLoader;
use nirspi_mcu::{GatewareLoader, LoadError, Micros};
use nirspi_wire::crc32;

/// A CRC-32 and its complement. The complement shows that the memory was written.
#[expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use")]
#[unsafe(link_section = ".uninit.gateware")]
static RUNNING: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

fn recall() -> Option<u32> {
    let [crc, complement] = RUNNING.each_ref().map(|word| word.load(Ordering::Relaxed));
    (crc == !complement).then_some(crc)
}

fn remember(running: Option<u32>) {
    let [crc, complement] = &RUNNING;
    // Two equal words mean that there is no record.
    let words = running.map_or((0, 0), |running| (running, !running));
    crc.store(words.0, Ordering::Relaxed);
    complement.store(words.1, Ordering::Relaxed);
}

/// Loads the board's stored bitstream, unless the FPGA already runs it. A board awaits this before
/// the camera starts; this function feeds the watchdog meanwhile.
pub async fn load_stored(
    port: &mut impl SlaveSpi,
    stored: &[u8],
    is_nirspi: bool,
    mut feed_watchdog: impl FnMut(),
) {
    let wanted = crc32(stored);
    if !must_load(port.done() && is_nirspi, recall(), wanted) {
        defmt::info!("gateware {=u32:08x} runs already", wanted);
        return;
    }
    remember(None);
    let mut configuration = Configuration::new(IDCODE_LFE5UM5G_85F);
    let result = loop {
        feed_watchdog();
        if let Some(result) = configuration.poll(now(), port, stored) {
            break result;
        }
        yield_now().await;
    };
    match result {
        Ok(()) => {
            remember(Some(wanted));
            defmt::info!("gateware {=u32:08x} loaded, {=usize} bytes", wanted, stored.len());
        }
        Err(error) => report(error),
    }
}

fn report(error: ConfigureError) {
    match error {
        ConfigureError::Bus(_) => defmt::error!("no gateware: transfer failed"),
        ConfigureError::WrongDevice { found } => {
            defmt::error!("no gateware: no LFE5UM5G-85F in slave SPI mode but {=u32:#010x}", found);
        }
        ConfigureError::Stuck => defmt::error!("no gateware: the FPGA stays busy"),
        ConfigureError::Refused { status } => {
            defmt::error!("no gateware: refused, status {=u32:#010x}", status);
        }
    }
}

fn now() -> Micros {
    Micros(embassy_time::Instant::now().as_micros())
}

/// A [`StagingLoader`] that remembers what the FPGA runs.
pub struct Loader<'m, P>(StagingLoader<'m, P>);

impl<'m, P: SlaveSpi> Loader<'m, P> {
    /// A loader for bitstreams up to the length of the memory.
    #[must_use]
    pub fn new(port: P, memory: &'m mut [u8]) -> Self {
        Self(StagingLoader::new(port, memory, recall()))
    }
}

impl<P: SlaveSpi> GatewareLoader for Loader<'_, P> {
    fn begin(&mut self, total: u32) -> Result<(), LoadError> {
        self.0.begin(total)
    }

    fn write(&mut self, data: &[u8]) -> Result<(), LoadError> {
        self.0.write(data)
    }

    fn finish(&mut self) -> Result<(), LoadError> {
        self.0.finish()?;
        remember(self.0.running());
        Ok(())
    }

    fn forget(&mut self) {
        self.0.forget();
    }

    fn step(&mut self, now: Micros) -> bool {
        if self.0.step(now) {
            return true;
        }
        if let Some(error) = self.0.take_failure() {
            report(error);
        }
        if self.0.running() != recall() {
            remember(self.0.running());
        }
        false
    }
}
