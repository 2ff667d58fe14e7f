//! Deliberate faults in the RTL: the module's own bench and the equivalence runs must both notice
//! each fault.
//!
//! # Invariant
//! A fault is one substitution of text that still passes the analyser. A fault that one of the two
//! does not notice fails the test, and so does a law that no fault breaks
//! (`every_deliberate_fault_is_seen_and_every_law_can_be_broken`).

use crate::equivalence;
use crate::modules::{self, Law};
use crate::project::Project;
use std::cell::Cell;
use std::collections::BTreeSet;
use std::panic::{catch_unwind, set_hook, take_hook};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::ScopedJoinHandle;

/// A fault: what is broken, the file, the original text, the replacement.
type Fault = (&'static str, &'static str, &'static str, &'static str);

/// The faults.
#[rustfmt::skip]
const FAULTS: &[Fault] = &[
    ("a slot is a clock short", "registers", "next.dwell_less_1     = dwell[15:0] - 1;", "next.dwell_less_1     = dwell[15:0] - 2;"),
    ("dwell 1 is not known", "registers", "next.single_clock     = dwell == 1;", "next.single_clock     = 0;"),
    ("the window opens a clock early", "sequencer", "counts     = counts || skip_left == 1;", "counts     = counts || skip_left == 2;"),
    ("the first sample of an unblanked slot is left out", "registers", "next.unblanked        = blank == 0;", "next.unblanked        = 0;"),
    ("latency is one clock less", "window", "assign arrives = waiting && left == 0;", "assign arrives = waiting && (left == 1 || settings.latency == 0);"),
    ("latency drops its top bit", "registers", "next.latency          = latency[5:0];", "next.latency          = {1'b0, latency[4:0]};"),
    ("the sample is taken a clock late", "source", "sample = pins;", "sample.code = pins.code + 0; sample.over_range = over_range;"),
    ("complements are not inverted", "leds", "sign_lines(pattern[9:5]) ^ {inverts_rows[2] repeat 32}", "sign_lines(pattern[9:5]) ^ {inverts[2] repeat 32}"),
    ("complements invert a clock late", "leds", "{inverts_rows[2] repeat 32}", "{complement[3] repeat 32}"),
    ("sweeps do not alternate", "sequencer", "swapped  = settings.alternating && !swapped;", "swapped  = 0;"),
    ("every sweep but the first shows complements first", "sequencer", "swapped  = settings.alternating && !swapped;", "swapped  = settings.alternating;"),
    ("frames alternate, not sweeps", "sequencer", "} else if sweep_over {\n            swapped ", "} else if frame_over {\n            swapped "),
    ("a run goes on alternating where the last one stopped", "sequencer", "} else if start {\n            swapped  = 0;", "} else if start {\n            swapped  = swapped;"),
    ("patterns without complements alternate too", "registers", "next.alternating      = (mode & MODE_ALTERNATING) != 0 && (mode & MODE_DIFFERENTIAL) != 0;", "next.alternating      = (mode & MODE_ALTERNATING) != 0;"),
    ("no sweep inverts the lines", "sequencer", "inverted = inverted ^ swapped;", "inverted = 0;"),
    ("every second sweep inverts the lines", "sequencer", "inverted = inverted ^ swapped;", "inverted = swapped;"),
    ("a run goes on inverting where the last one stopped", "sequencer", "inverted = 0;\n        } else if sweep_over", "inverted = inverted;\n        } else if sweep_over"),
    ("the column lines are not inverted with the rows", "leds", "sign_lines(pattern[4:0]) ^ {inverts[2] repeat 32};", "sign_lines(pattern[4:0]);"),
    ("the column lines invert a clock early", "leds", "sign_lines(pattern[4:0]) ^ {inverts[2] repeat 32};", "sign_lines(pattern[4:0]) ^ {inverts[1] repeat 32};"),
    ("rows and columns are swapped", "leds", "sign_lines(pattern[4:0]) ^", "sign_lines(pattern[9:5]) ^"),
    ("sequency order is not Gray", "leds", "gray = index_2 ^ (index_2 >> 1);", "gray = index_2;"),
    ("sequency wins over the table", "leds", "if settings.order_table {", "if settings.order_table && !settings.order_sequency {"),
    ("the halves are swapped", "formatter", "assign sum_address = {negative, index};", "assign sum_address = {~negative, index};"),
    ("the banks are swapped for the host", "accumulators", "host_word = if reading[0] ? word[0] : if reading[1] ? word[1]", "host_word = if reading[0] ? word[1] : if reading[1] ? word[0]"),
    ("the first sweep adds to the last frame", "accumulators", "if first_2 {", "if 1'b0 {"),
    ("a first sweep takes what an older slot left", "accumulators", "&& address[d + 1] == address[1] && !first_1;", "&& address[d + 1] == address[1];"),
    ("no forwarding from 1 clock ago, low", "accumulators", "if again_3[1] ? low_4[HALF - 1:0] : low_3", "if 1'b0 ? low_4[HALF - 1:0] : low_3"),
    ("no forwarding from 1 clock ago, high", "accumulators", "if again_4 ? high_5 : high_4", "if 1'b0 ? high_5 : high_4"),
    ("no forwarding from 2 clocks ago, low", "accumulators", "{high_3, low_3} = {high_5, low_4[HALF - 1:0]};", "{high_3, low_3} = fetched;"),
    ("no forwarding from 2 clocks ago, high", "accumulators", "high_4 = if again_3[2] ? high_5 : high_3;", "high_4 = high_3;"),
    ("no forwarding from 3 clocks ago", "accumulators", "{high_3, low_3} = {high_5, low_5};", "{high_3, low_3} = fetched;"),
    ("no forwarding from 4 clocks ago", "accumulators", "{high_3, low_3} = word_6;", "{high_3, low_3} = fetched;"),
    ("no forwarding from 5 clocks ago", "accumulators", "{high_3, low_3} = word_7;", "{high_3, low_3} = fetched;"),
    ("the carry between the halves is lost", "accumulators", "{sum_4 as CARRY, low_4[HALF]};", "{sum_4 as CARRY, 1'b0};"),
    ("overflow is not seen", "accumulators", "wrapped = total[HALF];", "wrapped = 0;"),
    ("overflow sticks to the next frame", "frames", "            wrapped = 0;\n            made    = made + 1;", "            made    = made + 1;"),
    ("a slot's sum goes on into the next", "window", "(if place.slot_first ? 0 : sum)", "sum"),
    ("one sweep too many", "registers", "next.sweeps_less_1    = sweeps - 1;", "next.sweeps_less_1    = sweeps;"),
    ("a run has a frame too many", "registers", "next.frames_less_1    = frames - 1;", "next.frames_less_1    = frames;"),
    ("one pattern too many", "sequencer", "index_last = if index_last ? settings.single_pattern : index_left == 1;", "index_last = if index_last ? settings.single_pattern : index_left == 0;"),
    ("a held frame is overwritten", "frames", "assign full  = behind && !give_back;", "assign full  = 0;"),
    ("only one frame waits", "frames", "assign full  = behind && !give_back;", "assign full  = held;"),
    ("a release makes no room for the frame that is complete with it", "frames", "assign full  = behind && !give_back;", "assign full  = behind;"),
    ("a release gives back what waits too", "frames", "            ready   = held;\n", "            ready   = ready && !give_back;\n"),
    ("the frame that waits is never told", "frames", "            behind  = held;\n", "            behind  = 0;\n"),
    ("the frame behind comes with the header of the one before", "frames", "} else if gives {\n            header = header_two;", "} else if 1'b0 {\n            header = header_two;"),
    ("the next frame changes the header of the delivered one", "frames", "if done && !held {\n            header = newest;", "if done && !full {\n            header = newest;"),
    ("a lost frame changes the header of the one that waits", "frames", "if done && !full {\n            header_two = newest;", "if done {\n            header_two = newest;"),
    ("a release of nothing goes on to the next bank", "frames", "assign gives = give_back && ready;", "assign gives = give_back;"),
    ("a release with the end of a frame stays at its bank", "frames", "            if gives {\n                reading = {reading[1:0], reading[2]};\n            }\n        } else {", "        } else {"),
    ("a restart leaves the host at the bank of the last run", "frames", "            reading    = filling;\n", "            reading    = reading;\n"),
    ("a frame that waits outlives a restart", "frames", "            reading    = filling;\n            ready      = 0;\n            behind     = 0;\n", "            reading    = filling;\n            ready      = 0;\n            behind     = behind;\n"),
    ("the third bank is read as the second", "accumulators", "if reading[1] ? word[1] : word[2];", "if reading[1] ? word[1] : word[1];"),
    ("the third bank adds to what the second has", "accumulators", "if bank_2[1] ? word[1] : word[2];", "if bank_2[1] ? word[1] : word[1];"),
    ("the third bank is written with the first", "accumulators", "assign ours = filling[i];", "assign ours = filling[i] || i == 2 && filling[0];"),
    ("the host reads the bank that is filled", "engine", "        reading               ,\n        place ", "        reading     : filling ,\n        place "),
    ("a lost frame is not counted", "frames", "lost       = lost + 1;", "lost       = lost;"),
    ("no frame says that one was lost", "frames", "                after_loss = 1;", "                after_loss = 0;"),
    ("counters of the last run stay", "frames", "            behind     = 0;\n            made       = 0;\n            lost       = 0;\n            wrapped    = 0;\n            after_loss = 0;\n        } else if done", "            behind     = 0;\n            lost       = 0;\n            wrapped    = 0;\n            after_loss = 0;\n        } else if done"),
    ("a frame of the last run stays", "frames", "            reading    = filling;\n            ready      = 0;", "            reading    = filling;\n            ready      = held;"),
    ("the time of a frame is off by one", "engine", "64'd2 - settings.latency", "64'd1 - settings.latency"),
    ("the high word of the clock is not held", "registers", "clock_read = clock_now;", "clock_read = {clock_now[31:0], clock_now[31:0]};"),
    ("over-range samples of the whole run are counted", "over_counter", "assign so_far = if first_1[1] ? 0 : count_3;", "assign so_far = count_3;"),
    ("over-range samples before the light count", "engine", "counts : place.active || raw_active,", "counts : 1'b1,"),
    ("over-range trips one late", "over_counter", "fits >= trip", "fits >: trip"),
    ("over-range never trips", "over_counter", "hit_4    = counts_1[2] && trips", "hit_4    = 1'b0 && trips"),
    ("the watchdog is one clock late", "registers", "next.watchdog_less_1  = watchdog[26:0] - 1;", "next.watchdog_less_1  = watchdog[26:0];"),
    ("reads do not feed the watchdog", "engine", "feed            : access ", "feed            : write "),
    ("the watchdog never barks", "watchdog", "assign barks   = if renewed ? at_once : last;", "assign barks   = 0;"),
    ("pattern 0 costs as any other", "engine", "{full_late[6], lit_late[6] && !full_late[6]", "{1'b0, lit_late[6]"),
    ("a dark complement costs light", "engine", "&& !full_late[6] && !dark_late[6]}", "&& !full_late[6]}"),
    ("a start renews the light budget", "duty", "left          = limit as 22 - (if window_first ? 0 : spent);", "left          = limit as 22;"),
    ("duty windows never end", "duty", "spent         = (if window_first ? 0 : spent)", "spent         = spent"),
    ("the duty limit may be used up to one more", "duty", "below_1       = less_1[21];", "below_1       = after[21];"),
    ("an open interlock does not put the LEDs out at once", "safety", "assign permitted = interlock_now && !dropped && ", "assign permitted = "),
    ("a tripped LED stays on a clock longer", "leds", "enable  = shines && permit;", "enable  = shines;"),
    ("a run without light is lit", "leds", "lights = active[2] && !settings.unlit;", "lights = active[2];"),
    ("a run without light shows no lines", "leds", "assign shown  = active[3] &&", "assign shown  = lights &&"),
    ("every run is lit", "registers", "next.unlit            = (mode & MODE_UNLIT) != 0;", "next.unlit            = 0;"),
    ("an open interlock ends no run", "safety", "assign opens     = running && !interlock_closed;", "assign opens     = 0;"),
    ("a closed interlock lights a run up again", "safety", "interlock_now && !dropped &&", "interlock_now &&"),
    ("over-range is latched as duty", "safety", "fault = register_map::FAULT_OVER_RANGE as 3;", "fault = register_map::FAULT_DUTY as 3;"),
    ("a fault does not end the run", "control", "} else if stop || opens || trips || ends {", "} else if stop || opens || ends {"),
    ("a fault may be cleared by the wrong bit", "control", "(data & CONTROL_CLEAR_FAULT) != 0", "(data & CONTROL_RELEASE) != 0"),
    ("a start is accepted with a fault latched", "control", "&& (clear || fault == 0 && !opens)", ""),
    ("settings out of range are accepted", "control", "begins      = wanted && in_range;", "begins      = wanted;"),
    ("blanking may be as long as the slot", "registers", "blank <: dwell", "blank <= dwell"),
    ("a setting counts in the run under way", "registers", "} else if copy {", "} else if copy || write {"),
    ("the table can be written in a run", "control", "table_write = access && to_table && !running;", "table_write = access && to_table;"),
    ("a refused write is not reported", "control", "write_refused = 1;", "write_refused = 0;"),
    ("a stop ends no run", "control", "(data & CONTROL_STOP) != 0", "1'b0"),
    ("a release gives nothing back", "control", "(data & CONTROL_RELEASE) != 0", "1'b0"),
    ("the test generator has another polynomial", "source", "generator[13] ^ generator[4]", "generator[13] ^ generator[5]"),
    ("a burst is a sample short", "raw_capture", "is_last = left == 1;", "is_last = left == 2;"),
    ("a burst loses its over-range flag", "raw_capture", "host_word = {fetched[14],", "host_word = {1'b0,"),
    ("the checksum leaves the header out", "formatter", "covered    = open_frame;", "covered    = 0;"),
    ("the checksum has another polynomial", "crc32", "32'hEDB88320", "32'hEDB88321"),
    ("without complements the negative half is what was there", "formatter", "negative && !settings.differential", "1'b0"),
    ("an abandoned transfer goes on in the next", "spi_slave", "assign stale    = !empty && fifo_data[8] != epoch;", "assign stale    = 0;"),
    ("the FIFO overruns", "byte_fifo", "assign full  = written_gray == (taken_there ^ 5'b11000);", "assign full  = 0;"),
    ("a write is carried out before its check", "spi_slave", "data  = next;\n                            phase = Phase::Check;", "data  = next;\n                            send  = 1;\n                            phase = Phase::Check;"),
    ("a level is in step a clock early", "synchroniser", "to    = first;", "to    = from;"),
    ("a level is seen as it was in reset", "synchroniser", "first = from;", "first = 0;"),
    ("the sequencer's table misses what the host writes", "order_table", "copy[host_address] = host_data;\n        }\n        fetched", "copy[host_address] = 0;\n        }\n        fetched"),
    ("a sum is read a clock early", "bank_ram", "read_data = fetched;", "read_data = words[read_address];"),
    ("sums of the upper half of a bank fall on the lower", "bank_ram", "words[write_address] = write_data;", "words[write_address & 11'h3FF] = write_data;"),
    ("an access comes over twice", "crossing", "asked_last = asked_here;", "asked_last = if answered ? asked_here : asked_last;"),
    ("a stream goes on in the epoch of the last", "crossing", "epoch_host = ~epoch_host;", "epoch_host = epoch_host;"),
    ("the answer is that of the access before", "crossing", "held_value = value;", "held_value = if asked_last ? value : held_value;"),
    ("the lines are driven on when the host lets go", "core", "(drive | {drives repeat 4}) & {~spi_cs_n repeat 4};", "(drive | {drives repeat 4});"),
    ("an access is answered before it is done", "control", "const ANSWER: u32 = types::DEPTH + 6;", "const ANSWER: u32 = 0;"),
    ("a run ends a clock before its last frame is done", "engine", "ends       = run_last[4]", "ends       = run_last[3]"),
    ("a burst has its high bytes first", "formatter", "{48'b0, raw_word}", "{48'b0, raw_word[7:0], raw_word[15:8]}"),
    ("light goes on for some clocks after a run", "leds", "} else if halt {\n            active = 0;", "} else if 1'b0 {\n            active = 0;"),
    ("frames are recorded like a burst", "raw_capture", "active  = settings.raw;", "active  = 1;"),
    ("a register reads as its neighbour", "registers", "(blank & {asked[4] repeat 32})", "(dwell & {asked[4] repeat 32})"),
    ("a stop may trip", "safety", "assign counts    = running && !opens && !stop;", "assign counts    = (running || stop) && !opens;"),
    ("a burst is summed like a frame", "window", "waiting = !settings.raw;", "waiting = 1;"),
    ("a damaged write is carried out", "spi_slave", "send  = extended == 0;", "send  = 1;"),
    ("an answer has no check", "spi_slave", "out = {extended, 16'b0};", "out = 0;"),
    ("the check leaves the address out", "spi_slave", "check = extended;\n                        if left == 0 {\n                            address", "if left == 0 {\n                            address"),
    ("a write is not counted", "registers", "writes = writes + 1;", "writes = writes;"),
    ("a glitch of one clock is an edge", "glitch_filter", "level && last || last && earlier || level && earlier", "last"),
    ("a glitch in a level ends the level", "glitch_filter", "level && last || last && earlier || level && earlier", "level && last"),
    ("the parallel port does not ask its receiver", "parallel_port", "phase == 2 && ready && there", "phase == 2 && there"),
    ("the parallel port takes bytes that it does not send", "parallel_port", "assign taken     = puts && part == Part::Packet;", "assign taken     = phase == 2 && valid && part == Part::Packet;"),
    ("the parallel port sends bytes that are not there", "parallel_port", "part == Part::Packet && valid ||", "part == Part::Packet ||"),
    ("no zero goes before a packet", "parallel_port", "if open {\n                    part = Part::Before;", "if open {\n                    part = Part::Packet;"),
    ("two zeros go behind a packet", "parallel_port", "left = 2;", "left = 1;"),
    ("a start cuts no packet", "parallel_port", "} else if restart {", "} else if 1'b0 {"),
    ("a sent frame is not given back", "parallel_port", "assign give_back = part == Part::Sent;", "assign give_back = 0;"),
    ("a frame is given back before its last zeros", "parallel_port", "assign give_back = part == Part::Sent;", "assign give_back = part == Part::Behind && left == 2 && puts;"),
    ("a packet is opened with the start that ends it", "parallel_port", "&& frame && !restart;", "&& frame;"),
    ("a port that is off opens packets", "parallel_port", "part == Part::Idle && on && frame", "part == Part::Idle && frame"),
    ("the strobe of a port that is off goes on", "parallel_port", "runs   = on;", "runs   = 1;"),
    ("the strobe stops in the middle of a period", "parallel_port", "strobe[1] = runs && phase == 1;", "strobe[1] = on && phase == 1;"),
    ("the strobe rises too late", "parallel_port", "strobe[0] = runs && phase != 2;", "strobe[0] = runs && phase == 1;"),
    ("the lines keep the last byte", "parallel_port", "if taken ? octet : 0;", "if taken ? octet : lines;"),
    ("a period has four clocks", "parallel_port", "if phase == 2 {\n                phase  = 0;", "if phase == 3 {\n                phase  = 0;"),
    ("the host's release gives the parallel port's frame back", "engine", "if parallel ? sent : give_back,", "sent || give_back,"),
    ("the host sees a frame of the parallel port as ready", "engine", "assign frame_ready = waits && !parallel;", "assign frame_ready = waits;"),
    ("bytes of the parallel port go to the host too", "engine", "packet_valid && !parallel || format_valid;", "packet_valid || format_valid;"),
    ("a read of the host ends the packet of the parallel port", "engine", "close      : opens_any && !parallel,", "close      : opens_any,"),
    ("the parallel port is never on", "registers", "parallel         = (mode & MODE_PARALLEL) != 0;", "parallel         = 0;"),
    ("frames that are no packets may go by the parallel port", "registers", " && (mode & (MODE_PARALLEL | MODE_PACKETS)) != MODE_PARALLEL;", ";"),
    ("without clock a read gives 0", "host_registers", "answer   = if here == 0 ?\n                NO_CLOCK", "answer   = if here == 0 ?\n                0"),
    ("the engine answers for the host port", "host_registers", "answered = back && !own;\n            if back && !own {", "answered = back;\n            if back {"),
    ("the lock is not told", "host_registers", "(if locked_here ? CLOCKS_LOCKED : 0)", "(if locked_here ? 0 : CLOCKS_LOCKED)"),
    ("the design is not told", "host_registers", "(design_id as 32 & {here[3] repeat 32})", "(DESIGN_CAMERA & {here[3] repeat 32})"),
    ("the sampling phase is not told", "host_registers", "(sampling & {here[4] repeat 32})", "(0 & {here[4] repeat 32})"),
    ("a sample like the one before is right", "pattern_check", "one = code == ~last && (", "one = ("),
    ("any two samples that are each other's complement are right", "pattern_check", " && (code == SAMPLING_CHECKERBOARD as 14 || last == SAMPLING_CHECKERBOARD as 14)", ""),
    ("one right sample is enough", "pattern_check", "right   = right && one;", "right   = right || one;"),
    ("the last sample is not looked at", "pattern_check", "left    = (SAMPLING_SAMPLES - 1) as 16;", "left    = (SAMPLING_SAMPLES - 2) as 16;"),
    ("a look is over for ever", "pattern_check", "checked = 0;\n                right   = 1;", "right   = 1;"),
    ("the last window is taken", "phase_scan", "if run_here >: longest {", "if right_here {"),
    ("the clock stops at the end of the window", "phase_scan", "if next == middle ?", "if next == last ?"),
    ("the period is gone through once", "phase_scan", "if again {\n                            moves", "if 1'b1 {\n                            moves"),
    ("the scan never ends", "phase_scan", "} else if next == 0 {", "} else if next == 63 {"),
    ("every step counts as right", "phase_scan", "right_here = right;", "right_here = 1;"),
    ("a wrong step does not end a window", "phase_scan", "run_here = if !right_here ? 0 :", "run_here = if !right_here ? run :"),
    ("the ADC keeps its checkerboard", "phase_scan", "shift = SAMPLING_AFTER_1 as 24;", "shift = SAMPLING_AFTER_0 as 24;"),
    ("the transfer is not written", "phase_scan", "shift = SAMPLING_BEFORE_1 as 24;", "shift = SAMPLING_BEFORE_0 as 24;"),
    ("a word to the ADC has a bit less", "phase_scan", "word = word + 1;\n                    bits = 23;", "word = word + 1;\n                    bits = 22;"),
    ("the scan says that it is over before the ADC's own samples are back", "phase_scan", "            done            = state == State::Done;\n        }\n    }", "            done            = moves;\n        }\n    }"),
    ("the frequency is of half a window", "clock_meter", "left   = (CLOCKS_WINDOW - 1) as 16;\n                so_far = 0;", "left   = (CLOCKS_WINDOW / 2 - 1) as 16;\n                so_far = 0;"),
    ("a clock that stands still is counted", "clock_meter", "(if level != last ? 1 : 0)", "(if level ? 1 : 0)"),
    ("an access of before the reset is carried out after it", "core", "rst_host    : rst_bridge,", "rst_host,"),
    ("a clock that is lost stays ready", "core", "always_ff (clk_host, rst_bridge) {\n        if_reset {\n            ready = 0;", "always_ff (clk_host, rst_bridge) {\n        if_reset {\n            ready = 1;"),
    ("the bring-up sees a line less", "loopback", "{enable repeat 32};", "({enable repeat 32} >> 1);"),
    ("numbers are not padded", "packer", "{bytes_left != 1, word[6:0]}", "{word[63:7] != 0, word[6:0]}"),
    ("a number goes by eight bits a byte", "packer", "if padded ? word >> 7 : word >> 8", "word >> 8"),
    ("a microsecond has 126 clocks", "packer", "reduced = partial - 8'd125;\n    assign fits    = partial >= 8'd125;", "reduced = partial - 8'd126;\n    assign fits    = partial >= 8'd126;"),
    ("the last clock of a microsecond is the next", "packer", "fits    = partial >= 8'd125;", "fits    = partial >= 8'd124;"),
    ("the time goes out before it is divided", "packer", "            timed     = 0;\n        } else if bits_left", "            timed     = 1;\n        } else if bits_left"),
    ("the time is counted from the start of the FPGA", "packer", "header.shown_at - stamp.clock_base", "header.shown_at"),
    ("the time is counted from the start of the run", "packer", "micros = quotient + stamp.time_base;", "micros = quotient;"),
    ("a packet is of the run before", "packer", "word       = stamp.run as 64;", "word       = stamp.run as 64 - 1;"),
    ("the packet has another shift", "packer", "register_map::SAMPLES_NARROW as 64 : 0;", "register_map::SAMPLES_NARROW as 64 : 1;"),
    ("the length is in samples", "packer", "{settings.patterns, 2'b0};", "{2'b0, settings.patterns};"),
    ("the positive sum is read a clock late", "packer", "if age == 1 {", "if age == 2 {"),
    ("the negative sum is read a clock early", "packer", "if age == 2 {", "if age == 1 {"),
    ("the difference has the other sign", "packer", "positive - (if settings.differential ? sum_word[31:0] : 0)", "(if settings.differential ? sum_word[31:0] : 0) - positive"),
    ("packets without complements subtract what was there", "packer", "(if settings.differential ? sum_word[31:0] : 0)", "sum_word[31:0]"),
    ("a packet is a sample short", "packer", "if index == settings.patterns[9:0] {", "if index == settings.patterns_less_1 {"),
    ("the checksum takes a byte twice", "packer", "take : puts && !full,", "take : puts,"),
    ("the checksum goes on from the packet before", "packer", "clear: open", "clear: 1'b0"),
    ("a zero stays in the packet", "packer", "assign ends = full || next == 0;", "assign ends = full;"),
    ("a block is a byte too long", "packer", "assign full = distance == 255;", "assign full = distance == 0;"),
    ("a block is a byte short", "packer", "assign full = distance == 255;", "assign full = distance == 254;"),
    ("a byte is lost where a block is full", "packer", "if !full {\n                    word", "if 1'b1 {\n                    word"),
    ("a block's length is written a place later", "packer", "if puts && !ends ? next_at : code_at", "next_at"),
    ("the ring overruns", "packer", "assign puts = bytes_left != 0 && !used[10];", "assign puts = bytes_left != 0;"),
    ("the packet has no delimiter", "packer", "code_at = code_at + 1;", "code_at = code_at;"),
    ("the delimiter is a length", "packer", "if part == Part::Delimiter ? 0 :", "if part == Part::Idle ? 0 :"),
    ("a byte goes out before its block is closed", "packer", "} else if flows && read_at != code_at {", "} else if flows && read_at != next_at {"),
    ("a byte goes out a clock early", "packer", "valid = seen;", "valid = 1;"),
    ("an abandoned packet goes on", "packer", "} else if open || close {\n            part       = if open ? Part::Head : Part::Idle;", "} else if open {\n            part       = if open ? Part::Head : Part::Idle;"),
    ("the next packet begins with the last one's bytes", "packer", "} else if open || close {\n            read_at = 0;\n            seen    = 0;\n            valid   = 0;", "} else if open || close {\n            read_at = 0;\n            seen    = 0;\n            valid   = valid;"),
    ("a sample of the last packet begins the next", "packer", "            age   = OPENED;\n", ""),
    ("a packet begins with its first block", "packer", "} else if flows && read_at != code_at {", "} else if read_at != code_at {"),
    ("a short packet never begins", "packer", "code_at >= 100 || part == Part::Idle", "code_at >= 100"),
    ("a packet waits for what the one before had", "packer", "} else if open || close {\n            flows = 0;", "} else if close && !open {\n            flows = 0;"),
    ("packets are sent as frames", "registers", "next.packets          = (mode & MODE_PACKETS) != 0;", "next.packets          = 0;"),
    ("what a packet says counts in the run under way", "registers", "        if copy {\n            stamp.run ", "        if write {\n            stamp.run "),
    ("the halves of the time are swapped", "registers", "{time_high, time_low};", "{time_low, time_high};"),
    ("the clock base is that of any read", "registers", "} else if read && address as 32 == ADDRESS_CLOCK_LOW {", "} else if read {"),
    ("packets have the sums of frames", "engine", "if settings.packets ? packet_sum : format_sum;", "format_sum;"),
    ("a frame is sent beside its packet", "engine", "open_frame : opens_frame && !settings.packets,", "open_frame : opens_frame,"),
    ("a burst goes on behind a packet", "engine", "open_none  : opens_any ", "open_none  : opens_raw "),
    ("a packet goes on behind a burst", "engine", "close      : opens_any &&", "close      : opens_frame &&"),
    ("blanked samples are in the frame's sum", "sample_total", "code_1  = if counts ? code : 0;", "code_1  = code;"),
    ("the frame's sum goes on from the frame before", "sample_total", "(if first_1 ? 0 : low_2[LOW - 1:0])", "low_2[LOW - 1:0]"),
    ("the upper part of the sum goes on from the frame before", "sample_total", "(if first_2 ? 0 : high_3)", "high_3"),
    ("the upper part of the sum begins a clock early", "sample_total", "first_2 = first_1;", "first_2 = first;"),
    ("the carry into the upper part is lost", "sample_total", "+ low_2[LOW] as HIGH;", "+ 0;"),
    ("the upper part of the sum has a bit less", "sample_total", "total_4 = {high_3, low_3};", "total_4 = {high_3 & 48'h7FFF, low_3};"),
    ("the frame's sum is a clock early", "sample_total", "total   = total_4;", "total   = {high_3, low_3};"),
    ("the sum is that of the last frame made", "frames", "            header_two = newest;\n        }\n", "            header_two = newest;\n        }\n        if done {\n            header.total = total;\n        }\n"),
    ("the sum is of every clock", "engine", "counts: place.counts     ,", "counts: place.active     ,"),
    ("the sum begins with each slot", "engine", "first : place.frame_first,\n        code  :", "first : place.slot_first,\n        code  :"),
    ("the halves of the sum are swapped", "registers", "(header.total[31:0] & {asked_live[5]", "(header.total[63:32] & {asked_live[5]"),
    ("the sum is told of a frame that was given back", "registers", "{asked_live[5] && delivered repeat 32}", "{asked_live[5] repeat 32}"),
    ("over-range samples are told of a frame that was given back", "registers", "{asked_live[7] && delivered repeat 32}", "{asked_live[7] repeat 32}"),
    ("what is left of the last read begins the next", "packet_port", "        } else if !reads_there {\n            takes        = 0;\n            written      = 0;\n            written_gray = 0;", "        } else if !reads_there {\n            takes        = 0;"),
    ("a read takes what an earlier access has left", "packet_port", "if access {\n                takes = 1;", "if 1'b1 {\n                takes = 1;"),
    ("bytes go on to the read that is over", "packet_port", "        } else if !reads_there {\n            takes        = 0;", "        } else if !reads_there {"),
    ("the port overruns", "packet_port", "assign full         = written_gray == (taken_there ^ 5'b11000);", "assign full         = 0;"),
    ("the port is full a byte late", "packet_port", "assign full         = written_gray == (taken_there ^ 5'b11000);", "assign full         = written_gray == ((taken_there ^ (taken_there >> 1)) ^ 5'b11000);"),
    ("an empty port gives what was there", "packet_port", "if empty ? 0 : words[taken[3:0]]", "words[taken[3:0]]"),
    ("an empty port goes on", "packet_port", "if !empty {\n                            taken ", "if 1'b1 {\n                            taken "),
    ("the halves of a byte are swapped", "packet_port", "lines_out = byte_now[7:4];\n                        low       = byte_now[3:0];", "lines_out = byte_now[3:0];\n                        low       = byte_now[7:4];"),
    ("each half comes once", "packet_port", "second = ~second;", "second = 0;"),
    ("the bytes come a clock of sck early", "packet_port", "= 11 + HOST_DUMMY_CYCLES;", "= 10 + HOST_DUMMY_CYCLES;"),
    ("the bytes come a clock of sck late", "packet_port", "= 11 + HOST_DUMMY_CYCLES;", "= 12 + HOST_DUMMY_CYCLES;"),
    ("the lines are driven in the dummy cycles", "packet_port", "                if reads && clocks >= LEAD as 5 {\n                    drives = 1;", "                drives = reads;\n                if reads && clocks >= LEAD as 5 {"),
    ("any opcode reads a packet", "packet_port", "may_begin && {shifted, line} == (HOST_PACKET[7:0] | HOST_QUAD[7:0])", "may_begin"),
    ("the opcode counts by its last bits", "packet_port", "{shifted, line} == (HOST_PACKET[7:0] | HOST_QUAD[7:0])", "{shifted[2:0], line} == HOST_PACKET[3:0]"),
    ("an opcode within an access counts", "packet_port", "if clocks == 7 {", "if clocks >= 7 && !reads {"),
    ("a read begins where none may", "packet_port", "reads = may_begin && ", "reads = "),
    ("the pointers cross as they are", "packet_port", "written_gray = next_written ^ (next_written >> 1);", "written_gray = next_written;"),
    ("a packet by sck is asked for twice", "spi_slave", "send      = idle && !asked;", "send      = 1;"),
    ("a packet by sck is not asked for", "spi_slave", "send      = idle && !asked;", "send      = 0;"),
    ("a packet by sck is asked for as a burst", "spi_slave", "operation = HOST_FRAME[1:0];\n                send      = idle && !asked;", "operation = HOST_RAW[1:0];\n                send      = idle && !asked;"),
    ("both ports listen", "spi_slave", "phase     = Phase::Over;\n                operation = HOST_FRAME[1:0];", "operation = HOST_FRAME[1:0];"),
    ("a read by sck may begin at any time", "spi_slave", "assign beginning = phase == Phase::Opcode && age != YOUNG;", "assign beginning = 1;"),
    ("a packet by sck is asked for while the crossing is busy", "spi_slave", "send      = idle && !asked;", "send      = !asked;"),
    ("an old access may begin a read by sck", "spi_slave", "phase == Phase::Opcode && age != YOUNG", "phase == Phase::Opcode"),
    ("a packet by sck is driven by the other port", "core", "assign spi_out   = if drives ? packet_lines : slow_lines;", "assign spi_out   = slow_lines;"),
    ("a packet by sck is not driven", "core", "(drive | {drives repeat 4})", "drive"),
    ("the other port's place counts for a packet by sck", "core", "if by_sck ? !full_sck : !full,", "!full,"),
    ("a packet by sck begins without the ADC's clock", "core", "may_begin : beginning && ready,", "may_begin : beginning,"),
    ("a packet begins with too few bytes", "packer", "code_at >= 100 ||", "code_at >= 20 ||"),
    ("samples of 24 bits have four bytes", "packer", "bytes_left = if settings.narrow ? 3 : 4;", "bytes_left = 4;"),
    ("samples of 24 bits are counted as of 32", "packer", "all_of_four - (if settings.narrow ? {2'b0, settings.patterns} : 0);", "all_of_four;"),
    ("samples of 24 bits have the form of 32", "packer", "if settings.narrow ? register_map::SAMPLES_NARROW as 64 : 0;", "0;"),
    ("samples of 24 bits keep their upper bytes", "packer", "word       = {32'b0, sample};", "word       = if settings.narrow ? {40'b0, sample[31:8]} : {32'b0, sample};"),
    ("samples of 24 bits are sent with 32", "registers", "next.narrow           = (mode & MODE_NARROW) != 0;", "next.narrow           = 0;"),
    ("all samples have 24 bits", "registers", "next.narrow           = (mode & MODE_NARROW) != 0;", "next.narrow           = 1;"),
    ("a packet begins with its second sample", "packer", "            index = 0;\n        } else if fetches {", "            index = 1;\n        } else if fetches {"),
    ("the negative sum is that of the sample before", "packer", "assign sum_address = {fetches, index};", "assign sum_address = {fetches, index - (fetches as 10)};"),
    ("one dummy cycle too few", "spi_slave", "left  = (HOST_DUMMY_CYCLES - 1) as 6;", "left  = (HOST_DUMMY_CYCLES - 2) as 6;"),
];

