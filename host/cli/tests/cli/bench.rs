//! A place to run the program in: folders, processes, measurement files.

use nirspi::files::interrupt::Signal;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// No command of these tests takes longer, on a busy machine either. A GPU in software compiles the kernels of the networks for
/// 100 s on two busy cores.
const LIMIT: Duration = Duration::from_secs(400);

/// How a line of progress begins.
pub const PROGRESS: &str = "nirspi: progress: ";

/// A folder of its own for one test.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// What lies in the folder, logs of processes and calibrations kept left out.
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| !name.starts_with("log-") && name != "data")
            .collect();
        names.sort();
        names
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap();
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_slice(&fs::read(self.path(name)).unwrap()).unwrap()
    }

    /// The pixels of a `.npy` file.
    pub fn pixels(&self, name: &str) -> Vec<f32> {
        nirspi::files::npy::read_stack(&self.path(name)).unwrap().values
    }

    /// Starts `nirspi` with these arguments, in the folder.
    pub fn start(&self, arguments: &[&str]) -> Process {
        self.spawn(&mut heeding_signals(&program()), arguments)
    }

    /// Runs `nirspi` with these variables in its environment, to its end.
    pub fn run_with(&self, variables: &[(&str, &str)], arguments: &[&str]) -> Outcome {
        let mut program = Command::new(program());
        program.envs(variables.iter().copied());
        self.spawn(&mut program, arguments).wait()
    }

    /// Runs `nirspi` under limits that a shell sets, `ulimit -n 64` or the like.
    #[cfg(unix)]
    pub fn run_limited(&self, limits: &str, arguments: &[&str]) -> Outcome {
        self.start_limited(limits, arguments).wait()
    }

    /// Starts `nirspi` after these commands of a shell.
    #[cfg(unix)]
    pub fn start_limited(&self, commands: &str, arguments: &[&str]) -> Process {
        let mut shell = heeding_signals("sh");
        let script = format!("{commands}; exec \"$0\" \"$@\"");
        shell.args(["-c", &script, &program()]);
        self.spawn(&mut shell, arguments)
    }

    fn spawn(&self, program: &mut Command, arguments: &[&str]) -> Process {
        let log = |stream: &str| {
            let number = fs::read_dir(self.folder.path()).unwrap().count();
            self.path(&format!("log-{number}-{stream}"))
        };
        let out = log("out");
        let stdout = File::create(&out).unwrap();
        let err = log("err");
        let child = program
            .args(arguments)
            .current_dir(self.folder.path())
            // Calibrations that the user keeps are none of ours, nor ours his.
            .env("XDG_DATA_HOME", self.path("data"))
            // Mesa asks the desktop which GPU it prefers, and complains where there is no desktop.
            .env("NODEVICE_SELECT", "1")
            // Help is wrapped at this width.
            .env("COLUMNS", "100")
            .stdin(Stdio::null())
            .stdout(stdout)
            .stderr(File::create(&err).unwrap())
            .spawn()
            .unwrap();
        Process { child, out, err, command: arguments.join(" ") }
    }

    /// Runs `nirspi` with these words, parted by blanks, in the folder, to its end.
    pub fn run_line(&self, line: &str) -> Outcome {
        self.run(&line.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs `nirspi` with these arguments, in the folder, to its end.
    pub fn run(&self, arguments: &[&str]) -> Outcome {
        self.start(arguments).wait()
    }
}

/// The program under test: the one of `NIRSPI_CLI`, or that which was built with the tests.
pub fn program() -> String {
    std::env::var("NIRSPI_CLI").unwrap_or_else(|_| env!("CARGO_BIN_EXE_nirspi").to_owned())
}

/// A program that ignores no signal at its start. Tests that are started by `nohup`, or in the background of a script,
/// hand on to their programs that they ignore some.
fn heeding_signals(program: &str) -> Command {
    if !Signal::ALL.into_iter().any(Signal::is_ignored) {
        return Command::new(program);
    }
    let mut env = Command::new("env");
    env.args(["--default-signal=INT,TERM,HUP", program]);
    env
}

/// A running `nirspi`; killed when dropped.
pub struct Process {
    child: Child,
    out: PathBuf,
    err: PathBuf,
    command: String,
}

impl Process {
    /// Polls until `ready` gives something.
    fn until<T>(&mut self, what: &str, mut ready: impl FnMut(&mut Self) -> Option<T>) -> T {
        let deadline = Instant::now() + LIMIT;
        loop {
            if let Some(found) = ready(self) {
                return found;
            }
            assert!(
                Instant::now() < deadline,
                "{}: no {what} within {LIMIT:?}; it said {:?}",
                self.command,
                (fs::read_to_string(&self.out), fs::read_to_string(&self.err))
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for its end.
    pub fn wait(mut self) -> Outcome {
        let status = self.until("end", |process| process.child.try_wait().unwrap());
        let text = |path: &Path| fs::read_to_string(path).unwrap();
        // A busy machine makes any command slow enough for a line of progress.
        let stderr = text(&self.err);
        let said = stderr.split_inclusive('\n').filter(|line| !line.starts_with(PROGRESS));
        Outcome {
            code: status.code(),
            stdout: text(&self.out),
            stderr: said.collect(),
            command: self.command.clone(),
        }
    }

    /// Waits for its end, and returns all of stderr.
    #[cfg(unix)]
    pub fn wait_raw(mut self) -> String {
        self.until("end", |process| process.child.try_wait().unwrap());
        fs::read_to_string(&self.err).unwrap()
    }

    /// Waits until stdout has a line with `text`, and returns the line.
    pub fn says(&mut self, text: &str) -> String {
        self.until(text, |process| {
            let output = fs::read_to_string(&process.out).unwrap();
            let whole = output.rfind('\n').map_or("", |end| &output[..end]);
            whole.lines().find(|line| line.contains(text)).map(str::to_owned)
        })
    }

    /// Waits until stderr has a line that begins like this, and returns the line.
    pub fn remarks(&mut self, start: &str) -> String {
        self.until(start, |process| {
            let output = fs::read_to_string(&process.err).unwrap();
            let whole = output.rfind('\n').map_or("", |end| &output[..end]);
            whole.lines().find(|line| line.starts_with(start)).map(str::to_owned)
        })
    }

    /// Waits until a file or folder is there.
    #[cfg(unix)]
    pub fn has_made(&mut self, path: &Path) {
        self.until("file", |_| path.exists().then_some(()));
    }

    /// Waits until a file has at least this many bytes.
    pub fn has_written(&mut self, path: &Path, bytes: u64) {
        self.until("bytes on disk", |_| {
            fs::metadata(path).ok().filter(|file| file.len() >= bytes).map(drop)
        });
    }

    pub fn kill(&mut self) {
        self.child.kill().unwrap();
    }

    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        let command = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &command]).status().unwrap().success());
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail where it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// How a command ended.
#[derive(Debug)]
pub struct Outcome {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
    command: String,
}

impl Outcome {
    /// It did what it was asked, and complained of nothing.
    #[track_caller]
    pub fn succeeded(self) -> Self {
        let mut lines = self.stderr.lines();
        let only_warnings = lines.all(|line| line.starts_with("nirspi: warning: "));
        assert!(self.code == Some(0) && only_warnings, "{}: {self:?}", self.command);
        self
    }

    /// It failed with this code and one line on stderr that has all of these words in it.
    #[track_caller]
    pub fn failed(self, code: i32, words: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{}: {self:?}", self.command);
        assert!(
            self.stderr.lines().count() == 1 && self.stderr.starts_with("nirspi: "),
            "not one line: {self:?}"
        );
        for word in words {
            assert!(self.stderr.contains(word), "nothing of {word:?} in {self:?}");
        }
        self
    }

    /// Stdout is one JSON value and nothing else.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }
}

/// A provenance for pictures that tests write.
pub fn provenance() -> Provenance {
    let made = Made::by("another 1.0", None, ["another"], 0);
    Taken::without_camera(Origin::Unknown).made(&made)
}

/// The bytes of a `.npz` file of float32 arrays: name, shape, values.
pub fn npz(fields: &[(&str, &[usize], &[f32])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, shape, values) in fields {
        archive.start_file(format!("{name}.npy"), stored).unwrap();
        archive.write_all(&nirspi::files::npy::encode(shape, values)).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// The bytes of an array of a `.npz` file, behind its header.
pub fn array(path: &Path, name: &str) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let mut bytes = Vec::new();
    archive.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
    bytes.split_off(10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]])))
}

