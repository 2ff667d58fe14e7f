//! The FPGA's parallel port: PSSI and a DMA channel, which fill a ring in memory without end (feature `parallel`).
//!
//! The PSSI takes the eight lines where the FPGA's clock rises while `valid` is high, and asks for the DMA channel when
//! it has four bytes. The channel walks through a list of blocks, the last of which leads to the first, so it never
//! stops and needs no interrupt; the register of its destination says where it writes next.
//!
//! The FPGA sends while `ready` is high. The PSSI's own RDY is not used: at how many free bytes it falls is not known.
//! `ready` is a channel of a timer, which lets it fall when the time is over that the ring grants, whatever the processor
//! does then. The timer counts microseconds, and the line is high while the count is below the compare value (PWM mode
//! 1). Its 32 bits last for 71 minutes, and the watchdog ends a loop that does not look for half a second; after
//! that only the FPGA of a run that is over can still send, and no run takes its bytes.
//!
//! **Built only, never run on a board.** Registers as stm32-data has them; the order of an item of the list as RM0456
//! and embassy-stm32 have it.

use core::sync::atomic::{AtomicU32, Ordering};
use embassy_stm32::Peri;
use embassy_stm32::dcmi::{
    D0Pin, D1Pin, D2Pin, D3Pin, D4Pin, D5Pin, D6Pin, D7Pin, FrameDma, HSyncPin, PixClkPin,
};
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pin, Pull, Speed};
use embassy_stm32::pac::gpdma::vals::{Ap, Dreq, Dw, Prio};
use embassy_stm32::pac::gpdma::{Channel, regs};
use embassy_stm32::pac::pssi::vals::{Ckpol, Depol, Derdycfg, Edm, Outen};
use embassy_stm32::pac::{GPDMA1, PSSI};
use embassy_stm32::peripherals::{DCMI, GPDMA1_CH3, TIM3};
use embassy_stm32::rcc::enable_and_reset;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{OutputCompareMode, Timer};
use embassy_stm32::timer::{Ch1, Channel as Compare, TimerPin};
use nirspi_mcu::{Micros, Ring, RingMemory};

/// Blocks of the list. A block has at most 65 535 bytes.
const BLOCKS: usize = 4;
const BLOCK_BYTES: u16 = 32 * 1024;
const WORDS: usize = BLOCKS * BLOCK_BYTES as usize / 4;

/// 128 KB. The camera's loop looks once in a millisecond, in which the FPGA sends 42 KB at most and USB 40 KB: so much
/// has to be lent already, and as much to be free. Beside both there is room for the transfer that is under way, 20 KB,
/// and for a packet that has not come whole.
static RING: RingMemory<WORDS> = RingMemory::new();

/// The registers that an item loads, in the order in which the channel reads them: BR1, DAR, LLR.
const ITEM_WORDS: usize = 3;

/// The list. The channel takes its items from one page of 64 KB, and this alignment keeps the list within a page.
#[repr(align(64))]
struct List([AtomicU32; ITEM_WORDS * BLOCKS]);

static LIST: List = List([const { AtomicU32::new(0) }; ITEM_WORDS * BLOCKS]);

/// Link to this item of the list, which loads the three registers.
fn link(item: usize) -> regs::ChLlr {
    let mut link = regs::ChLlr(0);
    let address = LIST.0.as_ptr() as u32 + (item * ITEM_WORDS * 4) as u32;
    link.set_la((address as u16) >> 2);
    link.set_ub1(true);
    link.set_uda(true);
    link.set_ull(true);
    link
}

fn block() -> regs::ChBr1 {
    let mut block = regs::ChBr1(0);
    block.set_bndt(BLOCK_BYTES);
    block
}

fn address_of_block(number: usize) -> u32 {
    RING.words().as_ptr() as u32 + number as u32 * u32::from(BLOCK_BYTES)
}

const fn channel() -> Channel {
    GPDMA1.ch(3)
}

/// The data lines, in their order.
pub type Lines<P0, P1, P2, P3, P4, P5, P6, P7> = (
    Peri<'static, P0>,
    Peri<'static, P1>,
    Peri<'static, P2>,
    Peri<'static, P3>,
    Peri<'static, P4>,
    Peri<'static, P5>,
    Peri<'static, P6>,
    Peri<'static, P7>,
);

