//! The client of a store: its requests, one call each, from any thread.
//!
//! # Invariant
//! A child of `fork` has a client of its own: the threads and connections of the parent do not exist
//! there (`host/python/tests/stores`, `test_a_child_of_fork_reads_a_store`).

use super::PIECE_BYTES;
use data_encoding::BASE64;
use futures_util::{StreamExt, TryStreamExt, stream};
use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::http::HttpBuilder;
use object_store::path::Path as Key;
use object_store::{
    ClientOptions, Error, GetOptions, GetRange, ObjectStore, ObjectStoreExt, ObjectStoreScheme,
    PutMode, PutMultipartOptions, PutOptions, PutPayload, RetryConfig,
};
use percent_encoding::percent_decode_str;
use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};
use std::error::Error as _;
use std::io::{self, Read, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::runtime::Runtime;
use url::{Position, Url};

/// The longest time of one request to a WebDAV server, retries not counted: it takes a table in one
/// piece. The other stores have the time limits of `object_store`, which the environment can change.
const PATIENCE: Duration = Duration::from_secs(300);
/// A request that fails is repeated for this long.
const RETRY: Duration = Duration::from_secs(30);
const RETRIES: usize = 5;

/// A store with the thread that speaks to it.
struct Open {
    runtime: Runtime,
    store: Arc<dyn ObjectStore>,
}

/// A store, opened when it is used first.
pub(super) struct Client {
    make: Box<dyn Fn() -> object_store::Result<Arc<dyn ObjectStore>> + Send + Sync>,
    open: Mutex<Option<(u32, Arc<Open>)>>,
}

impl Client {
    /// The store of an address.
    pub(super) fn new(url: Url, scheme: ObjectStoreScheme) -> Self {
        Self { make: Box::new(move || store_of(&url, &scheme)), open: Mutex::default() }
    }

    /// A store that is there.
    #[cfg(test)]
    pub(super) fn of(store: Arc<dyn ObjectStore>) -> Self {
        Self { make: Box::new(move || Ok(Arc::clone(&store))), open: Mutex::default() }
    }

    fn open(&self) -> io::Result<Arc<Open>> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let process = std::process::id();
        match &*open {
            Some((owner, open)) if *owner == process => return Ok(Arc::clone(open)),
            _ => {}
        }
        // The thread of the parent does not exist here, so nothing can wait for it.
        std::mem::forget(open.take());
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("object-store")
            .enable_all()
            .build()?;
        let store = (self.make)().map_err(reason)?;
        let opened = Arc::new(Open { runtime, store });
        *open = Some((process, Arc::clone(&opened)));
        Ok(opened)
    }

    /// Every object whose key begins with the folder's, with its size.
    pub(super) fn list(&self, folder: &Key) -> io::Result<Vec<(Key, u64)>> {
        let Open { runtime, store } = &*self.open()?;
        let found = store.list(Some(folder)).map_ok(|object| (object.location, object.size));
        runtime.block_on(found.try_collect()).map_err(reason)
    }

    pub(super) fn size(&self, key: &Key) -> io::Result<Option<u64>> {
        let Open { runtime, store } = &*self.open()?;
        match runtime.block_on(store.head(key)) {
            Ok(object) => Ok(Some(object.size)),
            Err(Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(reason(error)),
        }
    }

    pub(super) fn range(&self, key: &Key, range: Range<u64>) -> io::Result<Vec<u8>> {
        let Open { runtime, store } = &*self.open()?;
        Ok(runtime.block_on(store.get_range(key, range)).map_err(reason)?.to_vec())
    }

    /// Copies an object, piece by piece.
    pub(super) fn copy_to(&self, key: &Key, to: &mut impl Write) -> io::Result<()> {
        let Open { runtime, store } = &*self.open()?;
        let first = async {
            let range = Some(GetRange::Bounded(0..PIECE_BYTES));
            let found = store.get_opts(key, GetOptions { range, ..GetOptions::default() }).await?;
            let size = found.meta.size;
            Ok::<_, Error>((size, found.bytes().await?))
        };
        let (size, bytes) = match runtime.block_on(first) {
            Ok(found) => found,
            Err(error @ Error::NotFound { .. }) => return Err(reason(error)),
            // A server that knows no ranges, and an object of no bytes.
            Err(_) => {
                let whole = async { store.get(key).await?.bytes().await };
                return to.write_all(&runtime.block_on(whole).map_err(reason)?);
            }
        };
        to.write_all(&bytes)?;
        let mut at = bytes.len() as u64;
        while at < size {
            let piece = at..(at + PIECE_BYTES).min(size);
            let bytes = runtime.block_on(store.get_range(key, piece)).map_err(reason)?;
            if bytes.is_empty() {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            to.write_all(&bytes)?;
            at += bytes.len() as u64;
        }
        Ok(())
    }

    pub(super) fn put(&self, key: &Key, bytes: Vec<u8>, mode: PutMode) -> io::Result<()> {
        let Open { runtime, store } = &*self.open()?;
        let payload = PutPayload::from(bytes);
        let put = |mode| store.put_opts(key, payload.clone(), PutOptions::from(mode));
        let put = match runtime.block_on(put(mode.clone())) {
            Err(Error::NotImplemented { .. }) if mode != PutMode::Overwrite => {
                runtime.block_on(put(PutMode::Overwrite))
            }
            put => put,
        };
        put.map(|_| ()).map_err(reason)
    }

    /// Writes an object of this size from a file. The object appears when it is whole.
    pub(super) fn put_file(&self, key: &Key, file: &mut impl Read, bytes: u64) -> io::Result<()> {
        let piece_of = |file: &mut dyn Read, most: u64| {
            let mut piece = Vec::new();
            file.take(most).read_to_end(&mut piece).map(|_| piece)
        };
        if bytes <= PIECE_BYTES {
            return self.put(key, piece_of(file, bytes)?, PutMode::Overwrite);
        }
        let Open { runtime, store } = &*self.open()?;
        let parts = runtime.block_on(store.put_multipart_opts(key, PutMultipartOptions::default()));
        let mut parts = match parts {
            // WebDAV takes an object in one piece.
            Err(Error::NotImplemented { .. }) => {
                return self.put(key, piece_of(file, bytes)?, PutMode::Overwrite);
            }
            parts => parts.map_err(reason)?,
        };
        let mut send = || {
            loop {
                let piece = piece_of(file, PIECE_BYTES)?;
                if piece.is_empty() {
                    break;
                }
                runtime.block_on(parts.put_part(piece.into())).map_err(reason)?;
            }
            runtime.block_on(parts.complete()).map(|_| ()).map_err(reason)
        };
        let sent = send();
        if sent.is_err() {
            // What was sent takes room in the store until it is given up.
            let _ = runtime.block_on(parts.abort());
        }
        sent
    }

    /// Removes objects. Those that are gone are no error.
    pub(super) fn remove(&self, keys: Vec<Key>) -> io::Result<()> {
        let Open { runtime, store } = &*self.open()?;
        let keys = stream::iter(keys.into_iter().map(Ok)).boxed();
        let removed = store.delete_stream(keys).try_for_each(|_| async { Ok(()) });
        match runtime.block_on(removed) {
            Err(Error::NotFound { .. }) | Ok(()) => Ok(()),
            Err(error) => Err(reason(error)),
        }
    }
}

fn store_of(url: &Url, scheme: &ObjectStoreScheme) -> object_store::Result<Arc<dyn ObjectStore>> {
    // An error says that another part of the program has chosen one.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let retry =
        RetryConfig { max_retries: RETRIES, retry_timeout: RETRY, ..RetryConfig::default() };
    Ok(match scheme {
        ObjectStoreScheme::AmazonS3 => {
            Arc::new(AmazonS3Builder::from_env().with_url(url.as_str()).with_retry(retry).build()?)
        }
        ObjectStoreScheme::GoogleCloudStorage => {
            let builder = GoogleCloudStorageBuilder::from_env().with_url(url.as_str());
            Arc::new(builder.with_retry(retry).build()?)
        }
        ObjectStoreScheme::MicrosoftAzure => {
            let builder = MicrosoftAzureBuilder::from_env().with_url(url.as_str());
            Arc::new(builder.with_retry(retry).build()?)
        }
        _ => {
            let options = ClientOptions::new().with_timeout(PATIENCE);
            let mut options = options.with_allow_http(url.scheme() == "http");
            if let Some(headers) = authorization(url) {
                options = options.with_default_headers(headers);
            }
            let host = &url[Position::BeforeHost..Position::BeforePath];
            let server = format!("{}://{host}", url.scheme());
            let builder = HttpBuilder::new().with_url(server).with_client_options(options);
            Arc::new(builder.with_retry(retry).build()?)
        }
    })
}

/// The user and the password of an address, as a server takes them.
fn authorization(url: &Url) -> Option<HeaderMap> {
    let user = percent_decode_str(url.username());
    let password = percent_decode_str(url.password().unwrap_or_default());
    if url.username().is_empty() {
        return None;
    }
    let pair: Vec<u8> = user.chain([b':']).chain(password).collect();
    let mut value = HeaderValue::try_from(format!("Basic {}", BASE64.encode(&pair))).ok()?;
    value.set_sensitive(true);
    Some(HeaderMap::from_iter([(AUTHORIZATION, value)]))
}

/// A store's error as one of the system, with the innermost reason: what stands around it names
/// requests and their retries.
fn reason(error: Error) -> io::Error {
    let (mut kind, mut innermost) = (io::ErrorKind::Other, error.to_string());
    match &error {
        Error::NotFound { .. } => kind = io::ErrorKind::NotFound,
        Error::AlreadyExists { .. } | Error::Precondition { .. } => {
            kind = io::ErrorKind::AlreadyExists;
        }
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
            return io::Error::other("the store refuses these credentials");
        }
        // The address of the service that gives credentials to machines of a cloud.
        _ if innermost.contains("169.254.169.254") => {
            return io::Error::other(
                "no credentials: set those of the store in the environment, such as \
                 AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_SKIP_SIGNATURE=true",
            );
        }
        _ => {}
    }
    let mut cause = error.source();
    while let Some(error) = cause {
        innermost = error.to_string();
        cause = error.source();
    }
    let reason = innermost.rsplit_once(" - ").map_or(&*innermost, |(_, reason)| reason);
    io::Error::new(kind, reason.trim().to_owned())
}
