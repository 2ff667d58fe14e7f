"""Measurements in memory and from files."""

import pickle
import subprocess

import numpy as np
import pytest

import nirspi as ns
from conftest import asymmetric

N = 16


def of(scene, order="zig-zag", split=False):
    return ns.Hadamard(N, rows=ns.order(order, N), split=split)(scene)


@pytest.mark.parametrize("form", ["pairs", "halves", "single"])
def test_every_form_of_readings_gives_the_same_differences(form):
    scene = asymmetric(N)
    y = of(scene, split=True)
    shaped = {"pairs": y, "halves": np.concatenate([y[0::2], y[1::2]]), "single": y[0::2]}[form]
    found = ns.Measurement(y=shaped, rows="zig-zag", n=N, readings=form)
    assert np.allclose(found.d, of(scene), atol=1e-9)


def test_several_measurements_keep_their_leading_axes():
    scenes = np.stack([asymmetric(N, seed) for seed in range(6)]).reshape(2, 3, N, N)
    y = of(scenes, split=True)
    found = ns.Measurement(y=y, rows="zig-zag", n=N)
    assert found.d.shape == (2, 3, N * N) and np.allclose(found.d, of(scenes))
    images = ns.reconstruct(found, method="hadamard")
    assert images.shape == (2, 3, N, N) and np.allclose(images, scenes, atol=1e-4)


@pytest.mark.parametrize("not_read", [False, True])
def test_differences_lie_one_measurement_after_another(not_read):
    rows = ns.order("zig-zag", N)
    rows[3] = -1 if not_read else rows[3]
    for d in (np.zeros((5, N * N)), np.zeros((5, N * N), order="F"), np.zeros((5, N * N), np.float32)):
        assert ns.Measurement(d=d, rows=rows, n=N).d.flags.c_contiguous


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_all_measurements_of_a_file_are_those_that_are_read_one_by_one(tmp_path, save, order):
    random = np.random.default_rng(5)
    rows = ns.order("cake-cutting", N)
    # More than one thread reads a file of this size.
    d = random.normal(size=(2100, N * N))
    d[7, 3] = d[2099, 0] = np.nan
    path = tmp_path / "many.npz"
    images = random.normal(size=(2100, N, N)).astype(np.float32)
    save(path, n=N, h_row=rows, d=np.asarray(d, order=order), recon=images)
    every = ns.load(path, index="all")
    assert np.array_equal(every.reference, images)
    assert np.array_equal(every.d, d, equal_nan=True) and every.d.flags.c_contiguous
    assert every.rows.tolist() == rows.tolist() and len(every.dropouts) == 2100 == len(every)
    for k in (0, 7, 1024, 2099):
        one = ns.load(path, index=k)
        assert np.array_equal(one.d, d[k][~np.isnan(d[k])])
        assert one.rows.tolist() == rows[~np.isnan(d[k])].tolist()
    again = pickle.loads(pickle.dumps(every[:3]))
    assert np.array_equal(again.d, d[:3]) and again.n == N


def test_a_pattern_that_no_measurement_of_a_file_has_read_is_left_out(tmp_path):
    rows = ns.order("zig-zag", N)
    d = np.arange(3.0 * N * N).reshape(3, -1)
    d[:, 5] = np.nan
    d[1, 9] = np.nan
    np.savez(tmp_path / "m.npz", n=N, h_row=rows, d=d)
    found = ns.load(tmp_path / "m.npz", index="all")
    assert found.not_read.tolist() == [5] and found.rows.tolist() == np.delete(rows, 5).tolist()
    assert np.array_equal(found.d, np.delete(d, 5, axis=1), equal_nan=True)


@pytest.mark.parametrize("copy", [True, False])
def test_a_measurement_shares_the_memory_of_its_array_only_if_told_to(copy):
    d = of(asymmetric(N))
    found = ns.Measurement(d=d, rows="zig-zag", n=N, copy=copy)
    assert np.shares_memory(found.d, d) is not copy
    d[3] = np.nan
    assert np.isnan(found.d[3]) == (not copy)


