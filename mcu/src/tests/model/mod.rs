//! Model checking: every state that the firmware's session can reach, under every order of host
//! commands, FPGA events, losses, restarts and steps of time.
//!
//! `world` is one state: the real firmware, a fake FPGA, and the monitors of what must hold. This
//! module walks breadth first from power-up over all actions. Two states that no later action can
//! tell apart are one state (`World::key`), so the walk ends by itself when nothing new appears. The
//! graph then shows what no single step can: every state has a way out, and every run ends.
//!
//! What the walk leaves out is stated in `docs/log/firmware.md`, beside its figures.

mod world;

use std::collections::{HashMap, VecDeque};
use std::format;
use std::println;
use std::string::String;
use std::sync::Mutex;
use std::thread;
use std::vec;
use std::vec::Vec;
use world::{Action, Trouble, World};

/// More states than any walk of this machine has: a key has forgotten to forget something.
const MOST_STATES: usize = 400_000;

/// An edge that does not exist: the action cannot be taken in that state.
const NONE: u32 = u32::MAX;

/// Everything that can be reached with some actions and some troubles at a time.
struct Graph {
    actions: Vec<Action>,
    /// One row a state, one column an action.
    edges: Vec<u32>,
    /// What the walk has noted of each state.
    notes: Vec<world::Note>,
    /// From which state, and by which action, each state was found first.
    parents: Vec<(u32, u8)>,
    depth: usize,
}

impl Graph {
    /// Walks from power-up until no action leads to a new state.
    fn walk(walk: &Walk) -> Self {
        let &Walk { ref actions, troubles, window, .. } = walk;
        let mut graph = Self {
            actions: actions.clone(),
            edges: Vec::new(),
            notes: Vec::new(),
            parents: Vec::new(),
            depth: 0,
        };
        let mut seen = HashMap::new();
        let start = World::new(walk.tries_enables);
        seen.insert(start.key(), 0);
        graph.notes.push(start.note());
        graph.parents.push((NONE, 0));
        let mut layer = vec![start];
        let mut first = 0u32;
        while !layer.is_empty() {
            let mut next = Vec::new();
            for (state, world) in (first..).zip(&layer) {
                for (column, &action) in (0..).zip(actions) {
                    if !world.can(action, troubles, window) {
                        graph.edges.push(NONE);
                        continue;
                    }
                    let mut after = world.clone();
                    if let Err(broken) = after.take(action) {
                        panic!("{broken}\nafter {:#?} and {action:?}", graph.path(state));
                    }
                    let number = graph.notes.len() as u32;
                    let number = *seen.entry(after.key()).or_insert_with(|| {
                        graph.notes.push(after.note());
                        graph.parents.push((state, column));
                        next.push(after);
                        number
                    });
                    graph.edges.push(number);
                }
            }
            first += layer.len() as u32;
            let states = graph.notes.len();
            assert!(
                states < MOST_STATES,
                "{} grows without end, as by {:#?}",
                walk.name,
                graph.path(states as u32 - 1)
            );
            graph.depth += usize::from(!next.is_empty());
            layer = next;
        }
        graph
    }

    /// The actions by which a state was found first.
    fn path(&self, mut state: u32) -> Vec<Action> {
        let mut path = Vec::new();
        while let (parent, column) = self.parents[state as usize]
            && parent != NONE
        {
            path.push(self.actions[usize::from(column)]);
            state = parent;
        }
        path.reverse();
        path
    }

    fn after(&self, state: u32, action: Action) -> Option<u32> {
        let column = self.actions.iter().position(|&known| known == action)?;
        let edge = self.edges[state as usize * self.actions.len() + column];
        (edge != NONE).then_some(edge)
    }

    /// The most actions of this kind that any state needs to a state of that kind.
    fn farthest(
        &self,
        goal: impl Fn(&world::Note) -> bool,
        allowed: impl Fn(Action) -> bool,
    ) -> Result<usize, String> {
        let width = self.actions.len();
        let mut sources: Vec<Vec<u32>> = vec![Vec::new(); self.notes.len()];
        for (at, &to) in self.edges.iter().enumerate() {
            if to != NONE && allowed(self.actions[at % width]) {
                sources[to as usize].push((at / width) as u32);
            }
        }
        let mut distance = vec![NONE; self.notes.len()];
        let mut queue = VecDeque::new();
        for (state, note) in (0..).zip(&self.notes) {
            if goal(note) {
                distance[state as usize] = 0;
                queue.push_back(state);
            }
        }
        while let Some(state) = queue.pop_front() {
            for &source in &sources[state as usize] {
                if distance[source as usize] == NONE {
                    distance[source as usize] = distance[state as usize] + 1;
                    queue.push_back(source);
                }
            }
        }
        let (state, farthest) =
            (0..).zip(&distance).max_by_key(|&(_, far)| far).expect("there is a first state");
        if *farthest == NONE {
            return Err(format!("no way out after {:#?}", self.path(state)));
        }
        Ok(*farthest as usize)
    }

