// Values read off a chart: a cross-hair follows the mouse, a touch or the arrow keys, with the numbers beside it.
import { byId, escaped, sizeOf } from "./page.js";

/** Take the cross-hair of a chart away. */
export const clear = (svg) => svg.querySelector(".cross")?.remove();

/**
 * Put a cross-hair over a chart that `draw` drew as `shown`, at `x` and `y` in pixels, either of which may be missing.
 * `dots` are {x, y, colour}, `says` {text, colour} are the lines beside it.
 */
export function place(svg, { box }, { x, y, dots = [], says }) {
  clear(svg);
  const across = y === undefined ? "" : `M${box.l} ${y.toFixed(1)}H${box.r}`, up = x === undefined ? "" : `M${x.toFixed(1)} ${box.t}V${box.b}`;
  const points = dots.map((dot) => `<circle cx="${dot.x.toFixed(1)}" cy="${dot.y.toFixed(1)}" r="3.5" fill="${dot.colour}"/>`);
  const lines = says.map(({ text, colour }, i) => `<tspan x="0" dy="${i ? 14 : 0}"${colour ? ` fill="${colour}"` : ""}>${escaped(text)}</tspan>`);
  svg.insertAdjacentHTML("beforeend", `<g class="cross"><path d="${across}${up}"/>${points.join("")}<g class="tip"><rect rx="3"/><text>${lines.join("")}</text></g></g>`);
  const tip = svg.querySelector(".tip"), { width, height } = tip.querySelector("text").getBBox(), frame = tip.querySelector("rect");
  for (const [name, value] of Object.entries({ x: -5, y: -14, width: width + 10, height: height + 7 })) frame.setAttribute(name, value);
  // Beside the place that is read, on the side with space, and within the chart.
  const tipFrame = sizeOf(svg), px = x ?? box.r, py = y ?? box.t;
  const left = px + 12 + width < tipFrame.width ? px + 14 : px - 14 - width, top = py - 10 - height < 4 ? py + 24 : py - height + 4;
  tip.setAttribute("transform", `translate(${Math.max(6, Math.min(tipFrame.width - width - 6, left)).toFixed(1)} ${Math.max(15, Math.min(tipFrame.height - height, top)).toFixed(1)})`);
}

/** Let a screen reader say the values at the cross-hair. */
export function speak(text) { byId("spoken").textContent = text; }

/**
 * Follow what reads a chart: `over` (x, y in its pixels) is called where the pointer is, `away` when it has left, `key`
 * (name of a key) when one is pressed, and with nothing when the chart is reached by the keyboard; it tells whether it took it.
 */
export function follow(svg, { over, away, key }) {
  const at = (event) => {
    const box = svg.getBoundingClientRect();
    over(event.clientX - box.left, event.clientY - box.top);
  };
  // A finger that moves scrolls the page: it reads where it touches.
  svg.addEventListener("pointermove", (event) => { if (event.pointerType !== "touch") at(event); });
  svg.addEventListener("pointerdown", (event) => { if (event.pointerType === "touch") at(event); });
  svg.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") away(); });
  svg.addEventListener("focus", () => { if (svg.matches(":focus-visible")) key(); });
  svg.addEventListener("blur", away);
  svg.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape") away();
    else if (key(event.key)) event.preventDefault();
  });
}

/**
 * Follow a chart that is read where the pointer is: `read` (x, y in its pixels) is called there, and again by the
 * function that is returned, which tells whether the pointer is on the chart; `key` as of `follow`.
 */
export function followPointer(svg, { read, key }) {
  let pointer = null;
  const again = () => { if (pointer) read(...pointer); return Boolean(pointer); };
  follow(svg, {
    over: (...at) => {
      pointer = at;
      again();
    },
    away: () => {
      pointer = null;
      clear(svg);
    },
    key,
  });
  return again;
}
