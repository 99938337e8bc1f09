// Viewpoints: from where the three views look, as in the other pictures.

import { View } from "./view.js";

/** Obliquely; from the sun, or along the orbit normal; and from near by, following a craft. */
export function views(scene) {
  const made = scene.sun ? sunlit(scene.sun) : scene.mean_motion ? orbital() : upright();
  const close = made.pop();
  close.follows = true;
  return [...made, close];
}

/** Radial upwards, along-track to the right as far as that goes. */
function orbital() {
  const frame = { pole: [1, 0, 0], front: [0, 1, 0] };
  const [azimuth, elevation] = [Math.atan2(-0.5, -0.45), Math.asin(0.75 / Math.hypot(0.75, 0.45, 0.5))];
  return [
    new View("oblique", "Oblique view", frame, azimuth, elevation),
    new View("top", "Along the orbit normal", frame, -Math.PI / 2, 0),
    new View("close", "Close view", frame, azimuth, 0.6 * elevation),
  ];
}

/** The sun above. */
function sunlit(sun) {
  const front = Math.abs(sun[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const off = sun.reduce((sum, one, i) => sum + one * front[i], 0);
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
