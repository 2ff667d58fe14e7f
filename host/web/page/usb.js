// A camera on USB, by WebUSB: the page asks a person for the camera, the worker opens it and moves its bytes.

// The identity that mcu/wire/src/usb.rs gives the camera; tests/tests/web_usb.rs compares them.
const CAMERA = { vendorId: 0x1209, productId: 0x0001, classCode: 0xff, subclassCode: 0x53 };
// The number of both bulk endpoints, one for each direction.
const ENDPOINT = 1;
// As nirspi's own USB link: enough transfers wait at all times that the camera never waits for the host.
const TRANSFERS = 16, TRANSFER_BYTES = 16384;

// Whether this browser has WebUSB, and lets a program wait for a promise.
export const isOffered = () => "usb" in navigator && "Suspending" in WebAssembly;
// Whether the address of this page, or of its worker, asks for the camera on USB.
export const isAsked = address => new URL(address).searchParams.get("camera") === "usb";

// Lets a person choose the camera. Works in answer to a click only.
export const choose = () => navigator.usb.requestDevice({ filters: [CAMERA] });

const settings = usbInterface => usbInterface.alternates.find(
  one => one.interfaceClass === CAMERA.classCode && one.interfaceSubclass === CAMERA.subclassCode);

// The connection: transfers of an earlier one may end while the same device is open again.
let connection = 0, camera = null, received = [], problem = "", wake = () => {};

// Opens the camera that a person has chosen. What an earlier connection has left is forgotten.
export async function open() {
  const mine = ++connection;
  await camera?.close().catch(() => {});
  [camera, received, problem] = [null, [], ""];
  const found = (await navigator.usb.getDevices())
    .filter(one => one.vendorId === CAMERA.vendorId && one.productId === CAMERA.productId);
  if (found.length !== 1) throw new Error(`found ${found.length} cameras that this page may use, expected 1`);
  const [device] = found;
  await device.open();
  if (!device.configuration) await device.selectConfiguration(1);
  const own = device.configuration.interfaces.find(settings);
  if (!own) throw new Error("the device has no camera interface");
  await device.claimInterface(own.interfaceNumber);
  camera = device;
  for (let at = 0; at < TRANSFERS; at++) read(device, mine);
}

async function read(device, mine) {
  try {
    while (true) {
      const { status, data } = await device.transferIn(ENDPOINT, TRANSFER_BYTES);
      if (mine !== connection) return;
      if (status === "stall") await device.clearHalt("in", ENDPOINT);
      if (data?.byteLength) received.push(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
      wake();
    }
  } catch (error) {
    if (mine !== connection) return;
    problem ||= error.message;
    wake();
  }
}

// Sends all of the bytes.
export async function send(bytes) {
  if (problem) throw new Error(problem);
  const { status } = await camera.transferOut(ENDPOINT, bytes);
  if (status === "ok") return;
  // The endpoint must work again for the next command.
  await camera.clearHalt("out", ENDPOINT);
  throw new Error("the camera refused the transfer");
}

// The next bytes, at most `room`; none after `timeout_ms`. Null if the camera is gone.
export async function receive(room, timeout_ms) {
  if (!received.length && !problem) {
    let late = 0;
    await new Promise(done => { wake = done; late = setTimeout(done, timeout_ms); });
    clearTimeout(late);
    wake = () => {};
  }
  const next = received.shift();
  if (!next) return problem ? null : new Uint8Array();
  if (next.length > room) received.unshift(next.subarray(room));
  return next.subarray(0, room);
}
