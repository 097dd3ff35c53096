// The page: the reader's choice, its simulations, pictures and plots.

import loadMujoco from "./vendor/mujoco.js";
import { Simulation, estimatorFor, trace } from "./engine.js";
import * as functions from "./components.js"; // laws, surfaces, estimators
import { Stage } from "./machine.js";
import { History, overTime, phasePlane } from "./plots.js";

const SECONDS = 10; // span of the plots, s: chosen
const MAX_FRAME = 0.1; // s: after a frame that took longer, only this much time is simulated
const TICKS = 1000; // along a slider
const MAX_NAME = 40; // characters of a name from a link that the page repeats
const WORDS = { NaN, Infinity, "-Infinity": -Infinity }; // words in facts.json for numbers that JSON lacks
const SIDES = ["a", "b"];
const PARTS = { surface: "surfaces", velocity: "estimators" }; // controller part beside its law -> key of its facts
const COUNTS = [64, 256, 1024, 4096, 16384]; // of an encoder, per revolution or metre: what the page offers

const $ = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

let facts, mujoco, vfs, stage;
// What the reader has chosen: {plant, a: {law, gains, model, surface, velocity}, b: {...}, counts, and a number for each
// condition}. A surface or velocity estimator is {name, gains}, or null for the default.
let chosen;
let running = [];
let playing = true;
let pressed = 0; // direction of the arrow key that is held: -1, 0 for none, or 1
let owed = 0; // s that are still to be simulated

const plantFacts = () => facts.plants[chosen.plant];
const sides = () => SIDES.filter((side) => chosen[side].law);
const controller = (law) => ({ law, gains: {}, surface: null, velocity: null });

// ---- the reader's choice, as an address and as a scenario

// Return the choice with which the page shows a plant at first.
function opening(plant) {
  const { start, conditions } = facts.plants[plant];
  const numbers = Object.fromEntries(conditions.map(({ name, value }) => [name, value]));
  return { plant, ...numbers, counts: 0, a: controller(start[0]), b: controller(start[1] ?? "") };
}

// Return the choice that the page's address holds, with that of `opening` for all that it lacks or has wrong. What it
// names but the page does not have is added to `missing`.
function fromAddress(missing) {
  const given = new URLSearchParams(location.hash.slice(1));
  const lacks = (kind, key) => missing.push(`the ${kind} “${given.get(key).slice(0, MAX_NAME)}”`);
  const known = Object.hasOwn(facts.plants, given.get("plant"));
  if (given.has("plant") && !known) lacks("plant", "plant");
  const plant = known ? given.get("plant") : Object.keys(facts.plants)[0];
  const made = opening(plant);
  const { conditions, laws, ranges, surface_ranges, estimator_ranges } = facts.plants[plant];
  for (const { name, least, most } of conditions) {
    const value = parseFloat(given.get(name));
    if (Number.isFinite(value)) made[name] = Math.min(Math.max(value, least), most);
  }
  const counts = Math.round(parseFloat(given.get("counts")));
  if (counts >= 2 && counts <= 2 ** 32) made.counts = counts;
  // the gains of a component, within their sliders
  const gains = (key, { order }, sliders) => Object.fromEntries(order.map((name) => {
    const [least, most] = sliders[name] ?? [-Number.MAX_VALUE, Number.MAX_VALUE];
    return [name, Math.min(Math.max(parseFloat(given.get(`${key}.${name}`)), least), most)];
  }).filter(([, value]) => !Number.isNaN(value)));
  for (const side of SIDES) {
    if (!given.has(side)) continue;
    const law = given.get(side);
    const none = side === "b" && law === "";
    if (!laws.includes(law) && !none) {
      lacks("law", side);
      continue;
    }
    made[side] = controller(law);
    if (none) continue;
    made[side].gains = gains(side, facts.laws[law], ranges[law]);
    for (const [part, kind] of Object.entries(PARTS)) {
      const key = `${side}-${part}`;
      const name = given.get(key);
      if (name === null || (part === "surface" && !facts.laws[law].takes_surface)) continue;
      if (!Object.hasOwn(facts[kind], name)) {
        lacks(part === "surface" ? "surface" : "velocity estimator", key);
        continue;
      }
      const sliders = (part === "surface" ? surface_ranges : estimator_ranges)[name];
      made[side][part] = { name, gains: gains(key, facts[kind][name], sliders) };
    }
    if (given.has(`${side}.model`)) made[side].model = given.get(`${side}.model`) === "nominal" ? "nominal" : "none";
  }
  return made;
}

