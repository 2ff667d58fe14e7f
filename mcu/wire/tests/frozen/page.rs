//! `docs/protocol.md` is written from the definitions of the messages and from their frozen bytes. `NIRSPI_BLESS=1` writes it.

use super::v1;
use nirspi_wire::version;
use std::fmt::Write;
use std::path::Path;

const HEAD: &str = "\
# Wire protocol

<!-- Written by mcu/wire/tests/frozen/page.rs: NIRSPI_BLESS=1 cargo test -p nirspi-wire -->

This page says which bytes a camera and a host exchange, over USB bulk transfers, a serial line or TCP. The definitions are
those of [`mcu/wire`](../mcu/wire/src/message.rs), which the firmware and the host program share.

## Packets

```text
packet = COBS( postcard(message) ++ CRC-32 little-endian ) ++ 0x00
```

- The host sends [requests](#request), the camera sends [device messages](#devicemessage).
- CRC-32 is the ISO-HDLC one (polynomial 0xEDB88320 reflected, as in zip), over the bytes of the message.
- COBS takes all zeros out of a packet, so a zero ends it. A receiver that joins anywhere is in step after the next zero. An
  empty packet means nothing.
- Wireshark shows all of it with [`nirspi.lua`](../mcu/wire/wireshark/nirspi.lua).

How [postcard](https://postcard.jamesmunns.com/wire-format) writes a value:

| type | bytes |
|---|---|
| `u8` | one byte |
| `u16`, `u32`, `u64` | 7 bits a byte, least significant first; the top bit says that another byte follows |
| `i16` | as unsigned, after 0, -1, 1, -2, ... became 0, 1, 2, 3, ... |
| `bool` | 0 or 1 |
| an enum | the number of the variant, then its fields |
| a struct | its fields, one after the other |
| `Option` | 0, or 1 and the value |
| `Result` | 0 and the value, or 1 and the error |
| `&str`, bytes | the length in bytes, then the bytes |
| `Words` | the length in bytes, then little-endian 16-bit words |
| `Samples` | the byte 0 or 0x80, the length in bytes, then little-endian signed words: of 32 bits after 0, of 24 bits after 0x80 |
";

/// What stands before a type in the source.
struct Type {
    name: String,
    about: String,
    is_enum: bool,
    /// Name, payload or type, meaning.
    rows: Vec<[String; 3]>,
}

/// Doc comments as one line; links of rustdoc become code.
fn prose(lines: &[&str]) -> String {
    let mut text = lines.join(" ");
    while let Some(at) = text.find("](") {
        let end = text[at..].find(')').map_or(text.len(), |length| at + length + 1);
        text.replace_range(at..end, "]");
    }
    text.replace("[`", "`").replace("`]", "`").replace('|', "\\|")
}

/// The types that are sent, from the source: a line of it is a doc comment, an attribute, a field, a variant or a brace.
fn types(source: &str) -> Vec<Type> {
    let mut types: Vec<Type> = Vec::new();
    let mut docs: Vec<&str> = Vec::new();
    let mut sent = false;
    let mut inside = false;
    for line in source.lines() {
        let depth = line.len() - line.trim_start().len();
        let text = line.trim();
        if let Some(doc) = text.strip_prefix("///") {
            docs.push(doc.trim());
        } else if text.starts_with("#[derive") {
            sent = text.contains("Serialize");
        } else if text.starts_with("#[") || text.is_empty() {
        } else if let (0, Some(rest)) = (depth, text.strip_prefix("pub ")) {
            let kind = rest.split_once(' ').filter(|(kind, _)| ["enum", "struct"].contains(kind));
            inside = kind.is_some() && sent && text.ends_with('{');
            if let (Some((kind, name)), true) = (kind, sent) {
                let name = name.split(['<', ' ', '(']).next().unwrap_or(name);
                types.push(Type {
                    name: name.to_owned(),
                    about: prose(&docs),
                    is_enum: kind == "enum",
                    rows: Vec::new(),
                });
                if let Some((_, fields)) = text.split_once('(') {
                    let fields = fields.trim_end_matches(");").replace("pub ", "");
                    types.last_mut().unwrap().rows.push(["".into(), fields, "".into()]);
                }
            }
            (docs, sent) = (Vec::new(), false);
        } else if depth == 0 {
            inside = false;
            docs.clear();
        } else if inside {
            let rows = &mut types.last_mut().unwrap().rows;
            let is_enum = text.starts_with(char::is_uppercase);
            let entry = text.trim_end_matches(',').trim_end_matches(" {");
            match (depth, is_enum) {
                (4, true) => {
                    let (name, payload) = entry.split_once('(').unwrap_or((entry, ""));
                    let payload = payload.trim_end_matches(')').to_owned();
                    rows.push([name.to_owned(), payload, prose(&docs)]);
                }
                (4, false) if entry.starts_with("pub ") => {
                    let (name, of) = entry["pub ".len()..].split_once(": ").unwrap();
                    rows.push([name.to_owned(), of.to_owned(), prose(&docs)]);
                }
                // A field of a variant.
                (8, false) if entry.contains(": ") => {
                    let [_, payload, meaning] = rows.last_mut().unwrap();
                    let (name, of) = entry.split_once(": ").unwrap();
                    let separator = if payload.is_empty() { "" } else { ", " };
                    write!(payload, "{separator}{name} {of}").unwrap();
                    write!(meaning, " `{name}`: {}", prose(&docs)).unwrap();
                }
                _ => {}
            }
            docs.clear();
        }
    }
    types
}

/// A type without lifetimes, linked where the page has it.
fn linked(of: &str, names: &[&str]) -> String {
    let plain = of.replace("<'a>", "").replace("&'a ", "&");
    let mut words: Vec<String> = Vec::new();
    for word in plain.split_inclusive(|c: char| !c.is_alphanumeric()) {
        let (name, rest) =
            word.split_at(word.trim_end_matches(|c: char| !c.is_alphanumeric()).len());
        let rest = rest.replace('<', "&lt;").replace('>', "&gt;");
        words.push(match names.contains(&name) {
            true => format!("[{name}](#{}){rest}", name.to_lowercase()),
            false => format!("{name}{rest}"),
        });
    }
    words.concat()
}

fn page() -> String {
    let types = types(include_str!("../../src/message.rs"));
    let names: Vec<&str> = types.iter().map(|found| &found.name[..]).collect();
    let rules = include_str!("../../src/version.rs").lines();
    let rules = rules
        .map_while(|line| line.strip_prefix("//!"))
        .map(|line| line.strip_prefix(' ').unwrap_or(line));
    let rules = rules.skip_while(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n");
    let rules = rules.replace("\n# ", "\n### ").replacen("# Rules", "### Rules", 1);
    let rules: String = prose(&[&rules]).replace("\\|", "|").replace("* ", "- ");
    let mut page = format!(
        "{HEAD}\n## Versions\n\nThe oldest version that is spoken is {}, the newest {}.\n\n{rules}\n\n## Messages\n",
        version::MIN,
        version::CURRENT
    );
    for Type { name, about, is_enum, rows } in &types {
        write!(page, "\n### {name}\n\n{about}\n").unwrap();
        match (is_enum, rows.is_empty()) {
            (_, true) => {}
            (true, _) => page += "\n| number | variant | fields | meaning |\n|---|---|---|---|\n",
            (false, _) => page += "\n| field | type | meaning |\n|---|---|---|\n",
        }
        for (number, [row, of, meaning]) in rows.iter().enumerate() {
            let of = linked(of, &names);
            if *is_enum {
                writeln!(page, "| {number} | `{row}` | {of} | {meaning} |").unwrap();
            } else {
                let row = if row.is_empty() { "" } else { &format!("`{row}`") };
                writeln!(page, "| {row} | {of} | {meaning} |").unwrap();
            }
        }
    }
    page += "\n## Bytes\n\nBytes of messages before CRC and COBS, in hexadecimal, as the tests freeze them.\n\n```text\n";
    for (request, bytes) in v1::requests() {
        writeln!(page, "{bytes}\n    {request:?}").unwrap();
    }
    for (message, bytes) in v1::device_messages() {
        writeln!(page, "{bytes}\n    {message:?}").unwrap();
    }
    page + "```\n"
}

#[test]
fn the_page_of_the_protocol_is_of_this_version() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/protocol.md");
    let expected = page();
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{} is stale: NIRSPI_BLESS=1 writes it", path.display());
}
