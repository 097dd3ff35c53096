// Plots of the last seconds of a few simulations, on canvases.

const MARGINS = { left: 46, right: 8, top: 4, bottom: 18 }; // px around the axes
const CURVE = 40; // parts of the curve s = 0: chosen
const BINS = 1000; // parts of a history: chosen, more than a plot has px
const SIGNALS = ["x", "v", "u", "s", "q"]; // q: position of a free joint
const LETTERS = "11px system-ui, 'DejaVu Sans', sans-serif";

// The last `seconds` of a simulation, in BINS parts of equal time. Each part has the lowest, highest and last value of each
// signal.
export class History {
  constructor(seconds) {
    this.seconds = seconds;
    this.t = new Float64Array(BINS + 1); // time of the last sample of each part, s
    for (const name of SIGNALS) {
      this[name] = { low: new Float64Array(BINS + 1), high: new Float64Array(BINS + 1), last: new Float64Array(BINS + 1) };
    }
    this.count = 0; // number of parts with samples
    this.part = -1; // number of the part of the last sample, counted from t = 0
  }

  // Add a sample.
  add({ t, x, v, u, s }) {
    const part = Math.floor((t * BINS) / this.seconds + 1e-9);
    const fresh = part !== this.part;
    if (fresh) this.count += 1;
    this.part = part;
    const i = this.latest;
    this.t[i] = t;
    const put = ({ low, high, last }, value) => {
      last[i] = value;
      if (fresh || value < low[i]) low[i] = value;
      if (fresh || value > high[i]) high[i] = value;
    };
    put(this.x, x[0]);
    put(this.v, v[0]);
    put(this.u, u);
    put(this.s, s);
    put(this.q, x[1] ?? 0);
  }

  // Index of the last part in the arrays.
  get latest() {
    return (this.count - 1) % (BINS + 1);
  }

  // Call f(i) with the index of each part, the oldest first.
  each(f) {
    const begin = this.t[this.latest] - this.seconds;
    for (let k = Math.max(0, this.count - BINS - 1); k < this.count; k++) {
      const i = k % (BINS + 1);
      if (this.t[i] >= begin) f(i);
    }
  }
}

// Clear a canvas, and give it the resolution of the screen. Return its pen and its size, px of the page.
function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = LETTERS;
  return { pen, width, height };
}

// Return a round step (1, 2 or 5 times a power of 10) that divides a range into about `count` parts.
function stepOf(range, count) {
  const rough = range / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
}

// Return how many decimals tell the multiples of a step apart.
function decimals(step) {
  return Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
}

const label = (value, step) => (step >= 1e4 || step < 1e-3 ? value.toExponential(0) : value.toFixed(decimals(step))).replace("-", "−");

// Return a range with some room around it, at least `least` wide.
function padded(low, high, least) {
  if (!(high >= low)) [low, high] = [-1, 1];
  const middle = (low + high) / 2;
  const half = Math.max((high - low) / 2, least / 2) * 1.08;
  return [middle - half, middle + half];
}

// Draw the grid and its labels. Return the functions from values to px.
function axes({ pen, width, height }, colours, [x0, x1], [y0, y1], xUnit) {
  const place = {
    x: (x) => MARGINS.left + ((x - x0) / (x1 - x0)) * (width - MARGINS.left - MARGINS.right),
    y: (y) => height - MARGINS.bottom - ((y - y0) / (y1 - y0)) * (height - MARGINS.top - MARGINS.bottom),
  };
  pen.lineWidth = 1;
  pen.strokeStyle = colours.grid;
  pen.fillStyle = colours.muted;
  const ruled = (low, high, step, draw) => {
    for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-9; value += step) draw(Math.abs(value) < step * 1e-9 ? 0 : value);
  };
  const yStep = stepOf(y1 - y0, Math.max(3, height / 30));
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  ruled(y0, y1, yStep, (y) => {
    line(pen, [[MARGINS.left, place.y(y)], [width - MARGINS.right, place.y(y)]]);
    pen.fillText(label(y, yStep), MARGINS.left - 5, place.y(y));
  });
  const xStep = stepOf(x1 - x0, Math.max(2, width / 90));
  pen.textBaseline = "top";
  ruled(x0, x1, xStep, (x) => {
    line(pen, [[place.x(x), MARGINS.top], [place.x(x), height - MARGINS.bottom]]);
    pen.textAlign = place.x(x) > width - MARGINS.right - 16 ? "right" : "center";
    pen.fillText(`${label(x, xStep)}${xUnit}`, place.x(x), height - MARGINS.bottom + 4);
  });
  return place;
}

