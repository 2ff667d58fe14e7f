#!/usr/bin/env bash
# Tests a camera as an instrument, from outside: the same steps for a real camera and for the virtual one.
#
#   bash boards/hil.sh                                 the virtual camera, served over TCP (simulated)
#   bash boards/hil.sh --camera usb                    a camera on the bench, before a white sheet
#   bash boards/hil.sh --camera usb --hub 1-1:2        and its USB port switched off and on by uhubctl
#
#   --frames N           frames of a capture (1000)
#   --hub HUB:PORT       the camera's port of a hub that can switch power (uhubctl); without it, unplugging is skipped
#   --unplugs N          times the port is switched off in a capture (100)
#   --gateware FILE      a bitstream to load; without it, loading is skipped
#   --minutes N          length of the last capture (1)
#   --out DIR            where reports and recordings go (target/hil)
#
# Prints a line for each step: ok, FAIL or skipped, with what was seen. Exits 1 if a step failed. `nirspi` is taken from the
# PATH, or from $NIRSPI.
set -uo pipefail
nirspi=${NIRSPI:-nirspi}
camera='' frames=1000 hub='' unplugs=100 gateware='' minutes=1 out=target/hil
while [ $# -gt 0 ]; do
    [ $# -ge 2 ] || { echo "$1 needs a value" >&2; exit 2; }
    case $1 in
    --camera) camera=$2 ;; --frames) frames=$2 ;; --hub) hub=$2 ;; --unplugs) unplugs=$2 ;;
    --gateware) gateware=$2 ;; --minutes) minutes=$2 ;; --out) out=$2 ;;
    *) echo "no option $1: bash boards/hil.sh explains the options in its head" >&2; exit 2 ;;
    esac
    shift 2
