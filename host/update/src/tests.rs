#![allow(clippy::unwrap_used)] // helpers of tests are tests

use super::*;
use crate::gateware::tests::{bitstream, camera};
use std::fs;
use std::path::Path;

const FIRMWARE: &[u8] = b"\x7fELF and so on";

/// A release of firmware for two boards, and of one bitstream.
fn release(folder: &Path) -> PathBuf {
    fs::write(folder.join("firmware"), FIRMWARE).unwrap();
    fs::write(folder.join("bitstream"), bitstream()).unwrap();
    let source = |file, component, board: &str| Source {
        path: folder.join(file),
        component,
        board: board.to_owned(),
    };
    let sources = [
        source("firmware", Component::Firmware, "another-board"),
        source("firmware", Component::Firmware, "nucleo-u5a5zj-q"),
        source("bitstream", Component::Gateware, "ecp5-evn"),
    ];
    let out = folder.join("release");
    let manifest = pack(&sources, &out).unwrap();
    assert_eq!(Release::open(&out).unwrap().manifest(), &manifest);
    out
}

fn identity(change: impl FnOnce(&mut CameraIdentity)) -> CameraIdentity {
    let mut camera = CameraIdentity {
        firmware: "0.0.9".into(),
        ..CameraIdentity::current("nucleo-u5a5zj-q", "A1")
    };
    change(&mut camera);
    camera
}

/// Changes the manifest of a release.
fn edit(release: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let path = release.join(MANIFEST);
    let mut manifest = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut manifest);
    fs::write(path, manifest.to_string()).unwrap();
}

/// Why the release is refused for this camera, in one line.
fn refusal(path: &Path, camera: &CameraIdentity) -> String {
    let plan = Release::open(path).and_then(|release| Plan::new(&release, camera));
    let line = nirspi::causes::in_one_line(&plan.unwrap_err());
    assert!(!line.contains('\n'), "{line}");
    line
}

#[test]
fn a_release_updates_the_fpga_of_a_camera_and_its_version_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let release = release(folder.path());
    let (link, loaded) = camera();
    let mut session = Session::open(Box::new(link)).unwrap();
    let file = Release::open(&release.join("ecp5-evn.bit")).unwrap();
    let mut plan = Plan::new(&file, &identity(|_| {})).unwrap();
    assert!(plan.firmware.is_none());
    let mut change = plan.gateware.take().unwrap();
    load_gateware(&mut session, &change, &mut |_| {}).unwrap();
    assert!(loaded.lock().unwrap().bytes == bitstream());

    change.asset.version = "9.9.9".into();
    let error = load_gateware(&mut session, &change, &mut |_| {}).unwrap_err();
    assert!(matches!(error, UpdateError::NotRunning { .. }), "{error}");
}

#[test]
fn a_release_without_files_and_gateware_for_a_camera_without_an_fpga_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let release = release(folder.path());
    for board in ["virtual", "mps2-an505"] {
        let line =
            refusal(&release.join("ecp5-evn.bit"), &identity(|camera| camera.board = board.into()));
        assert_eq!(
            line,
            format!("ecp5-evn.bit: gateware, but the camera's board is {board}, which loads none")
        );
    }
    edit(&release, |manifest| manifest["files"] = serde_json::json!([]));
    let line = refusal(&release, &identity(|_| {}));
    assert!(line.contains("the release has no files, expected firmware or gateware"), "{line}");
}

#[test]
fn a_camera_gets_the_firmware_of_its_board_once() {
    let folder = tempfile::tempdir().unwrap();
    let release = Release::open(&release(folder.path())).unwrap();
    let plan = Plan::new(&release, &identity(|_| {})).unwrap();
    let firmware = plan.firmware.as_ref().unwrap();
    assert_eq!(
        (firmware.asset.board.as_str(), &firmware.content[..]),
        ("nucleo-u5a5zj-q", FIRMWARE)
    );
    assert_eq!((firmware.before.as_str(), plan.chip()), ("0.0.9", Some("STM32U5A5ZJTxQ")));
    let same = identity(|camera| camera.firmware = env!("CARGO_PKG_VERSION").into());
    assert!(Plan::new(&release, &same).unwrap().firmware.is_none());
}

