//! The RTL against the golden model.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod map;
mod pins;
mod project;
mod stale;

#[test]
fn speed() {
    let project = project::Project::read();
    let t = std::time::Instant::now();
    let mut pins = pins::Pins::new(&project);
    eprintln!("build {:?}", t.elapsed());
    let t = std::time::Instant::now();
    for i in 0..100_000u32 {
        pins.sample(nirspi_hdl::AdcSample { code: i as u16, over_range: false });
        pins.adc_edge();
    }
    eprintln!("100k adc {:?}", t.elapsed());
    let t = std::time::Instant::now();
    for _ in 0..100_000 {
        pins.host_edge();
    }
    eprintln!("100k host {:?}", t.elapsed());
    let t = std::time::Instant::now();
    for _ in 0..100_000 {
        pins.leds(); pins.access(); pins.ready();
    }
    eprintln!("100k gets {:?}", t.elapsed());
}
