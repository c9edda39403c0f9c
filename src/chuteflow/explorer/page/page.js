// Small things that every panel needs: elements by their id, colours of the theme, text that is safe in markup.

export const byId = (id) => document.getElementById(id);

export const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

/** The text as a sentence: with a capital letter and a full stop. */
export const sentence = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1).replace(/\.$/, "")}.`;

// Messages of the server are shown before those on typed text.
const messages = { flows: "", curve: "", export: "", typed: "" };

/** Show a message of what is wrong, by its source; an empty text removes it. */
export function showMessage(from, text) {
  messages[from] = text;
  const first = Object.values(messages).find(Boolean) ?? "", line = byId("failure");
  line.hidden = !first;
  if (line.textContent !== first) line.textContent = first;
}

const sizes = new WeakMap();
const watcher = new ResizeObserver((entries) => {
  for (const { target, contentRect } of entries) sizes.set(target, contentRect);
});

/** Width and height of an element. Asking the browser after each change would make it lay out the page again. */
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

/** Colours are read again: the theme has changed. */
export function forgetColours() { seen = {}; }

/** Hand a file to the browser's downloads. */
export function download(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