def test_a_pattern_that_was_not_read_is_left_out():
    scene = asymmetric(N)
    d, rows = of(scene), ns.order("zig-zag", N).copy()
    gone = [5, 9, 200]
    missing = d.copy()
    missing[gone] = np.nan
    rest = np.setdiff1d(np.arange(N * N), gone)
    expected = ns.reconstruct(ns.Measurement(d=d[rest], rows=rows[rest], n=N))
    assert (ns.reconstruct(ns.Measurement(d=missing, rows=rows, n=N)) == expected).all()
    # What a masked array hides is no reading, whatever stands there.
    hidden = np.ma.masked_array(np.where(np.isnan(missing), 1e9, missing), mask=np.isnan(missing))
    masked = ns.Measurement(d=hidden, rows=rows, n=N)
    assert np.flatnonzero(np.isnan(masked.d)).tolist() == gone
    assert (ns.reconstruct(masked) == expected).all()
    counts = np.ma.masked_array(np.rint(hidden.data).astype(np.int32), mask=hidden.mask)
    assert np.flatnonzero(np.isnan(ns.Measurement(d=counts, rows=rows, n=N).d)).tolist() == gone
    with pytest.raises(ns.Error, match="nan at"):
        ns.Measurement(d=d, rows=np.ma.masked_equal(rows, 7), n=N)
    # An array without masked places keeps its type.
    assert (ns.Measurement(d=np.ma.masked_array(d), rows=rows, n=N).d == d).all()
    rows[gone] = -1
    negative = ns.Measurement(d=d, rows=rows, n=N)
    assert negative.not_read.tolist() == gone
    assert (ns.reconstruct(negative) == expected).all()


def test_drop_outs_of_pairs_are_found_and_left_out():
    scene = 5 + asymmetric(N)
    y = of(scene, split=True)
    y[100:108] = 0.01 * y[100:108]
    found = ns.Measurement(y=y, rows="zig-zag", n=N)
    (lost,) = found.dropouts
    assert lost and lost[0][0] == 100 and np.isnan(found.d[50:54]).all()
    assert np.isfinite(np.delete(found.d, range(50, 54))).all()


def test_a_trace_is_the_measurement_of_its_readings(tmp_path):
    scene = asymmetric(N)
    y = of(scene, split=True)
    samples = np.concatenate([np.zeros(5), np.repeat(y, 6), np.zeros(4)])
    trigger = np.zeros(len(samples))
    for start in range(5, 5 + 6 * len(y), 6):
        trigger[start : start + 3] = 5.0
    np.savez(tmp_path / "scope.npz", CH1=samples, TRIG=trigger)
    m = ns.Measurement.from_trace(tmp_path / "scope.npz", trigger="TRIG", settle=2, rows="zig-zag", n=N)
    assert np.allclose(m.d, of(scene), atol=1e-9)
    assert "512 readings by the trigger" in m.notes[0]
    assert m.origin["file"] == "scope.npz" and m.origin["origin"].startswith("unknown")
    assert b'"file":"scope.npz"' in ns.reconstruct(m, method="hadamard").png()
    # An edge that is not there is a pattern that was not read.
    trigger[5 + 6 * 8 : 8 + 6 * 8] = 0.0
    np.savez(tmp_path / "scope.npz", CH1=samples, TRIG=trigger)
    with pytest.warns(RuntimeWarning, match="8"):
        gap = ns.Measurement.from_trace(tmp_path / "scope.npz", trigger="TRIG", rows="zig-zag", n=N)
    assert np.flatnonzero(np.isnan(gap.d)).tolist() == [4]
    assert np.isfinite(ns.reconstruct(gap)).all()
    samples.astype("<f4").tofile(tmp_path / "adc.f32")
    raw = ns.Measurement.from_trace(
        tmp_path / "adc.f32", raw="f32", samples=6, skip=5, count=512, rows="zig-zag", n=N
    )
    assert np.allclose(raw.d, of(scene), atol=1e-3)


