// Colours: those of the page's theme, and those whose brightness tells a value.

/** The colours of the theme that holds now, by name. */
function themeColours() {
  const probe = document.body.appendChild(make("span", { hidden: true }));
  const names = ["paper", "ink", "muted", "grid", "rule", "accent", "mark"];
  const resolved = names.map((name) => {
    probe.style.color = `var(--${name})`;
    return [name, getComputedStyle(probe).color];
  });
  probe.remove();
  return Object.fromEntries(resolved);
}

const NO_NUMBER = [128, 128, 128];

/** Make a function from [0, 1] to a colour [r, g, b] out of colours in order of brightness. */
function brightnessScale(colours) {
  const channels = colours.map((colour) => [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16)));
  return (fraction) => {
    if (Number.isNaN(fraction)) return NO_NUMBER;
    const place = Math.min(Math.max(fraction, 0), 1) * (channels.length - 1);
    const low = Math.min(Math.floor(place), channels.length - 2);
    return channels[low].map((channel, i) => channel + (channels[low + 1][i] - channel) * (place - low));
  };
}

function rgb([red, green, blue]) {
  return `rgb(${Math.round(red)},${Math.round(green)},${Math.round(blue)})`;
}
