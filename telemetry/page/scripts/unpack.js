// Undo the compression of a page's script, and begin it: the page's policy knows both scripts by their hashes.

(async () => {
  const bytes = Uint8Array.from(atob("PACKED"), letter => letter.charCodeAt(0));
  const script = document.createElement("script");
  script.textContent = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.body.append(script);
})();
