//! What instruments and their programs export: a file of ours in the form of each, which gives the image.

use crate::bench::{Bench, Measured, correlation};
use std::fmt::Write as _;

/// A file of an instrument: its name, its text, the field of the readings if it has several, and what a note says.
pub struct Export {
    pub file: &'static str,
    pub text: String,
    field: Option<&'static str>,
    note: &'static str,
}

/// The lines of a table: its head, and a line for each reading.
fn table(head: &str, y: &[f32], line: impl Fn(usize, f32) -> String) -> String {
    let lines = y.iter().enumerate();
    lines.fold(head.to_owned(), |mut text, (at, &y)| {
        writeln!(text, "{}", line(at, y)).unwrap();
        text
    })
}

/// With decimal commas.
fn european(text: &str) -> String {
    text.replace('.', ",")
}

/// Time of day of a sample, a millisecond after the one before.
fn clock(at: usize) -> String {
    format!("10:00:{:02}.{:03}", at / 1000, at % 1000)
}

const TEKTRONIX: [&str; 17] = [
    "Record Length,5.120000e+02,",
    "Sample Interval,4.000000e-07,",
    "Trigger Point,2.560000000000e+02,",
    ",,",
    ",,",
    ",,",
    "Source,CH1,",
    "Vertical Units,V,",
    "Vertical Scale,2.000000e+01,",
    "Vertical Offset,0.000000e+00,",
    "Horizontal Units,s,",
    "Horizontal Scale,1.000000e-04,",
    "Pt Fmt,Y,",
    "Yzero,0.000000e+00,",
    "Probe Atten,1.000000e+00,",
    "Model Number,TDS2024B,",
    "Firmware Version,FV:v22.01,",
];

const TEKTRONIX_5: &str = "Model,MSO54\nFirmware Version,1.28.4.9163\n\nWaveform Type,ANALOG\nPoint Format,Y\n\
    Horizontal Units,s\nHorizontal Scale,0.0004\nHorizontal Delay,0\nSample Interval,4e-10\nRecord Length,512\n\
    Gating,0.0% to 100.0%\nProbe Attenuation,1\nVertical Units,V\nVertical Offset,0\n,\n,\n,\nLabel,\nTIME,CH1\n";

const BENCHLINK: &str = "Name:,Scan 1\nOwner:,lab\nAcquisition Date:,11/20/2026 10:00:00 AM\n\
    Total Channels:,1\nChannel,Name,Function,Range\n101,,DC voltage,Auto\n\nScan Control:\n\
    Start Action:,Immediately\n\nScan,Time,101 <PD> (VDC)\n";

const THORLABS: &str = "Thorlabs Optical Power Monitor\nDevice:;PM100D\nSerial Number:;P0000000\n\
    Wavelength:;1550 nm\n\nSamples;Date (MM/dd/yyyy);Time of day (hh:mm:ss);Power (W)\n";

const LABVIEW: &str = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n\
    Decimal_Separator\t.\nMulti_Headings\tYes\nX_Columns\tOne\nTime_Pref\tAbsolute\nOperator\tlab\n\
    Date\t2026/11/20\nTime\t10:00:00.1234567\n***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t512\t\n\
    Date\t2026/11/20\t\nTime\t10:00:00.1234567\t\nY_Unit_Label\tVolts\t\nX_Dimension\tTime\t\n\
    X0\t0.0000000000000000E+0\t\nDelta_X\t1.000000E-3\t\n***End_of_Header***\t\t\n\
    X_Value\tVoltage_0\tComment\n";

const DIGILENT: &str = "#Digilent WaveForms Oscilloscope Acquisition\n#Device Name: Discovery2\n\
    #Sample rate: 1000Hz\n\nTime (s),Channel 1 (V)\n";

