//! Where the registers of an STM32U5A5 are: addresses, names and interrupt numbers of ST's CMSIS header `stm32u5a5xx.h`,
//! clock enables of RM0456, 11.8. Not taken from the sources of the firmware's HAL.
//!
//! Only registers that a model knows are listed. An access to another one is a violation.

/// One peripheral.
#[derive(Debug)]
pub struct Block {
    pub name: &'static str,
    pub base: u32,
    pub bytes: u32,
    /// Register of the RCC and bit that switch its clock on; `None`: always on.
    pub clock: Option<(u32, u32)>,
    pub part: Part,
    /// Offset, name and value after a reset.
    pub registers: &'static [(u32, &'static str, u32)],
}

/// Which model a peripheral has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    Rcc,
    Pwr,
    Flash,
    Plain,
    Iwdg,
    Timer(usize),
    Gpio(usize),
    Exti,
    Adc,
    I2c,
    Spi,
    Octospim,
    Octospi,
    Dma,
    Pssi,
    Otg,
}

pub const AHB1ENR: u32 = 0x88;
pub const AHB2ENR1: u32 = 0x8C;
pub const AHB2ENR2: u32 = 0x90;
pub const AHB3ENR: u32 = 0x94;
pub const APB1ENR1: u32 = 0x9C;
pub const APB2ENR: u32 = 0xA4;
pub const APB3ENR: u32 = 0xA8;

pub const RCC: u32 = 0x4602_0C00;
pub const RCC_CSR: u32 = RCC + 0xF4;
pub const FLASH_ACR: u32 = 0x4002_2000;
pub const PWR: u32 = 0x4602_0800;
pub const GPIO: u32 = 0x4202_0000;
pub const EXTI: u32 = 0x4602_2000;
pub const ADC1: u32 = 0x4202_8000;
pub const OCTOSPI1: u32 = 0x420D_1400;
pub const OCTOSPIM: u32 = 0x420C_4000;
pub const GPDMA1: u32 = 0x4002_0000;
pub const I2C1: u32 = 0x4000_5400;
pub const SPI1: u32 = 0x4001_3000;
pub const PSSI: u32 = 0x4202_C400;
pub const SYSCFG: u32 = 0x4600_0400;
pub const OTG: u32 = 0x4204_0000;
pub const TIM3: usize = 0;
pub const TIM15: usize = 1;

/// Interrupts.
pub mod irq {
    pub const EXTI0: usize = 11;
    pub const GPDMA1_CHANNEL0: usize = 29;
    pub const GPDMA1_CHANNEL8: usize = 80;
    pub const TIM3: usize = 46;
    pub const I2C1_EV: usize = 55;
    pub const TIM15: usize = 69;
    pub const OTG_HS: usize = 73;
}

const TIMER: &[(u32, &str, u32)] = &[
    (0x00, "CR1", 0),
    (0x04, "CR2", 0),
    (0x0C, "DIER", 0),
    (0x10, "SR", 0),
    (0x14, "EGR", 0),
    (0x18, "CCMR1", 0),
    (0x1C, "CCMR2", 0),
    (0x20, "CCER", 0),
    (0x24, "CNT", 0),
    (0x28, "PSC", 0),
    (0x2C, "ARR", 0xFFFF),
    (0x34, "CCR1", 0),
    (0x38, "CCR2", 0),
    (0x3C, "CCR3", 0),
    (0x40, "CCR4", 0),
    (0x44, "BDTR", 0),
];

macro_rules! port {
    ($name:literal, $number:literal, $mode:literal, $speed:literal, $pull:literal) => {
        Block {
            name: $name,
            base: GPIO + 0x400 * $number,
            bytes: 0x400,
            clock: Some((AHB2ENR1, $number)),
            part: Part::Gpio($number),
            registers: &[
                (0x00, "MODER", $mode),
                (0x04, "OTYPER", 0),
                (0x08, "OSPEEDR", $speed),
                (0x0C, "PUPDR", $pull),
                (0x10, "IDR", 0),
                (0x14, "ODR", 0),
                (0x18, "BSRR", 0),
                (0x20, "AFRL", 0),
                (0x24, "AFRH", 0),
                (0x28, "BRR", 0),
            ],
        }
    };
}

