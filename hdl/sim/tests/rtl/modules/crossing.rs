//! Tests of accesses that cross between the two clocks.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![
    every_access_comes_over_once_and_whole_and_its_answer_back,
    an_access_that_comes_before_the_last_answer_is_dropped,
];

/// Operation, address, data.
type Access = [u64; 3];

/// Both sides of the crossing; the test chooses the order of the clocks.
struct Rig {
    bench: Bench,
    /// Accesses that arrived on the other side.
    requests: Vec<Access>,
    /// Answers that arrived back.
    answers: Vec<u64>,
}

impl Rig {
    fn new(project: &Project) -> Self {
        let mut bench = Bench::new(project, "crossing");
        bench.reset("clk_host", "rst_host");
        bench.reset("clk_adc", "rst_adc");
        Self { bench, requests: Vec::new(), answers: Vec::new() }
    }

    fn at_engine(&mut self) -> Access {
        ["operation", "address", "data"].map(|port| self.bench.get(port))
    }

    fn host_edge(&mut self) {
        if self.bench.is("back") {
            self.answers.push(self.bench.get("value_out"));
        }
        self.bench.edge("clk_host");
    }

    fn adc_edge(&mut self) {
        if self.bench.is("request") {
            let access = self.at_engine();
            self.requests.push(access);
        }
        self.bench.edge("clk_adc");
    }

    /// Makes `count` edges of one clock with random edges of the other between them; the crossing
    /// access must stay unchanged meanwhile.
    fn edges(&mut self, dice: &mut Dice, count: u64, stands: Option<Access>) {
        let host_is_slow = dice.once_in(2);
        let at_most = dice.range(1, 6);
        for _ in 0..count {
            let others = dice.range(1, at_most);
            for edge in 0..=others {
                if (edge == 0) == host_is_slow {
                    self.host_edge();
                } else {
                    self.adc_edge();
                }
                if let Some(access) = stands {
                    assert_eq!(self.at_engine(), access);
                }
            }
        }
    }

    fn send(&mut self, access: Access) {
        for (port, value) in ["operation_in", "address_in", "data_in"].into_iter().zip(access) {
            self.bench.set(port, value);
        }
        self.bench.set("send", true);
        self.host_edge();
        self.bench.set("send", false);
        // The host moves on to another access.
        for port in ["operation_in", "address_in", "data_in"] {
            self.bench.set(port, 0u64);
        }
    }

    fn answer(&mut self, value: u64) {
        self.bench.set("value", value);
        self.bench.set("answered", true);
        self.adc_edge();
        self.bench.set("answered", false);
        self.bench.set("value", !value);
    }
}

fn random(dice: &mut Dice) -> Access {
    [dice.range(0, 3), dice.range(0, 0xFFFF), dice.range(0, 0xFFFF_FFFF)]
}

fn every_access_comes_over_once_and_whole_and_its_answer_back(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(31);
    let mut epoch = 0;
    for round in 0..500 {
        let access = random(dice);
        rig.send(access);
        // A stream begins a new epoch.
        epoch ^= access[0] >> 1;
        rig.edges(dice, 5, Some(access));
        assert_eq!(rig.requests, [access], "round {round}");
        assert_eq!([rig.bench.get("epoch_host"), rig.bench.get("epoch_adc")], [epoch; 2]);
        assert!(rig.answers.is_empty(), "round {round}");
        let value = dice.range(0, 0xFFFF_FFFF);
        rig.answer(value);
        rig.edges(dice, 5, Some(access));
        assert_eq!(rig.answers, [value], "round {round}");
        assert_eq!(rig.requests.len(), 1, "round {round}");
        rig.requests.clear();
        rig.answers.clear();
    }
}

fn an_access_that_comes_before_the_last_answer_is_dropped(project: &Project) {
    let mut rig = Rig::new(project);
    let dice = &mut Dice::new(32);
    for round in 0..200 {
        let access = random(dice);
        rig.send(access);
        let epoch = rig.bench.get("epoch_host");
        for _ in 0..dice.range(1, 3) {
            let count = dice.range(0, 9);
            rig.edges(dice, count, Some(access));
            let too_early = random(dice);
            rig.send(too_early);
        }
        rig.edges(dice, 5, Some(access));
        assert_eq!(rig.requests, [access], "round {round}");
        assert_eq!(rig.bench.get("epoch_host"), epoch, "round {round}");
        rig.answer(round);
        rig.edges(dice, 5, None);
        assert_eq!(rig.answers, [round]);
        rig.requests.clear();
        rig.answers.clear();
    }
}