pub fn exports(y: &[f32]) -> Vec<Export> {
    let export = |file, text, note| Export { file, text, field: None, note };
    let of = |field, export: Export| Export { field: Some(field), ..export };
    let noise = |at: usize| 0.01 * ((at * at * 31 + at * 7) % 97) as f32;
    let micro = |at: usize| at as f64 * 1e-6 - 2.56e-4;
    let rows = y.iter().enumerate();
    let tektronix = rows.map(|(at, y)| {
        format!("{}{:018.12},{y:9.5},\n", TEKTRONIX.get(at).unwrap_or(&",,"), at as f64 * 4e-7)
    });
    let braces: Vec<String> = y.iter().map(|y| format!("{y:.6}")).collect();
    let units = "left out of the text: the units below its heading";
    let counts = "left out: columns that count in even steps: ";
    vec![
        // Rigol: the DS1000 with start and step beside the units, the MSO5000 without times, the DHO800.
        export(
            "rigol-ds.csv",
            table("X,CH1,Start,Increment,\nSequence,Volt,-6.0e-04,1.0e-06\n", y, |at, y| {
                format!("{at},{y:.6e},")
            }),
            units,
        ),
        of(
            "CH1",
            export(
                "rigol-two.csv",
                table(
                    "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-6.0e-04,1.0e-06\n",
                    y,
                    |at, y| format!("{at},{y:.6e},{:.6e},", noise(at)),
                ),
                units,
            ),
        ),
        export(
            "rigol-mso.csv",
            table("CH1V,t0 = -2.56e-04,tInc = 1e-06,\n", y, |_, y| format!("{y:.6e},,,")),
            "",
        ),
        export(
            "rigol-dho.csv",
            table("Time(s),CH1(V)\n", y, |at, y| format!("{:+.6e},{y:+.6e}", micro(at))),
            counts,
        ),
        // Tektronix: settings beside the first samples (TDS), above them (5 Series).
        export("tektronix-tds.csv", tektronix.collect(), "columns that hold words: 1, 2"),
        export(
            "tektronix-5.csv",
            table(TEKTRONIX_5, y, |at, y| format!("{:.6e},{y:.6}", at as f64 * 4e-10)),
            "lines before the table",
        ),
        // Keysight: InfiniiVision, with channels that are numbers; BenchLink, in UTF-16 here.
        of(
            "1",
            export(
                "keysight-scope.csv",
                table("x-axis,1,2\nsecond,Volt,Volt\n", y, |at, y| {
                    format!("{:+.7E},{y:+.7E},{:+.7E}", micro(at), noise(at))
                }),
                units,
            ),
        ),
        export(
            "keysight-logger.csv",
            table(BENCHLINK, y, |at, y| format!("{},11/20/2026 {},{y:.6}", at + 1, clock(at))),
            "8 lines before the table; columns that hold words: `Time`",
        ),
        // Rohde & Schwarz: point and comma.
        export(
            "rohde-schwarz.csv",
            table("in s,C1 in V\n", y, |at, y| format!("{:.8E},{y:.5E}", micro(at))),
            counts,
        ),
        export(
            "rohde-schwarz-eu.csv",
            table("in s;CH1 in V\n", y, |at, y| european(&format!("{:.8E};{y:.5E}", micro(at)))),
            counts,
        ),
        // PicoScope: a blank line below the units, infinity for overload; and as it writes in Germany.
        of(
            "Channel A",
            export(
                "picoscope.csv",
                table("Time,Channel A,Channel B\n(ms),(V),(mV)\n\n", y, |at, y| {
                    let y = if at == 200 { "∞".to_owned() } else { format!("{y:.8}") };
                    format!("{:.8},{y},{:.5}", 1e3 * micro(at), noise(at))
                }),
                units,
            ),
        ),
        export(
            "picoscope-eu.csv",
            table("Zeit;Kanal A\n(ms);(V)\n\n", y, |at, y| {
                european(&format!("{:.8};{y:.8}", 1e3 * micro(at)))
            }),
            units,
        ),
        // Thorlabs' power monitor.
        export(
            "thorlabs.csv",
            table(THORLABS, y, |at, y| format!("{at};11/20/2026;{};{:.6E}", clock(at), 1e-6 * y)),
            "4 lines before the table; columns that hold words: `Date (MM/dd/yyyy)`, `Time of day (hh:mm:ss)`",
        ),
        // LabVIEW: one and two channels, with decimal commas, without times, and a table of a waveform.
        export(
            "labview.lvm",
            table(LABVIEW, y, |at, y| format!("{:.6}\t{y:.6}", at as f32 * 1e-3)),
            "21 lines before the table",
        ),
        of(
            "Voltage_0",
            export(
                "labview-two.lvm",
                table(&LABVIEW.replace("Comment", "Voltage_1\tComment"), y, |at, y| {
                    format!("{:.6}\t{y:.6}\t{:.6}", at as f32 * 1e-3, noise(at))
                }),
                "21 lines before the table",
            ),
        ),
        export(
            "labview-eu.lvm",
            table(&LABVIEW.replace("tor\t.", "tor\t,"), y, |at, y| {
                european(&format!("{:.6}\t{y:.6}", at as f32 * 1e-3))
            }),
            "21 lines before the table",
        ),
        export(
            "labview-times.lvm",
            table(LABVIEW, y, |_, y| format!("\t{y:.6}")),
            "21 lines before the table",
        ),
        export(
            "labview.txt",
            table(
                "waveform\t[0]\nt0\t20.11.2026 10:00:00\ndelta t\t1E-3\n\ntime[0]\tY[0]\n",
                y,
                |at, y| european(&format!("20.11.2026 {}\t{y:.6E}", clock(at))),
            ),
            "3 lines before the table; columns that hold words: `time[0]`",
        ),
        // Red Pitaya: an answer of its SCPI server, and the table of its page.
        export("red-pitaya.txt", format!("{{{}}}\r\n", braces.join(",")), ""),
        of(
            "IN1 [V]",
            export(
                "red-pitaya.csv",
                table("Time [s],IN1 [V],IN2 [V]\n", y, |at, y| {
                    format!("{:.9},{y:.6},{:.6}", at as f64 * 8e-9, noise(at))
                }),
                "",
            ),
        ),
        // The Arduino's serial monitor with its times, and lines for its plotter.
        export(
            "arduino.txt",
            table("Photodiode ready\n", y, |at, y| format!("{} -> {:.2}", clock(at), 100.0 * y)),
            "1 line before the table; columns that hold words: 1, 2",
        ),
        export("arduino-plotter.txt", table("", y, |_, y| format!("A0:{:.1}", 100.0 * y)), ""),
        of(
            "light",
            export(
                "arduino-two.txt",
                table("", y, |at, y| format!("light:{:.1},dark:{:.2}", 100.0 * y, noise(at))),
                "",
            ),
        ),
        export(
            "digilent.csv",
            table(DIGILENT, y, |at, y| format!("{:.9},{y:.8}", 1e3 * micro(at))),
            counts,
        ),
    ]
}

