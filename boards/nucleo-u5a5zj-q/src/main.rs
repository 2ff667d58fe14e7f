//! The camera on ST's NUCLEO-U5A5ZJ-Q, the reference board: USB High-Speed to the host, OCTOSPI to the FPGA.
//!
//! This file connects the parts. `nirspi_mcu` makes the camera's decisions; `nirspi_app` runs them
//! in its loop.
//!
//! The enable line of the LEDs is low from reset until the camera raises it.
#![no_std]
#![no_main]

mod board;
mod clocks;
mod configuration;
mod crash;
mod depth;
mod fpga;
mod gateware;
mod memory;
#[cfg(feature = "parallel")]
mod parallel;
mod pins;
mod port;
mod restart;

use board::Nucleo;
use configuration::ConfigurationPort;
use defmt_rtt as _;
use depth::Depth;
use embassy_executor::Spawner;
use embassy_stm32::adc::{Adc, AdcChannel};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{Input, Level, Output, OutputOpenDrain, Pull, Speed};
use embassy_stm32::i2c::{self, I2c};
use embassy_stm32::ospi::Ospi;
use embassy_stm32::peripherals::{GPDMA1_CH1, GPDMA1_CH2, GPDMA1_CH12, I2C1, USB_OTG_HS};
use embassy_stm32::spi::Spi;
use embassy_stm32::usb::{self, Driver};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, dma, interrupt};
use embassy_time::Instant;
use fpga::Fpga;
use memory::uncleared;
use nirspi_app::link::{HostIn, HostOut, Link, Packet};
use nirspi_app::{Board, DepthMailbox, Device, board_info, measure_depth, run};
use nirspi_mcu::{HostPort, Limits};
use nirspi_usb::{Endpoints, Memory, OutBuffer, PACKET_BYTES, Presence, serve};
use nirspi_wire::Capabilities;
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::seal;
use nirspi_wire::register::{IDENTITY, Register};
use static_cell::{ConstStaticCell, StaticCell};

bind_interrupts!(struct Interrupts {
    OTG_HS => usb::InterruptHandler<USB_OTG_HS>;
    GPDMA1_CHANNEL12 => dma::InterruptHandler<GPDMA1_CH12>;
    GPDMA1_CHANNEL1 => dma::InterruptHandler<GPDMA1_CH1>;
    GPDMA1_CHANNEL2 => dma::InterruptHandler<GPDMA1_CH2>;
    I2C1_EV => i2c::EventInterruptHandler<I2C1>;
    I2C1_ER => i2c::ErrorInterruptHandler<I2C1>;
    EXTI9 => exti::InterruptHandler<interrupt::typelevel::EXTI9>;
    EXTI13 => exti::InterruptHandler<interrupt::typelevel::EXTI13>;
});

type UsbDriver = Driver<'static, USB_OTG_HS>;

/// Number of packets that can wait for the host: 32 full frames.
const PLACES: usize = 32;

uncleared! { PACKETS: [Packet; PLACES], PACKETS_TAKEN }
static LINK: StaticCell<Link<'static>> = StaticCell::new();
static MAILBOX: StaticCell<DepthMailbox> = StaticCell::new();
static FRAME: ConstStaticCell<[u8; MAX_FRAME_BYTES]> = ConstStaticCell::new([0; _]);
uncleared! { STAGING: [u8; configuration::STAGING_BYTES], STAGING_TAKEN }
static PRESENCE: StaticCell<Presence> = StaticCell::new();
static USB_MEMORY: StaticCell<Memory> = StaticCell::new();
static USB_BUFFER: ConstStaticCell<OutBuffer> = ConstStaticCell::new(OutBuffer::new());

#[embassy_executor::task]
async fn usb_device(mut device: nirspi_usb::Device<UsbDriver>) -> ! {
    device.run().await
}

#[embassy_executor::task]
async fn host(
    endpoints: Endpoints<UsbDriver>,
    commands: HostIn<'static>,
    packets: HostOut<'static, PACKET_BYTES>,
) -> ! {
    serve(endpoints, commands, packets).await
}

