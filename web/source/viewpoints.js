// Viewpoints: directions of the three views, as in the other pictures.

import { dot, View } from "./view.js";

export const VIEWS = ["oblique", "top", "close"]; // their keys, in their order
const FLATTER = 4; // times as broad ways must look from the other side before it is taken

/** Obliquely; from the sun, or along the orbit normal; and from near by, following a craft. */
export function views(scene, moment) {
  const made = scene.sun ? sunlit(scene.sun) : scene.mean_motion ? orbital(moment) : upright();
  const close = made.pop();
  close.follows = true;
  return [...made, close];
}

/** Radial upwards, along-track to the right as far as that goes. */
function orbital(moment) {
  const frame = { pole: [1, 0, 0], front: [0, 1, 0] };
  const elevation = Math.asin(0.75 / Math.hypot(0.75, 0.45, 0.5));
  const usual = Math.atan2(-0.5, -0.45);
  const azimuth = breadth(moment, frame, -usual, elevation) > FLATTER * breadth(moment, frame, usual, elevation) ? -usual : usual;
  return [
    new View("oblique", "Oblique view", frame, azimuth, elevation),
    new View("top", "Along the orbit normal", frame, -Math.PI / 2, 0),
    new View("close", "Close view", frame, azimuth, 0.6 * elevation),
  ];
}

/** How broad the ways look from a side: the lesser spread of their points on the picture. */
function breadth(moment, frame, azimuth, elevation) {
  const view = new View("", "", frame, azimuth, elevation);
  const points = moment.tracks.filter(({ kind }) => kind === "executed").flatMap((track) => {
    const chords = track.chords(Infinity);
    return Array.from({ length: chords.length / 4 }, (_, k) => chords.slice(4 * k, 4 * k + 3));
  }).map((point) => [dot(point, view.right), dot(point, view.up)]);
  const [x, y] = [0, 1].map((i) => points.reduce((sum, point) => sum + point[i], 0) / points.length);
  const sums = points.reduce(([a, b, c], [u, v]) => [a + (u - x) ** 2, b + (u - x) * (v - y), c + (v - y) ** 2], [0, 0, 0]);
  return (sums[0] + sums[2] - Math.hypot(sums[0] - sums[2], 2 * sums[1])) / 2;
}

/** The sun above. */
function sunlit(sun) {
  const front = Math.abs(sun[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const off = dot(sun, front);
  const level = front.map((one, i) => one - off * sun[i]);
  const size = Math.hypot(...level);
  const frame = { pole: sun, front: level.map((one) => one / size) };
  return [
    new View("oblique", "Oblique view", frame, -0.45, 0.5),
    new View("top", "From the sun", frame, 0, Math.PI / 2),
    new View("close", "Close view", frame, -0.45, 0.5),
  ];
}

/** z upwards. */
function upright() {
  const frame = { pole: [0, 0, 1], front: [1, 0, 0] };
  return [
    new View("oblique", "Oblique view", frame, -1, 0.42),
    new View("top", "Along z", frame, -Math.PI / 2, Math.PI / 2),
    new View("close", "Close view", frame, -1, 0.42),
  ];
}
