use super::*;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn line(error: &FileError) -> String {
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

#[test]
fn files_appear_only_at_commit() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("a/b/out");
    let mut dir = OutputDir::create(&out).unwrap();
    dir.write("image.npy", b"123").unwrap();
    dir.write("report.json", b"{}").unwrap();
    assert!(!out.join("image.npy").exists() && !out.join("report.json").exists());
    let paths = dir.commit().unwrap();
    assert_eq!(paths, [out.join("image.npy"), out.join("report.json")]);
    assert_eq!(names(&out), [".nirspi.json", "image.npy", "report.json"]);
    assert_eq!(fs::read(out.join("image.npy")).unwrap(), b"123");
}

#[test]
fn a_file_that_grows_is_read_again_and_gets_its_beginning_last() {
    let root = tempfile::tempdir().unwrap();
    // Twice: the second run knows the file of the first by its checksum, and replaces it.
    for text in [&b"0123456789"[..], b"other"] {
        let mut dir = OutputDir::create(root.path()).unwrap();
        let mut grown = dir.grow("image.npy", 3).unwrap();
        for piece in text.chunks(4) {
            grown.write_all(piece).unwrap();
        }
        let mut read = [0; 3];
        grown.read_at(2, &mut read).unwrap();
        assert_eq!(read, text[2..5]);
        assert!(grown.read_at(text.len() as u64 - 2, &mut read).is_err(), "beyond the end");
        grown.write_all(b"!").unwrap();
        dir.take(grown, b"npy").unwrap();
        dir.write_in_pieces("report.json", |to| to.write_all(b"{}")).unwrap();
        dir.commit().unwrap();
        let found = fs::read(root.path().join("image.npy")).unwrap();
        assert_eq!(found, [b"npy", text, b"!"].concat());
        assert_eq!(names(root.path()), [".nirspi.json", "image.npy", "report.json"]);
    }
    let mut dir = OutputDir::create(root.path()).unwrap();
    dir.grow("image.npy", 0).unwrap().write_all(b"lost").unwrap();
    drop(dir.scratch().unwrap());
    dir.write("other.npy", b"1").unwrap();
    dir.commit().unwrap();
    let names = names(root.path());
    assert_eq!(names, [".nirspi.json", "image.npy", "other.npy", "report.json"]);
}

#[test]
fn a_run_that_fails_leaves_nothing_of_its_own() {
    let root = tempfile::tempdir().unwrap();
    let mut dir = OutputDir::create(&root.path().join("a/b/out")).unwrap();
    dir.write("image.npy", b"123").unwrap();
    drop(dir);
    assert!(names(root.path()).is_empty(), "{:?}", names(root.path()));
}

#[test]
fn a_run_without_results_keeps_its_folder() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    assert!(OutputDir::create(&out).unwrap().commit().unwrap().is_empty());
    assert!(out.is_dir());
}

#[test]
fn a_run_that_fails_leaves_what_was_there() {
    let root = tempfile::tempdir().unwrap();
    run(root.path(), &[("image.npy", b"old")]).unwrap();
    let mut dir = OutputDir::create(root.path()).unwrap();
    dir.write("image.npy", b"new").unwrap();
    drop(dir);
    assert_eq!(names(root.path()), [".nirspi.json", "image.npy"]);
    assert_eq!(fs::read(root.path().join("image.npy")).unwrap(), b"old");
}

#[test]
fn a_failing_commit_takes_its_new_files_back() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    let mut dir = OutputDir::create(&out).unwrap();
    dir.write("first.npy", b"1").unwrap();
    dir.write("second.npy", b"2").unwrap();
    fs::create_dir(out.join("second.npy")).unwrap();
    let error = dir.commit().unwrap_err();
    assert!(line(&error).contains("second.npy: is there already"), "{error}");
    assert_eq!(names(&out), ["second.npy"]);
}

