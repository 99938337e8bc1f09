// Solids: many bodies of one shape in one draw: zones, cones, shades and tubes as glass, craft as solid.

import {
  BackSide, BufferAttribute, BufferGeometry, ConeGeometry, CylinderGeometry, DoubleSide, BoxGeometry, DynamicDrawUsage,
  EdgesGeometry, FrontSide, InstancedBufferAttribute, InstancedBufferGeometry, LineSegments, Mesh, ShaderMaterial,
  SphereGeometry, Vector3,
} from "three";
import { ConvexGeometry } from "three/addons/geometries/ConvexGeometry.js";
import { rgb } from "./palette.js";

const SMOOTH = 12; // degrees between two faces up to which no edge is drawn

const VERTEX = `
attribute vec3 first, second, third, middle; // columns of the matrix that makes the body of the unit shape
attribute vec4 tint;
uniform float stretch;
varying vec4 colour;
varying vec3 facing;

void main() {
  vec3 place = middle + stretch * (first * position.x + second * position.y + third * position.z);
  gl_Position = projectionMatrix * modelViewMatrix * vec4(place, 1.0);
  facing = mat3(viewMatrix) * (cross(second, third) * normal.x + cross(third, first) * normal.y + cross(first, second) * normal.z);
  colour = tint;
}`;

const GLASS = `
varying vec4 colour;
varying vec3 facing;
void main() {
  float flat_on = abs(normalize(facing).z);
  gl_FragColor = vec4(colour.rgb, colour.a * mix(1.0, 0.3, flat_on));
}`;

const MATTE = `
varying vec4 colour;
varying vec3 facing;
void main() {
  vec3 n = normalize(facing);
  n *= gl_FrontFacing ? 1.0 : -1.0;
  float light = 0.62 + 0.38 * max(0.0, dot(n, vec3(-0.45, 0.6, 0.66)));
  gl_FragColor = vec4(colour.rgb * light, 1.0);
}`;

const PLAIN = `
varying vec4 colour;
void main() { gl_FragColor = colour; }`;

/** Unit shapes: faces, and edges as pairs of points. */
export const SHAPES = {
  ball: () => [new SphereGeometry(1, 24, 14), circles([[0, 1], [1, 2], [2, 0]])],
  box: () => [new BoxGeometry(2, 2, 2), new EdgesGeometry(new BoxGeometry(2, 2, 2))],
  cylinder: () => [new CylinderGeometry(1, 1, 2, 36).rotateX(Math.PI / 2), circles([[0, 1]], [-1, 1])],
  cone: () => [new ConeGeometry(1, 1, 36, 1, true).translate(0, -0.5, 0).rotateX(-Math.PI / 2), rays()],
  disc: () => [new CylinderGeometry(1, 1, 0.04, 28).rotateZ(Math.PI / 2), null],
};

/** Rows of the matrix that leaves a shape as it is. */
export const AS_IT_IS = [1, 0, 0, 0, 1, 0, 0, 0, 1];

/** The shape of a zone of the scene: [faces, edges]. */
export function shapeOf(zone) {
  return zone.shape === "faces" ? polyhedron(zone.corners) : SHAPES[zone.shape]();
}

/** The matrix that makes the zone of its shape. */
export function axesOf(zone) {
  return zone.shape === "faces" ? AS_IT_IS : zone.axes;
}

/** Faces and edges of a convex body by its corners. */
function polyhedron(corners) {
  const faces = new ConvexGeometry(corners.map((corner) => new Vector3(...corner)));
  return [faces, new EdgesGeometry(faces, SMOOTH)];
}

function circles(planes, heights = [0], steps = 64) {
  const points = [];
  for (const [i, j] of planes) {
    for (const height of heights) {
      for (let k = 0; k < 2 * steps; k++) {
        const angle = (Math.PI * ((k + 1) >> 1)) / (steps / 2);
        const point = [height, height, height];
        [point[i], point[j]] = [Math.cos(angle), Math.sin(angle)];
        points.push(...point);
      }
    }
  }
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
}

function rays() {
  const rim = circles([[0, 1]], [1]).attributes.position.array;
  const points = [...rim];
  for (let k = 0; k < rim.length; k += 36) points.push(0, 0, 0, rim[k], rim[k + 1], rim[k + 2]);
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
}

export class Solids {
  /** Room for `most` bodies of a shape [faces, edges]: as glass, of which the far side is seen, or solid. */
  constructor([faces, edges], most, { matte = false, side = "back", order = 1, edge = 0.5 } = {}) {
    const attribute = (size) => new InstancedBufferAttribute(new Float32Array(size * most), size).setUsage(DynamicDrawUsage);
    this.columns = [attribute(3), attribute(3), attribute(3), attribute(3)];
    this.tint = attribute(4);
    this.edgeTint = attribute(4);
    this.edge = edge;
    this.uniforms = { stretch: { value: 1 } };
    const sides = { back: BackSide, front: FrontSide, both: DoubleSide };
    const look = { uniforms: this.uniforms, vertexShader: VERTEX, transparent: !matte, depthWrite: matte };
    this.meshes = [];
    this.add(Mesh, faces, this.tint, { ...look, fragmentShader: matte ? MATTE : GLASS, side: sides[side] }, order);
    if (edges) this.add(LineSegments, edges, this.edgeTint, { ...look, fragmentShader: PLAIN, transparent: true }, order + 0.5);
    this.clear();
  }

  add(Kind, shape, tint, look, order) {
    const geometry = new InstancedBufferGeometry();
    geometry.index = shape.index;
    geometry.setAttribute("position", shape.attributes.position);
    geometry.setAttribute("normal", shape.attributes.normal ?? shape.attributes.position);
    ["first", "second", "third", "middle"].forEach((name, k) => geometry.setAttribute(name, this.columns[k]));
    geometry.setAttribute("tint", tint);
    const mesh = new Kind(geometry, new ShaderMaterial(look));
    mesh.frustumCulled = false;
    mesh.renderOrder = order;
    this.meshes.push(mesh);
  }

  clear() {
    this.count = 0;
  }

  /** Adds a body: a matrix of rows [m] that makes it of the unit shape, its middle, colour and opacity. */
  put(axes, middle, colour, alpha = 1) {
    const k = this.count++;
    for (let j = 0; j < 3; j++) this.columns[j].array.set([axes[j], axes[3 + j], axes[6 + j]], 3 * k);
    this.columns[3].array.set(middle, 3 * k);
    const parts = rgb(colour);
    this.tint.array.set([...parts, alpha], 4 * k);
    this.edgeTint.array.set([...parts, Math.min(1, alpha * (1 + this.edge))], 4 * k);
  }

  finish() {
    for (const buffer of [...this.columns, this.tint, this.edgeTint]) buffer.needsUpdate = true;
    for (const mesh of this.meshes) mesh.geometry.instanceCount = this.count;
  }
}
