// Plots of the last seconds of a few simulations, on canvases.

const MARGINS = { left: 46, right: 8, top: 4, bottom: 18 }; // px around the axes
const CURVE = 60; // parts of the curve s = 0
const LETTERS = "11px system-ui, 'DejaVu Sans', sans-serif";

// The last `seconds` of a simulation's samples, in circular buffers. `period` is the control period, s.
export class History {
  constructor(period, seconds) {
    this.size = Math.ceil(seconds / period) + 1;
    for (const name of ["t", "x", "v", "u", "s", "q"]) this[name] = new Float64Array(this.size);
    this.count = 0;
  }

  add(sample) {
    const i = this.count % this.size;
    [this.t[i], this.u[i], this.s[i]] = [sample.t, sample.u, sample.s];
    [this.x[i], this.v[i], this.q[i]] = [sample.x[0], sample.v[0], sample.x[1] ?? 0]; // q: of a free joint
    this.count += 1;
  }

  // Call f(i) with the index of each sample, the oldest first.
  each(f) {
    for (let k = Math.max(0, this.count - this.size); k < this.count; k++) f(k % this.size);
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

// Draw a signal: a column of pixels shows the lowest and highest of its samples, so that chattering is drawn whole.
function curve(pen, place, history, name) {
  let [column, least, most, last] = [null, 0, 0, 0];
  const finish = () => {
    if (column === null) return;
    pen.lineTo(column, least);
    if (most !== least) pen.lineTo(column, most);
    pen.lineTo(column, last);
  };
  pen.beginPath();
  history.each((i) => {
    const [x, y] = [Math.round(place.x(history.t[i]) * 2) / 2, place.y(history[name][i])];
    if (x !== column) {
      finish();
      [column, least, most] = [x, y, y];
    }
    least = Math.min(least, y);
    most = Math.max(most, y);
    last = y;
  });
  finish();
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
        const value = history[name][i];
        if (value < low) low = value;
        if (value > high) high = value;
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
        range[name][0] = Math.min(range[name][0], history[name][i]);
        range[name][1] = Math.max(range[name][1], history[name][i]);
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
    const every = Math.max(1, Math.floor(Math.min(history.count, history.size) / 2500));
    pen.strokeStyle = pen.fillStyle = colour;
    pen.beginPath();
    let k = 0;
    history.each((i) => k++ % every === 0 && pen.lineTo(place.x(history.x[i]), place.y(history.v[i])));
    pen.stroke();
    const end = (history.count - 1) % history.size;
    pen.beginPath();
    pen.arc(place.x(history.x[end]), place.y(history.v[end]), 4.5, 0, 7);
    pen.fill();
  }
  pen.restore();
}