#[test]
fn a_file_where_the_folder_should_be_is_named() {
    let root = tempfile::tempdir().unwrap();
    let file = root.path().join("taken");
    fs::write(&file, b"x").unwrap();
    let error = OutputDir::create(&file).unwrap_err();
    assert!(
        line(&error).ends_with("taken: found a file, expected a folder for the results"),
        "{error}"
    );
    let error = OutputDir::create(&file.join("sub/out")).unwrap_err();
    assert!(
        line(&error).ends_with("taken: found a file, expected a folder for the results"),
        "{error}"
    );
    assert_eq!(names(root.path()), ["taken"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_keeps_no_file_open_however_many_it_takes() {
    let open = |folder: &Path| {
        let files = fs::read_dir("/proc/self/fd").unwrap().filter_map(Result::ok);
        files
            .filter_map(|fd| fs::read_link(fd.path()).ok())
            .filter(|to| to.starts_with(folder))
            .count()
    };
    let root = tempfile::tempdir().unwrap();
    let mut dir = OutputDir::create(root.path()).unwrap();
    for n in 0..20 {
        dir.write(&format!("{n}.png"), b"x").unwrap();
        assert_eq!(open(root.path()), 0, "after {n}");
    }
    assert_eq!(dir.commit().unwrap().len(), 20);
}

#[cfg(unix)]
#[test]
fn results_can_be_read_by_others_as_far_as_the_umask_says() {
    use std::os::unix::fs::PermissionsExt;
    let root = tempfile::tempdir().unwrap();
    let (plain, ours) = (root.path().join("plain"), root.path().join("ours"));
    fs::write(&plain, b"x").unwrap();
    write_result(&ours, Existing::Stays, b"x").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&ours), mode(&plain));
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files_is_named_with_the_reason() {
    // A program cannot make a file in /proc, not even as root.
    let error = keep(Path::new("/proc/image.npy"), b"x").unwrap_err();
    assert!(line(&error).starts_with("/proc/image.npy: cannot write it: "), "{error}");
    assert!(!error.to_string().contains(STAGED_PREFIX), "{error}");
    let error = OutputDir::create(Path::new("/proc/out")).unwrap_err();
    assert!(line(&error).starts_with("/proc/out: cannot create it: "), "{error}");
}

#[test]
fn one_file_is_whole_or_not_there() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("rec.npy");
    let write = |path: &Path, bytes: &[u8]| write_result(path, Existing::Stays, bytes);
    write(&path, b"abc").unwrap();
    let error = write(&path, b"defg").unwrap_err();
    assert!(
        line(&error)
            .ends_with("rec.npy: is there already, expected a name that is free, or --overwrite"),
        "{error}"
    );
    let other = Existing::Replaced { made_of: None };
    write_result(&path, other, b"defg").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"defg");
    let failed = write_in_pieces(&path, other, |file| {
        file.write_all(b"half").unwrap();
        Err::<(), _>(FileError::kind(&path, "no more", "the rest"))
    });
    assert!(failed.is_err() && fs::read(&path).unwrap() == b"defg");
    assert_eq!(names(root.path()), ["rec.npy"]);

    let error = write(&root.path().join("none/rec.npy"), b"x").unwrap_err();
    assert!(line(&error).ends_with("none: cannot write to it: no such file or folder"), "{error}");
    let error = write(root.path(), b"x").unwrap_err();
    assert!(line(&error).contains("found a folder, expected a file to write"), "{error}");
    let error = write(Path::new("-"), b"x").unwrap_err();
    assert!(line(&error).starts_with("-: found no name"), "{error}");
    let error = OutputDir::create(Path::new("-")).unwrap_err();
    assert!(line(&error).starts_with("-: found no name"), "{error}");
}

/// As root, a file would else take the place of the device.
#[cfg(unix)]
#[test]
fn a_device_is_no_file_to_write() {
    for existing in [Existing::Stays, Existing::Replaced { made_of: None }] {
        let error = existing.check(Path::new("/dev/null")).unwrap_err();
        assert!(line(&error).starts_with("/dev/null: found a device or pipe"), "{error}");
    }
}