pub const BLOCKS: &[Block] = &[
    Block {
        name: "TIM3",
        base: 0x4000_0400,
        bytes: 0x400,
        clock: Some((APB1ENR1, 1)),
        part: Part::Timer(TIM3),
        registers: TIMER,
    },
    Block {
        name: "IWDG",
        base: 0x4000_3000,
        bytes: 0x400,
        clock: None,
        part: Part::Iwdg,
        registers: &[
            (0x00, "KR", 0),
            (0x04, "PR", 0),
            (0x08, "RLR", 0xFFF),
            (0x0C, "SR", 0),
            (0x10, "WINR", 0xFFF),
        ],
    },
    Block {
        name: "I2C1",
        base: I2C1,
        bytes: 0x400,
        clock: Some((APB1ENR1, 21)),
        part: Part::I2c,
        registers: &[
            (0x00, "CR1", 0),
            (0x04, "CR2", 0),
            (0x08, "OAR1", 0),
            (0x10, "TIMINGR", 0),
            (0x18, "ISR", 1),
            (0x1C, "ICR", 0),
            (0x24, "RXDR", 0),
            (0x28, "TXDR", 0),
        ],
    },
    Block {
        name: "SPI1",
        base: SPI1,
        bytes: 0x400,
        clock: Some((APB2ENR, 12)),
        part: Part::Spi,
        registers: &[
            (0x00, "CR1", 0),
            (0x04, "CR2", 0),
            (0x08, "CFG1", 0x0007_0007),
            (0x0C, "CFG2", 0),
            (0x10, "IER", 0),
            (0x14, "SR", 0x1002),
            (0x18, "IFCR", 0),
            (0x20, "TXDR", 0),
            (0x30, "RXDR", 0),
        ],
    },
    Block {
        name: "TIM15",
        base: 0x4001_4000,
        bytes: 0x400,
        clock: Some((APB2ENR, 16)),
        part: Part::Timer(TIM15),
        registers: TIMER,
    },
    Block {
        name: "GPDMA1",
        base: GPDMA1,
        bytes: 0x1000,
        clock: Some((AHB1ENR, 0)),
        part: Part::Dma,
        registers: &[(0x00, "SECCFGR", 0), (0x04, "PRIVCFGR", 0), (0x0C, "MISR", 0)],
    },
    Block {
        name: "FLASH",
        base: 0x4002_2000,
        bytes: 0x400,
        clock: Some((AHB1ENR, 8)),
        part: Part::Flash,
        // The option bytes of a new chip, with a brown-out level of 2.8 V as the board's README asks for.
        registers: &[(0x00, "ACR", 1), (0x40, "OPTR", 0x1FEF_FCAA)],
    },
    Block {
        name: "ICACHE",
        base: 0x4003_0400,
        bytes: 0x400,
        clock: None,
        part: Part::Plain,
        registers: &[(0x00, "CR", 4), (0x04, "SR", 0)],
    },
    port!("GPIOA", 0, 0xABFF_FFFF, 0x0800_0000, 0x6400_0000),
    port!("GPIOB", 1, 0xFFFF_FEBF, 0x0000_00C0, 0x0000_0100),
    port!("GPIOC", 2, 0xFFFF_FFFF, 0, 0),
    port!("GPIOD", 3, 0xFFFF_FFFF, 0, 0),
    port!("GPIOE", 4, 0xFFFF_FFFF, 0, 0),
    port!("GPIOF", 5, 0xFFFF_FFFF, 0, 0),
    port!("GPIOG", 6, 0xFFFF_FFFF, 0, 0),
    port!("GPIOH", 7, 0xFFFF_FFFF, 0, 0),
    port!("GPIOI", 8, 0xFFFF_FFFF, 0, 0),
    port!("GPIOJ", 9, 0xFFFF_FFFF, 0, 0),
    Block {
        name: "ADC1",
        base: ADC1,
        bytes: 0x100,
        clock: Some((AHB2ENR1, 10)),
        part: Part::Adc,
        registers: &[
            (0x00, "ISR", 0),
            (0x04, "IER", 0),
            (0x08, "CR", 0x2000_0000),
            (0x0C, "CFGR1", 0x8000_0000),
            (0x10, "CFGR2", 0),
            (0x14, "SMPR1", 0),
            (0x18, "SMPR2", 0),
            (0x1C, "PCSEL", 0),
            (0x30, "SQR1", 0),
            (0x34, "SQR2", 0),
            (0x38, "SQR3", 0),
            (0x3C, "SQR4", 0),
            (0x40, "DR", 0),
            (0xC0, "DIFSEL", 0),
            (0xC4, "CALFACT", 0),
            (0xC8, "CALFACT2", 0),
        ],
    },
    Block {
        name: "ADC12_COMMON",
        base: 0x4202_8300,
        bytes: 0x100,
        clock: Some((AHB2ENR1, 10)),
        part: Part::Plain,
        registers: &[(0x00, "CSR", 0), (0x08, "CCR", 0)],
    },
    Block {
        name: "PSSI",
        base: PSSI,
        bytes: 0x400,
        clock: Some((AHB2ENR1, 12)),
        part: Part::Pssi,
        registers: &[(0x00, "CR", 0x4000_0000), (0x04, "SR", 0), (0x14, "ICR", 0), (0x28, "DR", 0)],
    },
    Block {
        name: "OTG_HS",
        base: OTG,
        bytes: 0x2_0000,
        clock: Some((AHB2ENR1, 14)),
        part: Part::Otg,
        registers: &[],
    },
    Block {
        name: "OCTOSPIM",
        base: OCTOSPIM,
        bytes: 0x400,
        clock: Some((AHB2ENR1, 21)),
        part: Part::Octospim,
        registers: &[(0x00, "CR", 0), (0x04, "P1CR", 0x0301_0111)],
    },
    Block {
        name: "OCTOSPI1",
        base: OCTOSPI1,
        bytes: 0x400,
        clock: Some((AHB2ENR2, 4)),
        part: Part::Octospi,
        registers: &[
            (0x000, "CR", 0),
            (0x008, "DCR1", 0),
            (0x00C, "DCR2", 0),
            (0x010, "DCR3", 0),
            (0x014, "DCR4", 0),
            (0x020, "SR", 0),
            (0x024, "FCR", 0),
            (0x040, "DLR", 0),
            (0x048, "AR", 0),
            (0x050, "DR", 0),
            (0x100, "CCR", 0),
            (0x108, "TCR", 0),
            (0x110, "IR", 0),
        ],
    },
    Block {
        name: "SYSCFG",
        base: SYSCFG,
        bytes: 0x400,
        clock: Some((APB3ENR, 1)),
        part: Part::Plain,
        registers: &[(0x04, "CFGR1", 0), (0x74, "OTGHSPHYCR", 0)],
    },
    Block {
        name: "PWR",
        base: PWR,
        bytes: 0x400,
        clock: Some((AHB3ENR, 2)),
        part: Part::Pwr,
        registers: &[
            (0x00, "CR1", 0),
            (0x08, "CR3", 0),
            (0x0C, "VOSR", 0x8000),
            (0x10, "SVMCR", 0),
            (0x28, "DBPR", 0),
            (0x2C, "UCPDR", 0),
            (0x3C, "SVMSR", 0x8002),
        ],
    },
    Block {
        name: "RCC",
        base: RCC,
        bytes: 0x400,
        clock: None,
        part: Part::Rcc,
        registers: &[
            (0x00, "CR", 0x35),
            (0x08, "ICSCR1", 0x4400_0000),
            (0x1C, "CFGR1", 0),
            (0x20, "CFGR2", 0x6000),
            (0x24, "CFGR3", 0),
            (0x28, "PLL1CFGR", 0),
            (0x2C, "PLL2CFGR", 0),
            (0x30, "PLL3CFGR", 0),
            (0x34, "PLL1DIVR", 0x0101_0280),
            (0x38, "PLL1FRACR", 0),
            (0x60, "AHB1RSTR", 0),
            (0x64, "AHB2RSTR1", 0),
            (0x68, "AHB2RSTR2", 0),
            (0x6C, "AHB3RSTR", 0),
            (0x74, "APB1RSTR1", 0),
            (0x7C, "APB2RSTR", 0),
            (0x80, "APB3RSTR", 0),
            (AHB1ENR, "AHB1ENR", 0xD020_0100),
            (AHB2ENR1, "AHB2ENR1", 0xC000_0000),
            (AHB2ENR2, "AHB2ENR2", 0xC000_0000),
            (AHB3ENR, "AHB3ENR", 0x8000_0000),
            (APB1ENR1, "APB1ENR1", 0),
            (0xA0, "APB1ENR2", 0),
            (APB2ENR, "APB2ENR", 0),
            (APB3ENR, "APB3ENR", 0),
            (0xE0, "CCIPR1", 0),
            (0xE4, "CCIPR2", 0),
            (0xE8, "CCIPR3", 0),
            (0xF0, "BDCR", 0),
            (0xF4, "CSR", 0x0C00_4400),
        ],
    },
    Block {
        name: "EXTI",
        base: EXTI,
        bytes: 0x400,
        clock: None,
        part: Part::Exti,
        registers: &[
            (0x00, "RTSR1", 0),
            (0x04, "FTSR1", 0),
            (0x0C, "RPR1", 0),
            (0x10, "FPR1", 0),
            (0x60, "EXTICR1", 0),
            (0x64, "EXTICR2", 0),
            (0x68, "EXTICR3", 0),
            (0x6C, "EXTICR4", 0),
            (0x80, "IMR1", 0),
            (0x84, "EMR1", 0),
        ],
    },
    Block {
        name: "DBGMCU",
        base: 0xE004_4000,
        bytes: 0x400,
        clock: None,
        part: Part::Plain,
        registers: &[(0x00, "IDCODE", 0x3000_6481), (0x04, "CR", 0), (0x08, "APB1FZR1", 0)],
    },
];