done
command -v "$nirspi" >/dev/null || { echo "no program $nirspi: cargo install --locked --path host/cli" >&2; exit 2; }
mkdir -p "$out" && out=$(cd "$out" && pwd) && rm -f "$out"/*.{json,log,mcap}
calibration=$out/calibration.json

failures=0
# report NAME STATUS WHAT: a line of the result.
report() {
    printf '%-8s %-44s %s\n' "$2" "$1" "$3"
    [ "$2" != FAIL ] || failures=$((failures + 1))
}
# field FILE EXPRESSION: a value of a JSON report; empty where there is none.
field() { python3 -c 'import json,sys; report=json.load(open(sys.argv[1])); print(eval(sys.argv[2]))' "$1" "$2" 2>/dev/null; }
# ask NAME COMMAND...: runs a nirspi command with a JSON report in $out/NAME.json, its errors in $out/NAME.log.
ask() { local name=$1; shift; "$nirspi" "$@" --camera "$camera" --json >"$out/$name.json" 2>"$out/$name.log"; }
# said NAME: the first line that the command said on stderr.
said() { head -1 "$out/$1.log"; }
# film NAME FRAMES: a capture of so many frames into a new file.
film() { ask "$1" capture --frames "$2" --calibration "$calibration" --out "$out/$1.mcap"; }
# counts NAME: what a capture received and lost, in words.
counts() { field "$out/$1.json" '"{received} received, {lost} lost, {corrupt} corrupt, {late} late".format(**report["frames"])'; }

# checked NAME TITLE: the step passed if its capture is complete.
checked() {
    if [ "$(field "$out/$1.json" 'report["complete"]')" = True ]; then report "$2" ok "$(counts "$1")"; else report "$2" FAIL "$(counts "$1") $(said "$1")"; fi
}

served=''
end() { [ -z "$served" ] || kill "$served" 2>/dev/null; }
trap end EXIT
if [ -z "$camera" ]; then
    "$nirspi" dev virtual --listen 127.0.0.1:0 --scene white >"$out/virtual.log" 2>&1 &
    served=$!
    for _ in $(seq 100); do
        address=$(grep -o '127\.0\.0\.1:[0-9]*' "$out/virtual.log" | head -1)
        [ -z "$address" ] || break
        sleep 0.1
    done
    camera=tcp:$address
    echo "the virtual camera at $camera: everything below is simulated"
fi

step_info() {
    local title='identity and versions'
    ask info camera info || { report "$title" FAIL "$(said info)"; return; }
    local advice answers
    advice=$(field "$out/info.json" '"; ".join(part["advice"] for part in report["parts"] if part["advice"])')
    answers=$(field "$out/info.json" 'report["fpga_answers"]')
    if [ "$answers" = True ] && [ -z "$advice" ]; then
        report "$title" ok "$(field "$out/info.json" '"{board} {serial}, firmware {firmware}, gateware {gateware}".format(**report["camera"])')"
    else
        report "$title" FAIL "FPGA answers: $answers; ${advice:-versions as expected}"
    fi
}

step_selftest() {
    ask selftest camera selftest --calibration "$calibration"
    local code=$? failed
    failed=$(field "$out/selftest.json" '", ".join(check["name"] for check in report["checks"] if check["verdict"] == "failed")')
    if [ $code = 0 ]; then report 'self-test, from registers to light' ok "$(field "$out/selftest.json" '"{} checks".format(len(report["checks"]))')"
    else report 'self-test, from registers to light' FAIL "${failed:-$(said selftest)}"; fi
}

step_gateware() {
    [ -n "$gateware" ] || { report 'gateware loaded over the link' skipped 'no --gateware FILE'; return; }
    if "$nirspi" camera gateware "$gateware" --camera "$camera" >"$out/gateware.log" 2>&1; then report 'gateware loaded over the link' ok "$gateware"
    else report 'gateware loaded over the link' FAIL "$(said gateware)"; fi
}

step_capture() {
    film capture "$frames"
    checked capture "$frames frames, one after the other"
}

step_sessions() {
    local bad=0
    for k in 1 2 3 4 5; do film "session$k" 3 || bad=$((bad + 1)); done
    if [ $bad = 0 ]; then report 'five sessions in a row' ok '3 frames each'; else report 'five sessions in a row' FAIL "$bad incomplete"; fi
}

# The host dies in a capture: the camera must go dark by itself and take the next host.
step_killed() {
    "$nirspi" capture --camera "$camera" --frames 100000000 --calibration "$calibration" --out "$out/killed.mcap" >"$out/killed.log" 2>&1 &
    local host=$!
    sleep 2
    kill -9 $host 2>/dev/null || { report 'a host killed in a capture, then the next' FAIL "$(head -1 "$out/killed.log")"; return; }
    wait $host 2>/dev/null
    for _ in $(seq 20); do
        film after-kill 10 && break
        sleep 0.5
    done
    checked after-kill 'a host killed in a capture, then the next'
}

# The host is stopped for longer than the camera's patience of 5 s.
step_silent() {
    "$nirspi" capture --camera "$camera" --frames 100000000 --calibration "$calibration" --out "$out/silent.mcap" >"$out/silent.out" 2>"$out/silent.log" &
    local host=$!
    sleep 2
    kill -STOP $host 2>/dev/null || { report 'a host silent for 7 s is told in one line' FAIL "$(tail -1 "$out/silent.log")"; return; }
    sleep 7
    kill -CONT $host
    # A camera has switched its LEDs off, and the host says so and ends. The virtual camera's time stands still while its
    # host reads nothing, so its capture may go on.
    local waited=0
    while kill -0 $host 2>/dev/null && [ $waited -lt 100 ]; do
        sleep 0.1
        waited=$((waited + 1))
    done
    # Not INT, which a script ignores for what it starts in the background.
    if kill -TERM $host 2>/dev/null; then waited=on; fi
    wait $host
    local code=$?
    local title='a host silent for 7 s is told in one line'
    if [ $waited = on ] && [ -n "$served" ]; then report "$title" skipped 'the virtual camera waited for its host'
    elif [ $waited != on ] && [ $code = 1 ] && [ -s "$out/silent.log" ]; then report "$title" ok "$(tail -1 "$out/silent.log")"
    else report "$title" FAIL "exit $code: $(tail -1 "$out/silent.log")"; fi
    rm -f "$out/silent.mcap"
    film after-silence 10
    checked after-silence 'a capture after that'
}

step_unplug() {
    local title="$unplugs times unplugged in a capture"
    [ -n "$hub" ] || { report "$title" skipped 'no --hub HUB:PORT'; return; }
    command -v uhubctl >/dev/null || { report "$title" skipped 'no uhubctl'; return; }
    local lost=0
    for k in $(seq "$unplugs"); do
        "$nirspi" capture --camera "$camera" --frames 100000000 --calibration "$calibration" --out "$out/unplugged.$k.mcap" >/dev/null 2>&1 &
        local host=$!
        sleep "1.$((RANDOM % 10))"
        uhubctl -l "${hub%:*}" -p "${hub#*:}" -a cycle -d 2 >"$out/uhubctl.log" 2>&1
        wait $host
        rm -f "$out/unplugged.$k.mcap"
        sleep 2
        film replugged 10 || lost=$((lost + 1))
        rm -f "$out/replugged.mcap"
    done
    if [ $lost = 0 ]; then report "$title" ok 'a capture after each was complete'; else report "$title" FAIL "$lost captures after it were not complete"; fi
}

step_long() {
    local rate
    rate=$(field "$out/capture.json" 'report["frames_per_s"]')
    local count
    count=$(python3 -c "print(max(1, int(60 * $minutes * float('${rate:-1}'))))")
    film long "$count"
    checked long "$count frames, about $minutes min"
}

step_info
step_selftest
step_gateware
step_capture
step_sessions
step_killed
step_silent
step_unplug
step_long
echo "reports: $out"
if [ $failures != 0 ]; then
    echo "$failures failed" >&2
    exit 1
fi