#[test]
fn no_result_replaces_what_it_was_made_of() {
    let root = tempfile::tempdir().unwrap();
    let input = root.path().join("in.npy");
    fs::write(&input, b"readings").unwrap();
    let other_names = [root.path().join("./in.npy"), root.path().join("hard.npy")];
    fs::hard_link(&input, &other_names[1]).unwrap();
    let replaced = Existing::of(true, Some(&input));
    for name in other_names.iter().chain([&input]) {
        let error = write_result(name, replaced, b"image").unwrap_err();
        assert!(line(&error).contains("the result is made of this file"), "{error}");
    }
    // A folder of images: none of them is replaced.
    let error = write_result(&input, Existing::of(true, Some(root.path())), b"image").unwrap_err();
    assert!(line(&error).contains("the result is made of this file"), "{error}");
    assert_eq!(fs::read(&input).unwrap(), b"readings");

    let beside = root.path().join("in.npy.png");
    fs::write(&beside, b"old").unwrap();
    write_result(&beside, replaced, b"new").unwrap();
    assert_eq!(fs::read(&beside).unwrap(), b"new");
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_mode_and_a_link_to_it() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let root = tempfile::tempdir().unwrap();
    let (behind, link) = (root.path().join("kept/behind.npy"), root.path().join("link.npy"));
    fs::create_dir(root.path().join("kept")).unwrap();
    fs::write(&behind, b"old").unwrap();
    fs::set_permissions(&behind, fs::Permissions::from_mode(0o640)).unwrap();
    symlink(&behind, &link).unwrap();
    write_result(&link, Existing::Replaced { made_of: None }, b"new").unwrap();
    assert!(link.is_symlink());
    assert_eq!(fs::read(&behind).unwrap(), b"new");
    assert_eq!(fs::metadata(&behind).unwrap().permissions().mode() & 0o777, 0o640);
}

fn run(folder: &Path, files: &[(&str, &[u8])]) -> Result<Vec<PathBuf>, FileError> {
    let mut out = OutputDir::create(folder)?;
    for (name, bytes) in files {
        out.write(name, bytes)?;
    }
    out.commit()
}

#[test]
fn a_run_replaces_all_of_the_run_before() {
    let root = tempfile::tempdir().unwrap();
    let files = |second: &'static [u8]| [("image.npy", &b"1"[..]), ("enhanced.npy", second)];
    run(root.path(), &files(b"2")).unwrap();
    // Results of another kind stay.
    run(root.path(), &[("rain.json", b"{}")]).unwrap();
    run(root.path(), &[("image.npy", b"3")]).unwrap();
    assert_eq!(names(root.path()), [".nirspi.json", "image.npy", "rain.json"]);
    assert_eq!(fs::read(root.path().join("image.npy")).unwrap(), b"3");
    // What a person has changed or added is not a result any more.
    run(root.path(), &files(b"2")).unwrap();
    fs::write(root.path().join("enhanced.npy"), b"my own").unwrap();
    fs::write(root.path().join("notes.txt"), b"mine").unwrap();
    run(root.path(), &[("image.npy", b"4")]).unwrap();
    let left = [".nirspi.json", "enhanced.npy", "image.npy", "notes.txt", "rain.json"];
    assert_eq!(names(root.path()), left);
}

#[test]
fn a_folder_keeps_what_is_not_ours() {
    let root = tempfile::tempdir().unwrap();
    let image = root.path().join("image.npy");
    fs::write(&image, b"readings of mine").unwrap();
    for list in [None, Some("[]"), Some("nonsense"), Some(r#"[{"../image.npy":{"bytes":1}}]"#)] {
        list.map_or(Ok(()), |list| fs::write(root.path().join(".nirspi.json"), list)).unwrap();
        let error = run(root.path(), &[("image.npy", b"1")]).unwrap_err();
        assert!(line(&error).contains("image.npy: is there already, expected another folder"));
        assert_eq!(fs::read(&image).unwrap(), b"readings of mine");
    }
    // A result that was changed since is not ours either.
    fs::remove_file(&image).unwrap();
    run(root.path(), &[("image.npy", b"1")]).unwrap();
    run(root.path(), &[("image.npy", b"2")]).unwrap();
    fs::write(&image, b"3").unwrap();
    assert!(run(root.path(), &[("image.npy", b"1")]).is_err());
    // No list leads to files elsewhere.
    let folder = root.path().join("inner");
    let outside =
        r#"[{"image.npy":{"bytes":1,"crc32":0},"../image.npy":{"bytes":1,"crc32":1842515611}}]"#;
    assert_eq!(crc32fast::hash(b"3"), 1_842_515_611);
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join(".nirspi.json"), outside).unwrap();
    run(&folder, &[("image.npy", b"1")]).unwrap();
    assert_eq!(fs::read(&image).unwrap(), b"3");
}

#[test]
fn a_file_of_the_program_is_replaced_and_its_folders_are_made() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("a/b/kept.json");
    keep(&path, b"1").unwrap();
    keep(&path, b"22").unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"22");
    assert!(keep(&root.path().join("a"), b"3").is_err());
}
