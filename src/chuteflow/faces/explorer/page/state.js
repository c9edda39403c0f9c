// The state of the page is its address: whoever opens a copied address sees the same.

const listeners = [];
const defaults = { si: "", d: "1", rho: "2500", theme: "", flow: "0", against: "h", whole: "", x: "slope", y: "roughness" };
export const state = {};
let due = null;

/** Take the state of the address, over the defaults and over `first`. */
export function start(first) {
  Object.assign(state, defaults, Object.fromEntries(Object.entries(first).map(([k, v]) => [k, String(v)])));
  const given = new URLSearchParams(location.search);
  for (const name of Object.keys(state)) if (given.has(name)) state[name] = given.get(name);
}

/** Change parts of the state, tell the listeners which, and put it into the address. */
export function change(parts) {
  const changed = Object.keys(parts).filter((name) => state[name] !== String(parts[name]));
  if (!changed.length) return;
  for (const name of changed) state[name] = String(parts[name]);
  for (const listen of listeners) listen(new Set(changed));
  // Browsers allow some hundred changes of the address in half a minute: wait until a drag pauses.
  clearTimeout(due);
  due = setTimeout(write, 120);
}

export function onChange(listen) { listeners.push(listen); }

export function address() {
  const shown = Object.entries(state).filter(([name, value]) => defaults[name] !== value);
  return `${location.pathname}?${new URLSearchParams(shown)}`;
}

export function write() { clearTimeout(due); history.replaceState(null, "", address()); }

export function chute() {
  return Object.fromEntries(["slope", "e", "ew", "roughness", "surface", "closure"].map((name) => [name, state[name]]));
}
