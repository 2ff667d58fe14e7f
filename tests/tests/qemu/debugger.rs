//! A debugger's hand on the emulated processor: as much of GDB's remote protocol as it takes to break a program.
//!
//! The one law: it is used to do what radiation, a wild pointer or a bad solder joint would do, and nothing else.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

/// Attached; the processor stands still until [`go`](Self::go).
pub struct Debugger {
    line: TcpStream,
}

/// Where QEMU is to connect its GDB server.
pub struct Waiting {
    listener: TcpListener,
}

impl Waiting {
    pub fn new() -> Self {
        Self { listener: TcpListener::bind("127.0.0.1:0").unwrap() }
    }

    /// QEMU's arguments.
    pub fn arguments(&self) -> [String; 4] {
        let port = self.listener.local_addr().unwrap().port();
        let socket = format!("socket,id=gdb,host=127.0.0.1,port={port}");
        ["-chardev".into(), socket, "-gdb".into(), "chardev:gdb".into()]
    }

    pub fn attach(self) -> Debugger {
        let (line, _) = self.listener.accept().unwrap();
        let mut debugger = Debugger { line };
        // Once it answers it has stopped the processor.
        debugger.ask("?");
        // It lets nobody write registers who has not read what registers there are.
        debugger.ask("qXfer:features:read:target.xml:0,10");
        debugger
    }
}

impl Debugger {
    fn send(&mut self, command: &str) {
        let sum = command.bytes().fold(0u8, u8::wrapping_add);
        write!(self.line, "${command}#{sum:02x}").unwrap();
    }

    fn ask(&mut self, command: &str) -> String {
        self.send(command);
        self.receive()
    }

    /// The next packet from QEMU, acknowledged.
    fn receive(&mut self) -> String {
        let mut byte = || {
            let mut byte = [0];
            self.line.read_exact(&mut byte).unwrap();
            byte[0]
        };
        while byte() != b'$' {}
        let mut text = Vec::new();
        loop {
            match byte() {
                b'#' => break,
                other => text.push(other),
            }
        }
        byte();
        byte();
        self.line.write_all(b"+").unwrap();
        String::from_utf8(text).unwrap()
    }

    fn halt(&mut self) {
        self.line.write_all(&[0x03]).unwrap();
        let stopped = self.receive();
        assert!(stopped.starts_with(['S', 'T']), "{stopped}");
    }

    /// Stops the processor and reads memory.
    pub fn read(&mut self, start: u64, end: u64) -> Vec<u8> {
        const PIECE: u64 = 1024;
        self.halt();
        let mut bytes = Vec::new();
        for at in (start..end).step_by(PIECE as usize) {
            let digits = self.ask(&format!("m{at:x},{:x}", PIECE.min(end - at)));
            let pairs = digits.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
            bytes.extend(pairs.map(|pair| u8::from_str_radix(pair, 16).unwrap()));
        }
        bytes
    }

    /// Lets the processor run.
    pub fn go(&mut self) {
        self.send("c");
    }

    /// Stops the processor, makes it go on at `address`.
    pub fn derail(&mut self, address: u32) {
        self.halt();
        // Register 15, its bytes in the target's order.
        assert_eq!(self.ask(&format!("Pf={:08x}", address.swap_bytes())), "OK");
        self.go();
    }
}
