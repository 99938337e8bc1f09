// Pen: text, lines and arrows on a canvas of two dimensions, sharp on every screen. The processor draws it:
// without a graphics card that is several times quicker, and with one quick enough.

const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif";

export class Pen {
  constructor(canvas) {
    this.canvas = canvas;
    this.page = canvas.getContext("2d", { willReadFrequently: true });
    this.widths = new Map();
  }

  /** Clears a canvas of a size in pixels of the page. */
  begin(width, height) {
    const ratio = Math.min(3, window.devicePixelRatio || 1);
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
    this.page.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.page.clearRect(0, 0, width, height);
  }

  font(size, weight = 400) {
    this.page.font = `${weight} ${size}px ${FONT}`;
  }

  width(text) {
    const key = `${this.page.font}|${text}`;
    if (!this.widths.has(key)) this.widths.set(key, this.page.measureText(text).width);
    return this.widths.get(key);
  }

  /** Text that stays readable on lines: `halo` is the ground's colour. */
  text(text, x, y, colour, { align = "left", base = "middle", halo = null } = {}) {
    const { page } = this;
    Object.assign(page, { textAlign: align, textBaseline: base });
    if (halo) {
      Object.assign(page, { strokeStyle: halo, lineWidth: 3.5, lineJoin: "round" });
      page.strokeText(text, x, y);
    }
    page.fillStyle = colour;
    page.fillText(text, x, y);
  }

  /** The longest beginning of a text that fits a width. */
  fitted(text, room) {
    if (this.width(text) <= room) return text;
    const letters = [...text];
    while (letters.length > 1 && this.width(`${letters.join("")}…`) > room) letters.pop();
    return letters.length > 1 ? `${letters.join("")}…` : "";
  }

  line(points, colour, { width = 1, dash = [], alpha = 1 } = {}) {
    const { page } = this;
    page.beginPath();
    points.forEach(([x, y], k) => (k ? page.lineTo(x, y) : page.moveTo(x, y)));
    page.setLineDash(dash);
    Object.assign(page, { strokeStyle: colour, lineWidth: width, globalAlpha: alpha });
    page.stroke();
    page.setLineDash([]);
    page.globalAlpha = 1;
  }

  arrow([x, y], [u, v], colour, { width = 2, head = 7 } = {}) {
    const { page } = this;
    const size = Math.hypot(u - x, v - y) || 1;
    const [a, b] = [(u - x) / size, (v - y) / size];
    const tip = Math.min(head, size);
    this.line([[x, y], [u - 0.8 * tip * a, v - 0.8 * tip * b]], colour, { width });
    page.beginPath();
    page.moveTo(u, v);
    page.lineTo(u - tip * a - 0.45 * tip * b, v - tip * b + 0.45 * tip * a);
    page.lineTo(u - tip * a + 0.45 * tip * b, v - tip * b - 0.45 * tip * a);
    page.closePath();
    page.fillStyle = colour;
    page.fill();
  }

  ring(x, y, radius, colour, { width = 1.5, fill = null, dash = [] } = {}) {
    const { page } = this;
    page.beginPath();
    page.arc(x, y, radius, 0, 2 * Math.PI);
    if (fill) {
      page.fillStyle = fill;
      page.fill();
    }
    page.setLineDash(dash);
    Object.assign(page, { strokeStyle: colour, lineWidth: width });
    page.stroke();
    page.setLineDash([]);
  }

  diamond(x, y, radius, colour, filled = true) {
    const { page } = this;
    page.beginPath();
    [[0, -1], [1, 0], [0, 1], [-1, 0]].forEach(([a, b], k) => page[k ? "lineTo" : "moveTo"](x + radius * a, y + radius * b));
    page.closePath();
    Object.assign(page, { fillStyle: colour, strokeStyle: colour, lineWidth: 1.4 });
    if (filled) page.fill();
    else page.stroke();
  }

  cross(x, y, radius, colour) {
    this.line([[x - radius, y - radius], [x + radius, y + radius]], colour, { width: 2.2 });
    this.line([[x - radius, y + radius], [x + radius, y - radius]], colour, { width: 2.2 });
  }

  /** Draws within a frame only (left, top, width, height). */
  within({ left, top, width, height }, draw) {
    this.page.save();
    this.page.beginPath();
    this.page.rect(left, top, width, height);
    this.page.clip();
    draw();
    this.page.restore();
  }
}
