//! Reads the file's own images, to compare with.

use super::FileError;
use crate::array::shape_text;
use crate::field::Field;
use crate::fields::Fields;
use nirspi_recon::Side;

/// The file's own images and their number: one, or one for each measurement.
pub(super) fn read_reference(
    fields: &mut Fields,
    side: Side,
    count: usize,
) -> Result<Option<(Field, usize)>, FileError> {
    const FIELD: &str = "recon";
    if fields.is_unnamed() || !fields.holds(FIELD) {
        return Ok(None);
    }
    let n = side.pixels() as u64;
    let images = |shape: &[u64]| match shape {
        [leading @ .., height, width] if (*height, *width) == (n, n) => {
            let product =
                leading.iter().try_fold(1_u64, |product, &axis| product.checked_mul(axis));
            product.filter(|&images| images == 1 || images == count as u64)
        }
        _ => None,
    };
    let field = fields.read(FIELD, |shape| match images(shape) {
        Some(_) => Ok(()),
        None if count == 1 => Err(shape_text(&[n, n])),
        None => Err(format!("({n}, {n}) or ({count}, {n}, {n})")),
    })?;
    let parts = [Some(&field.real), field.imaginary.as_ref()];
    if parts.into_iter().flatten().flatten().any(|value| !value.is_finite()) {
        return Err(FileError::field(
            fields.path(),
            FIELD,
            "has numbers that are not finite",
            "finite numbers",
        ));
    }
    let images = field.real.len() / side.area();
    Ok(Some((field, images)))
}
