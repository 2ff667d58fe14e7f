use super::super::testing::{npy, npy_f64, npy_with_header};
use super::*;
use proptest::prelude::*;

const LIMIT: u64 = 1 << 20;

fn read(bytes: &[u8]) -> Result<(Vec<u64>, Vec<f64>), ArrayError> {
    let mut stream = bytes;
    let header = Header::read(&mut stream)?;
    let values = header.read_data(&mut stream, LIMIT)?;
    Ok((header.shape().to_vec(), values))
}

#[test]
fn every_real_type_and_byte_order_gives_the_same_numbers() {
    let wanted = vec![0.0, 1.0, 100.0];
    let cases: [(&str, Vec<u8>); 18] = [
        ("|i1", vec![0, 1, 100]),
        ("|u1", vec![0, 1, 100]),
        ("<i2", [0i16, 1, 100].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">i2", [0i16, 1, 100].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<u2", [0u16, 1, 100].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">u2", [0u16, 1, 100].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<i4", [0i32, 1, 100].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">i4", [0i32, 1, 100].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<u4", [0u32, 1, 100].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">u4", [0u32, 1, 100].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<i8", [0i64, 1, 100].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">u8", [0u64, 1, 100].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<f2", vec![0, 0, 0x00, 0x3c, 0x40, 0x56]),
        (">f2", vec![0, 0, 0x3c, 0x00, 0x56, 0x40]),
        ("<f4", [0f32, 1.0, 100.0].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">f4", [0f32, 1.0, 100.0].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ("<f8", [0f64, 1.0, 100.0].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">f8", [0f64, 1.0, 100.0].iter().flat_map(|v| v.to_be_bytes()).collect()),
    ];
    for (descr, data) in cases {
        let (shape, values) = read(&npy(&format!("'{descr}'"), false, "(3,)", &data)).unwrap();
        assert_eq!((shape, &values), (vec![3], &wanted), "{descr}");
    }
    assert_eq!(read(&npy("'|b1'", false, "(2,)", &[0, 1])).unwrap().1, [0.0, 1.0]);
    assert_eq!(read(&npy("'|i1'", false, "(1,)", &[0x80])).unwrap().1, [-128.0]);
}

#[test]
fn half_precision_follows_ieee_754() {
    // Bit patterns and values of IEEE 754-2019 binary16: largest, smallest normal, smallest
    // subnormal, 1/3.
    let cases = [
        (0x7bff, 65504.0),
        (0x0400, 2f64.powi(-14)),
        (0x0001, 2f64.powi(-24)),
        (0xc000, -2.0),
        (0x3555, 0.333251953125),
    ];
    for (bits, value) in cases {
        assert_eq!(half_to_f64(bits), value, "{bits:#x}");
    }
    assert_eq!(half_to_f64(0xfc00), f64::NEG_INFINITY);
    assert!(half_to_f64(0x7e00).is_nan());
}

#[test]
fn a_matrix_of_any_size_comes_out_in_c_order() {
    for (rows, columns) in [(1, 5), (5, 1), (2, 3), (32, 32), (33, 70), (100, 31)] {
        // Row r and column c as one number, stored column by column.
        let number = |r: usize, c: usize| (r * 1000 + c) as u32;
        let stored: Vec<u8> = (0..columns)
            .flat_map(|c| (0..rows).flat_map(move |r| number(r, c).to_le_bytes()))
            .collect();
        let (_, values) =
            read(&npy("'<u4'", true, &format!("({rows}, 1, {columns})"), &stored)).unwrap();
        let wanted = (0..rows).flat_map(|r| (0..columns).map(move |c| f64::from(number(r, c))));
        assert!(values.into_iter().eq(wanted), "{rows} x {columns}");
    }
}

#[test]
fn fortran_order_comes_out_in_c_order() {
    // The array [[[0 1 2 3] [4 ..] [8 ..]] ...] of shape (2, 3, 4), stored with the first axis
    // fastest.
    let mut stored = Vec::new();
    for k in 0..4 {
        for j in 0..3 {
            for i in 0..2u8 {
                stored.push(i * 12 + j * 4 + k);
            }
        }
    }
    let (_, values) = read(&npy("'|u1'", true, "(2, 3, 4)", &stored)).unwrap();
    assert_eq!(values, (0..24).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn headers_of_all_formats_and_habits_are_read() {
    for header in [
        r#"{"shape": (2, 1), "fortran_order": False, "descr": "<f8"}"#,
        "{'descr':'<f8','fortran_order':False,'shape':(2L,1L)}",
        "  { 'fortran_order' : False , 'shape' : ( 2 , 1 , ) , 'descr' : '<f8' , }   ",
    ] {
        let (shape, values) = read(&npy_with_header(header, &[0; 16])).unwrap();
        assert_eq!((shape, values), (vec![2, 1], vec![0.0; 2]), "{header}");
    }
    let scalar = read(&npy_f64("()", &[7.0])).unwrap();
    assert_eq!(scalar, (vec![], vec![7.0]));

    let version_1 = npy_f64("(1,)", &[7.0]);
    for version in [2, 3] {
        let length = u32::from(u16::from_le_bytes([version_1[8], version_1[9]])).to_le_bytes();
        let bytes = [b"\x93NUMPY".as_slice(), &[version, 0], &length, &version_1[10..]].concat();
        assert_eq!(read(&bytes).unwrap(), (vec![1], vec![7.0]));
    }
}

#[test]
fn what_is_no_real_number_is_refused_by_type() {
    for descr in [
        "'<U7'",
        "'|O'",
        "'<c16'",
        "'<f16'",
        "'<M8[s]'",
        "'|S3'",
        "'|V8'",
        "[('a', '<f8'), ('b', '<i4')]",
    ] {
        let error = read(&npy(descr, false, "(1,)", &[0; 16])).unwrap_err();
        assert!(matches!(error, ArrayError::Dtype(_)), "{descr}: {error:?}");
    }
}

#[test]
fn a_claim_beyond_the_limit_takes_no_memory() {
    for shape in [
        "(1000000000000,)",
        "(4294967296, 4294967296, 4294967296)",
        "(131073,)",
        "(18446744073709551615, 2)",
    ] {
        let error = read(&npy("'<f8'", false, shape, &[0; 64])).unwrap_err();
        assert!(matches!(error, ArrayError::TooLarge { .. }), "{shape}: {error:?}");
    }
    let empty = npy("'<f8'", true, "(0, 18446744073709551615, 3)", &[]);
    assert!(read(&empty).unwrap().1.is_empty());
    let long = [b"\x93NUMPY\x02\x00".as_slice(), &u32::MAX.to_le_bytes(), b"{}"].concat();
    assert!(matches!(read(&long), Err(ArrayError::Damaged(_))));
}

#[test]
fn too_few_and_too_many_bytes_are_both_damage() {
    for data in [15, 17] {
        let error = read(&npy("'<f8'", false, "(2,)", &vec![0; data])).unwrap_err();
        assert!(matches!(error, ArrayError::Damaged(_)), "{data}: {error:?}");
    }
}

proptest! {
    #[test]
    fn no_header_makes_the_reader_panic(
        header in "[{}\\[\\]()'\":, 0-9a-zTF<>|_]{0,80}",
        data in prop::collection::vec(any::<u8>(), 0..40),
    ) {
        let _ = read(&npy_with_header(&header, &data));
    }

    #[test]
    fn no_damage_makes_the_reader_panic(
        at in 0usize..200,
        byte in any::<u8>(),
        fortran in any::<bool>(),
    ) {
        let mut bytes = npy("'<f4'", fortran, "(3, 5)", &[1; 60]);
        let at = at % bytes.len();
        bytes[at] = byte;
        let _ = read(&bytes);
    }
}

#[test]
fn deep_brackets_do_not_exhaust_the_stack() {
    for bracket in ["(", "[", "{"] {
        let _ = read(&npy_with_header(&bracket.repeat(60_000), &[]));
        let _ = read(&npy_with_header(&format!("{{'descr': {}", bracket.repeat(60_000)), &[]));
    }
}