/// The port, as it runs.
pub struct Parallel {
    ring: Ring,
    timer: Timer<'static, TIM3>,
    _inputs: [Flex<'static>; 10],
    _ready: Flex<'static>,
}

fn input<P: Pin>(pin: Peri<'static, P>, function: u8) -> Flex<'static> {
    let mut pin = Flex::new(pin);
    pin.set_as_af_unchecked(function, AfType::input(Pull::Down));
    pin
}

impl Parallel {
    /// Starts the channel, then the PSSI. The receiver is not ready until the first look.
    ///
    /// PSSI and DCMI share clock, pins and request of the DMA, so the driver's traits of the DCMI tell which pin can do
    /// what: DE is where HSYNC is, and the clock where the pixel clock is.
    pub fn new<P0, P1, P2, P3, P4, P5, P6, P7>(
        _dcmi: Peri<'static, DCMI>,
        dma: Peri<'static, GPDMA1_CH3>,
        (d0, d1, d2, d3, d4, d5, d6, d7): Lines<P0, P1, P2, P3, P4, P5, P6, P7>,
        clock: Peri<'static, impl PixClkPin<DCMI>>,
        valid: Peri<'static, impl HSyncPin<DCMI>>,
        timer: Peri<'static, TIM3>,
        ready: Peri<'static, impl TimerPin<TIM3, Ch1>>,
    ) -> Self
    where
        P0: D0Pin<DCMI>,
        P1: D1Pin<DCMI>,
        P2: D2Pin<DCMI>,
        P3: D3Pin<DCMI>,
        P4: D4Pin<DCMI>,
        P5: D5Pin<DCMI>,
        P6: D6Pin<DCMI>,
        P7: D7Pin<DCMI>,
    {
        macro_rules! inputs {
            ($($pin:ident)*) => {[$({
                let function = $pin.af_num();
                input($pin, function)
            }),*]};
        }
        let inputs = inputs!(d0 d1 d2 d3 d4 d5 d6 d7 clock valid);
        enable_and_reset::<DCMI>();
        start_channel(FrameDma::<DCMI>::request(&*dma));
        PSSI.cr().write(|port| {
            port.set_outen(Outen::RECEIVE_MODE);
            port.set_edm(Edm::BIT_WIDTH8);
            port.set_derdycfg(Derdycfg::DE);
            port.set_depol(Depol::ACTIVE_HIGH);
            port.set_ckpol(Ckpol::RISING_EDGE);
            port.set_dmaen(true);
        });
        PSSI.cr().modify(|port| port.set_enable(true));
        let timer = start_timer(timer);
        let function = ready.af_num();
        let mut ready = Flex::new(ready);
        ready.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::Low));
        Self { ring: Ring::new(&RING), timer, _inputs: inputs, _ready: ready }
    }

    /// The ring, as of the last look.
    pub fn ring(&mut self) -> &mut Ring {
        &mut self.ring
    }

    /// Tells the ring where the channel writes now, and lets the FPGA send for as long as the ring grants from the
    /// moment before. In between the line is low, for a microsecond.
    pub fn look(&mut self) {
        self.timer.set_compare_value(Compare::Ch1, 0);
        self.timer.reset();
        let place = channel().dar().read().wrapping_sub(address_of_block(0));
        self.ring.came(place as usize);
        let Micros(grant) = self.ring.grant();
        self.timer.set_compare_value(Compare::Ch1, grant as u32);
    }
}

/// A timer of microseconds, with the line low.
fn start_timer(timer: Peri<'static, TIM3>) -> Timer<'static, TIM3> {
    let mut timer = Timer::new(timer);
    // A timer of 32 bits: of another this does not compile.
    timer.set_max_compare_value(u32::MAX);
    timer.set_tick_freq(Hertz(1_000_000));
    timer.set_output_compare_preload(Compare::Ch1, false);
    timer.set_compare_value(Compare::Ch1, 0);
    timer.set_output_compare_mode(Compare::Ch1, OutputCompareMode::PwmMode1);
    timer.enable_channel(Compare::Ch1, true);
    timer.start();
    timer
}

/// Lets the channel write words of the PSSI round and round.
fn start_channel(request: u8) {
    let channel = channel();
    for (number, item) in LIST.0.chunks(ITEM_WORDS).enumerate() {
        let next = link((number + 1) % BLOCKS);
        for (to, word) in item.iter().zip([block().0, address_of_block(number), next.0]) {
            to.store(word, Ordering::SeqCst);
        }
    }
    channel.cr().write(|control| control.set_reset(true));
    channel.tr1().write(|transfer| {
        transfer.set_sdw(Dw::WORD);
        transfer.set_ddw(Dw::WORD);
        transfer.set_dinc(true);
        transfer.set_sap(Ap::PORT1);
        transfer.set_dap(Ap::PORT0);
    });
    channel.tr2().write(|transfer| {
        transfer.set_dreq(Dreq::SOURCE_PERIPHERAL);
        transfer.set_reqsel(request);
    });
    channel.tr3().write(|_| {});
    channel.br1().write_value(block());
    channel.sar().write_value(PSSI.dr().as_ptr() as u32);
    channel.dar().write_value(address_of_block(0));
    channel.lbar().write(|base| base.set_lba((LIST.0.as_ptr() as u32 >> 16) as u16));
    channel.llr().write_value(link(1));
    channel.cr().write(|control| {
        control.set_prio(Prio::HIGH);
        control.set_en(true);
    });
}
