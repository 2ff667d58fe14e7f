//! `nirspi reconstruct DIR`: the images of all measurements in a folder, as one table.

use super::{Args, print};
use crate::Usage;
use crate::progress::Progress;
use crate::provenance::made;
use crate::report::ReportArgs;
use anyhow::Result;
use nirspi::archive::{ArchiveOptions, ArchiveReport, ImageFiles, RowReader, Shard, Work, archive};
use nirspi::provenance::{Provenance, Taken};
use nirspi::source::FirstPatterns;
use nirspi_nets::Device;
use std::num::NonZeroUsize;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// How to make a table of many images.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "A table of many images")]
pub struct FolderArgs {
    /// Number of files or measurements to work on at a time [default: the number of cores]
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Continue a run that was interrupted, with the files that it began with
    #[arg(long)]
    resume: bool,
    /// Take a share of the files or measurements, part I of N, so that several machines can work on one table
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

impl FolderArgs {
    /// Refuses these arguments for a single file.
    pub fn refuse(&self) -> Result<()> {
        let Self { jobs, resume, shard } = self;
        let given = [(jobs.is_some(), "jobs"), (*resume, "resume"), (shard.is_some(), "shard")];
        match given.into_iter().find(|(given, _)| *given) {
            Some((_, name)) => Err(Usage(format!("--{name} belongs to a folder of files")).into()),
            None => Ok(()),
        }
    }

    /// How to make the table `out`.
    pub fn options(&self, out: &Path, of: &str) -> Result<ArchiveOptions> {
        if out.extension().is_none_or(|ending| ending != "parquet") {
            let found = out.display();
            let expected = "expected a name that ends in .parquet for the table of";
            return Err(Usage(format!("--out {found}: {expected} {of}")).into());
        }
        let (jobs, resume, shard) = (self.jobs, self.resume, self.shard.unwrap_or(Shard::WHOLE));
        Ok(ArchiveOptions { out: out.to_owned(), jobs, resume, shard })
    }

    /// Makes the table, and says what is missing.
    pub fn run(
        &self,
        work: &impl Work,
        options: &ArchiveOptions,
        items: &str,
        printed: ReportArgs,
        provenance: &Provenance,
    ) -> Result<(ArchiveReport, ExitCode)> {
        let mut bar = None;
        let report = archive(work, options, &AtomicBool::new(false), &mut |done| {
            let bar = bar.get_or_insert_with(|| Progress::of("reconstructing", done.items, items));
            bar.set(done.done);
        })?;
        drop(bar);
        let code = printed.print(&report, provenance, |report| {
            let reasons = report.skipped.iter().map(|skipped| &skipped.reason);
            reasons.map(|reason| format!("skipped: {reason}")).try_for_each(print::note)?;
            print::line(report)
        })?;
        let Some(missing) = report.complaint() else { return Ok((report, code)) };
        print::complain(format_args!("{}: {missing}", report.out.display()));
        Ok((report, ExitCode::FAILURE))
    }
}

pub fn run(args: &Args, first: FirstPatterns) -> Result<ExitCode> {
    if args.warm_start || args.matrix.is_some() {
        let name = if args.warm_start { "--warm-start" } else { "--matrix" };
        return Err(Usage(format!("{name} belongs to a single file, not to a folder")).into());
    }
    let input = &args.source.input;
    let options = args.folder.options(&args.out, &format!("the folder {}", input.display()))?;
    let mut reader =
        RowReader::new(args.source.options()?, args.method.solver(first, args.sampling)?);
    if args.enhance {
        reader = reader.enhanced(Device::cpu());
    }
    let work = ImageFiles::of(input, reader)?;
    let provenance = Taken::of_file(input, None).made(made());
    Ok(args.folder.run(&work, &options, "files", args.report, &provenance)?.1)
}