/// A measured scene: what a test knows of it, and the fields of its measurement file.
pub struct Measured {
    pub n: usize,
    pub image: Vec<f32>,
    pub h_row: Vec<f32>,
    /// Differences, one a row.
    pub d: Vec<f32>,
    /// Readings, + and - in turn: half of the light, and a dark level.
    pub y: Vec<f32>,
}

impl Measured {
    /// A disc and a bar on a rising ground, measured with all rows in a scattered order, by the definition:
    /// row `k` of the Sylvester matrix has the sign of the parity of `k & p` at pixel `p`.
    pub fn new(n: usize) -> Self {
        let area = n * n;
        let image: Vec<f32> = (0..area)
            .map(|p| {
                let (r, c) = ((p / n) as f32 / n as f32, (p % n) as f32 / n as f32);
                let disc = (r - 0.4).hypot(c - 0.6) < 0.25;
                let bar = (0.7..0.85).contains(&r) && c < 0.7;
                0.1 + 0.2 * r + if disc { 0.5 } else { 0.0 } + if bar { 0.3 } else { 0.0 }
            })
            .collect();
        let rows: Vec<usize> = (0..area).map(|k| (k * 77 + 5) % area).collect();
        let d: Vec<f32> =
            rows.iter()
                .map(|k| {
                    let signed = image.iter().enumerate().map(|(p, &light)| {
                        if (k & p).count_ones() % 2 == 0 { light } else { -light }
                    });
                    signed.sum()
                })
                .collect();
        let total: f32 = image.iter().sum();
        let y = d.iter().flat_map(|d| [(total + d) / 2.0 + 1.0, (total - d) / 2.0 + 1.0]).collect();
        Self { n, image, h_row: rows.iter().map(|&row| row as f32).collect(), d, y }
    }

