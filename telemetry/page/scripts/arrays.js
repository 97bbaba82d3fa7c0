// Arrays that a page carries as text.

const bytesOf = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
const floatsOf = text => new Float32Array(bytesOf(text).buffer);
const three = (array, k) => [array[3 * k], array[3 * k + 1], array[3 * k + 2]];
