//! Crates that were made up, with and without cycles.

use super::{Crate, Knot};
use std::fs;

/// The knots of a crate of these files in `src`, each in words.
fn knots(files: &[(&str, &str)]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
    }
    let base = format!("{}/", folder.path().display());
    let words = |knot: &Knot| knot.to_string().replace(&base, "");
    Crate::read(&folder.path().join("lib.rs")).knots().iter().map(words).collect()
}

#[test]
fn a_cycle_through_a_group_of_names_is_found_with_a_line_for_each_edge() {
    let found = knots(&[
        ("lib.rs", "mod a;\nmod b;\nmod c;\nmod d;"),
        ("a.rs", "//! Uses d.\n\nuse crate::{d as other, b::{self, B}};"),
        ("b.rs", "pub struct B(pub crate::c::C);"),
        ("c.rs", "pub struct C;\nfn f(x: crate::a::A) { g!(x, crate::d::D) }"),
        ("d.rs", ""),
    ]);
    assert_eq!(
        found,
        ["a, b, c use each other:\n  a -> b: a.rs:3\n  b -> c: b.rs:1\n  c -> a: c.rs:2"]
    );
}

#[test]
fn a_cycle_through_super_and_files_below_is_found() {
    let found = knots(&[
        ("lib.rs", "pub mod a;\npub(crate) mod b;"),
        ("a.rs", "mod inner;\nuse super::b;"),
        ("a/inner.rs", "use super::super::b::B;"),
        (
            "b/mod.rs",
            "mod inner { fn f() -> super::super::a::A { super::super::a::A } }\nmod below;",
        ),
        ("b/below.rs", ""),
    ]);
    assert_eq!(found, ["a, b use each other:\n  a -> b: a/inner.rs:1\n  b -> a: b/mod.rs:1"]);
}

#[test]
fn a_name_that_the_root_passes_on_hides_no_cycle() {
    let found = knots(&[
        ("lib.rs", "mod a;\nmod b;\npub use b::{B as Other, C};\npub struct Own;"),
        ("a.rs", "use crate::{Other, Own};"),
        ("b.rs", "use crate::a;"),
    ]);
    assert_eq!(found, ["a, b use each other:\n  a -> b: a.rs:1\n  b -> a: b.rs:1"]);
}

#[test]
fn modules_below_a_module_are_held_to_the_same() {
    let found = knots(&[
        ("lib.rs", "mod a;"),
        ("a.rs", "mod x;\nmod y;\nuse x::X;"),
        ("a/x.rs", "use super::y::Y;"),
        ("a/y.rs", "use super::X;"),
    ]);
    assert_eq!(
        found,
        ["a::x, a::y use each other:\n  a::x -> a::y: a/x.rs:1\n  a::y -> a::x: a/y.rs:1"]
    );
}

#[test]
fn comments_strings_tests_and_uses_in_one_direction_are_no_cycle() {
    let found = knots(&[
        ("lib.rs", "#[cfg(test)]\nmod testing;\nmod a;\nmod b;\n#[path = \"else/where.rs\"]\nmod c;"),
        ("a.rs", "use crate::b::B;\nuse crate::c::C;\nmod child;\npub struct A;"),
        ("a/child.rs", "use super::A;\nuse crate::a;"),
        (
            "b.rs",
            "//! [`crate::a`]\n/// [A](crate::a::A)\n// crate::a::A\npub const B: &str = \"crate::a\"; /* crate::a */
             #[cfg(test)]\nuse crate::a::A;
             pub struct D<T> { #[cfg(all(test, unix))] pub(crate) a: crate::a::A, pub(crate) b: T }
             #[test_case]\n#[cfg(test)]\nimpl<T, U> D<T> { fn f(_: crate::a::A) {} }
             #[cfg(test)]\nmod tests { use crate::a::A; }\n#[cfg(test)]\nmod more;",
        ),
        ("b/more.rs", "use crate::a::A;"),
        ("else/where.rs", "#![cfg(test)]\nuse crate::a::A;"),
        ("testing.rs", "use crate::a::A;"),
    ]);
    assert_eq!(found, Vec::<String>::new());
}

#[test]
fn what_is_left_out_of_tests_counts() {
    let found = knots(&[
        ("lib.rs", "mod a;\nmod b;"),
        ("a.rs", "#[cfg(not(test))]\nuse crate::b::B;"),
        ("b.rs", "#[cfg(feature = \"test\")]\nuse crate::a::A;"),
    ]);
    assert_eq!(found.len(), 1, "{found:?}");
}
