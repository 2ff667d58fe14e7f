use super::*;
use crate::archive::tests::{Stopping, folder_of, options, reader};
use crate::archive::{ArchiveReport, ImageFiles, Work, archive, archive_to};
use crate::files::FileError;
use object_store::memory::InMemory;
use object_store::{ObjectStoreExt, PutPayload};
use std::sync::atomic::AtomicBool;

/// A store in memory with the files of a folder under `archive/`, the files in their folder, and the
/// path of a table there.
fn store_of(count: usize) -> (tempfile::TempDir, Arc<InMemory>, PathBuf) {
    let (root, folder, out) = folder_of(count);
    let store = Arc::new(InMemory::new());
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let entry = entry.unwrap();
        let key = Key::from(format!("archive/{}", entry.file_name().to_str().unwrap()));
        let bytes = std::fs::read(entry.path()).unwrap();
        runtime.block_on(store.put(&key, PutPayload::from(bytes))).unwrap();
    }
    let local = ImageFiles::of(&folder, reader()).unwrap();
    archive(&local, &options(&out, 2, false), &AtomicBool::new(false), &mut |_| {}).unwrap();
    (root, store, out)
}

fn files_in(store: &Arc<InMemory>) -> ImageFiles {
    let folder = Stored::in_store(Arc::clone(store) as Arc<_>, "archive");
    ImageFiles::at(Place::Store(folder), reader()).unwrap()
}

fn table_in(store: &Arc<InMemory>) -> Place {
    Place::Store(Stored::in_store(Arc::clone(store) as Arc<_>, "out/table.parquet"))
}

fn run(
    table: &Place,
    work: &impl Work,
    resume: bool,
    stop: &AtomicBool,
) -> Result<ArchiveReport, ArchiveError> {
    let options = options(Path::new("unused"), 2, resume);
    archive_to(table, work, &options, stop, &mut |_| {})
}

fn object(place: &Place) -> &Stored {
    let Place::Store(object) = place else { panic!("an object") };
    object
}

#[test]
fn a_table_of_a_store_has_the_bytes_of_a_local_one_whatever_interrupts_it() {
    let (_root, store, local) = store_of(600);
    let (files, table) = (files_in(&store), table_in(&store));
    let never = AtomicBool::new(false);
    for at in [100, 290, 530] {
        let stop = AtomicBool::new(false);
        let work = Stopping { files: &files, stop: &stop, at, made: Vec::new().into() };
        let ended = run(&table, &work, at > 100, &stop);
        assert!(matches!(ended, Err(ArchiveError::Stopped { .. })), "{at}");
        assert_eq!(object(&table).size().unwrap(), None);
    }
    let begun = run(&table, &files, false, &never).unwrap_err().to_string();
    assert!(begun.starts_with("memory://out/table.parquet.parts: an earlier run"), "{begun}");
    let report = run(&table, &files, true, &never).unwrap();
    assert_eq!((report.rows, report.files_before), (600, 512));
    assert!(object(&table).get().unwrap().unwrap() == std::fs::read(&local).unwrap());
    // Nothing but the table is left, and a further run has nothing to do.
    assert_eq!(object(&table).with_ending(".parts").names().unwrap(), []);
    let again = run(&table, &files, true, &never).unwrap();
    assert_eq!((again.rows, again.files_before, again.jobs), (600, 600, 0));
    assert_eq!(again.bytes, std::fs::metadata(&local).unwrap().len());
}

#[test]
fn a_part_that_is_not_whole_is_made_again() {
    let (_root, store, local) = store_of(600);
    let (files, table) = (files_in(&store), table_in(&store));
    let parts = object(&table).with_ending(".parts");
    let interrupted_at_the_end = || {
        let stop = AtomicBool::new(false);
        let work = Stopping { files: &files, stop: &stop, at: 599, made: Vec::new().into() };
        run(&table, &work, true, &stop).unwrap_err();
        work.made.into_inner().unwrap()
    };
    interrupted_at_the_end();
    // What a kill leaves: rows without a line; and what a damaged store leaves: a line alone.
    let damages: [(&str, usize); 3] =
        [("000001.json", 256), ("000001.rows", 256), ("000000.json", 0)];
    for (gone, first) in damages {
        parts.remove([gone.to_owned()]).unwrap();
        assert_eq!(interrupted_at_the_end().into_iter().min(), Some(first), "{gone}");
    }
    assert_eq!(run(&table, &files, true, &AtomicBool::new(false)).unwrap().rows, 600);
    assert!(object(&table).get().unwrap().unwrap() == std::fs::read(local).unwrap());
}

#[test]
fn of_two_processes_one_is_told() {
    let (_root, store, local) = store_of(300);
    let (files, table) = (files_in(&store), table_in(&store));
    let stop = AtomicBool::new(false);
    let work = Stopping { files: &files, stop: &stop, at: 200, made: Vec::new().into() };
    run(&table, &work, false, &stop).unwrap_err();
    // Two runs go on from the same moment: the first adds a part, and the second finds it there.
    let mut first = table.shelf().unwrap();
    let mut second = table.shelf().unwrap();
    assert_eq!((first.take().unwrap().len(), second.take().unwrap().len()), (1, 1));
    first.add(0, &[], "{}\n").unwrap();
    assert!(matches!(second.add(0, &[], "{}\n"), Err(ArchiveError::Busy(_))));
    drop((first, second));
    object(&table).with_ending(".parts").remove(["000000.json".to_owned()]).unwrap();
    assert_eq!(run(&table, &files, true, &AtomicBool::new(false)).unwrap().rows, 300);
    assert!(object(&table).get().unwrap().unwrap() == std::fs::read(local).unwrap());
}