def test_channels_of_a_wav_file_and_of_a_tdms_file_are_traces(tmp_path):
    scene = asymmetric(N)
    y = of(scene, split=True)
    samples = np.concatenate([np.zeros(5), np.repeat(y, 6)])
    trigger = np.zeros_like(samples)
    for at in range(3):
        trigger[5 + at :: 6] = 5.0
    wavfile = pytest.importorskip("scipy.io.wavfile")
    wavfile.write(tmp_path / "adc.wav", 48_000, np.stack([samples, trigger], 1).astype(np.float32))
    m = ns.Measurement.from_trace(tmp_path / "adc.wav", field="1", trigger="2", rows="zig-zag", n=N)
    assert np.allclose(m.d, of(scene), atol=1e-3)
    wavfile.write(tmp_path / "d.wav", 48_000, np.rint(1e4 * of(scene)).astype(np.int32))
    d = ns.load(tmp_path / "d.wav", shown="zig-zag", readings="differences")
    assert np.allclose(d.d, 1e4 * of(scene), atol=0.51)
    # As docs/measurements.md says.
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "adc.tdms") as writer:
        named = {"ai0": samples, "ai1": trigger}
        writer.write_segment([nptdms.ChannelObject("group", name, data) for name, data in named.items()])
    with pytest.raises(ns.Error, match="TDMS file of LabVIEW .two lines of Python"):
        ns.load(tmp_path / "adc.tdms")
    channels = nptdms.TdmsFile.read(tmp_path / "adc.tdms")["group"].channels()
    np.savez(tmp_path / "adc.npz", **{c.name: c[:] for c in channels})
    t = ns.Measurement.from_trace(tmp_path / "adc.npz", field="ai0", trigger="ai1", rows="zig-zag", n=N)
    assert np.allclose(t.d, of(scene), atol=1e-9)


def test_a_table_in_memory_is_read_as_a_file_of_its_columns(tmp_path):
    scene = asymmetric(N)
    y, rows = of(scene, split=True), ns.order("zig-zag", N)
    columns = {
        "lit": y[0::2],
        "dark": y[1::2],
        "shown": rows,
        "side": [N] * len(rows),
        "note": ["ok"] * len(rows),
    }
    named = "lit,dark,h_row=shown,n=side"
    found = ns.Measurement.from_table(columns, field=named)
    assert np.allclose(found.d, of(scene)) and found.rows.tolist() == rows.tolist() and found.n == N
    structured = np.zeros(len(rows), [("d", "f4"), ("h_row", "i4"), ("n", "u1"), ("word", "U3")])
    structured["d"], structured["h_row"], structured["n"] = of(scene), rows, N
    assert np.allclose(ns.Measurement.from_table(structured).d, of(scene), atol=1e-4)
    # A row a reading, complements in any order.
    every = np.random.default_rng(2).permutation(len(y))
    loose = {"y": y[every], "h_row": np.repeat(rows, 2)[every], "sign": np.tile([1, -1], len(rows))[every]}
    signed = ns.Measurement.from_table(loose, side=N)
    assert np.allclose(ns.reconstruct(signed, method="hadamard"), scene, atol=1e-4)
    np.savez(tmp_path / "a.npz", **{name: columns[name] for name in ("lit", "dark", "shown")}, side=N)
    assert (ns.load(tmp_path / "a.npz", field=named).d == found.d).all()
    with pytest.raises(ns.Error, match="^the table: `volts` is not in the file"):
        ns.Measurement.from_table(columns, field="volts,h_row=shown,n=side")


def test_readings_that_a_warning_names_are_read_by_an_option(tmp_path):
    scene = asymmetric(N)
    y = of(scene, split=True)
    for options, changed in [
        ({"complements_first": True}, y.reshape(-1, 2)[:, ::-1].ravel()),
        ({"inverted": True}, -y),
        ({"shift": -1}, np.concatenate([y[:1], y[:-1]])),
        ({"sweeps": 3}, np.tile(y, 3)),
    ]:
        np.save(tmp_path / "y.npy", changed)
        found = ns.load(tmp_path / "y.npy", shown="zig-zag", side=N, **options)
        expected = of(scene)[: len(found.d)]
        assert np.allclose(found.d, expected), options
        assert not any(note.startswith("warning") for note in found.notes)


def test_read_takes_files_and_traces(tmp_path):
    scene = asymmetric(N)
    y = of(scene, split=True)
    np.save(tmp_path / "y.npy", y)
    assert np.allclose(ns.read(tmp_path / "y.npy", shown="zig-zag").d, of(scene))
    samples = np.concatenate([np.zeros(5), np.repeat(y, 6), np.zeros(4)])
    np.savez(tmp_path / "adc.npz", CH1=samples, CH2=samples[::-1])
    trace = ns.read(tmp_path / "adc.npz", samples=6, skip=5, count=len(y), field="CH1", shown="zig-zag")
    assert np.allclose(trace.d, of(scene)) and "512 readings" in trace.notes[0]
    with pytest.raises(ns.Error, match="adc.npz: .* expected n, h_row"):
        ns.read(tmp_path / "adc.npz", samples=6, skip=5, count=len(y), field="CH1")