#[test]
fn a_file_that_is_cut_or_changed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let release = release(folder.path());
    let (file, camera) = (release.join("ecp5-evn.bit"), identity(|_| {}));
    let mut damaged = bitstream();
    damaged[3000] ^= 1;
    fs::write(&file, &damaged).unwrap();
    assert!(refusal(&release, &camera).contains("ecp5-evn.bit: SHA-256 is "));
    damaged.truncate(4000);
    fs::write(&file, &damaged).unwrap();
    assert!(refusal(&release, &camera).contains("ecp5-evn.bit: 4000 bytes, expected 5042"));
    // A file of twenty gigabytes, of which nothing is read.
    fs::File::options().write(true).open(&file).unwrap().set_len(20 << 30).unwrap();
    assert!(refusal(&release, &camera).contains("21474836480 bytes, expected 5042"));
    fs::remove_file(&file).unwrap();
    assert!(refusal(&release, &camera).contains("ecp5-evn.bit: cannot read it"));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/zero", &file).unwrap();
        let told = refusal(&release, &camera);
        assert!(told.contains("ecp5-evn.bit: cannot read it: a device or pipe"), "{told}");
    }
}

#[test]
fn what_does_not_fit_is_refused_before_the_camera_changes() {
    let folder = tempfile::tempdir().unwrap();
    let release = release(folder.path());
    let fits = identity(|_| {});
    let other = identity(|camera| camera.board = "mps2-an505".into());
    let told = refusal(&release, &other);
    assert!(
        told.contains("another-board, nucleo-u5a5zj-q, but the camera's board is mps2"),
        "{told}"
    );
    let newer = identity(|camera| camera.protocol = version::CURRENT + 1);
    assert!(refusal(&release, &newer).contains("choose a newer release"));
    assert!(refusal(folder.path(), &fits).contains("expected a release folder"));
    assert!(refusal(&folder.path().join("none"), &fits).contains("no such file or folder"));
    fs::write(release.join("stray"), b"").unwrap();
    assert!(refusal(&release.join("stray"), &fits).contains("does not list stray"));

    edit(&release, |manifest| manifest["protocol"] = 999.into());
    assert!(refusal(&release, &fits).contains("update this program first"));
    edit(&release, |manifest| manifest["files"][0]["file"] = "../firmware".into());
    let told = refusal(&release, &fits);
    assert!(told.contains("files[0].file") && told.contains("../firmware"), "{told}");
    edit(&release, |manifest| manifest["files"] = 5.into());
    assert!(refusal(&release, &fits).contains("release.json: not the manifest of a release: "));
}

#[test]
fn a_bitstream_longer_than_the_boards_memory_is_refused_before_the_camera_changes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bitstream");
    let most = Board::named("nucleo-u5a5zj-q").unwrap().staging_bytes.unwrap();
    let plan = |length: u64| {
        let mut long = bitstream();
        long.resize(length as usize, 0xFF);
        fs::write(&path, long).unwrap();
        let gateware = Source {
            path: path.clone(),
            component: Component::Gateware,
            board: "ecp5-evn".to_owned(),
        };
        let out = folder.path().join(length.to_string());
        pack(&[gateware], &out).unwrap();
        Release::open(&out).and_then(|release| Plan::new(&release, &identity(|_| {})))
    };
    assert!(plan(most).is_ok());
    let told = plan(most + 1).unwrap_err().to_string();
    let words =
        "gateware of 1048577 bytes, but the camera's board nucleo-u5a5zj-q takes 1048576 at most";
    assert!(told.contains(words), "{told}");
}

#[test]
fn no_release_is_made_of_files_of_another_kind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("firmware");
    fs::write(&path, FIRMWARE).unwrap();
    let source = Source { path, component: Component::Gateware, board: "ecp5-evn".into() };
    let out = folder.path().join("release");
    let error = pack(&[source], &out).unwrap_err();
    assert!(error.to_string().contains("not gateware, expected a bitstream"), "{error}");
    assert!(!out.exists());
}

#[test]
fn new_firmware_is_awaited_and_must_be_the_releases() {
    let folder = tempfile::tempdir().unwrap();
    let release = Release::open(&release(folder.path())).unwrap();
    let mut plan = Plan::new(&release, &identity(|_| {})).unwrap();
    let mut change = plan.firmware.take().unwrap();
    let mut attempts = 0;
    let mut open = || match attempts {
        0..2 => {
            attempts += 1;
            Err(UpdateError::NoManifest("not up yet".into()))
        }
        _ => Ok(Session::open(Box::new(camera().0)).unwrap()),
    };
    await_firmware(&change, &mut open).unwrap();
    change.asset.version = "9.9.9".into();
    let error = await_firmware(&change, &mut open).err().unwrap();
    assert!(error.to_string().contains("reports 0.1.0, expected 9.9.9"), "{error}");
}