// Put the choice into the page's address.
function toAddress() {
  const words = new URLSearchParams({ plant: chosen.plant });
  for (const side of SIDES) {
    const put = (key, name, gains) => {
      words.set(key, name);
      for (const [gain, value] of Object.entries(gains)) words.set(`${key}.${gain}`, value);
    };
    put(side, chosen[side].law, chosen[side].gains);
    for (const part of Object.keys(PARTS)) {
      if (chosen[side][part]) put(`${side}-${part}`, chosen[side][part].name, chosen[side][part].gains);
    }
    if (chosen[side].model) words.set(`${side}.model`, chosen[side].model);
  }
  for (const { name, value } of plantFacts().conditions) if (chosen[name] !== value) words.set(name, chosen[name]);
  if (chosen.counts) words.set("counts", chosen.counts);
  history.replaceState(null, "", `#${words}`);
}

// Return the scenario of one side for the engine.
function scenarioOf(side) {
  const { plant, start, reference, mass, friction, delay, noise, amplitude, omega, period, bound, counts } = chosen;
  const { law, gains, model, surface, velocity } = chosen[side];
  const x0 = [...plantFacts().x0];
  x0[plantFacts().started] = start;
  return {
    plant, law, gains, model, surface, velocity: velocity ?? undefined, counts, x0, reference, mass, friction,
    input_delay: delay / 1000, control_period: period / 1000, u_max: bound, disturbance: { amplitude, omega },
    noise: { position: noise * facts.noise.position, velocity: noise * facts.noise.velocity },
  };
}

// Show what the page's address holds, and say what the page does not have of it.
function follow() {
  const missing = [];
  chosen = fromAddress(missing);
  forms();
  restart();
  if (missing.length) say(`This page does not have ${missing.join(" and ")}, which the link names.`);
}

// ---- simulations

const simulationOf = (side) => new Simulation(mujoco, vfs, facts, functions, scenarioOf(side));

function colours() {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const names = sides().map((side) => chosen[side].law);
  const known = names.map((name) => facts.laws[name][dark ? "colour_dark" : "colour"]);
  // if both sides have the same law, the second has a neutral colour
  return known.map((colour, i) => (i && names[i] === names[0] ? css("--muted") : colour));
}

// Start the simulations of the choice, in place of those that run.
function restart() {
  for (const { simulation } of running) simulation.delete();
  const palette = colours();
  running = sides().map((side, i) => ({ side, simulation: simulationOf(side), colour: palette[i] }));
  for (const each of running) each.history = new History(SECONDS);
  stage.show(running.map(({ simulation }) => simulation), palette);
  owed = 0;
  writeNames();
  say("");
}

// Continue from the present state under the changed choice.
function change() {
  for (const each of running) {
    const simulation = simulationOf(each.side);
    simulation.resume(each.simulation);
    each.simulation.delete();
    each.simulation = simulation;
  }
  stage.swap(running.map(({ simulation }) => simulation));
}

// Put every simulation back to its initial state.
function reset() {
  for (const each of running) {
    each.simulation.reset();
    stage.machines[running.indexOf(each)].u = 0;
    each.history = new History(SECONDS);
  }
  owed = 0;
  say("");
}

// Advance every simulation by `seconds`.
function simulate(seconds) {
  owed += seconds;
  const pulls = stage.pulls();
  let done = 0;
  running.forEach(({ simulation, history }, i) => {
    const push = pulls[i];
    push[simulation.plant.channels[0].dof] += 0.5 * pressed * simulation.s.u_max;
    simulation.push.set(push);
    let [total, samples] = [0, 0]; // of u
    const steps = Math.floor(owed / simulation.s.physics_step + 1e-9);
    for (let k = 0; k < steps && !simulation.failed; k++) {
      const sample = simulation.advance();
      if (!sample) continue;
      history.add(sample);
      total += sample.u;
      samples += 1;
    }
    if (samples) stage.machines[i].u = total / samples / simulation.s.u_max;
    done = Math.max(done, steps * simulation.s.physics_step);
  });
  owed -= done;
  const failures = running.filter(({ simulation }) => simulation.failed);
  if (failures.length) {
    say(failures.map(({ simulation: { failed, law } }) =>
      `${law.known.label}: ${failed.why} at ${failed.time.toFixed(2)} s`).join("; "));
  }
}