function line(pen, points) {
  pen.beginPath();
  points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
}

// Draw a signal: each part of the history from its lowest to its highest value, so that chattering is drawn whole.
function curve(pen, place, history, name) {
  const { low, high, last } = history[name];
  pen.beginPath();
  history.each((i) => {
    const x = place.x(history.t[i]);
    const [lowest, highest] = [place.y(low[i]), place.y(high[i])];
    if (lowest - highest > 1) {
      pen.lineTo(x, lowest);
      pen.lineTo(x, highest);
    }
    pen.lineTo(x, place.y(last[i]));
  });
  pen.stroke();
}

// Draw signals of the histories over time, those after the first one pale. There is a dashed line at each of `levels`.
// The axis spans at least `least`.
export function overTime(canvas, colours, series, names, { now, seconds, levels = [], least }) {
  const on = cleared(canvas);
  let [low, high] = [Infinity, -Infinity];
  for (const { history } of series) {
    for (const name of names) {
      history.each((i) => {
        low = Math.min(low, history[name].low[i]);
        high = Math.max(high, history[name].high[i]);
      });
    }
  }
  const end = Math.max(now, seconds);
  const place = axes(on, colours, [end - seconds, end], padded(low, high, least), " s");
  const { pen, width, height } = on;
  pen.save();
  pen.beginPath();
  pen.rect(MARGINS.left, 0, width - MARGINS.left - MARGINS.right, height - MARGINS.bottom);
  pen.clip();
  pen.strokeStyle = colours.bound;
  pen.setLineDash([5, 4]);
  for (const level of levels) line(pen, [[MARGINS.left, place.y(level)], [width, place.y(level)]]);
  pen.setLineDash([]);
  for (const { history, colour } of series) {
    names.forEach((name, j) => {
      pen.globalAlpha = j ? 0.5 : 1;
      pen.strokeStyle = colour;
      pen.lineWidth = j ? 1.2 : 1.6;
      curve(pen, place, history, name);
    });
  }
  pen.restore();
}

// Draw the phase plane: v over x of the histories, and the curve s = 0 of each, from its function `surface`.
export function phasePlane(canvas, colours, series, { reference, least, unit }) {
  const on = cleared(canvas);
  const range = { x: [Infinity, -Infinity], v: [Infinity, -Infinity] };
  for (const { history } of series) {
    history.each((i) => {
      for (const name of ["x", "v"]) {
        range[name][0] = Math.min(range[name][0], history[name].low[i]);
        range[name][1] = Math.max(range[name][1], history[name].high[i]);
      }
    });
  }
  range.x = [Math.min(range.x[0], reference), Math.max(range.x[1], reference)];
  range.v = [Math.min(range.v[0], 0), Math.max(range.v[1], 0)];
  const x = padded(...range.x, least);
  const v = padded(...range.v, least);
  const place = axes(on, colours, x, v, ` ${unit}`);
  const { pen, width, height } = on;
  pen.save();
  pen.beginPath();
  pen.rect(MARGINS.left, 0, width - MARGINS.left - MARGINS.right, height - MARGINS.bottom);
  pen.clip();
  pen.lineWidth = 1.6;
  for (const { colour, surface } of series) {
    if (!surface) continue;
    pen.strokeStyle = colour;
    pen.globalAlpha = 0.55;
    pen.setLineDash([5, 4]);
    pen.beginPath();
    for (let i = 0, begun = false; i <= CURVE; i++) {
      const at = x[0] + ((x[1] - x[0]) * i) / CURVE;
      const height = surface(at, v);
      const here = !Number.isNaN(height);
      if (here) pen[begun ? "lineTo" : "moveTo"](place.x(at), place.y(height));
      begun = here;
    }
    pen.stroke();
  }
  pen.setLineDash([]);
  pen.globalAlpha = 1;
  pen.strokeStyle = colours.muted;
  line(pen, [[place.x(reference) - 4, place.y(0)], [place.x(reference) + 4, place.y(0)]]);
  line(pen, [[place.x(reference), place.y(0) - 4], [place.x(reference), place.y(0) + 4]]);
  for (const { history, colour } of series) {
    if (history.count === 0) continue;
    pen.strokeStyle = pen.fillStyle = colour;
    pen.beginPath();
    const { x: { last: x }, v: { last: v }, latest } = history;
    history.each((i) => pen.lineTo(place.x(x[i]), place.y(v[i])));
    pen.stroke();
    pen.beginPath();
    pen.arc(place.x(x[latest]), place.y(v[latest]), 4.5, 0, 7);
    pen.fill();
  }
  pen.restore();
}
