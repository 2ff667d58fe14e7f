use super::*;

#[test]
fn an_order_is_known_by_its_first_rows() {
    let side = Side::INSTRUMENT;
    for named in Order::NAMED {
        let rows = named.order.rows(side).unwrap();
        let found = Order::of(&rows.as_slice()[..700], side).unwrap();
        assert_eq!(found.rows(side).unwrap().as_slice()[..700], rows.as_slice()[..700]);
    }
    let mut rows = Order::ZigZag.rows(side).unwrap().as_slice().to_vec();
    rows.swap(5, 600);
    assert_eq!(Order::of(&rows, side), None);
    assert_eq!(Order::of(&rows[..1], side), None);
}

use proptest::prelude::*;

fn side(n: u64) -> Side {
    Side::new(n).unwrap()
}

fn built_in() -> Vec<Order> {
    Order::NAMED.iter().map(|named| named.order.clone()).chain([Order::Random(3)]).collect()
}

fn sign(row: u32, pixel: u32) -> i32 {
    if (row & pixel).count_ones().is_multiple_of(2) { 1 } else { -1 }
}

/// Runs of equal sign down and across, connected blocks by flood fill, isotropic total variation.
fn looked_at(row: u32, n: u32) -> (u32, f64) {
    let at = |r: u32, c: u32| sign(row, n * r + c);
    let mut label = vec![false; (n * n) as usize];
    let mut blocks = 0;
    for start in 0..n * n {
        if label[start as usize] {
            continue;
        }
        blocks += 1;
        let mut open = vec![start];
        while let Some(p) = open.pop() {
            if std::mem::replace(&mut label[p as usize], true) {
                continue;
            }
            let (r, c) = (p / n, p % n);
            let neighbours =
                [(r.wrapping_sub(1), c), (r + 1, c), (r, c.wrapping_sub(1)), (r, c + 1)];
            for (nr, nc) in neighbours {
                if nr < n && nc < n && at(nr, nc) == at(r, c) {
                    open.push(n * nr + nc);
                }
            }
        }
    }
    let mut variation = 0.0;
    for r in 0..n {
        for c in 0..n {
            let down = if r + 1 < n { at(r + 1, c) - at(r, c) } else { 0 };
            let across = if c + 1 < n { at(r, c + 1) - at(r, c) } else { 0 };
            variation += f64::from(down * down + across * across).sqrt();
        }
    }
    (blocks, variation)
}

#[test]
fn every_order_is_a_permutation_at_every_side() {
    for n in [2, 4, 8, 16, 32, 64, 128, 256] {
        for order in built_in() {
            let mut rows = order.rows(side(n)).unwrap().to_vec();
            rows.sort_unstable();
            assert!(rows.iter().copied().eq(0..(n * n) as u32), "{order} at {n}");
        }
    }
}

#[test]
fn names_round_trip() {
    for order in built_in() {
        assert_eq!(order.to_string().parse(), Ok(order));
    }
    for wrong in ["zigzag", "random", "random:", "random:-1", "table", ""] {
        assert_eq!(wrong.parse::<Order>(), Err(ParseOrderError { found: wrong.into() }));
    }
    let told = "zigzag".parse::<Order>().unwrap_err().to_string();
    assert!(
        told.starts_with("unknown order \"zigzag\", expected natural, sequency, zig-zag, "),
        "{told}"
    );
    assert!(told.ends_with(", deepinv:xy or random:SEED"), "{told}");
    assert_eq!(Order::Table(vec![1, 0]).to_string(), "table");
}

#[test]
fn positions_by_sequency_follow_the_zig_zag_and_leave_out_the_even_pattern() {
    let shown = [9_u32, 0, 2, 15, 8];
    let rows = Rows::new(side(4), shown).unwrap();
    let found: Vec<u32> = positions_by_sequency(&rows).iter().map(|&k| shown[k]).collect();
    let zig_zag = Order::ZigZag.rows(side(4)).unwrap();
    let expected = zig_zag.iter().copied().filter(|row| *row != 0 && shown.contains(row));
    assert!(expected.eq(found.iter().copied()), "{found:?}");
    assert_eq!(found.len(), 4);
}

#[test]
fn sequency_counts_the_sign_changes_of_the_long_row() {
    for (k, row) in Order::Sequency.rows(side(8)).unwrap().iter().copied().enumerate() {
        let changes = (1..64).filter(|&p| sign(row, p) != sign(row, p - 1)).count();
        assert_eq!(changes, k);
    }
}