/// Registers of one channel of the GPDMA, which begin at 0x50, 0x80 bytes a channel.
pub const CHANNEL: &[(u32, &str)] = &[
    (0x00, "CLBAR"),
    (0x0C, "CFCR"),
    (0x10, "CSR"),
    (0x14, "CCR"),
    (0x40, "CTR1"),
    (0x44, "CTR2"),
    (0x48, "CBR1"),
    (0x4C, "CSAR"),
    (0x50, "CDAR"),
    (0x54, "CTR3"),
    (0x58, "CBR2"),
    (0x7C, "CLLR"),
];

/// The peripheral at this address.
#[must_use]
pub fn block(address: u32) -> Option<&'static Block> {
    BLOCKS.iter().find(|block| address.wrapping_sub(block.base) < block.bytes)
}

/// The place of a register in words.
#[must_use]
pub fn name(address: u32) -> String {
    let Some(block) = block(address) else { return format!("{address:#010x}") };
    let offset = address - block.base;
    let found = block.registers.iter().find(|(at, ..)| *at == offset & !3);
    match (found, block.part) {
        (Some((_, name, _)), _) => format!("{}.{name}", block.name),
        (None, Part::Dma) if offset >= 0x50 => {
            let (channel, of) = ((offset - 0x50) / 0x80, (offset - 0x50) % 0x80);
            let name = CHANNEL.iter().find(|(at, _)| *at == of & !3).map_or("?", |(_, name)| name);
            format!("GPDMA1.C{channel}.{name}")
        }
        _ => format!("{}+{offset:#x}", block.name),
    }
}