/// Faults that only the module's own bench notices. Beyond the packet the host port sends zeros, which are delimiters
/// too. The equivalence runs are too short for a sum of 2^31. In the core, only the right opcode at the start of an access
/// is fast enough to begin a read by `sck`, the other port is released before it sees another edge, and the crossing takes
/// no access while it is busy. A packet that is opened with a start gives nothing to anyone, and the equivalence runs look at
/// the strobe only where it has to rise.
const BENCH_ALONE: &[&str] = &[
    "the packet has no delimiter",
    "the upper part of the sum has a bit less",
    "the opcode counts by its last bits",
    "an opcode within an access counts",
    "both ports listen",
    "a packet by sck is asked for while the crossing is busy",
    "a packet is opened with the start that ends it",
    "the strobe of a port that is off goes on",
];

/// Whether the equivalence runs do not reach a fault, so that the module's own bench alone must notice the fault.
fn is_beside((what, file, ..): &Fault) -> bool {
    modules::BESIDE_THE_CORE.contains(file) || BENCH_ALONE.contains(what)
}

thread_local! {
    /// The current thread expects a panic.
    static EXPECTED: Cell<bool> = const { Cell::new(false) };
}

/// Whether a law panics, as it should. The panic message is not printed.
fn breaks((_, law): &Law, broken: &Project) -> bool {
    EXPECTED.set(true);
    let breaks = catch_unwind(|| law(broken)).is_err();
    EXPECTED.set(false);
    breaks
}

