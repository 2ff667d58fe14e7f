// Runs the camera's program, WebAssembly, in a worker: one turn after the other, the page's commands in between.

import * as usb from "./usb.js";

const PROGRAM = "nirspi_web.wasm", SEED = 1;
// Screens show no more images a second.
const PACE_MS = 33;
const words = { decode: new TextDecoder(), encode: new TextEncoder() };
// Whether the camera is a real one. Its bytes come as promises, for which the program waits.
const isReal = usb.isAsked(location.href);
let program = null, panic = "", paused = false, next = 0;

const read = (address, bytes) => words.decode.decode(new Uint8Array(program.memory.buffer, address >>> 0, bytes));
const answer = () => read(program.answer(), program.answer_bytes());

// The functions that the program calls.
const page = {
  now_ms: () => performance.timeOrigin + performance.now(),
  panicked: (address, bytes) => { panic = read(address, bytes); },
  usb_open: waiting(async () => { await usb.open(); return 0; }),
  usb_send: waiting(async (address, bytes) => {
    await usb.send(new Uint8Array(program.memory.buffer, address >>> 0, bytes).slice());
    return 0;
  }),
  usb_receive: waiting(async (address, room, timeout_ms) => {
    const bytes = await usb.receive(room, timeout_ms);
    if (!bytes) return GONE;
    new Uint8Array(program.memory.buffer).set(bytes, address >>> 0);
    return bytes.length;
  }),
  usb_problem: (address, room) => {
    const { written } = words.encode.encodeInto(problem, new Uint8Array(program.memory.buffer, address >>> 0, room));
    return written;
  },
};

// What the functions of USB return in place of a number: an error whose text `usb_problem` gives, and the end.
const FAILED = -1, GONE = -2;
let problem = "";

// A function for which the program waits.
function waiting(work) {
  const guarded = async (...given) => {
    try {
      return await work(...given);
    } catch (error) {
      problem = error.message;
      return FAILED;
    }
  };
  return isReal ? new WebAssembly.Suspending(guarded) : guarded;
}

// A function of the program that may wait for the camera.
const patient = work => isReal ? WebAssembly.promising(work) : work;

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
  const begin = isReal ? patient(program.begin_usb) : () => program.begin(SEED);
  postMessage({ loading: isReal ? "connecting to the camera on USB" : "preparing: latency and settling are measured before a white sheet" });
  if (!await begin()) throw new Error(answer());
  again(0);
}

function again(ms) {
  clearTimeout(next);
  next = setTimeout(() => inTurn(turn), ms);
}

async function turn() {
  // A real camera needs its host: firmware takes a host that is silent for gone.
  if (paused && !isReal || !program) return;
  const began = performance.now();
  if (!await patient(program.turn)()) throw new Error(answer());
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

// Work comes one after the other, for while the program waits for the camera nothing else may enter it. After a panic the
// program's memory may be in any state, so the program does not go on.
let before = Promise.resolve();
function inTurn(work) {
  before = before.then(work).catch(stopped);
}

function stopped(error) {
  clearTimeout(next);
  program = null;
  postMessage({ stopped: panic ? `The program in this page has stopped because of a bug: ${panic.replaceAll("\n", " ")}`
    : `The program in this page has stopped: ${error.message}` });
}

onmessage = ({ data }) => {
  if ("paused" in data) { paused = data.paused; if (program) again(0); } else inTurn(() => command(data));
};
inTurn(start);