def test_transposed_pixels_give_the_transposed_image():
    scene = asymmetric(N)
    m = ns.Measurement(d=of(scene.T, "natural"), rows="natural", n=N, transpose=True)
    assert np.allclose(ns.reconstruct(m, method="hadamard"), scene, atol=1e-4)


def test_a_file_comes_back_and_the_reader_is_the_command_lines(tmp_path):
    scene = asymmetric(N)
    m = ns.Measurement(d=of(scene), rows="zig-zag", n=N, reference=scene)
    m.save(tmp_path / "a.npz")
    found = ns.load(tmp_path / "a.npz")
    assert (found.d == m.d).all() and (found.rows == m.rows).all()
    assert np.allclose(found.reference, scene)
    np.savez(tmp_path / "many.npz", n=N, h_row=m.rows, y=np.stack([of(scene, split=True)] * 3))
    assert ns.load(tmp_path / "many.npz", index="all").d.shape == (3, N * N)
    assert ns.load(tmp_path / "many.npz", index=2).d.shape == (N * N,)
    np.save(tmp_path / "alone.npy", of(scene))
    alone = ns.load(tmp_path / "alone.npy", shown="zig-zag", side=N, readings="differences")
    assert (alone.d == m.d).all()
    (tmp_path / "t.csv").write_text("\n".join(map(str, of(scene, split=True))))
    assert np.allclose(ns.load(tmp_path / "t.csv", shown="zig-zag").d, m.d)


def test_measurements_of_a_file_with_different_gaps_share_their_rows(tmp_path):
    d = np.stack([of(asymmetric(N, seed)) for seed in range(3)])
    d[0, 3] = d[1, 7] = d[2, 3] = np.nan
    np.savez(tmp_path / "gaps.npz", n=N, h_row=ns.order("zig-zag", N), d=d)
    found = ns.load(tmp_path / "gaps.npz", index="all")
    assert found.d.shape == d.shape and np.array_equal(found.d, d, equal_nan=True)
    assert (found.rows == ns.order("zig-zag", N)).all()


def test_a_file_is_one_kind_of_measurement_whatever_it_holds(tmp_path):
    """Differences as they lie there, readings in pairs, complex numbers, gaps: the same types and shapes."""
    scenes = np.stack([5 + asymmetric(N, seed) for seed in range(3)])
    rows, d = ns.order("zig-zag", N), of(scenes)
    gaps = d.copy()
    gaps[0, 3] = gaps[:, 9] = np.nan
    files = {"d": {"d": d}, "y": {"y": of(scenes, split=True)}, "complex": {"d": d + 1j}, "gaps": {"d": gaps}}
    for name, fields in files.items():
        path = tmp_path / f"{name}.npz"
        np.savez(path, n=N, h_row=rows, recon=scenes, **fields)
        every, one = ns.load(path, index="all"), ns.load(path, index=1)
        shown = np.delete(rows, 9) if name == "gaps" else rows
        assert every.rows.tolist() == shown.tolist() and every.rows.dtype == np.int64 and every.n == N, name
        assert every.d.shape == (3, len(shown)) and one.d.shape == (len(shown),), name
        assert every.d.dtype == (complex if name == "complex" else float), name
        assert np.array_equal(every.reference, scenes.astype("f4")) and one.reference.shape == (N, N), name
        assert every.dropouts == [[], [], []] and one.dropouts == [[]], name
        assert every.not_read.tolist() == ([9] if name == "gaps" else []), name
        assert every.frames is None and every.flat_field is None and every.notes == [], name
        assert every.unit == ns.Measurement(d=d, rows=rows, n=N).unit and len(every[1:]) == 2, name


