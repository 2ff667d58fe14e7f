//! Fields that a file calls something else: `--field volts,h_row=order,n=side,sign=polarity`. What stands beside the readings in a
//! group or structure, `run1/h_row` beside `run1/y`, needs no name.

use super::{FileError, Selection};
use crate::fields::Fields;
use std::borrow::Cow;

/// The fields that can have another name, beside the readings.
const NAMES: [&str; 3] = ["h_row", "n", "sign"];

/// What is wanted of the file, with the name of the readings alone in [`Selection::field`]. The other names
/// that stand there are those of the fields from here on.
pub(super) fn called<'w>(
    fields: &mut Fields,
    want: &'w Selection,
) -> Result<Cow<'w, Selection>, FileError> {
    let Some(named) = want.field.as_ref().filter(|_| !fields.is_unnamed()) else {
        return Ok(Cow::Borrowed(want));
    };
    if fields.holds(named) {
        beside(fields, named);
        return Ok(Cow::Borrowed(want));
    }
    let mut readings = Vec::new();
    for part in named.split(',').map(|part| part.trim().trim_start_matches('/')) {
        let renamed = part.split_once('=');
        let renamed = renamed.map(|(name, own)| (name.trim(), own.trim().trim_start_matches('/')));
        let known = renamed
            .and_then(|(name, own)| Some((NAMES.into_iter().find(|known| *known == name)?, own)));
        match known {
            Some((name, own)) if fields.holds(own) => fields.call(own, name),
            Some((name, own)) => {
                let expected = format!("--field {name}= with one of {}", fields.names().join(", "));
                return Err(FileError::field(fields.path(), own, "is not in the file", expected));
            }
            None => readings.push(part),
        }
    }
    if let Some(first) = readings.first() {
        beside(fields, first);
    }
    let field = (!readings.is_empty()).then(|| readings.join(","));
    Ok(Cow::Owned(Selection { field, ..want.clone() }))
}

/// Takes what else is needed from the group or structure of the readings, where the file has it nowhere else.
fn beside(fields: &mut Fields, readings: &str) {
    let Some(at) = readings.rfind(['.', '/']) else { return };
    for name in NAMES {
        let own = format!("{}{name}", &readings[..=at]);
        if !fields.holds(name) && fields.holds(&own) {
            fields.call(&own, name);
        }
    }
}
