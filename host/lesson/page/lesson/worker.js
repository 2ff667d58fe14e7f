// Runs the lesson's program, WebAssembly, in a worker: one question after the other.

const PROGRAM = "nirspi_lesson.wasm";
const words = { decode: new TextDecoder(), encode: new TextEncoder() };
let panic = "";

async function start() {
  const got = await fetch(PROGRAM);
  if (!got.ok) throw new Error(`${PROGRAM} cannot be read: the server answers ${got.status}`);
  const page = { panicked: (address, bytes) => { panic = words.decode.decode(new Uint8Array(program.memory.buffer, address >>> 0, bytes)); } };
  const program = (await WebAssembly.instantiate(await got.arrayBuffer(), { page })).instance.exports;
  program.begin();
  return program;
}
const started = start();

// The numbers that a function of the program answers. `given` is a text or 32-bit numbers for the room, or nothing.
function numbers(program, name, given, rest) {
  if (given !== null) {
    const bytes = typeof given === "string" ? words.encode.encode(given) : new Uint8Array(Float32Array.from(given).buffer);
    const room = program.room(bytes.length) >>> 0;
    new Uint8Array(program.memory.buffer).set(bytes, room);
  }
  const isDone = program[name](...rest);
  const address = program.answer(isDone) >>> 0, length = program.answer_bytes(isDone);
  const answer = program.memory.buffer.slice(address, address + length);
  if (!isDone) throw new Error(words.decode.decode(answer));
  return new Float64Array(answer);
}

let before = Promise.resolve();
onmessage = ({ data: { id, name, given, rest } }) => {
  before = before.then(async () => {
    try {
      postMessage({ id, numbers: numbers(await started, name, given, rest) });
    } catch (error) {
      postMessage({ id, problem: panic ? `the program has stopped because of a bug: ${panic}` : error.message });
    }
  });
};
