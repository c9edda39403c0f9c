// A drawing of the selected flow: grains placed by the volume fraction, carried by the velocity, shaken by the temperature.

const canvas = document.getElementById("chute");
const key = document.getElementById("chute-key");
const still = matchMedia("(prefers-reduced-motion: reduce)");
let flow = null, grains = [], view = null, running = true, last = 0;

function at(list, z, height) {
  const step = z[1] - z[0], i = Math.min(z.length - 2, Math.max(0, Math.floor(height / step)));
  const w = Math.min(1, Math.max(0, height / step - i));
  return list[i] * (1 - w) + list[i + 1] * w;
}

export function show(chosen, slope, colour) {
  flow = chosen && { ...chosen.profile, slope, colour, M: chosen.M };
  const box = canvas.getBoundingClientRect(), ratio = devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(box.width * ratio)); canvas.height = Math.max(1, Math.round(box.height * ratio));
  if (!flow) { grains = []; key.textContent = "No flow, no grains."; paint(0); return; }
  const angle = Math.atan(slope), top = flow.z.at(-1);
  // Room for the chute's fall across the picture, and for the flow above it.
  const fall = box.width * Math.sin(angle), pixel = Math.max(40, box.height - Math.min(fall, 0.55 * box.height) - 12) / top;
  const radius = Math.min(12, Math.max(1.5, pixel / 2)), length = box.width / pixel / Math.cos(angle);
  const exact = (4 / Math.PI) * flow.M * length, count = Math.round(Math.min(1200, Math.max(25, exact)));
  const fastest = Math.max(...flow.u);
  view = { angle, top, pixel, radius, length, ratio, width: box.width, height: box.height, pace: (0.25 * length) / Math.max(fastest, 1e-9) };
  const sum = [0];
  for (let i = 1; i < flow.z.length; i++) sum.push(sum[i - 1] + (flow.nu[i] + flow.nu[i - 1]) / 2);
  while (grains.length > count) grains.pop();
  while (grains.length < count) grains.push({ share: Math.random(), x: Math.random(), dx: 0, dz: 0 });
  for (const grain of grains) {
    const target = grain.share * sum.at(-1);
    let low = 0, high = sum.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (sum[middle] <= target) low = middle; else high = middle; }
    grain.z = (low + (target - sum[low]) / (sum[high] - sum[low] || 1)) * (flow.z[1] - flow.z[0]);
    grain.u = at(flow.u, flow.z, grain.z); grain.root = Math.sqrt(Math.max(0, at(flow.T, flow.z, grain.z)));
  }
  const size = pixel / 2 < 1.5 ? "grains drawn larger than they are" : pixel / 2 > 12 ? "grains drawn smaller than they are" : "grains to scale";
  key.textContent = `A drawing of the computed fields, not a simulation: ${size}${count !== Math.round(exact) ? ", their number not" : ""}.`;
  paint(0);
}

function normal() { return Math.sqrt(-2 * Math.log(1 - Math.random())) * Math.cos(2 * Math.PI * Math.random()); }

function paint(dt) {
  const pen = canvas.getContext("2d");
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  if (!flow) return;
  const { angle, pixel, radius, length, ratio, pace, top } = view, style = getComputedStyle(document.documentElement);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.translate(0, Math.max(8, view.height - 8 - Math.min(view.width * Math.tan(angle), 0.6 * view.height)));
  pen.rotate(angle);
  pen.strokeStyle = style.getPropertyValue("--quiet"); pen.lineWidth = 3;
  pen.beginPath(); pen.moveTo(-50, 3); pen.lineTo(view.width * 2, 3); pen.stroke();
  pen.fillStyle = flow.colour;
  const step = dt * pace, spread = Math.min(1.5, 0.15 * top);
  for (const grain of grains) {
    if (step) {
      grain.x = (grain.x + (grain.u * step) / length) % 1;
      const kick = grain.root * Math.sqrt(step) * 0.6, keep = Math.exp(-4 * dt);
      grain.dx = keep * grain.dx + kick * normal(); grain.dz = Math.min(spread, Math.max(-spread, keep * grain.dz + kick * normal()));
    }
    const x = (grain.x * length * 1.15 + grain.dx) * pixel - 0.1 * view.width, z = Math.abs(grain.z + grain.dz) * pixel + radius;
    pen.beginPath(); pen.arc(x, -z, radius, 0, 7); pen.fill();
  }
}

function frame(now) {
  const dt = Math.min(0.05, (now - last) / 1000);
  last = now;
  if (running && !still.matches && flow && !document.hidden) paint(dt);
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);

document.getElementById("pause").addEventListener("click", (event) => {
  running = !running;
  event.target.textContent = running ? "pause" : "play";
});