#[test]
fn cake_cutting_and_total_variation_ascend_in_what_the_patterns_show() {
    let looked: Vec<_> = (0..256).map(|row| looked_at(row, 16)).collect();
    let cake = Order::CakeCutting.rows(side(16)).unwrap();
    let variation = Order::TotalVariation.rows(side(16)).unwrap();
    for k in 1..256 {
        let (a, b) = (cake[k - 1], cake[k]);
        let (blocks_a, blocks_b) = (looked[a as usize].0, looked[b as usize].0);
        assert!((blocks_a, a) < (blocks_b, b), "cake-cutting at {k}");
        let (a, b) = (variation[k - 1], variation[k]);
        let rise = looked[b as usize].1 - looked[a as usize].1;
        assert!(rise > 1e-9 || (rise.abs() <= 1e-9 && a < b), "total variation at {k}");
    }
}

#[test]
fn each_russian_doll_is_a_complete_coarser_basis() {
    let rows = Order::RussianDolls.rows(side(16)).unwrap();
    for doll in [1, 2, 4, 8] {
        let block = 16 / doll;
        // A pattern of a doll x doll basis is constant on blocks: its low bits select nothing.
        let coarse =
            |row: u32| (row / 16).is_multiple_of(block) && (row % 16).is_multiple_of(block);
        assert!(rows[..(doll * doll) as usize].iter().all(|&row| coarse(row)), "doll {doll}");
        let (start, quarter) = ((doll * doll) as usize, (doll * doll) as usize);
        let (second, third) = (start..start + quarter, start + quarter..start + 2 * quarter);
        let transposed = rows[second].iter().map(|row| (row % 16) * 16 + row / 16);
        assert!(transposed.eq(rows[third].iter().copied()), "quarters of doll {doll}");
    }
}

#[test]
fn zig_zag_starts_as_the_public_log_does() {
    let rows = Order::ZigZag.rows(side(64)).unwrap();
    assert_eq!(rows[..10], [0, 32, 2048, 3072, 2080, 48, 16, 2096, 3104, 1024]);
}

#[test]
fn orders_of_other_packages_are_theirs() {
    let mut compared = 0;
    for line in include_str!("others.txt").lines().filter(|line| !line.starts_with('#')) {
        let (head, rows) = line.split_once(": ").unwrap();
        let (name, n) = head.rsplit_once(' ').unwrap();
        let theirs: Vec<u32> = rows.split(' ').map(|row| row.parse().unwrap()).collect();
        let side = side(n.parse().unwrap());
        let ours = name.parse::<Order>().unwrap().rows(side).unwrap();
        match others::ties(name) {
            None => assert_eq!(*ours, theirs[..], "{head}"),
            Some(key) => {
                let patterns = others::by_row(side);
                let keys =
                    |rows: &[u32]| rows.iter().map(|&row| key(&patterns[row as usize])).collect();
                let (ours, theirs): (Vec<u64>, Vec<u64>) = (keys(&ours), keys(&theirs));
                assert_eq!(ours, theirs, "{head}");
            }
        }
        compared += 1;
    }
    assert_eq!(compared, 15, "five orders at three sides");
}

#[test]
fn the_shuffle_of_a_seed_never_changes() {
    assert_eq!(
        *Order::Random(2026).rows(side(4)).unwrap(),
        [0, 14, 11, 10, 13, 7, 12, 2, 15, 8, 3, 4, 6, 5, 9, 1],
        "do not change the test: files are read by the seed of their order"
    );
}

#[test]
fn a_table_that_is_no_permutation_is_named_by_its_first_fault() {
    let check = |table: &[u32]| Order::Table(table.to_vec()).rows(side(2));
    assert_eq!(check(&[3, 1, 0, 2]), Rows::new(side(2), [3, 1, 0, 2]));
    assert_eq!(check(&[0, 1]), Err(RowsError::Length { found: 2, expected: 4 }));
    assert_eq!(check(&[0, 4, 0, 1]), Err(RowsError::OutOfRange { index: 1, found: 4, last: 3 }));
    assert_eq!(check(&[2, 1, 0, 1]), Err(RowsError::Repeated { index: 3, first: 1, row: 1 }));
}

proptest! {
    #[test]
    fn seeds_differ(a in any::<u64>(), b in any::<u64>()) {
        prop_assume!(a != b);
        let rows = |seed| Order::Random(seed).rows(side(8)).unwrap();
        prop_assert_ne!(rows(a), rows(b));
    }

    #[test]
    fn every_part_of_a_random_sweep_holds_the_all_ones_pattern(seed: u64, n in prop::sample::select(vec![2, 8, 32])) {
        prop_assert_eq!(Order::Random(seed).rows(side(n)).unwrap()[0], 0);
    }
}
