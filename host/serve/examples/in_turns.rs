//! The live page of the virtual camera without a server: commands come from the standard input, one a line, and the last
//! message to the page goes to the standard output.
//!
//! ```text
//! POST /api/settings {"frames": 8}
//! turns 12
//! ```

use nirspi_serve::Turns;
use std::error::Error;
use std::io::stdin;

fn main() -> Result<(), Box<dyn Error>> {
    let mut page = Turns::virtual_camera(1)?;
    let mut message = String::new();
    for line in stdin().lines() {
        let line = line?;
        match line.split(' ').collect::<Vec<_>>()[..] {
            ["turns", count] => {
                for _ in 0..count.parse()? {
                    page.turn().clone_into(&mut message);
                }
            }
            ["POST", path, ref body @ ..] => {
                page.command(path, body.join(" ").as_bytes())?;
            }
            _ => {
                return Err(
                    format!("found {line:?}, expected `turns N` or `POST PATH BODY`").into()
                );
            }
        }
    }
    println!("{message}");
    Ok(())
}
