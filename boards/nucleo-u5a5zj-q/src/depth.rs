//! The 8 x 8 time-of-flight sensor: VL53L5CX or VL53L8CX, which the driver distinguishes
//! (`vl53-8x8`: no C, no heap).
//!
//! The driver sends ST's firmware to the sensor at each start: 86 KB of this board's flash, about 2
//! s at 400 kHz. A task of its own does all of that, so the camera does not wait for the sensor.

use embassy_stm32::i2c::{Config, Error, I2c, Master};
use embassy_stm32::mode::Async;
use embassy_stm32::pac;
use embassy_stm32::time::Hertz;
use embassy_time::{Delay, Duration, Instant, with_timeout};
use embedded_hal_async::i2c::{self, ErrorType, Operation};
use nirspi_app::{DepthMap, DepthSensor};
use vl53_8x8::{Resolution, Sensor};

/// Fastest rate at which the sensor measures 64 zones.
const RATE_HZ: u8 = 15;

/// A sensor that gives no map for this long has failed.
const PATIENCE: Duration = Duration::from_millis(500);

/// Bus settings.
pub fn config() -> Config {
    let mut config = Config::default();
    config.frequency = Hertz(400_000);
    // The longest transfer, 32 KB of the sensor's firmware, takes 0.74 s.
    config.timeout = Duration::from_secs(1);
    config
}

/// Time for the end of a transfer, which takes a few bits. A bus that is busy for longer is stuck.
const SETTLING: Duration = Duration::from_micros(200);

/// I2C1 without busy waits. The driver below this type would wait for a busy bus for up to a
/// second, which is longer than the watchdog allows; a bus whose sensor has no supply is busy for
/// ever.
struct Bus(I2c<'static, Async, Master>);

impl Bus {
    fn make_ready() {
        let patience = Instant::now() + SETTLING;
        let is_busy = || pac::I2C1.isr().read().busy() || pac::I2C1.cr2().read().start();
        while is_busy() {
            if Instant::now() > patience {
                // Stops any transfer (RM0456, I2C software reset).
                pac::I2C1.cr1().modify(|control| control.set_pe(false));
                while pac::I2C1.cr1().read().pe() {}
                pac::I2C1.cr1().modify(|control| control.set_pe(true));
                return;
            }
        }
    }
}

impl ErrorType for Bus {
    type Error = Error;
}

impl i2c::I2c for Bus {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), Error> {
        Self::make_ready();
        i2c::I2c::transaction(&mut self.0, address, operations).await
    }
}

/// The sensor. It is started at the first request, and again after it has stopped answering.
pub struct Depth {
    sensor: Sensor<Bus, Delay>,
    started: bool,
}

impl Depth {
    pub fn new(bus: I2c<'static, Async, Master>) -> Self {
        Self { sensor: Sensor::new(Bus(bus), Delay), started: false }
    }

    async fn start(&mut self) -> Option<()> {
        self.sensor.init().await.ok()?;
        self.sensor.set_resolution(Resolution::Res8x8).await.ok()?;
        self.sensor.set_ranging_frequency_hz(RATE_HZ).await.ok()?;
        self.sensor.start_ranging().await.ok()?;
        defmt::info!("depth: {}", defmt::Debug2Format(&self.sensor.variant()));
        Some(())
    }

    async fn measure(&mut self) -> Option<DepthMap> {
        with_timeout(PATIENCE, self.sensor.poll_data_ready()).await.ok()?.ok()?;
        let data = self.sensor.get_ranging_data().await.ok()?;
        let mut map = [0; _];
        for (to, (distance_mm, status)) in
            map.iter_mut().zip(data.distance_mm.iter().zip(&data.target_status))
        {
            // Statuses 5 and 9 mark a good measurement (UM2884, 5.5).
            let good = matches!(status, 5 | 9);
            *to = u16::try_from(*distance_mm).unwrap_or(0) * u16::from(good);
        }
        Some(map)
    }
}

impl DepthSensor for Depth {
    async fn next(&mut self) -> Option<DepthMap> {
        if !self.started {
            self.start().await?;
            self.started = true;
        }
        let map = self.measure().await;
        self.started = map.is_some();
        map
    }
}
