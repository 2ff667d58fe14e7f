//! The files of the page, which are part of the program.

use axum::http::header;
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{MethodRouter, get};

const INDEX: &str = include_str!("page/index.html");
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// Path, type and content of each file that the page loads.
const FILES: [(&str, &str, &str); 22] = [
    ("/page/style.css", STYLE, include_str!("page/style.css")),
    ("/page/main.js", SCRIPT, include_str!("page/main.js")),
    ("/page/connection.js", SCRIPT, include_str!("page/connection.js")),
    ("/page/age.js", SCRIPT, include_str!("page/age.js")),
    ("/page/account.js", SCRIPT, include_str!("page/account.js")),
    ("/page/windows.js", SCRIPT, include_str!("page/windows.js")),
    ("/page/words.js", SCRIPT, include_str!("page/words.js")),
    ("/page/dom.js", SCRIPT, include_str!("page/dom.js")),
    ("/page/explain.js", SCRIPT, include_str!("page/explain.js")),
    ("/page/speech.js", SCRIPT, include_str!("page/speech.js")),
    ("/page/light.js", SCRIPT, include_str!("page/light.js")),
    ("/page/display.js", SCRIPT, include_str!("page/display.js")),
    ("/page/controls.js", SCRIPT, include_str!("page/controls.js")),
    ("/page/facts.js", SCRIPT, include_str!("page/facts.js")),
    ("/page/save.js", SCRIPT, include_str!("page/save.js")),
    ("/page/requests.js", SCRIPT, include_str!("page/requests.js")),
    ("/page/colours.js", SCRIPT, include_str!("page/colours.js")),
    ("/page/history.js", SCRIPT, include_str!("page/history.js")),
    ("/page/plots.js", SCRIPT, include_str!("page/plots.js")),
    ("/page/brush.js", SCRIPT, include_str!("page/brush.js")),
    ("/page/scene.js", SCRIPT, include_str!("page/scene.js")),
    ("/page/line.js", SCRIPT, include_str!("page/line.js")),
];

/// Path and answer of every file.
pub fn routes<S: Clone + Send + Sync + 'static>()
-> impl Iterator<Item = (&'static str, MethodRouter<S>)> {
    let files = FILES
        .iter()
        .map(|&(path, kind, content)| (path, get(move || async move { file(kind, content) })));
    [("/", get(Html(INDEX)))].into_iter().chain(files)
}

fn file(kind: &'static str, content: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind)], content).into_response()
}