    /// The most rounds of these actions, one after the other as far as each can be taken, until a busy camera
    /// rests.
    fn longest_run(&self, round: &[Action]) -> Result<usize, String> {
        let mut longest = 0;
        for (start, note) in (0..).zip(&self.notes) {
            let (mut state, mut rounds) = (start, 0);
            while note.busy && self.notes[state as usize].busy {
                for &action in round {
                    state = self.after(state, action).unwrap_or(state);
                }
                rounds += 1;
                if rounds > 20 {
                    return Err(format!("{round:?} for ever after {:#?}", self.path(start)));
                }
            }
            longest = longest.max(rounds);
        }
        Ok(longest)
    }
}

/// One walk: its name, its actions, how many troubles may stand at a time.
struct Walk {
    name: &'static str,
    actions: Vec<Action>,
    troubles: u32,
    /// How many commands may wait for their replies at a time.
    window: usize,
    /// The first light waits for the test of the LED enables.
    tries_enables: bool,
}

/// The actions of every walk, more, and the beginning and end of these troubles.
fn with(more: &[Action], troubles: &[Trouble]) -> Vec<Action> {
    use Action::*;
    let mut actions =
        vec![Tick, Poll, Close, Hello, Configure, StartEndless, StartTwo, Stop, Status, Frame];
    actions.extend(more);
    actions.extend(troubles.iter().flat_map(|&trouble| [Begin(trouble), End(trouble)]));
    actions
}

fn walk(name: &'static str, actions: Vec<Action>, troubles: u32, window: usize) -> Walk {
    Walk { name, actions, troubles, window, tries_enables: false }
}

fn walks() -> Vec<Walk> {
    use Action::*;
    use Trouble::*;
    vec![
        walk("one host, nothing fails", with(&[SelfTest, Burst], &[LinkFull]), 1, 2),
        walk("the FPGA fails", with(&[Reset, Latch, Spoil], &[BusDead, BusDeaf, NoClock]), 1, 1),
        walk("two failures of the bus", with(&[], &[BusDead, BusDeaf]), 2, 1),
        walk("a full link", with(&[Spoil, SelfTest], &[LinkFull, Interlock]), 1, 1),
        walk(
            "sensors and link",
            with(&[], &[Interlock, FpgaInterlock, Hot, Warm, NoSensor, LinkFull]),
            2,
            1,
        ),
        walk("damaged and unknown commands", with(&[Damaged, Unknown], &[LinkFull]), 1, 2),
        walk("two hosts, restarts", with(&[Stranger, Reboot, Crash], &[LinkFull, BusDeaf]), 1, 2),
        walk(
            "self-test, burst and gateware while something fails",
            with(
                &[Burst, SelfTest, FirstPiece, LastPiece],
                &[LinkFull, BusDeaf, BusDead, Interlock],
            ),
            1,
            1,
        ),
        Walk {
            tries_enables: true,
            ..walk(
                "the first light tries the LED enables",
                with(&[Burst, SelfTest, Reset, FirstPiece, LastPiece], &[BusDeaf, Interlock]),
                1,
                1,
            )
        },
    ]
}

#[test]
fn every_reachable_state_keeps_the_laws_of_light() {
    hold(walks());
}

/// Checks each walk. As many threads as the machine has processors take one walk after another.
fn hold(walks: Vec<Walk>) {
    let (left, total) = (Mutex::new(walks.into_iter()), Mutex::new((0, 0)));
    let next = || left.lock().unwrap().next();
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(walk) = next() {
                    let (states, steps) = hold_one(&walk);
                    let mut total = total.lock().unwrap();
                    *total = (total.0 + states, total.1 + steps);
                }
            });
        }
    });
    let (states, steps) = *total.lock().unwrap();
    println!("{states} states, {steps} steps");
}

/// Checks a walk; its numbers of states and steps.
fn hold_one(walk: &Walk) -> (usize, usize) {
    let (name, begun) = (walk.name, std::time::Instant::now());
    let graph = Graph::walk(walk);
    let states = graph.notes.len();
    let steps = graph.edges.iter().filter(|&&edge| edge != NONE).count();
    // Time passes, troubles end, the link closes, and a host greets and acknowledges what has latched.
    let repairs = |action| {
        use Action::{Close, Configure, End, Hello, Poll, Tick};
        matches!(action, Tick | Poll | Close | End(_) | Hello | Configure)
    };
    let dark = graph.farthest(|note| note.dark_and_idle, repairs).unwrap();
    let lit = graph.farthest(|note| note.shines, |_| true).unwrap();
    let silent = graph.longest_run(&[Action::Tick]).unwrap();
    let asked = graph.longest_run(&[Action::Status, Action::Tick]).unwrap();
    println!(
        "{name}: {states} states, {steps} steps, depth {}; at most {dark} actions to a dark idle \
         state, {lit} to light, {silent} ticks until a run without a host ends, {asked} until \
         a run without frames ends; {:.1} s",
        graph.depth,
        begun.elapsed().as_secs_f64(),
    );
    (states, steps)
}