def test_complex_readings_give_the_magnitude(tmp_path):
    scene = asymmetric(N) * np.exp(0.5j)
    m = ns.Measurement(d=of(scene), rows="zig-zag", n=N)
    assert np.allclose(ns.reconstruct(m, method="hadamard"), abs(scene), atol=1e-4)
    np.savez(tmp_path / "c.npz", n=N, h_row=m.rows, d=m.d)
    assert np.allclose(ns.load(tmp_path / "c.npz").d, m.d)
    assert np.allclose(ns.load(tmp_path / "c.npz", part="imaginary").d, m.d.imag)


def test_parts_and_pickles_are_measurements():
    d = np.stack([of(asymmetric(N, seed)) for seed in range(4)])
    m = ns.Measurement(d=d, rows="zig-zag", n=N)
    assert len(m) == 4 and (m[1].d == d[1]).all() and m[1:3].d.shape == (2, N * N)
    assert (m.take(10).rows == m.rows[:10]).all()
    other = pickle.loads(pickle.dumps(m))
    assert (other.d == m.d).all() and other.n == N


def test_what_pairs_say_of_their_noise_comes_through_every_door(cli, tmp_path, random):
    # A quarter of noisy pairs: their sums say more of the noise than their differences.
    rows = ns.order("zig-zag", 32)[:256]
    figure = np.zeros((32, 32))
    figure[6:25, 9:15] = figure[6:12, 9:24] = 1.0
    y = ns.Hadamard(32, rows=rows, split=True)(np.stack([figure, figure.T + 0.2]))
    y += random.normal(scale=[[3.0], [9.0]], size=y.shape)
    np.savez(tmp_path / "one.npz", n=32, h_row=rows, y=y[0])
    np.savez(tmp_path / "two.npz", n=32, h_row=rows, y=y)
    np.savez(tmp_path / "scope.npz", y=np.repeat(y[0], 3))

    def images(given, **options):
        return ns.reconstruct(given, method="tikhonov", **options)

    from_file = ns.load(tmp_path / "one.npz")
    expected = images(from_file)
    alone = ns.Measurement(d=from_file.d, rows=rows, n=32)
    assert from_file.most_noise > 3 and (images(alone) != expected).any()
    in_memory = ns.Measurement(y=y[0], rows=rows, n=32)
    in_memory.save(tmp_path / "d.npz")
    with ns.Feed([y[0]], n=32, order=rows) as feed:
        fed = feed.capture(1)
    doors = {
        "memory": in_memory,
        "halves": ns.Measurement(
            y=np.concatenate([y[0, 0::2], y[0, 1::2]]), rows=rows, n=32, readings="halves"
        ),
        "differences": ns.Measurement(d=from_file.d, rows=rows, n=32, most_noise=from_file.most_noise),
        "saved": ns.load(tmp_path / "d.npz"),
        "table": ns.Measurement.from_table({"n": [32] * 512, "y": y[0], "h_row": rows.repeat(2)[::2]}),
        "trace": ns.Measurement.from_trace(tmp_path / "scope.npz", samples=3, rows=rows, n=32),
        "feed": fed,
        "pickle": pickle.loads(pickle.dumps(in_memory)),
        "part": ns.Measurement(y=y, rows=rows, n=32)[0],
        "one of a file": ns.load(tmp_path / "two.npz", index=0),
        "the first of all": ns.load(tmp_path / "two.npz", index="all")[0],
    }
    for door, measurement in doors.items():
        assert measurement.most_noise == from_file.most_noise, door
        assert (images(measurement) == expected).all(), door

    stack = ns.load(tmp_path / "two.npz", index="all")
    expected = images(stack)
    assert stack.most_noise.shape == (2,) and stack.most_noise[1] > 2 * stack.most_noise[0]
    without = ns.Measurement(d=stack.d, rows=rows, n=32)
    assert (images(without) != expected).any()
    in_memory = ns.Measurement(y=y, rows=rows, n=32)
    in_memory.save(tmp_path / "both.npz")
    doors = {
        "memory": in_memory,
        "axes": ns.Measurement(y=y.reshape(2, 1, -1), rows=rows, n=32),
        "saved": ns.load(tmp_path / "both.npz", index="all"),
        "all of it": in_memory[:],
        "the file while it is read": tmp_path / "both.npz",
    }
    for door, given in doors.items():
        options = {} if isinstance(given, ns.Measurement) else {"index": "all"}
        assert (images(given, **options).reshape(expected.shape) == expected).all(), door
    for file in ("two", "both"):
        out = tmp_path / file
        options = ["--index", "all", "--method", "tikhonov", "--out", out]
        subprocess.run([cli, "reconstruct", tmp_path / f"{file}.npz", *options], check=True)
        assert (np.load(out / "image.npy") == expected).all(), file


