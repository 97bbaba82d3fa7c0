// Undo the compression of a page's script, and begin it: the page's policy knows both scripts by their hashes.

(async () => {
  const text = "PACKED", size = Math.ceil(text.length / 5);
  const digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~";
  const values = Object.fromEntries(Array.from(digits, (digit, value) => [digit, value]));
  const words = new DataView(new ArrayBuffer(4 * size)), whole = text.padEnd(5 * size, "~");
  for (let word = 0; word < size; word++) {
    let value = 0;
    for (let at = 5 * word; at < 5 * word + 5; at++) value = 85 * value + values[whole[at]];
    words.setUint32(4 * word, value);
  }
  const bytes = new Uint8Array(words.buffer, 0, 4 * size - (whole.length - text.length));
  const script = document.createElement("script");
  script.textContent = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.body.append(script);
})();