// Return the present curve s = 0 of a simulation in the phase plane: a function of x and of the least and largest v. It
// returns v, or NaN where s does not change its sign.
function surfaceOf({ simulation }) {
  const sliding = simulation.sliding();
  return (x, [low, high]) => {
    const [first, last] = [sliding(x, low), sliding(x, high)];
    if (!(first * last < 0)) return NaN;
    const small = 1e-6 * (Math.abs(first) + Math.abs(last));
    let v = low - (first * (high - low)) / (last - first); // exact where s is linear in v
    let s = sliding(x, v);
    for (let k = 0; k < 40 && !(Math.abs(s) < small); k++) { // else by halves
      if (k > 0) [low, high] = s * first > 0 ? [v, high] : [low, v];
      v = (low + high) / 2;
      s = sliding(x, v);
    }
    return Math.abs(s) < small ? v : NaN;
  };
}

// ---- the loop

let before = null;
let frames = [];
let drawn = 0; // frames

function frame(now) {
  const elapsed = before === null ? 0 : (now - before) / 1000;
  before = now;
  if (playing && !document.hidden) simulate(Math.min(elapsed, MAX_FRAME) * parseFloat($("speed").value));
  stage.draw();
  stage.watch(now);
  plot();
  frames.push(now);
  while (frames[0] < now - 1000) frames.shift();
  const seconds = (now - frames[0]) / 1000;
  $("clock").value = `${running[0].simulation.time.toFixed(1)} s`;
  $("rate").value = seconds > 0.5 ? `${Math.round((frames.length - 1) / seconds)} fps` : "";
  requestAnimationFrame(frame);
}

// Draw two of the four plots: in every frame the other two.
function plot() {
  const palette = { grid: css("--grid"), muted: css("--muted"), bound: css("--bound") };
  const now = Math.max(...running.map(({ simulation }) => simulation.time));
  const { u_max: bound, reference } = running[0].simulation.s;
  const least = Math.abs(plantFacts().x0[0]) || 0.2;
  const free = plantFacts().channels.length > 1 ? ["q"] : [];
  const over = (name, levels, height) =>
    overTime($(`plot-${name}`), palette, running, name === "x" ? ["x", ...free] : [name], { now, seconds: SECONDS, levels, least: height });
  drawn += 1;
  if (drawn % 2) {
    over("x", [reference], 0.4 * least);
    over("u", [-bound, bound], 0.2 * bound);
    return;
  }
  over("s", [0], 0.4 * least);
  const series = running.map((each) => ({ ...each, surface: each.history.count ? surfaceOf(each) : null }));
  phasePlane($("plot-phase"), palette, series, { reference, least: 0.4 * least, unit: plantFacts().channels[0].unit });
}

// ---- words

const GREEK = { lam: "λ", alpha: "α", beta: "β", gamma: "γ", delta: "δ", mu: "μ", phi: "φ", tau: "τ", sigma: "σ", eps: "ε", omega: "ω" };

