//! Fields that a file calls something else: `--field volts,h_row=order,n=side,sign=polarity`.

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
    let Some(named) = want.field.as_ref().filter(|named| named.contains('=')) else {
        return Ok(Cow::Borrowed(want));
    };
    if fields.is_unnamed() || fields.holds(named) {
        return Ok(Cow::Borrowed(want));
    }
    let mut readings = Vec::new();
    for part in named.split(',').map(str::trim) {
        let renamed = part.split_once('=').map(|(name, own)| (name.trim(), own.trim()));
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
    let field = (!readings.is_empty()).then(|| readings.join(","));
    Ok(Cow::Owned(Selection { field, ..want.clone() }))
}
