//! The camera on ST's NUCLEO-H7S3L8: USB High-Speed to the host, XSPI to the FPGA.
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
mod fpga;
mod pins;

use board::Nucleo;
use configuration::ConfigurationPort;
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::adc::{Adc, AdcChannel};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{Input, Level, Output, OutputOpenDrain, Pull, Speed};
use embassy_stm32::peripherals::{HPDMA1_CH0, USB_OTG_HS};
use embassy_stm32::spi::Spi;
use embassy_stm32::usb::{self, Driver};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::xspi::Xspi;
use embassy_stm32::{bind_interrupts, dma, interrupt};
use embassy_time::Instant;
use fpga::Fpga;
use nirspi_app::link::{HostIn, HostOut, Link, Packet};
use nirspi_app::{DepthMailbox, Device, board_info, run};
use nirspi_mcu::Limits;
use nirspi_nucleo::{crash, gateware, restart};
use nirspi_usb::{Endpoints, Memory, OutBuffer, PACKET_BYTES, Presence, serve};
use nirspi_wire::Capabilities;
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use static_cell::{ConstStaticCell, StaticCell};

bind_interrupts!(struct Interrupts {
    OTG_HS => usb::InterruptHandler<USB_OTG_HS>;
    HPDMA1_CHANNEL0 => dma::InterruptHandler<HPDMA1_CH0>;
    EXTI9 => exti::InterruptHandler<interrupt::typelevel::EXTI9>;
    EXTI4 => exti::InterruptHandler<interrupt::typelevel::EXTI4>;
});

type UsbDriver = Driver<'static, USB_OTG_HS>;

/// Number of packets that can wait for the host: 6 full frames.
const PLACES: usize = 6;

static PACKETS: ConstStaticCell<[Packet; PLACES]> = ConstStaticCell::new([Packet::EMPTY; PLACES]);
static LINK: StaticCell<Link<'static>> = StaticCell::new();
static MAILBOX: StaticCell<DepthMailbox> = StaticCell::new();
static FRAME: ConstStaticCell<[u8; MAX_FRAME_BYTES]> = ConstStaticCell::new([0; _]);
static STAGING: ConstStaticCell<[u8; configuration::STAGING_BYTES]> = ConstStaticCell::new([0; _]);
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

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    restart::enter_bootloader_if_wished(board::BOOTLOADER);
    clocks::start_watchdog();
    let p = embassy_stm32::init(clocks::config());
    let pins = pins::take_pins!(p);
    let led_enable = Output::new(pins.led_enable, Level::Low, Speed::Low);
    crash::on_crash(pins::leds_off);
    clocks::enable_cache();
    clocks::watch_supply();
    clocks::wait_for_supply();

    let mut watchdog = IndependentWatchdog::new(p.IWDG, nirspi_mcu::BOARD_WATCHDOG_US);
    watchdog.unleash();
    let board = Nucleo {
        led_enable,
        lamps: [
            Output::new(pins.lamp_ready, Level::Low, Speed::Low),
            Output::new(pins.lamp_light, Level::Low, Speed::Low),
            Output::new(pins.lamp_fault, Level::Low, Speed::Low),
        ],
        interlock: Input::new(pins.interlock, Pull::Down),
        adc: Adc::new_with_config(p.ADC1, board::adc_config()),
        thermistor: pins.thermistor.degrade_adc(),
        temperature: None,
        temperature_due: Instant::now(),
        watchdog,
    };

    let port = Fpga {
        xspi: Xspi::new_quadspi(
            p.XSPI1,
            pins.fpga_sck,
            pins.fpga_io0,
            pins.fpga_io1,
            pins.fpga_io2,
            pins.fpga_io3,
            pins.fpga_cs_n,
            p.HPDMA1_CH0,
            Interrupts,
            fpga::config(),
        ),
        frame_ready: ExtiInput::new(pins.frame_ready, p.EXTI9, Pull::Down, Interrupts),
        raw_ready: ExtiInput::new(pins.raw_ready, p.EXTI4, Pull::Down, Interrupts),
    };
    let configuration = ConfigurationPort {
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

    let serial = embassy_stm32::uid::uid_hex();
    let info = board_info("nucleo-h7s3l8", serial)
        .can(Capabilities::LOAD_GATEWARE)
        .can(Capabilities::BOOTLOADER);
    let driver = Driver::new_hs(
        p.USB_OTG_HS,
        Interrupts,
        pins.usb_dp,
        pins.usb_dm,
        &mut USB_BUFFER.take().0,
        usb::Config::default(),
    );
    let presence = PRESENCE.init(Presence::new());
    let memory = USB_MEMORY.init(Memory::new(presence));
    let (device, endpoints) = nirspi_usb::device(driver, serial, info.firmware, memory);
    let (camera, commands, packets) = LINK.init(Link::new(PACKETS.take())).split();
    // There is no depth sensor: the sensor's firmware is larger than this chip's flash.
    let mailbox = MAILBOX.init(DepthMailbox::new());
    spawner.spawn(defmt::unwrap!(usb_device(device)));
    spawner.spawn(defmt::unwrap!(host(endpoints, commands, packets)));

    defmt::info!("nirspi {} on {=str}, {=str}", env!("CARGO_PKG_VERSION"), info.board, serial);
    let device = Device {
        board,
        port,
        frame: FRAME.take(),
        loader: gateware::Loader::new(configuration, STAGING.take()),
        info,
        limits: Limits::default(),
        crash: nirspi_app::crash::take(),
    };
    run(device, camera, mailbox).await
}