/// What noticed a fault.
struct Seen {
    /// Laws of the module's own bench that were run and that the fault breaks, the first of them among them.
    laws: Vec<&'static str>,
    /// The first difference in the equivalence runs of the top.
    difference: Option<String>,
}

impl Seen {
    /// Runs the laws of the module's bench up to the first that the fault breaks, and of the others those that no fault
    /// has broken yet.
    fn of(project: &Project, fault: &Fault, broken: &Mutex<BTreeSet<&'static str>>) -> Self {
        let (_, file, from, to) = fault;
        let faulty = project.with(file, from, to);
        let mut laws = Vec::new();
        for law in modules::laws(file) {
            let (name, _) = law;
            if (laws.is_empty() || !broken.lock().unwrap().contains(name)) && breaks(law, &faulty) {
                broken.lock().unwrap().insert(name);
                laws.push(*name);
            }
        }
        let beside = is_beside(fault);
        Self {
            laws,
            difference: if beside { None } else { equivalence::difference(&faulty, file) },
        }
    }

    /// Whether everything that tests the file noticed the fault.
    fn by_all(&self, fault: &Fault) -> bool {
        let (_, file, ..) = fault;
        (self.difference.is_some() || is_beside(fault))
            && (!self.laws.is_empty() || modules::laws(file).is_empty())
    }

