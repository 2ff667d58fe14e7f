//! An emulated board with a simulated FPGA at one UART and a TCP address at the other.
//!
//! The board runs the firmware's ELF unchanged.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

use nirspi::link::{Link, TcpLink};
use nirspi_virtual::{SimulatedFpga, serve_tunnel};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// A running QEMU.
pub struct Emulated {
    qemu: Child,
    host: String,
    fpga_line: TcpStream,
    interlock_closed: Arc<AtomicBool>,
}

/// A listener, and QEMU's argument to connect to it. Nagle's algorithm is off, because with it each
/// access takes 40 ms.
fn listen() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    (listener, format!("tcp:127.0.0.1:{port},nodelay=on"))
}

/// Waits for QEMU's connection. A QEMU that cannot start prints the reason itself.
fn accept(listener: &TcpListener, qemu: &mut Child) -> TcpStream {
    listener.set_nonblocking(true).unwrap();
    loop {
        if let Ok((stream, _)) = listener.accept() {
            stream.set_nonblocking(false).unwrap();
            stream.set_nodelay(true).unwrap();
            return stream;
        }
        assert!(qemu.try_wait().unwrap().is_none(), "QEMU has ended");
        thread::sleep(Duration::from_millis(5));
    }
}

impl Emulated {
    /// Powers up in front of `fpga`. `None`, with a printed message, without an emulator or
    /// firmware.
    ///
    /// # Panics
    /// If QEMU ends before it connects.
    #[must_use]
    pub fn start(fpga: impl SimulatedFpga + 'static) -> Option<Self> {
        Self::start_with(fpga, &[])
    }

    /// As [`start`](Self::start), with more arguments for QEMU.
    ///
    /// # Panics
    /// If QEMU ends before it connects.
    #[must_use]
    pub fn start_with(fpga: impl SimulatedFpga + 'static, more: &[&str]) -> Option<Self> {
        let (qemu, elf) = (crate::firmware::qemu()?, crate::firmware::elf()?);
        let (host_line, host_argument) = listen();
        let (fpga_line, fpga_argument) = listen();
        let mut child = Command::new(qemu)
            .args(["-M", "mps2-an505", "-display", "none", "-monitor", "none"])
            .args(["-serial", &host_argument, "-serial", &fpga_argument])
            .arg("-kernel")
            .arg(elf)
            .args(more)
            .stdin(Stdio::null())
            .spawn()
            .unwrap();
        let (host_line, fpga_line) =
            (accept(&host_line, &mut child), accept(&fpga_line, &mut child));
        let interlock_closed = Arc::new(AtomicBool::new(true));
        let (line, interlock) = (fpga_line.try_clone().unwrap(), Arc::clone(&interlock_closed));
        thread::spawn(move || {
            let mut fpga = fpga;
            serve_tunnel(line, &mut fpga, &interlock).unwrap();
        });
        let host = relay(host_line);
        Some(Self { qemu: child, host, fpga_line, interlock_closed })
    }

    /// A link to the camera: a new session each time, on the same line.
    ///
    /// # Panics
    /// If the line cannot be opened.
    #[must_use]
    pub fn link(&self) -> Box<dyn Link> {
        Box::new(TcpLink::connect(&self.host).unwrap())
    }

    /// Disconnects the FPGA.
    ///
    /// # Panics
    /// If the line to the FPGA is closed already.
    pub fn unplug_fpga(&self) {
        self.fpga_line.shutdown(Shutdown::Both).unwrap();
    }

    /// Opens or closes the enclosure's interlock.
    pub fn set_interlock(&self, closed: bool) {
        self.interlock_closed.store(closed, Ordering::Relaxed);
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Starts a TCP server in front of a serial line, for one client after the other; returns its
/// address.
fn relay(line: TcpStream) -> String {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let client = Arc::new(std::sync::Mutex::new(None::<TcpStream>));
        let (mut from_board, to_client) = (line.try_clone().unwrap(), Arc::clone(&client));
        thread::spawn(move || {
            let mut chunk = vec![0; 1 << 16];
            while let Ok(length @ 1..) = from_board.read(&mut chunk) {
                // Bytes that arrive without a client are lost.
                if let Some(client) = &mut *to_client.lock().unwrap() {
                    let _ = client.write_all(&chunk[..length]);
                }
            }
            if let Some(client) = &*to_client.lock().unwrap() {
                let _ = client.shutdown(Shutdown::Both);
            }
        });
        let mut to_board = line;
        for connected in server.incoming() {
            let mut from_client = connected.unwrap();
            from_client.set_nodelay(true).unwrap();
            *client.lock().unwrap() = Some(from_client.try_clone().unwrap());
            let mut chunk = vec![0; 1 << 16];
            while let Ok(length @ 1..) = from_client.read(&mut chunk) {
                if to_board.write_all(&chunk[..length]).is_err() {
                    return;
                }
            }
        }
    });
    address
}