#[test]
fn bad_files_are_named_by_their_address() {
    let (_root, store, _) = store_of(3);
    let folder = Stored::in_store(Arc::clone(&store) as Arc<_>, "archive");
    folder.join("0001.npz").put(b"PK damaged".to_vec()).unwrap();
    folder.join("b/none.csv").put(Vec::new()).unwrap();
    folder.join(".hidden/1.npz").put(b"x".to_vec()).unwrap();
    let files = files_in(&store);
    folder.join("0002.npz").client.remove(vec![folder.join("0002.npz").key]).unwrap();
    let report = run(&table_in(&store), &files, false, &AtomicBool::new(false)).unwrap();
    assert_eq!((report.rows, report.files), (1, 4));
    let reasons: Vec<&str> = report.skipped.iter().map(|skipped| &*skipped.reason).collect();
    assert!(reasons[0].starts_with("memory://archive/0001.npz: "), "{reasons:?}");
    assert_eq!(reasons[1], "memory://archive/0002.npz: cannot read it: no such file or folder");
    assert!(reasons[2].starts_with("memory://archive/b/none.csv: "), "{reasons:?}");
    let empty = Place::Store(Stored::in_store(store as Arc<_>, "nothing"));
    let error = empty.find().unwrap_err().to_string();
    assert!(error.starts_with("memory://nothing: no measurement files in the folder"), "{error}");
}

#[test]
fn a_large_object_goes_and_comes_in_pieces() {
    let object = Stored::in_store(Arc::new(InMemory::new()), "a/large");
    let bytes: Vec<u8> = (0..2 * PIECE_BYTES as usize + 5).map(|i| (i * 31 % 251) as u8).collect();
    let written = object.put_in_pieces(|file| {
        file.write_all(&bytes).map_err(|error| FileError::io(Path::new("x"), "write", error))
    });
    assert_eq!(written.unwrap(), bytes.len() as u64);
    assert_eq!(object.size().unwrap(), Some(bytes.len() as u64));
    assert!(object.get().unwrap().unwrap() == bytes);
    let copied = object.with_copy(|path| Ok(std::fs::read(path).unwrap()));
    assert!(copied.unwrap() == bytes);
    let mut reader = object.reader(bytes.len() as u64);
    for at in [0, 7, PIECE_BYTES as usize - 3, bytes.len() - 4] {
        let mut read = [0; 4];
        reader.seek(SeekFrom::Start(at as u64)).unwrap();
        reader.read_exact(&mut read).unwrap();
        assert_eq!(read, bytes[at..at + 4], "{at}");
    }
    assert_eq!(reader.seek(SeekFrom::End(-1)).unwrap(), bytes.len() as u64 - 1);
    let mut rest = Vec::new();
    reader.read_to_end(&mut rest).unwrap();
    assert_eq!(rest, bytes[bytes.len() - 1..]);
    // A table that cannot be made leaves no object.
    let other = object.join("other");
    let failed = other.put_in_pieces(|_| Err(ArchiveError::Threads("none".to_owned())));
    assert!(failed.is_err() && other.size().unwrap().is_none());
}

#[test]
fn an_address_names_a_place_and_hides_its_password() {
    let of = |address: &str| Stored::of(Path::new(address));
    for (address, key) in [
        ("s3://bucket/a/b", "a/b"),
        ("s3://bucket", ""),
        ("gs://bucket/a%20b/", "a b"),
        ("https://host:8443/dav/a", "dav/a"),
    ] {
        let Place::Store(object) = of(address).unwrap() else { panic!("{address}") };
        assert_eq!((object.key.as_ref(), object.shown.to_str()), (key, Some(address)));
    }
    let Place::Store(object) = of("https://me:secret@host/a").unwrap() else { panic!("an object") };
    assert_eq!(object.join("1.npz").shown(), Path::new("https://me:***@host/a/1.npz"));
    assert_eq!(of("file:///tmp/a%20b").unwrap().shown(), Path::new("/tmp/a b"));
    for (address, told) in [
        ("s3://", "s3://: "),
        ("https://me:secret@host/a?b", "https://me:***@host/a?b: a `?` or `#`"),
        ("https://me:se@cret@ho st/a", "https://me:***@ho st/a: "),
        ("file://host/a", "file://host/a: "),
    ] {
        let error = of(address).unwrap_err().to_string();
        assert!(error.starts_with(told), "{error}");
        assert!(error.ends_with("expected an address such as s3://bucket/folder"), "{error}");
    }
}

#[test]
fn a_server_that_is_not_there_is_one_line() {
    // The port of a listener that is gone.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let Place::Store(folder) =
        Stored::of(Path::new(&format!("http://127.0.0.1:{port}/a"))).unwrap()
    else {
        panic!("an object")
    };
    let error = folder.names().unwrap_err().to_string();
    let expected = format!("http://127.0.0.1:{port}/a: cannot list it: Connection refused");
    assert!(error.starts_with(&expected), "{error}");
}
