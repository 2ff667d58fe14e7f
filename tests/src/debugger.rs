//! A debugger for the emulated processor: the part of GDB's remote protocol that a test needs to
//! break a program.
//!
//! Tests use it only to simulate radiation, a wild pointer or a bad solder joint.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

/// An address without memory: an instruction fetch there ends in a hard fault.
pub const NOWHERE: u32 = 0x2FF0_0000;

/// A debugger attached to a stopped processor; [`go`](Self::go) lets it run.
pub struct Debugger {
    line: TcpStream,
}

/// A listener for QEMU's GDB server.
pub struct Waiting {
    listener: TcpListener,
}

impl Waiting {
    /// A listener on a free port of this machine.
    ///
    /// # Panics
    /// If the system gives no port.
    #[must_use]
    pub fn listen() -> Self {
        Self { listener: TcpListener::bind("127.0.0.1:0").unwrap() }
    }

    /// QEMU's arguments.
    ///
    /// # Panics
    /// If the port is closed.
    #[must_use]
    pub fn arguments(&self) -> [String; 4] {
        let port = self.listener.local_addr().unwrap().port();
        let socket = format!("socket,id=gdb,host=127.0.0.1,port={port}");
        ["-chardev".into(), socket, "-gdb".into(), "chardev:gdb".into()]
    }

    /// Waits for QEMU's connection.
    ///
    /// # Panics
    /// If QEMU does not speak the protocol.
    #[must_use]
    pub fn attach(self) -> Debugger {
        let (line, _) = self.listener.accept().unwrap();
        let mut debugger = Debugger { line };
        // QEMU stops the processor before it answers.
        debugger.ask("?");
        // QEMU accepts register writes only after a read of the register description.
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

    /// The next packet from QEMU, which is acknowledged.
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
    ///
    /// # Panics
    /// If QEMU does not speak the protocol.
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
    ///
    /// # Panics
    /// If QEMU is gone.
    pub fn go(&mut self) {
        self.send("c");
    }

    /// Stops the processor and makes it continue at `address`.
    ///
    /// # Panics
    /// If QEMU does not speak the protocol.
    pub fn derail(&mut self, address: u32) {
        self.halt();
        // Register 15, its bytes in the target's order.
        assert_eq!(self.ask(&format!("Pf={:08x}", address.swap_bytes())), "OK");
        self.go();
    }

    /// Stops the machine and starts it anew. Its memory stays.
    ///
    /// # Panics
    /// If QEMU does not speak the protocol.
    pub fn power_up(&mut self) {
        self.halt();
        let command: String = b"system_reset".iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(self.ask(&format!("qRcmd,{command}")), "OK");
        self.go();
    }
}
