// Labels: names beside points, none of which covers another or a mark.

const SIDES = [[1, -0.5], [1, 0.5], [-1, -0.5], [-1, 0.5], [0, -1], [0, 1], [1, 0], [-1, 0]]; // right and down
const RINGS = [9, 18, 30]; // distances from the mark [px]; from the second on a thin line leads to it
const SPOTS = RINGS.flatMap((ring) => SIDES.map(([right, down]) => ({ ring, right, down })));

export class Labels {
  constructor() {
    this.spots = new Map(); // where each stood before, so that names do not jump
    this.boxes = [];
  }

  /** Begins anew, with boxes (left, top, right, bottom) that are taken already. */
  begin(taken) {
    this.taken = [...taken];
    this.boxes = [];
  }

  /** Takes the first free spot for a text of a size within a frame; null where there is none. */
  place(key, x, y, width, height, frame) {
    const before = this.spots.get(key);
    for (const spot of before ? [before, ...SPOTS] : SPOTS) {
      const { ring, right, down } = spot;
      const left = x + right * ring - (right < 0 ? width : right > 0 ? 0 : width / 2);
      const top = y + down * ring - (right ? 0.5 : down < 0 ? 1 : 0) * height;
      const box = [left - 1, top - 1, left + width + 1, top + height + 1];
      const inside = box[0] >= frame[0] && box[1] >= frame[1] && box[2] <= frame[2] && box[3] <= frame[3];
      if (!inside || this.taken.some((other) => overlap(box, other))) continue;
      this.taken.push(box);
      this.boxes.push(box);
      this.spots.set(key, spot);
      return { left, top, led: ring > RINGS[0] };
    }
    this.spots.delete(key);
    return null;
  }
}

function overlap(a, b) {
  return a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
}
