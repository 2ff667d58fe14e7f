//! The path below which a server serves everything, where a reverse proxy serves other things beside it.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The most characters of a path before the page's own.
const LONGEST_PATH: usize = 200;

/// The path below which a server serves everything: empty, or as `/camera1`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BasePath(String);

/// A text that is no path to serve below.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "found {0:?}, expected a path as /camera1 or /lab/camera1: parts of letters of English, digits, '-', '_' and '.', each \
     after a '/', at most {LONGEST_PATH} characters"
)]
pub struct BasePathError(String);

impl BasePath {
    /// The whole path of a path of the page, which begins with `/`.
    pub(super) fn before(&self, path: &str) -> String {
        format!("{}{path}", self.0)
    }

    /// What the page calls this path; `None` for a path that is not below this one.
    pub(super) fn below<'p>(&self, path: &'p str) -> Option<&'p str> {
        path.strip_prefix(self.0.as_str()).filter(|rest| rest.starts_with('/'))
    }

    /// The address of the page, seen from this path: the base path, with or without its last `/`. It is relative, because a
    /// proxy may know the page by another path.
    pub(super) fn relative(&self, path: &str) -> String {
        match path.strip_prefix(self.0.as_str()) {
            Some("") => format!("./{}/", self.0.rsplit('/').next().unwrap_or_default()),
            _ => "./".to_owned(),
        }
    }

    /// The path without a `/` at its end, unless everything is served at the top.
    pub(super) fn named(&self) -> Option<&str> {
        Some(self.0.as_str()).filter(|path| !path.is_empty())
    }
}

impl FromStr for BasePath {
    type Err = BasePathError;

    /// A `/` at the end counts as none.
    fn from_str(text: &str) -> Result<Self, BasePathError> {
        let path = text.strip_suffix('/').unwrap_or(text);
        let is_sign = |sign: char| sign.is_ascii_alphanumeric() || "-_.".contains(sign);
        // A browser takes "." and ".." out of an address.
        let is_part = |part: &str| part.chars().all(is_sign) && !["", ".", ".."].contains(&part);
        let is_path = path.strip_prefix('/').is_some_and(|rest| rest.split('/').all(is_part));
        if text == "/" || (is_path && path.len() <= LONGEST_PATH) {
            Ok(Self(path.to_owned()))
        } else {
            Err(BasePathError(text.chars().take(LONGEST_PATH).collect()))
        }
    }
}

/// The path with a `/` at its end.
impl fmt::Display for BasePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_path_is_plain_parts_after_slashes() {
        for (text, whole) in
            [("/camera1", "/camera1/"), ("/lab/cam-1.b/", "/lab/cam-1.b/"), ("/", "/")]
        {
            assert_eq!(text.parse::<BasePath>().unwrap().to_string(), whole);
        }
        let long = format!("/{}", "x".repeat(LONGEST_PATH));
        for text in [
            "", "camera1", "//", "/a//b", "/a/../b", "/.", "/a b", "/a?b", "/{a}", "/*a", "/a%2fb",
            "/\u{e9}", &long,
        ] {
            let line = text.parse::<BasePath>().unwrap_err().to_string();
            assert!(
                line.contains("expected a path as /camera1") && line.lines().count() == 1,
                "{line}"
            );
        }
    }

    #[test]
    fn paths_below_a_base_path_are_told_from_others() {
        let base: BasePath = "/camera1".parse().unwrap();
        assert_eq!(base.below("/camera1/api/stop"), Some("/api/stop"));
        assert_eq!(base.below("/camera1/"), Some("/"));
        assert_eq!(base.before("/events"), "/camera1/events");
        assert_eq!(
            (base.relative("/camera1"), base.relative("/camera1/")),
            ("./camera1/".to_owned(), "./".to_owned())
        );
        for other in ["/camera1", "/camera12/", "/", "/api/stop", "/x/camera1/"] {
            assert_eq!(base.below(other), None, "{other}");
        }
        let top = BasePath::default();
        assert_eq!((top.below("/api/stop"), top.named()), (Some("/api/stop"), None));
    }
}
