// Small things that every panel needs: elements by their id, colours of the theme, text that is safe in markup.

export const byId = (id) => document.getElementById(id);

export const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

/** A sentence of what the server says: it begins large and ends with a full stop. */
export const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1).replace(/\.$/, "")}.`;

// What the server says comes before what is said of typed text, which then has changed nothing.
const told = { flows: "", curve: "", typed: "" };

/** Say on the one line for it what is wrong, by where that comes from, or with an empty text that it no longer is. */
export function tell(from, text) {
  told[from] = text;
  const first = Object.values(told).find(Boolean) ?? "", line = byId("failure");
  line.hidden = !first;
  if (line.textContent !== first) line.textContent = first;
}

const sizes = new WeakMap();
const watcher = new ResizeObserver((entries) => {
  for (const { target, contentRect } of entries) sizes.set(target, contentRect);
});

/** Width and height of an element. Asking the browser after each change would make it lay out the page anew. */
export function sizeOf(element) {
  if (!sizes.has(element)) {
    sizes.set(element, element.getBoundingClientRect());
    watcher.observe(element);
  }
  return sizes.get(element);
}

let seen = {};

/** The value of a colour of the theme, such as "--ink". */
export function colour(name) {
  seen[name] ??= getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return seen[name];
}

/** The colour of a flow, by its place among the flows. */
export const flowColour = (i) => colour(`--flow${i % 5}`);

/** Colours are looked up anew: the theme has changed. */
export function forgetColours() { seen = {}; }

/** Hand a file to the browser's downloads. */
export function download(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
