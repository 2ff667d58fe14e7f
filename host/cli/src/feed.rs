//! Feeds, the live readings of any bench: `nirspi capture --camera feed:ADDR`.

use super::capture::{self, Args};
use super::progress::Progress;
use super::{Usage, print, provenance, reconstruct, settings};
use anyhow::{Context, Result, bail};
use nirspi::capture::{FeedProgress, FeedReport, StopCause, record_feed};
use nirspi::feed::{Feed, FeedError, Recorder};
use nirspi::files::interrupt;
use nirspi::files::output::Existing;
use nirspi::source::Source;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Options of every command that reads a feed.
const EVERYWHERE: [&str; 7] =
    ["camera", "json", "quiet", "strict", "verbose", "settings", "save-settings"];

/// Records a camera or a feed.
pub fn capture(args: &Args) -> Result<ExitCode> {
    let Some(address) = args.camera.feed() else { return capture::run(args) };
    let Args { frames, seconds, overwrite, figure, report, .. } = *args;
    let (out, picture) = (args.out.as_deref(), args.picture.as_deref());
    refuse_others(&["frames", "seconds", "out", "overwrite", "picture", "figure"])?;
    let out = match out {
        Some(out) if out.extension().is_none_or(|extension| extension != "npz") => {
            let out = out.display();
            return Err(Usage(format!("--out {out}: expected a name that ends in .npz")).into());
        }
        Some(out) => out.to_owned(),
        None => Recorder::first_free(Path::new("")),
    };
    Existing::of(overwrite, None).check(&out)?;
    let stop = interrupt::stop_flag();
    let frames = frames.map(u64::from);
    let bar = Progress::new("capture", frames, "frames");
    bar.say("waiting for the header");
    let opened = Feed::open(address, || !stop.load(Ordering::Relaxed));
    let mut feed = match opened {
        Err(FeedError::Stopped(_)) => bail!("{address}: stopped before the header came"),
        opened => opened?,
    };
    if picture.is_some() {
        feed.header().hadamard().with_context(|| format!("--picture of {address}"))?;
    }
    let provenance = feed.header().taken(&address.to_string()).made(provenance::made());
    let recorder = Recorder::begin(&out, overwrite, feed.header(), &provenance)?;
    let watch = |progress: &FeedProgress<'_>| {
        bar.set(progress.account.frames);
        bar.say(match progress.quiet {
            Some(quiet) if quiet.as_secs() > 0 => format!("no data for {} s", quiet.as_secs()),
            _ => progress.account.to_string(),
        });
        match stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(StopCause::of_program()),
            false => ControlFlow::Continue(()),
        }
    };
    let recorded = record_feed(&mut feed, recorder, frames, seconds, watch)?;
    drop(bar);
    let say = |recorded: &FeedReport| recorded.words(address).iter().try_for_each(print::line);
    report.print(&recorded, &provenance, say)?;
    if let (Some(folder), Some(file)) = (picture, recorded.files.first()) {
        let source = Source::of_feed(feed.header(), file, recorded.mean.readings())?;
        reconstruct::picture(source, file, folder, figure, report.json)?;
    }
    match &recorded.missing {
        None => Ok(ExitCode::SUCCESS),
        Some(missing) => {
            print::complain(format_args!("{address}: {missing}"));
            Ok(ExitCode::FAILURE)
        }
    }
}

/// Whether the user has given this option on the command line.
pub fn is_given(name: &str) -> bool {
    settings::given().iter().any(|given| given == name)
}

/// Refuses options for cameras, all but these.
pub fn refuse_others(known: &[&str]) -> Result<()> {
    let mut given = settings::given().iter().map(String::as_str);
    match given.find(|name| !known.contains(name) && !EVERYWHERE.contains(name)) {
        None => Ok(()),
        Some(other) => {
            let why = "a feed says in its header what is measured";
            Err(Usage(format!("--{other} does not go with --camera feed:ADDR: {why}")).into())
        }
    }
}
