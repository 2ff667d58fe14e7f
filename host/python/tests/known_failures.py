"""Tests that are known to fail, each an open task: they run, and are reported as expected failures.

Since November 2026 the program weights each reading by its noise, which recordings and exported files state. A
``Measurement`` of this package does not carry the noise yet, so its images differ from the program's. The other tests
have words, figures or bytes from before that change.
"""

KNOWN = {
    "tests/test_bad_input.py::test_what_does_not_fit_is_refused_in_one_line[44]",
    "tests/test_camera.py::test_what_does_not_fit_is_refused_in_one_line",
    "tests/test_cli.py::test_reconstruct[1-omp]",
    "tests/test_cli.py::test_reconstruct[1-tikhonov]",
    "tests/test_cli.py::test_reconstruct[1-fista]",
    "tests/test_cli.py::test_reconstruct[1-tv]",
    "tests/test_cli.py::test_reconstruct[1-prior]",
    "tests/test_cli.py::test_reconstruct[1-auto]",
    "tests/test_cli.py::test_reconstruct[30%-omp]",
    "tests/test_cli.py::test_reconstruct[30%-tikhonov]",
    "tests/test_cli.py::test_reconstruct[30%-fista]",
    "tests/test_cli.py::test_reconstruct[30%-tv]",
    "tests/test_cli.py::test_reconstruct[30%-prior]",
    "tests/test_cli.py::test_reconstruct[30%-auto]",
    "tests/test_cli.py::test_a_recording_as_a_sum_and_frame_by_frame",
    "tests/test_cli.py::test_rain_and_spheres",
    "tests/test_cli.py::test_measurements_of_other_groups",
    "tests/test_examples.py::test_the_examples_of_docstrings_run[nirspi.bench]",
    "tests/test_examples.py::test_the_examples_of_docstrings_run[nirspi.reconstruction]",
    "tests/test_notebooks.py::test_a_notebook_prints_and_draws_what_the_page_shows[dataset]",
    "tests/test_notebooks.py::test_a_notebook_prints_and_draws_what_the_page_shows[measurements]",
    "tests/test_notebooks.py::test_a_notebook_prints_and_draws_what_the_page_shows[orders]",
    "tests/test_reconstruct.py::test_a_file_is_refused_in_the_words_of_load",
    "tests/test_reconstruct.py::test_a_file_that_is_read_while_it_is_reconstructed_is_never_whole_in_memory",
    "tests/test_reconstruct.py::test_patterns_of_ones_own",
    "tests/test_recording.py::test_a_zarr_store_has_the_programs_bytes",
}