def test_a_stack_has_the_noise_of_each_measurement(tmp_path, random):
    scenes = np.stack([asymmetric(32, seed) for seed in range(3)])
    d = ns.Hadamard(32, rows=ns.order("zig-zag", 32)[:300])(scenes) + random.normal(scale=20, size=(3, 300))
    m = ns.Measurement(d=d, rows="zig-zag", n=32, noise=[20.0, np.nan, 5.0])
    m.save(tmp_path / "m.npz")
    every = ns.load(tmp_path / "m.npz", index="all")
    assert np.array_equal(every.noise, m.noise, equal_nan=True)
    assert (every[0].noise, every[1].noise, every[1:].noise[1]) == (20.0, None, 5.0)
    images = ns.reconstruct(m, method="tikhonov")
    for k, noise in enumerate([20.0, None, 5.0]):
        one = ns.Measurement(d=d[k], rows="zig-zag", n=32, noise=noise)
        assert (ns.reconstruct(one, method="tikhonov") == images[k]).all()
        assert (ns.reconstruct(tmp_path / "m.npz", index=k, method="tikhonov") == images[k]).all()
    by_path = ns.reconstruct(tmp_path / "m.npz", index="all", method="tikhonov")
    assert (by_path == images).all()
    # One number for all.
    ns.Measurement(d=d, rows="zig-zag", n=32, noise=20.0).save(tmp_path / "same.npz")
    same = ns.reconstruct(tmp_path / "same.npz", index="all", method="tikhonov")
    assert (same[0] == images[0]).all() and (same[2] != images[2]).any()
    for wrong, of in [(-1.0, "-1"), ([1.0, 2.0], "shape"), (np.inf, "inf"), ("loud", "holds")]:
        with pytest.raises(ns.Error, match=of):
            ns.Measurement(d=d, rows="zig-zag", n=32, noise=wrong)


def test_all_on_readings_correct_a_lamp_that_drifts(tmp_path):
    scene = asymmetric(N)
    rows = np.insert(ns.order("zig-zag", N), np.arange(0, N * N, 8), 0)
    y = ns.Hadamard(N, rows=ns.order("natural", N), split=True)(scene)[0::2][rows]
    share = np.linspace(0, 1, len(rows))
    np.savez(tmp_path / "drifts.npz", n=N, h_row=rows, y=y * (1 + 0.4 * share))
    options = {"readings": "single", "divide_by_lamp": True}
    as_it_is = ns.load(tmp_path / "drifts.npz", readings="single")
    assert any("the lamp drifts by" in note for note in as_it_is.notes)
    # A scene of random pixels looks like noise to the other methods.
    corrected = ns.reconstruct(tmp_path / "drifts.npz", method="hadamard", **options)
    steady = scene - scene.mean()
    assert ns.metrics.correlation(steady, corrected) > 0.999
    assert ns.metrics.correlation(steady, ns.reconstruct(as_it_is, method="hadamard")) < 0.99


def test_sums_of_pairs_correct_a_lamp_that_drifts(tmp_path, random):
    scene = np.add.outer(np.linspace(0, 1, 16) ** 2, np.linspace(0, 2, 16))
    rows = ns.order("zig-zag", 16)
    y = ns.Hadamard(16, rows=rows, split=True)(scene)
    lamp = np.repeat(np.linspace(1, 1.4, len(rows)), 2)
    np.savez(tmp_path / "drifts.npz", n=16, h_row=rows, y=y * lamp)
    as_it_is = ns.load(tmp_path / "drifts.npz")
    assert any("the lamp drifts by 33" in note for note in as_it_is.notes)
    corrected = ns.load(tmp_path / "drifts.npz", divide_by_lamp=True)
    assert not any("the lamp drifts" in note for note in corrected.notes)
    steady = ns.Measurement(y=y, rows=rows, n=16)
    seen = np.abs(steady.d) > 1
    seen[0] = False
    assert seen.sum() > 10 and np.allclose(corrected.d[seen], 1.2 * steady.d[seen], rtol=1e-3)