#[test]
#[ignore = "long: .ci/run demo"]
fn what_each_instrument_exports_is_an_image_and_a_note() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    for Export { file, text, field, note } in exports(&measured.natural()) {
        let bytes = match file {
            "keysight-logger.csv" => {
                let text = format!("\u{feff}{text}");
                text.encode_utf16().flat_map(u16::to_le_bytes).collect()
            }
            _ if file.starts_with("arduino") => text.into_bytes(),
            _ => text.replace('\n', "\r\n").into_bytes(),
        };
        bench.write(file, &bytes);
        let line = ["reconstruct", file, "--shown", "natural", "--method", "hadamard"];
        let asked = [&line[..], &["--out", "out", "--field", field.unwrap_or("-")]].concat();
        let said = bench.run(&asked[..asked.len() - if field.is_some() { 0 } else { 2 }]);
        let said = said.succeeded().stdout;
        assert!(said.contains(note), "{file}: {said}");
        assert_eq!(said.contains("not read: 1 pattern"), file == "picoscope.csv", "{file}: {said}");
        let alike = correlation(&bench.pixels("out/image.npy"), &measured.image);
        assert!(alike > 0.99, "{file}: {alike}");
        std::fs::remove_dir_all(bench.path("out")).unwrap();
        // The first guess is this field in this order.
        let report = bench.run(&["inspect", file, "--json"]).succeeded().json();
        let guess = &report["guesses"][0];
        assert_eq!(
            (&guess["form"], &guess["order"]),
            (&"pairs".into(), &"natural".into()),
            "{file}"
        );
        assert!(field.is_none_or(|field| guess["field"] == field), "{file}: {guess}");
    }
}
