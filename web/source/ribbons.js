// Ribbons: lines some pixels wide, thousands of segments in one draw, strong where executed and faint beyond now.
// Each segment has four corners of its own: to draw instances of one is slow where there is no graphics card.

import {
  BufferAttribute, BufferGeometry, DoubleSide, InterleavedBuffer, InterleavedBufferAttribute, Mesh, ShaderMaterial, Vector2,
} from "three";
import { rgb } from "./palette.js";

const CORNER = 12; // numbers of a corner: x, y, z, time, way to the other end, length so far, side, width, craft, dashes

const VERTEX = `
attribute vec4 here, look; // look: side, width [px], craft, dashes [px]
attribute vec3 way;
attribute float run;
attribute vec4 tint;
uniform vec2 halfSize;
uniform float chosen;
varying vec4 colour;
varying vec4 along; // time, length, across [px], half width [px]
varying float dash;

void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(here.xyz, 1.0);
  vec2 ahead = (projectionMatrix * modelViewMatrix * vec4(way, 0.0)).xy * halfSize;
  float size = length(ahead);
  ahead = size > 1e-6 ? ahead / size : vec2(1.0, 0.0);
  float wide = look.y * (abs(look.z - chosen) < 0.5 ? 1.6 : 1.0);
  float reach = 0.5 * wide + 1.0;
  gl_Position.xy += look.x * reach * vec2(-ahead.y, ahead.x) / halfSize;
  colour = tint;
  along = vec4(here.w, run, look.x * reach, 0.5 * wide);
  dash = look.w;
}`;

const FRAGMENT = `
uniform float now, trail, units, ahead;
varying vec4 colour;
varying vec4 along;
varying float dash;

void main() {
  float alpha = colour.a * clamp(along.w + 0.5 - abs(along.z), 0.0, 1.0);
  if (dash > 0.0 && mod(along.y, dash * units) > 0.6 * dash * units) discard;
  float age = now - along.x;
  if (ahead < 1.0) alpha *= age < 0.0 ? ahead : max(1.4 * ahead, 1.0 - age / trail);
  if (alpha < 0.01) discard;
  gl_FragColor = vec4(colour.rgb, alpha);
}`;

export class Ribbons {
  /** Room for `most` segments. What lies beyond now keeps `ahead` of its strength; with 1 all is alike. */
  constructor(most, { ahead = 1, order = 2 } = {}) {
    this.corners = new InterleavedBuffer(new Float32Array(4 * CORNER * most), CORNER);
    this.tint = new BufferAttribute(new Uint8Array(16 * most), 4, true);
    this.geometry = new BufferGeometry();
    const parts = { here: [4, 0], way: [3, 4], run: [1, 7], look: [4, 8] };
    for (const [name, [size, offset]] of Object.entries(parts)) {
      this.geometry.setAttribute(name, new InterleavedBufferAttribute(this.corners, size, offset));
    }
    this.geometry.setAttribute("tint", this.tint);
    const index = new Uint32Array(6 * most);
    for (let k = 0; k < most; k++) index.set([0, 1, 2, 2, 1, 3].map((one) => 4 * k + one), 6 * k);
    this.geometry.setIndex(new BufferAttribute(index, 1));
    this.uniforms = Object.fromEntries(
      Object.entries({ halfSize: new Vector2(1, 1), units: 1, now: 0, trail: 1, ahead, chosen: -1 })
        .map(([name, value]) => [name, { value }]),
    );
    const { uniforms } = this;
    const shaders = { vertexShader: VERTEX, fragmentShader: FRAGMENT };
    const material = new ShaderMaterial({ uniforms, ...shaders, transparent: true, depthWrite: false, side: DoubleSide });
    this.meshes = [new Mesh(this.geometry, material)];
    this.meshes[0].frustumCulled = false;
    this.meshes[0].renderOrder = order;
    this.lines = [];
    this.clear();
  }

  clear() {
    this.count = 0;
    this.lines.length = 0;
  }

  /** Adds a line through points (x, y, z, t one after another). */
  line(points, colour, { width = 1.5, alpha = 1, dash = 0, craft = -2 } = {}) {
    const first = this.count;
    const rows = this.corners.array;
    let run = 0;
    for (let k = 4; k < points.length; k += 4) {
      const way = [0, 1, 2].map((i) => points[k + i] - points[k - 4 + i]);
      const size = Math.hypot(...way);
      for (let j = 0; j < 4; j++) {
        const from = j < 2 ? k - 4 : k;
        const at = CORNER * (4 * this.count + j);
        for (let i = 0; i < 4; i++) rows[at + i] = points[from + i];
        rows.set([...way, j < 2 ? run : run + size, j % 2 ? 1 : -1, width, craft, dash], at + 4);
      }
      run += size;
      this.count += 1;
    }
    this.lines.push({ first, last: this.count, colour, alpha });
  }

  /** Hands what was added to the graphics; `paint` makes a colour "#rrggbb" of each line's own. */
  finish(paint = (colour) => colour) {
    for (const { first, last, colour, alpha } of this.lines) {
      const parts = [...rgb(paint(colour)), alpha].map((part) => Math.round(255 * part));
      for (let k = 4 * first; k < 4 * last; k++) this.tint.array.set(parts, 4 * k);
    }
    this.corners.needsUpdate = true;
    this.tint.needsUpdate = true;
    this.geometry.setDrawRange(0, 6 * this.count);
  }
}