    /// The readings in the natural order of the rows.
    pub fn natural(&self) -> Vec<f32> {
        let mut y = vec![0.0; self.y.len()];
        for (pair, &row) in self.y.as_chunks::<2>().0.iter().zip(&self.h_row) {
            y[2 * row as usize..][..2].copy_from_slice(pair);
        }
        y
    }

    /// Its file, with the field `name` replaced, or left out where `with` is nothing.
    pub fn npz_with(&self, name: &str, with: Option<(&[usize], &[f32])>) -> Vec<u8> {
        let (rows, n) = ([self.h_row.len()], [self.n as f32]);
        let pairs = [self.y.len()];
        let mut fields: Vec<(&str, &[usize], &[f32])> =
            vec![("n", &[], &n), ("h_row", &rows, &self.h_row), ("y", &pairs, &self.y)];
        fields.retain(|field| field.0 != name);
        fields.extend(with.map(|(shape, values)| (name, shape, values)));
        npz(&fields)
    }

    pub fn npz(&self) -> Vec<u8> {
        self.npz_with("recon", Some((&[self.n, self.n], &self.image)))
    }
}

/// Weights of 0 and 1 that look random and are the same in each run.
pub fn bits(count: usize) -> Vec<f32> {
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 31) as f32
    };
    (0..count).map(|_| next()).collect()
}

/// What each pattern sees of a scene.
pub fn seen(weights: &[f32], scene: &[f32]) -> Vec<f32> {
    let see = |pattern: &[f32]| pattern.iter().zip(scene).map(|(w, v)| w * v).sum();
    weights.chunks_exact(scene.len()).map(see).collect()
}

/// Pearson's correlation.
pub fn correlation(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let mean = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().zip(b).map(|(&x, &y)| f(f64::from(x) - ma, f64::from(y) - mb)).sum()
    };
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

/// Reads a few bytes from a stream that ends after them.
pub fn first_bytes(stream: &mut impl Read, bytes: usize) -> Vec<u8> {
    let mut buffer = vec![0; bytes];
    stream.read_exact(&mut buffer).unwrap();
    buffer
}
