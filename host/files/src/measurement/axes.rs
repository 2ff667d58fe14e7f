//! Axes that together hold the readings of one measurement.

use super::Form;

/// A shape with one last axis for the readings of a measurement, where the file has several: pattern
/// and complement on a last axis of two, `(..., M, 2)`, and rows and readings as a spectrum of `n` by
/// `n`. `rows` is the shape of the rows, if the file has them. Axes of length 1 do not count.
pub(super) fn joined(shape: &[u64], rows: Option<&[u64]>, form: Form) -> Vec<u64> {
    let long = |axes: &[u64]| axes.iter().copied().filter(|&axis| axis != 1).collect::<Vec<_>>();
    let axes = long(shape);
    let mut last = match rows {
        Some(rows) => long(rows),
        // Without rows, the axis before the pairs is that of the patterns.
        None if axes.len() < 2 => return shape.to_vec(),
        None => vec![axes[axes.len() - 2]],
    };
    if form == Form::Pairs {
        last.push(2);
    }
    match axes.strip_suffix(&last[..]) {
        Some(before) if last.len() > 1 => {
            let one = last.iter().fold(1_u64, |product, &axis| product.saturating_mul(axis));
            [before, &[one]].concat()
        }
        _ => shape.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_on_a_last_axis_and_spectra_are_the_readings_of_one_measurement() {
        let rows = Some(&[256][..]);
        assert_eq!(joined(&[256, 2], rows, Form::Pairs), [512]);
        assert_eq!(joined(&[5, 256, 1, 2], rows, Form::Pairs), [5, 512]);
        assert_eq!(joined(&[256, 2], None, Form::Pairs), [512]);
        let spectrum = Some(&[16, 16][..]);
        assert_eq!(joined(&[16, 16], spectrum, Form::Differences), [256]);
        assert_eq!(joined(&[3, 16, 16, 2], spectrum, Form::Pairs), [3, 512]);
    }

    #[test]
    fn other_shapes_stay_as_they_are() {
        for (shape, rows, form) in [
            (&[512][..], Some(&[256][..]), Form::Pairs),
            (&[2, 512], Some(&[256]), Form::Pairs),
            (&[256, 2], Some(&[256]), Form::Single),
            (&[2, 256], Some(&[128]), Form::Halves),
            (&[16, 16], None, Form::Single),
            (&[512], None, Form::Pairs),
            (&[1], Some(&[1]), Form::Differences),
            (&[1, 1], Some(&[1]), Form::Single),
            (&[1, 2], Some(&[1]), Form::Pairs),
            (&[], None, Form::Pairs),
        ] {
            assert_eq!(joined(shape, rows, form), shape, "{rows:?} {form:?}");
        }
    }
}
