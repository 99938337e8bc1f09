// Numbers as text: lengths, times, values of curves.

/** 1, 2 or 5 times a power of ten, at least `least`. */
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 5, 10].find((one) => one * power >= least * (1 - 1e-9));
  return factor * power;
}

/** Steps of time that people count in. */
export function timeStep(least) {
  const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];
  return least < 1 ? niceStep(least) : (steps.find((one) => one >= least) ?? 86400 * niceStep(least / 86400));
}

/** Few digits, without an exponent where people need none. */
export function plain(value, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return minus(value.toExponential(digits - 1));
  return minus(String(size >= 10 ** digits ? Math.round(value) : Number(value.toPrecision(digits))));
}

export function length(metres, digits = 3) {
  const size = Math.abs(metres);
  if (size >= 2e3) return `${plain(metres / 1e3, digits)} km`;
  if (size >= 0.5 || size === 0) return `${plain(metres, digits)} m`;
  return size >= 0.005 ? `${plain(metres * 100, digits)} cm` : `${plain(metres * 1e3, digits)} mm`;
}

/** A value with its unit, in thousandths where it is small. */
export function measured(value, unit) {
  if (unit === "m") return length(value, 4);
  if (unit === "x zone") return `${value < 10 ? minus(value.toFixed(3)) : plain(value)} × zone`;
  const size = Math.abs(value);
  if (!size || size >= 0.1) return `${plain(value, 4)} ${unit}`;
  return size >= 1e-4 ? `${plain(value * 1e3, 4)} m${unit}` : `${plain(value * 1e6, 4)} µ${unit}`;
}

/** Hours, minutes and seconds; `digits` after the point. */
export function clock(seconds, digits = 0) {
  const unit = 10 ** digits;
  const whole = Math.round(Math.abs(seconds) * unit);
  const two = (value) => String(value).padStart(2, "0");
  const rest = whole % (60 * unit);
  const minutes = Math.floor(whole / (60 * unit));
  const [days, hours] = [Math.floor(minutes / 1440), Math.floor(minutes / 60) % 24];
  const fine = `${two(Math.floor(rest / unit))}${digits ? `.${String(rest % unit).padStart(digits, "0")}` : ""}`;
  const long = days || hours ? `${days ? two(hours) : hours}:${two(minutes % 60)}:${fine}` : `${minutes}:${fine}`;
  return `${seconds < 0 && whole ? "−" : ""}${days ? `${days} d ` : ""}${long}`;
}

/** The moment in UTC, to a tenth of a second. */
export function utc(epoch, seconds) {
  const at = new Date(Date.parse(epoch) + 1000 * seconds);
  return `${at.toISOString().slice(0, 21).replace("T", " ")} UTC`;
}

function minus(text) {
  return text.replace(/^-/, "−");
}