#[embassy_executor::task]
async fn depth_sensor(sensor: Depth, mailbox: &'static DepthMailbox) -> ! {
    measure_depth(sensor, mailbox).await
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    restart::enter_bootloader_if_wished(board::BOOTLOADER);
    clocks::start_watchdog();
    let start = restart::begin();
    // Every second restart lights the lamp from here on, so it blinks where no start gets further than its waits.
    let is_odd = start.restarts % 2 == 1;
    if is_odd {
        pins::light_fault_lamp();
    }
    let p = embassy_stm32::init(clocks::config());
    let pins = pins::take_pins!(p);
    let led_enable = Output::new(pins.led_enable, Level::Low, Speed::Low);
    crash::on_crash(pins::leds_off);
    clocks::watch_crystal();
    clocks::enable_cache();
    clocks::watch_supply();
    clocks::wait_for_supply();

    let mut watchdog = IndependentWatchdog::new(p.IWDG, nirspi_mcu::BOARD_WATCHDOG_US);
    watchdog.unleash();
    let mut board = Nucleo {
        led_enable,
        // The parallel port has the pin of the first lamp.
        #[cfg(feature = "parallel")]
        lamp_ready: None,
        #[cfg(not(feature = "parallel"))]
        lamp_ready: Some(Output::new(pins.lamp_ready, Level::Low, Speed::Low)),
        lamp_light: Output::new(pins.lamp_light, Level::Low, Speed::Low),
        lamp_fault: Output::new(pins.lamp_fault, is_odd.into(), Speed::Low),
        interlock: Input::new(pins.interlock, Pull::Down),
        adc: Adc::new_with_config(p.ADC1, board::adc_config()),
        thermistor: pins.thermistor.degrade_adc(),
        temperature: None,
        temperature_due: Instant::now(),
        watchdog,
    };

    let mut port = Fpga {
        ospi: Ospi::new_quadspi(
            p.OCTOSPI1,
            pins.fpga_sck,
            pins.fpga_io0,
            pins.fpga_io1,
            pins.fpga_io2,
            pins.fpga_io3,
            pins.fpga_cs_n,
            p.GPDMA1_CH12,
            Interrupts,
            fpga::config(),
        ),
        frame_ready: ExtiInput::new(pins.frame_ready, p.EXTI9, Pull::Down, Interrupts),
        raw_ready: ExtiInput::new(pins.raw_ready, p.EXTI13, Pull::Down, Interrupts),
        #[cfg(feature = "parallel")]
        parallel: parallel::Parallel::new(
            p.DCMI,
            p.GPDMA1_CH3,
            (p.PC6, pins.lamp_ready, p.PC8, p.PC9, p.PC11, p.PD3, p.PE5, p.PE6),
            p.PD9,
            p.PD8,
            p.TIM3,
            p.PE3,
        ),
    };
    let mut configuration = ConfigurationPort {
        spi: Spi::new_blocking(
            p.SPI1,
            pins.config_sck,
            pins.config_mosi,
            pins.config_miso,
            configuration::config(),
        ),
        cs_n: Output::new(pins.config_cs_n, Level::High, Speed::Medium),
        program_n: OutputOpenDrain::new(pins.config_program_n, Level::High, Speed::Low),
        done: Input::new(pins.config_done, Pull::Down),
    };
    if let Some(stored) = configuration::stored() {
        let identity = Register::Identity.address();
        let is_nirspi = port.read(identity) == Ok(seal(identity, IDENTITY));
        let feed = || board.feed_watchdog();
        gateware::load_stored(&mut configuration, stored, is_nirspi, feed).await;
    }

    let serial = embassy_stm32::uid::uid_hex();
    let info = board_info("nucleo-u5a5zj-q", serial)
        .can(Capabilities::DEPTH)
        .can(Capabilities::LOAD_GATEWARE)
        .can(Capabilities::BOOTLOADER);
    let mut usb_config = usb::Config::default();
    // The chip's data cache is for external memory alone, so core and processor see the same bytes.
    usb_config.dma = true;
    let driver = Driver::new_hs(
        p.USB_OTG_HS,
        Interrupts,
        pins.usb_dp,
        pins.usb_dm,
        &mut USB_BUFFER.take().0,
        usb_config,
    );
    let presence = PRESENCE.init(Presence::new());
    let memory = USB_MEMORY.init(Memory::new(presence));
    let (device, endpoints) = nirspi_usb::device(driver, serial, info.firmware, memory);
    let (camera, commands, packets) =
        LINK.init(Link::new(PACKETS.fill(&PACKETS_TAKEN, Packet::EMPTY))).split();
    let mailbox = &*MAILBOX.init(DepthMailbox::new());
    let bus = I2c::new(
        p.I2C1,
        pins.tof_scl,
        pins.tof_sda,
        p.GPDMA1_CH1,
        p.GPDMA1_CH2,
        Interrupts,
        depth::config(),
    );
    spawner.spawn(defmt::unwrap!(usb_device(device)));
    spawner.spawn(defmt::unwrap!(host(endpoints, commands, packets)));
    spawner.spawn(defmt::unwrap!(depth_sensor(Depth::new(bus), mailbox)));

    defmt::info!("nirspi {} on {=str}, {=str}", env!("CARGO_PKG_VERSION"), info.board, serial);
    let device = Device {
        board,
        port,
        frame: FRAME.take(),
        loader: gateware::Loader::new(configuration, STAGING.fill(&STAGING_TAKEN, 0)),
        info,
        limits: Limits::default(),
        crash: nirspi_app::crash::take().or(start.report),
        restarts: start.restarts,
    };
    run(device, camera, mailbox).await
}
