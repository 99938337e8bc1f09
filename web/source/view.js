// A view: an orthographic camera, so that one scale applies everywhere.

import { OrthographicCamera } from "three";

const NEAREST = 1e-5; // metres to a pixel
const SMALL = 300; // pixels of a view's height below which its margins are narrow

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

export class View {
  /** `pole` stays upright; azimuth is counted about it from `front`, elevation from the plane across it [rad]. */
  constructor(key, title, frame, azimuth, elevation) {
    Object.assign(this, { key, title, pole: frame.pole, front: frame.front, azimuth, elevation });
    this.side = cross(frame.pole, frame.front);
    this.first = { azimuth, elevation };
    this.camera = new OrthographicCamera();
    this.camera.matrixAutoUpdate = false;
    this.place = { left: 0, top: 0, width: 1, height: 1 };
    this.target = [0, 0, 0];
    this.scale = 1; // metres to a pixel
    this.cut = Infinity; // what stands out by more is cut away [m]
    this.touched = false; // whether the reader has turned or zoomed it
    this.turn(0, 0);
  }

  get shown() {
    return this.place.width > 1 && this.place.height > 1;
  }

  turn(azimuth, elevation) {
    this.azimuth = Math.atan2(Math.sin(this.azimuth + azimuth), Math.cos(this.azimuth + azimuth));
    this.elevation = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.elevation + elevation));
    const [c, s] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [up, flat] = [Math.sin(this.elevation), Math.cos(this.elevation)];
    const level = this.front.map((f, i) => c * f + s * this.side[i]);
    this.right = this.front.map((f, i) => c * this.side[i] - s * f);
    this.back = level.map((one, i) => flat * one + up * this.pole[i]);
    this.up = cross(this.back, this.right);
  }

  /** Moves what is looked at by pixels. */
  pan(right, down) {
    this.target = this.target.map((one, i) => one - this.scale * (right * this.right[i] - down * this.up[i]));
  }

  /** Zooms about a point of the view [pixels from its middle]; about its middle where it follows a craft. */
  zoom(factor, x = 0, y = 0) {
    const before = this.scale;
    this.scale = Math.max(NEAREST, before * factor);
    const moved = 1 - before / this.scale;
    this.pan(x * moved, y * moved);
  }

  /** Looks again as it first did at what reaches from `low` to `high` along a direction. */
  fit(reach) {
    Object.assign(this, this.first, { touched: false });
    this.turn(0, 0);
    const ranges = [this.right, this.up, this.back].map(reach);
    const { width, height } = this.place;
    const room = height < SMALL ? { above: 26, below: 24, beside: 30 } : { above: 34, below: 40, beside: 46 };
    const [across, upward] = ranges.map(([low, high]) => high - low);
    const wide = Math.max(40, width - 2 * room.beside);
    const high = Math.max(40, height - room.above - room.below);
    this.scale = Math.max(across / wide, upward / high, NEAREST) || 1;
    const lift = (this.scale * (room.above - room.below)) / 2; // the middle of the room is not that of the view
    const centre = ranges.map(([a, b]) => (a + b) / 2);
    this.target = [0, 1, 2].map((i) => this.right[i] * centre[0] + this.up[i] * (centre[1] + lift) + this.back[i] * centre[2]);
  }

  /** Pixels (x, y) on the page's canvas of a point, and how far it stands out towards the reader [m]. */
  project(x, y, z) {
    const d = [x - this.target[0], y - this.target[1], z - this.target[2]];
    const { left, top, width, height } = this.place;
    return [
      left + width / 2 + dot(d, this.right) / this.scale,
      top + height / 2 - dot(d, this.up) / this.scale,
      dot(d, this.back),
    ];
  }

  /** Whether pixels of the canvas lie in it. */
  holds(x, y, margin = 0) {
    const { left, top, width, height } = this.place;
    return x >= left - margin && y >= top - margin && x <= left + width + margin && y <= top + height + margin;
  }

  /** Sets the camera: it sees `far` [m] beyond the target, and what stands out by less than its `cut`. */
  aim(far) {
    const { camera, place, scale, right, up, back, target, cut } = this;
    const [half, tall] = [(scale * place.width) / 2, (scale * place.height) / 2];
    Object.assign(camera, { left: -half, right: half, top: tall, bottom: -tall, near: far - cut, far: 2 * far });
    camera.updateProjectionMatrix();
    const [x, y, z] = target.map((one, i) => one + far * back[i]);
    camera.matrix.set(right[0], up[0], back[0], x, right[1], up[1], back[1], y, right[2], up[2], back[2], z, 0, 0, 0, 1);
    camera.matrixWorld.copy(camera.matrix);
    camera.matrixWorldInverse.copy(camera.matrix).invert();
    return camera;
  }

  /** Azimuth and elevation [deg], metres across its shorter side, and what it looks at: for the address. */
  get numbers() {
    const degrees = [this.azimuth, this.elevation].map((angle) => Number(((angle * 180) / Math.PI).toFixed(2)));
    const span = this.scale * Math.min(this.place.width, this.place.height);
    return [...degrees, ...[span, ...this.target].map((one) => Number(one.toPrecision(6)))];
  }

  set numbers([azimuth, elevation, span, ...target]) {
    [this.azimuth, this.elevation] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
    this.turn(0, 0);
    this.scale = Math.max(NEAREST, span / Math.min(this.place.width, this.place.height));
    this.target = target;
    this.touched = true;
  }
}
