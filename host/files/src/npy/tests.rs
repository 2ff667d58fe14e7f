use super::super::testing::{file, line, npy, npy_f64};
use super::*;
use proptest::prelude::*;

fn refusal(bytes: &[u8]) -> String {
    let (_guard, path) = file("stack.npy", bytes);
    line(&read_stack(&path).unwrap_err(), "stack.npy")
}

proptest! {
    #[test]
    fn what_is_written_reads_back_bit_for_bit(
        count in 1usize..4,
        height in 1usize..6,
        width in 1usize..6,
        seed in any::<u64>(),
    ) {
        let values: Vec<f32> = (0..count * height * width)
            .map(|i| f32::from_bits((seed.wrapping_mul(i as u64 + 1) >> 20) as u32 & 0xbf7f_ffff))
            .collect();
        let (_guard, path) = file("stack.npy", &encode(&[count, height, width], &values));
        prop_assert_eq!(read_stack(&path).unwrap(), Stack { count, height, width, values });
    }
}

#[test]
fn one_image_is_a_stack_of_one() {
    let (_guard, path) = file("image.npy", &encode(&[2, 3], &[0.0_f32, 1.0, 2.0, 3.0, 4.0, 5.0]));
    let stack = read_stack(&path).unwrap();
    assert_eq!((stack.count, stack.height, stack.width), (1, 2, 3));
    assert_eq!(stack.values, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
}

#[test]
fn data_are_aligned_for_memory_mapping() {
    for shape in [vec![4], vec![1, 4], vec![1, 2, 2], vec![1; 40]] {
        let values = vec![1.5_f32; shape.iter().product()];
        let bytes = encode(&shape, &values);
        assert_eq!((bytes.len() - 4 * values.len()) % 64, 0, "{shape:?}");
    }
}

#[test]
fn each_kind_of_bad_file_gets_its_line() {
    let cases = [
        (npy_f64("(4,)", &[0.0; 4]), "`array` has shape (4,), expected (N, H, W) or (H, W)"),
        (
            npy_f64("(1, 1, 1, 1)", &[0.0]),
            "`array` has shape (1, 1, 1, 1), expected (N, H, W) or (H, W)",
        ),
        (npy_f64("(0, 2, 2)", &[]), "`array` has shape (0, 2, 2), expected (N, H, W) or (H, W)"),
        (
            npy_f64("(1, 2, 2)", &[0.0, 1.0, f64::NAN, 3.0]),
            "`array` is NaN at [0, 1, 0], expected finite numbers",
        ),
        (npy_f64("(1, 2)", &[0.0, 1e300]), "`array` is inf at [0, 0, 1], expected finite numbers"),
        (
            npy("'<U1'", false, "(1, 2)", &[0; 8]),
            "`array` is of type '<U1', expected real numbers of up to 8 bytes",
        ),
        (
            npy_f64("(1000000, 1000, 1000)", &[0.0]),
            "shape (1000000, 1000, 1000) with 8 bytes of data",
        ),
        (npy_f64("(1, 1)", &[0.0, 0.0]), "more than the 8 bytes of data"),
        (b"\x89PNG\r\n\x1a\n".to_vec(), "found a PNG image, expected a NumPy array (.npy)"),
        (b"PK\x03\x04".to_vec(), "found a zip archive, expected a NumPy array (.npy)"),
        (Vec::new(), "found an empty file, expected a NumPy array (.npy)"),
    ];
    for (bytes, expected) in cases {
        let line = refusal(&bytes);
        assert!(line.contains(expected), "{line}\n{expected}");
    }
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let whole = encode(&[2, 3, 4], &[0.5_f32; 24]);
    for end in 0..whole.len() {
        refusal(&whole[..end]);
    }
}
