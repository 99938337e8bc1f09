// The scene as the page holds it: its JSON, and its blocks of numbers as typed arrays (see ../scene.d.ts).

const FORMAT = 1;
const ARRAYS = { f4: Float32Array, f8: Float64Array };

/** @returns {import("../scene").Scene & { numbers: (block: import("../scene").Block) => Float32Array | Float64Array }} */
export function readScene(page) {
  const scene = JSON.parse(page.getElementById("scene").textContent);
  if (scene.format !== FORMAT) {
    throw new Error(`the scene has format ${scene.format}, this page shows format ${FORMAT}: run the scenario again`);
  }
  const bytes = decode(page.getElementById("numbers").textContent);
  scene.numbers = ({ at, rows, columns, type }) => new ARRAYS[type](bytes, at, rows * columns);
  return scene;
}

function decode(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes.buffer;
}

/** The last row k with times[k] <= time, 0 before the first; `stride` numbers a row. */
export function rowAt(times, time, stride = 1) {
  let low = 0;
  let high = times.length / stride - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle * stride] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Numbers of a table at a time, linear between rows (time first): `width` of them after the time. */
export function between(rows, time, width) {
  const stride = width + 1;
  const last = rows.length / stride - 1;
  const k = Math.min(rowAt(rows, time, stride), Math.max(0, last - 1));
  const [a, b] = [k * stride, Math.min(k + 1, last) * stride];
  const span = rows[b] - rows[a];
  const share = span > 0 ? Math.min(1, Math.max(0, (time - rows[a]) / span)) : 1;
  return Array.from({ length: width }, (_, i) => rows[a + 1 + i] * (1 - share) + rows[b + 1 + i] * share);
}
