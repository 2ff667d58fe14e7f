// Runs the camera's program, WebAssembly, in a worker: one turn after the other, the page's commands in between.

const PROGRAM = "nirspi_web.wasm", SEED = 1;
// Screens show no more images a second.
const PACE_MS = 33;
const words = { decode: new TextDecoder(), encode: new TextEncoder() };
let program = null, panic = "", paused = false, next = 0;

const read = (address, bytes) => words.decode.decode(new Uint8Array(program.memory.buffer, address >>> 0, bytes));
const answer = () => read(program.answer(), program.answer_bytes());

// The functions that the program calls.
const page = {
  now_ms: () => performance.timeOrigin + performance.now(),
  panicked: (address, bytes) => { panic = read(address, bytes); },
};

// The program's bytes, with the progress for people who wait.
async function load() {
  const got = await fetch(PROGRAM);
  if (!got.ok) throw new Error(`${PROGRAM} cannot be read: the server answers ${got.status}`);
  const all = Number(got.headers.get("Content-Length")), parts = [], reader = got.body.getReader();
  for (let bytes = 0; ;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    bytes += value.length;
    const of = all >= bytes ? ` of ${(all / 1e6).toFixed(1)}` : "";
    postMessage({ loading: `loading the camera: ${(bytes / 1e6).toFixed(1)}${of} MB` });
  }
  return new Blob(parts).arrayBuffer();
}

async function start() {
  const bytes = await load();
  try {
    program = (await WebAssembly.instantiate(bytes, { page })).instance.exports;
  } catch (error) {
    throw new Error(`this browser cannot run the program, which needs WebAssembly with SIMD: ${error.message}`);
  }
  postMessage({ loading: "preparing: latency and settling are measured before a white sheet" });
  if (!program.begin(SEED)) throw new Error(answer());
  again(0);
}

function again(ms) {
  clearTimeout(next);
  next = setTimeout(() => guarded(turn), ms);
}

function turn() {
  if (paused || !program) return;
  const began = performance.now();
  if (!program.turn()) throw new Error(answer());
  postMessage({ message: answer() });
  again(Math.max(0, PACE_MS - (performance.now() - began)));
}

function command({ id, path, body }) {
  // A command that comes before the program has started.
  if (!program) return postMessage({ id, ok: false, text: "the camera is not there yet" });
  const parts = [path, body].map(part => words.encode.encode(part)), [head, rest] = parts;
  const room = program.room(head.length + rest.length) >>> 0, memory = new Uint8Array(program.memory.buffer);
  memory.set(head, room);
  memory.set(rest, room + head.length);
  const ok = Boolean(program.command(head.length));
  postMessage({ id, ok, text: answer() });
}

// After a panic the program's memory may be in any state, so the program does not go on.
function guarded(work) {
  try {
    work();
  } catch (error) {
    stopped(error);
  }
}

function stopped(error) {
  clearTimeout(next);
  program = null;
  postMessage({ stopped: panic ? `The program in this page has stopped because of a bug: ${panic.replaceAll("\n", " ")}`
    : `The program in this page has stopped: ${error.message}` });
}

onmessage = ({ data }) => guarded(() => {
  if ("paused" in data) { paused = data.paused; if (program) again(0); } else command(data);
});
start().catch(stopped);