// Return a formula with Greek letters, exponents, primes and subscripts instead of plain text.
function pretty(text) {
  return text
    .replace(/\bde\b/g, "e'")
    .replace(/\b([A-Za-z]+)(?![\w(])/g, (word) => (Object.hasOwn(GREEK, word) ? GREEK[word] : word))
    .replace(/\^2\b/g, "²").replace(/\^3\b/g, "³").replace(/\^\(1\/2\)/g, "^½").replace(/<=/g, "≤").replace(/''/g, "″").replace(/'/g, "′").replace(/ - |(?<=[= (])-(?=\S)/g, (minus) => minus.replace("-", "−"))
    .replace(/\b([a-zA-Z])([0-9])\b/g, (_, letter, digit) => letter + "₀₁₂₃₄₅₆₇₈₉"[digit]);
}

function say(text) {
  if ($("status").textContent !== text) $("status").textContent = text;
}

// Return the name of a side: of its law, and of its surface and velocity estimator where they are chosen.
function nameOf(side) {
  const parts = Object.entries(PARTS).filter(([part]) => chosen[side][part]);
  const names = parts.map(([part, kind]) => facts[kind][chosen[side][part].name].label.toLowerCase());
  return [facts.laws[chosen[side].law].label, ...names].join(" · ");
}

// Write the names of plant, laws and quantities.
function writeNames() {
  const { label, equation, channels, effort } = plantFacts();
  const [{ unit }, free] = channels;
  $("plant").value = chosen.plant;
  $("equation").textContent = pretty(equation);
  $("cap-x").textContent = `x, ${unit === "rad" ? "angle" : "position"} (${unit})${free ? `; pale: ${free.name} (${free.unit})` : ""}`;
  $("cap-u").textContent = `u, command (${effort.replace(" ", " ")}), and its bound`;
  $("cap-s").textContent = "s, sliding variable";
  $("cap-phase").textContent = `Phase plane: v (${unit}/s) over x; dashed: s = 0`;
  const parts = stage.parts();
  SIDES.forEach((side) => {
    const i = running.findIndex((each) => each.side === side);
    const badge = $(`name-${side}`);
    badge.textContent = i < 0 ? "" : nameOf(side);
    $(`law-${side}`).style.setProperty("--law", i < 0 ? "" : running[i].colour);
    if (i < 0) return;
    badge.style.setProperty("--law", running[i].colour);
    badge.style.left = `${parts[i].x + 10}px`;
    badge.style.top = `${parts[i].y + 10}px`;
    badge.style.maxWidth = `${parts[i].width - 20}px`;
  });
  const names = running.map(({ side }) => nameOf(side)).join(" and ");
  $("machines").setAttribute("aria-label", `${label} under ${names}`);
  document.title = `${label}: ${names}`;
}

// ---- controls

// Return a new element. An attribute such as onclick is a listener.
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

const fourDigits = (value) => parseFloat(value.toPrecision(4));

// Return a slider with a number field beside it. `put` is called with each new number. The slider is logarithmic if its
// range spans more than a decade and has no step.
function slider({ name, label, unit, least, most, value, step }, put) {
  const logarithmic = least > 0 && most / least > 10 && !step;
  const toTick = (number) => logarithmic
    ? (TICKS * Math.log(number / least)) / Math.log(most / least)
    : (TICKS * (number - least)) / (most - least);
  const fromTick = (tick) => {
    const part = tick / TICKS;
    const number = logarithmic ? least * (most / least) ** part : least + part * (most - least);
    return step ? parseFloat((Math.round(number / step) * step).toFixed(6)) : fourDigits(number);
  };
  const clipped = (number) => Math.min(Math.max(number, least), most);
  const text = unit ? `${label}, ${unit}` : label;
  const range = element("input", { type: "range", min: 0, max: TICKS, step: "any", "aria-label": text, "data-name": name });
  const exact = element("input", { type: "number", step: "any", "aria-label": `${text}, exactly`, "data-exact": name });
  const show = (number) => {
    range.value = toTick(clipped(number));
    range.setAttribute("aria-valuetext", `${number} ${unit ?? ""}`.trim());
  };
  show(value);
  exact.value = value;
  range.addEventListener("input", () => {
    const number = fromTick(parseFloat(range.value));
    exact.value = number;
    range.setAttribute("aria-valuetext", `${number} ${unit ?? ""}`.trim());
    put(number);
  });
  range.addEventListener("keydown", (event) => { // an arrow key moves by a hundredth of the range, not by a tick
    const sign = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!sign) return;
    event.preventDefault();
    const before = parseFloat(exact.value);
    let number = fromTick(Math.min(Math.max(parseFloat(range.value) + (sign * TICKS) / 100, 0), TICKS));
    if (step && number === before) number = clipped(parseFloat((before + sign * step).toFixed(6)));
    exact.value = number;
    show(number);
    put(number);
  });
  exact.addEventListener("change", () => {
    const number = clipped(parseFloat(exact.value));
    if (Number.isNaN(number)) {
      exact.value = fromTick(parseFloat(range.value));
      return;
    }
    exact.value = number;
    show(number);
    put(number);
  });
  return element("div", { class: "slider" }, element("span", {}, label), range, exact, element("small", {}, unit ?? ""));
}

const of = (side) => running.find((each) => each.side === side);

// Return the formula of a law, surface or estimator, and a slider for each gain to choose. `put` takes {gain: number}.
function gainSliders({ formula, source, order }, values, ranges, put) {
  const shown = order.filter((name) => ranges[name]); // not an initial value, an exponent, the size of a table
  return [
    element("p", { class: "formula", title: source }, pretty(formula)),
    ...shown.map((name) => {
      const [least, most] = ranges[name];
      return slider({ name, label: pretty(name), least, most, value: values[name] }, (number) => {
        put({ [name]: number });
        toAddress();
      });
    }),
  ];
}

// Return the choice of a side's surface or velocity estimator, and its gains.
function partForm(side, part, title) {
  const kind = facts[PARTS[part]];
  const ranges = plantFacts()[part === "surface" ? "surface_ranges" : "estimator_ranges"];
  const fallback = part === "surface" ? "" : estimatorFor(chosen.counts);
  const { name, gains } = chosen[side][part] ?? { name: fallback, gains: {} };
  const select = element("select", { id: `${part}-${side}`, onchange: ({ target: { value } }) => {
    chosen[side][part] = value === fallback ? null : { name: value, gains: {} };
    change();
    writeNames();
    lawForm(side);
    $(`${part}-${side}`).focus();
    toAddress();
  } });
  if (part === "surface") select.append(element("option", { value: "" }, "the law's own"));
  for (const [value, { label }] of Object.entries(kind)) select.append(element("option", { value }, label));
  select.value = name;
  const row = element("div", { class: "part" }, element("label", { for: `${part}-${side}` }, title), select);
  if (!name) return [row];
  const note = part === "surface" ? [element("p", { class: "formula" }, "In place of the law's own s, whose gain has no effect now.")] : [];
  return [row, ...note, ...gainSliders(kind[name], { ...kind[name].gains, ...gains }, ranges[name], (changed) => {
    chosen[side][part] ??= { name, gains: {} };
    Object.assign(chosen[side][part].gains, changed);
    of(side).simulation[part].setGains(changed);
  })];
}

function lawForm(side) {
  const form = $(`law-${side}`);
  const { laws: offered, gains: tuned, ranges } = plantFacts();
  const { law } = chosen[side];
  const groups = new Map();
  for (const name of offered) {
    const family = facts.own.includes(name) ? "your own" : facts.laws[name].family || "other";
    groups.set(family, [...(groups.get(family) ?? []), name]);
  }
  const select = element("select", { id: `choice-${side}`, onchange: (event) => choose(side, event.target.value) });
  if (side === "b") select.append(element("option", { value: "" }, "no second law"));
  for (const [family, names] of groups) {
    select.append(element("optgroup", { label: family }, ...names.map((name) => element("option", { value: name }, facts.laws[name].label))));
  }
  select.value = law;
  const parts = [element("h2", {}, element("label", { for: `choice-${side}` }, side === "a" ? "First law" : "Second law")), select];
  if (law) {
    const known = facts.laws[law];
    parts.push(...gainSliders(known, { ...tuned[law], ...chosen[side].gains }, ranges[law], (gains) => {
      Object.assign(chosen[side].gains, gains);
      of(side).simulation.law.setGains(gains);
    }));
    if (known.takes_surface) parts.push(...partForm(side, "surface", "Surface"));
    parts.push(...partForm(side, "velocity", "Velocity"));
    if (known.reads_model && !known.requires_model) {
      const knows = element("input", { type: "checkbox", onchange: (event) => {
        chosen[side].model = event.target.checked ? "nominal" : "none";
        change();
        toAddress();
      } });
      knows.checked = chosen[side].model === "nominal";
      parts.push(element("label", { class: "check" }, knows, "knows the plant's equation"));
    }
  }
  form.replaceChildren(...parts);
}

function conditionsForm() {
  const parts = plantFacts().conditions.map((condition) => slider({ ...condition, value: chosen[condition.name] }, (number) => {
    chosen[condition.name] = number;
    if (condition.name === "start") restart();
    else change();
    toAddress();
  }));
  $("conditions").replaceChildren(element("h2", {}, "Conditions"), ...parts, encoderForm());
}

function encoderForm() {
  const per = plantFacts().channels[0].unit === "rad" ? "revolution" : "metre";
  const offered = [...new Set([0, ...COUNTS, chosen.counts])].sort((one, other) => one - other);
  const select = element("select", { id: "counts", onchange: ({ target: { value } }) => {
    chosen.counts = parseInt(value);
    change();
    SIDES.forEach(lawForm);
    toAddress();
  } });
  select.append(...offered.map((counts) => element("option", { value: counts }, counts ? `${counts} counts per ${per}` : "none: x as it is")));
  select.value = chosen.counts;
  return element("div", { class: "part" }, element("label", { for: "counts" }, "Encoder"), select);
}

function choose(side, law) {
  chosen[side] = controller(law);
  lawForm(side);
  restart();
  toAddress();
}

function forms() {
  SIDES.forEach(lawForm);
  conditionsForm();
}

function toggle() {
  playing = !playing;
  $("play").querySelector(".word").textContent = playing ? "Pause" : "Play";
  $("play").firstElementChild.textContent = playing ? "❚❚" : "▶";
}

async function share() {
  toAddress();
  try {
    await navigator.clipboard.writeText(location.href);
    say("The link to this setting is copied.");
  } catch {
    say(`The link to this setting: ${location.href}`);
  }
}

function listen() {
  const canvas = $("machines");
  $("play").addEventListener("click", toggle);
  $("reset").addEventListener("click", reset);
  $("share").addEventListener("click", share);
  $("plant").addEventListener("change", (event) => {
    chosen = opening(event.target.value);
    forms();
    restart();
    toAddress();
  });
  canvas.addEventListener("pointerdown", (event) => {
    if (!stage.grab(event)) return;
    event.preventDefault();
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("pushing");
  });
  canvas.addEventListener("pointermove", (event) => stage.drag(event));
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, () => {
      stage.release();
      canvas.classList.remove("pushing");
    });
  }
  canvas.addEventListener("touchstart", (event) => stage.held && event.preventDefault(), { passive: false });
  // whether the focused element uses a key itself: a field uses all keys, a button or a link the space bar
  const taken = ({ target, key }) => target.closest("input, select") || (key === " " && target.closest("button, a"));
  document.addEventListener("keydown", (event) => {
    if (taken(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") toggle();
    else if (event.key === "r" || event.key === "R") reset();
    else if (event.key === "ArrowLeft") pressed = -1;
    else if (event.key === "ArrowRight") pressed = 1;
    else return;
    event.preventDefault();
  });
  document.addEventListener("keyup", ({ key }) => {
    if (key === "ArrowLeft" || key === "ArrowRight") pressed = 0;
  });
  window.addEventListener("blur", () => (pressed = 0));
  window.addEventListener("resize", writeNames);
  window.addEventListener("hashchange", follow);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    restart();
  });
}

async function begin() {
  const read = async () => JSON.parse(await (await fetch("facts.json")).text(), (_, value) => (Object.hasOwn(WORDS, value) ? WORDS[value] : value));
  [facts, mujoco] = await Promise.all([read(), loadMujoco()]);
  vfs = new mujoco.MjVFS();
  for (const [name, text] of Object.entries(facts.includes)) vfs.addBuffer(name, new TextEncoder().encode(text));
  stage = new Stage($("machines"));
  for (const [name, { label }] of Object.entries(facts.plants)) $("plant").append(element("option", { value: name }, label));
  $("mujoco").textContent = mujoco.mj_versionString();
  $("version").textContent = facts.version;
  follow();
  listen();
  $("loading").hidden = true;
  // for tests, and for use in the browser's console
  window.live = {
    facts,
    running: () => running,
    trace: (chosen, duration) => trace(mujoco, vfs, facts, functions, chosen, duration),
    stage,
    onScreen: (i, geom) => stage.onScreen(i, geom),
  };
  document.documentElement.dataset.ready = "";
  requestAnimationFrame(frame);
}

begin().catch((error) => {
  $("loading").textContent = `The page could not start: ${error.message ?? error}`;
  throw error;
});
