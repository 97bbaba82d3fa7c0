// Arrays that a page carries as text.

const bytesOf = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
const floatsOf = text => new Float32Array(bytesOf(text).buffer);
/** Undo base64 and gzip. */
const inflated = async text => new Response(new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
/** Undo `planes` of telemetry/page/panel.py, for numbers of so many bytes. */
async function planesOf(text, size) {
  const bytes = new Uint8Array(await inflated(text)), count = bytes.length / size;
  return Uint8Array.from(bytes, (_, at) => bytes[(at % size) * count + Math.floor(at / size)]);
}
const three = (array, k) => [array[3 * k], array[3 * k + 1], array[3 * k + 2]];
