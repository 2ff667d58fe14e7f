//! `nirspi camera setup`: prepares a machine for cameras on USB.

use super::{Usage, print, provenance};
use anyhow::Result;
use nirspi::udev::{Group, Installed, RULE_NAME, RULES_DIR, RuleError, check, install, uninstall};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// Let this machine's users use cameras on USB
///
/// On Linux this installs a udev rule, once, and needs root. The rule lets the user at the machine open the camera; --group
/// lets a group of users open it too, over SSH and in services. Nothing has to be done on other systems.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera setup --check\n\
    \x20 sudo nirspi camera setup\n\
    \x20 sudo nirspi camera setup --group plugdev")]
pub struct Args {
    /// Only say whether the rule is installed; exit code 1 if not
    #[arg(long)]
    check: bool,
    /// Remove the rule
    #[arg(long, conflicts_with = "check")]
    uninstall: bool,
    /// Let the users of this group open the camera too [default: the group of the rule that is there]
    #[arg(long, value_name = "GROUP", conflicts_with_all = ["check", "uninstall"])]
    group: Option<Group>,
    /// Where udev rules lie
    #[arg(long, value_name = "DIR", default_value = RULES_DIR)]
    rules_dir: PathBuf,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    if !cfg!(target_os = "linux") {
        print::line("nothing to set up: this system needs no rule for USB")?;
        return Ok(ExitCode::SUCCESS);
    }
    let folder = &args.rules_dir;
    if !folder.is_dir() {
        return Err(Usage(format!("--rules-dir {}: no such folder", folder.display())).into());
    }
    let path = folder.join(RULE_NAME);
    let path = path.display();
    if args.check {
        let (text, code) = match check(folder)? {
            Installed::Yes => (format!("{path} is installed"), ExitCode::SUCCESS),
            Installed::Other => (
                format!("{path} is of another version: sudo nirspi camera setup"),
                ExitCode::FAILURE,
            ),
            Installed::No => {
                (format!("{path} is not installed: sudo nirspi camera setup"), ExitCode::FAILURE)
            }
        };
        print::line(text)?;
        return Ok(code);
    }
    let (changed, said) = if args.uninstall {
        (uninstall(folder).map_err(explain)?, ["removed", "was not there"])
    } else {
        if let Some(group) = &args.group {
            group.check().map_err(|error| Usage(format!("--group: {error}")))?;
        }
        (
            install(folder, args.group.as_ref()).map_err(explain)?,
            ["installed", "was installed already"],
        )
    };
    print::line(format_args!("{path} {}", said[usize::from(!changed)]))?;
    if changed && folder == Path::new(RULES_DIR) && !reload() {
        print::line("udev was not told: plug the camera in again, or restart the machine")?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Explains what to do about a missing permission.
fn explain(error: RuleError) -> anyhow::Error {
    if !error.is_permission() {
        return error.into();
    }
    // The PATH of root may not contain the program.
    let program = provenance::program().display();
    anyhow::anyhow!("{}: sudo {program} camera setup", nirspi::causes::in_one_line(&error))
}

/// Makes udev read its rules again and check the connected devices.
fn reload() -> bool {
    let udevadm = |arguments: &[&str]| {
        let mut command = Command::new("udevadm");
        let command = command.args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    udevadm(&["control", "--reload"]) && udevadm(&["trigger", "--subsystem-match=usb"])
}