    /// A row of the report.
    fn row(&self, fault: &Fault) -> String {
        let (what, file, ..) = fault;
        let law = self.laws.first().map_or("-".to_owned(), |name| name.replace('_', " "));
        let first = self.difference.as_deref().and_then(|difference| difference.lines().next());
        format!(
            "| {what} | `{file}` | {law} | {} |",
            first.unwrap_or(if is_beside(fault) { "-" } else { "**not seen**" })
        )
    }
}

/// Which faults are tried: all, or those whose place in the list leaves `part` when it is divided by
/// `parts`. `NIRSPI_FAULT_PART=1/3` is the second third.
fn part_of_faults() -> Option<(usize, usize)> {
    let asked = std::env::var("NIRSPI_FAULT_PART").ok()?;
    let (part, parts) = asked.split_once('/').expect("NIRSPI_FAULT_PART is like 1/3");
    let (part, parts): (usize, usize) = (part.parse().unwrap(), parts.parse().unwrap());
    assert!(part < parts, "NIRSPI_FAULT_PART={asked}: parts are counted from 0");
    Some((part, parts))
}

/// Takes minutes, so only `.ci/run` runs this test.
#[test]
#[ignore = "minutes; .ci/run does it"]
fn every_deliberate_fault_is_seen_and_every_law_can_be_broken() {
    let project = Project::read();
    let only = std::env::var("NIRSPI_FAULT").unwrap_or_default();
    let part = part_of_faults();
    let (rest, parts) = part.unwrap_or((0, 1));
    let faults: Vec<_> = FAULTS
        .iter()
        .skip(rest)
        .step_by(parts)
        .filter(|(what, file, ..)| what.contains(&only) || *file == only)
        .collect();
    let hook = take_hook();
    set_hook(Box::new(move |panic| {
        if !EXPECTED.get() {
            hook(panic);
        }
    }));
    let next = AtomicUsize::new(0);
    let broken = Mutex::new(BTreeSet::new());
    let work = || {
        let mut seen = Vec::new();
        while let Some(fault) = faults.get(next.fetch_add(1, Ordering::Relaxed)) {
            seen.push((*fault, Seen::of(&project, fault, &broken)));
        }
        seen
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let seen: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().map(ScopedJoinHandle::join).collect()
    });
    let mut seen: Vec<_> = seen.into_iter().flat_map(Result::unwrap).collect();
    seen.sort_by_key(|(fault, _)| FAULTS.iter().position(|other| other == *fault));
    println!("| fault | module | its own bench | over the top |\n|---|---|---|---|");
    for (fault, seen) in &seen {
        println!("{}", seen.row(fault));
    }
    let missed = seen.iter().filter(|(fault, seen)| !seen.by_all(fault));
    let missed: Vec<_> = missed.map(|(fault, _)| fault.0).collect();
    assert!(missed.is_empty(), "not seen: {missed:?}");

    let broken = broken.into_inner().unwrap();
    let laws = modules::BENCHES.iter().flat_map(|(_, laws)| *laws);
    let unbroken: Vec<_> = laws.filter(|(name, _)| !broken.contains(name)).collect();
    let all = only.is_empty() && part.is_none();
    assert!(unbroken.is_empty() || !all, "no fault breaks {unbroken:?}");
}
