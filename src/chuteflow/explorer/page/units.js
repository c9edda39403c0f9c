// SI units: each quantity scales with powers of the grain density, the grain diameter and g cos(theta).
import { state } from "./state.js";

let quantities = {};
export function setQuantities(given) { quantities = given; }

/** What a dimensionless value is multiplied with, on a chute of this slope. */
export function factor(symbol, slope = state.slope) {
  if (!state.si) return 1;
  const [a, b, c] = quantities[symbol].dimension;
  const value = Number(state.rho) ** a * (Number(state.d) / 1000) ** b * (9.81 / Math.hypot(1, Number(slope))) ** c;
  // An address may hold impossible grains or slopes, which the server reports.
  return value > 0 && Number.isFinite(value) ? value : 1;
}

export function unit(symbol) {
  const name = state.si ? quantities[symbol].unit : "1";
  return name === "1" ? "" : name.replaceAll("^2", "²").replaceAll("^3", "³");
}

export function labelled(text, symbol) {
  const name = unit(symbol);
  return name ? `${text} (${name})` : text;
}
