// One simulation of a plant under a law: the scenario of smc_mujoco, with MuJoCo's WebAssembly build.
//
// It does what the package's control callback does, in the same order. At each control sample
//     state -> noise -> encoder -> velocity estimator -> surface -> law -> saturation -> delay buffer
// and at each physics step the command whose delay has passed goes to the actuator and is held. Time counts in steps.
// Nothing here knows the page, so that node runs it as well.

const PARTS = ["law", "surface", "velocity"]; // of a controller

// The velocity estimator where none is chosen: an encoder measures no velocity.
export const estimatorFor = (counts) => (counts ? "filtered_difference" : "measured");

// Return the scenario that the reader has chosen, with defaults for what is undefined. `facts` is facts.json.
export function scenario(facts, chosen) {
  const plant = facts.plants[chosen.plant];
  const law = facts.laws[chosen.law];
  const given = Object.fromEntries(Object.entries(chosen).filter(([, value]) => value !== undefined));
  const s = {
    x0: plant.x0, reference: 0, u_max: plant.u_max, control_period: facts.control_period, input_delay: 0, friction: 0,
    mass: 1, seed: 0, noise: { position: 0, velocity: 0 }, disturbance: { amplitude: 0, omega: 0 },
    model: law.requires_model ? "nominal" : "none",
    counts: 0, // of the encoder; 0 for none
    surface: null, // {name, gains}; null for the law's own
    velocity: { name: estimatorFor(chosen.counts) }, // {name, gains} of the estimator
    ...given,
    gains: { ...plant.gains[chosen.law], ...chosen.gains },
  };
  s.realistic = s.friction > 0;
  const largest = s.realistic ? facts.realistic_step : facts.max_step;
  s.steps = Math.ceil(s.control_period / largest - 1e-9);
  s.physics_step = s.control_period / s.steps;
  s.delay_steps = Math.round(s.input_delay / s.physics_step);
  return s;
}

// A law, surface or velocity estimator with its gains, and with a memory for each channel.
class Component {
  constructor(name, known, call, gains, channels) {
    Object.assign(this, { name, known, call, gains: { ...known.gains, ...gains }, channels });
    this.setGains({});
    this.reset();
  }

  setGains(gains) {
    Object.assign(this.gains, gains);
    this.values = this.known.order.map((name) => this.gains[name]);
  }

  reset() {
    this.memories = Array.from({ length: this.channels }, () => new Float64Array(this.known.memory));
    this.scratch = new Float64Array(this.known.memory);
  }

  // Take over the memory of another component if it has the same name.
  resume(other) {
    if (other?.name === this.name) this.memories = other.memories.map((memory) => memory.slice());
  }

  // Write the two results for channel i to `out`.
  run(y, i, out) {
    this.call(y, this.values, this.memories[i], out);
  }

  // The same, without a change of the memory.
  peek(y, i, out) {
    this.scratch.set(this.memories[i]);
    this.call(y, this.values, this.scratch, out);
  }
}

export class Simulation {
  // mujoco: the module. vfs: an MjVFS with the files that models include. functions: laws, surfaces and estimators,
  // name -> function each.
  constructor(mujoco, vfs, facts, functions, chosen) {
    this.mujoco = mujoco;
    this.facts = facts;
    this.chosen = chosen;
    this.s = scenario(facts, chosen);
    this.plant = facts.plants[chosen.plant];
    const { s, plant } = this;
    const made = (kind, { name, gains }) => new Component(name, facts[kind][name], functions[kind][name], gains, plant.channels.length);
    this.law = made("laws", { name: chosen.law, gains: s.gains });
    this.surface = s.surface && made("surfaces", s.surface);
    this.velocity = made("estimators", s.velocity);
    this.model = this.compile(vfs, true);
    this.data = new mujoco.MjData(this.model);
    // the nominal mechanism, which a law may read: without friction, and with the nominal mass
    this.nominal = this.law.known.reads_model ? this.compile(vfs, false) : null;
    this.nominalData = this.nominal && new mujoco.MjData(this.nominal);
    this.reset();
  }

  // Free the memory of MuJoCo's objects.
  delete() {
    for (const each of [this.data, this.model, this.nominalData, this.nominal]) each?.delete();
  }

  // Return the model of the real mechanism, with the chosen mass and friction, or of the nominal one.
  compile(vfs, real) {
    const { mujoco, plant, s } = this;
    const model = mujoco.MjModel.from_xml_string(plant.mjcf, vfs);
    const array = (name) => (name.startsWith("opt.") ? model.opt[name.slice(4)] : model[name]);
    const mass = real ? s.mass : 1;
    for (const [name, [values, twice]] of Object.entries(plant.fields)) { // at the nominal mass, and at twice that
      array(name).set(values.map((value, i) => value + (mass - 1) * (twice[i] - value)));
    }
    if (real && s.friction > 0) {
      for (const { name, at, value, adds } of plant.friction) {
        const values = array(name);
        at.forEach((i, k) => (values[i] = adds ? values[i] + s.friction * value[k] : value[k]));
      }
    }
    const integrators = mujoco.mjtIntegrator;
    model.opt.timestep = s.physics_step;
    model.opt.integrator = (s.realistic ? integrators.mjINT_IMPLICITFAST : integrators.mjINT_RK4).value;
    const scratch = new mujoco.MjData(model);
    mujoco.mj_setConst(model, scratch);
    scratch.delete();
    return model;
  }

  // Go back to the initial state.
  reset() {
    const { mujoco, plant, s } = this;
    mujoco.mj_resetData(this.model, this.data);
    plant.channels.forEach((channel, i) => (this.data.qpos[channel.qpos] = s.x0[i]));
    mujoco.mj_forward(this.model, this.data);
    this.step = 0; // physics steps done
    this.failed = null; // {why, time} once the run has failed
    this.push = new Float64Array(this.model.nv); // generalised force of the reader's push
    for (const part of PARTS) this[part]?.reset();
    this.commands = new Float64Array(Math.floor(s.delay_steps / s.steps) + 2); // delay buffer: command k at k % length
    this.y = {};
    this.out = [0, 0];
    this.latest = { t: 0, x: [...s.x0], v: plant.channels.map(() => 0), u: 0, s: 0, r: s.reference, d: 0 };
    this.views = null;
  }

  // Continue from the state of another simulation of the same plant.
  resume(other) {
    this.data.qpos.set(other.data.qpos);
    this.data.qvel.set(other.data.qvel);
    this.mujoco.mj_forward(this.model, this.data);
    this.step = Math.round(other.time / this.s.control_period) * this.s.steps;
    for (const part of PARTS) this[part]?.resume(other[part]);
    this.commands.fill(other.latest.u);
    this.push.set(other.push);
    this.latest = other.latest;
    this.failed = other.failed;
  }

  get time() {
    const k = Math.floor(this.step / this.s.steps);
    return k * this.s.control_period + (this.step % this.s.steps) * this.s.physics_step;
  }

  // MuJoCo's arrays. They are views of its memory, which become empty when that memory grows.
  get arrays() {
    if (!this.views || this.views.qpos.length === 0) {
      const { qpos, qvel, qacc, ctrl, qfrc_applied } = this.data;
      this.views = { qpos, qvel, qacc, ctrl, qfrc_applied };
      if (this.nominalData) {
        const { qpos, qvel, qacc, ctrl } = this.nominalData;
        this.views.nominal = { qpos, qvel, qacc, ctrl };
      }
    }
    return this.views;
  }

  // Do one physics step. Return the control sample at its start, or null if there was none.
  advance() {
    if (this.failed) return null;
    const { s, plant } = this;
    const { qpos, qvel, ctrl } = this.arrays;
    const sampled = this.step % s.steps === 0;
    if (![...qpos, ...qvel].every((value) => Math.abs(value) < this.facts.max_state)) return this.fail("diverged");
    if (sampled && !this.sample(this.step / s.steps)) return this.fail("law is not finite");
    const past = this.step - s.delay_steps;
    if (past >= 0 && past % s.steps === 0) ctrl[plant.ctrl] = this.commands[(past / s.steps) % this.commands.length];
    this.latest.d = this.disturb(0);
    if (s.disturbance.amplitude !== 0 && !s.realistic) this.rungeKutta();
    else this.mujoco.mj_step(this.model, this.data);
    this.step += 1;
    return sampled ? this.latest : null;
  }

  // End the run, and return null, which `advance` returns.
  fail(why) {
    this.failed = { why, time: this.time };
    return null;
  }

  // Measure, and compute the command of sample k. Return whether it is finite.
  sample(k) {
    const { s, plant, y, out } = this;
    const { qpos, qvel } = this.arrays;
    const x = plant.channels.map((channel) => qpos[channel.qpos]);
    const v = plant.channels.map((channel) => qvel[channel.dof]);
    const seen = this.measure(x, v, k);
    const partner = plant.channels.length > 1; // a joint without actuator, which the driven one moves
    const [f, g] = this.equation(seen);
    Object.assign(y, {
      t: k * s.control_period, dt: s.control_period, x: seen.x[0], v: seen.v[0],
      e: seen.x[0] - s.reference, de: seen.v[0], r: s.reference, dr: 0, ddr: 0,
      f: f[0], g: g[0], a: Number.isNaN(seen.a[0]) ? 0 : seen.a[0], limit: s.u_max, model: s.model === "nominal" ? 1 : 0,
      has_surface: 0, s: 0, v_eq: 0,
      q: partner ? seen.x[1] : 0, dq: partner ? seen.v[1] : 0, fq: partner ? f[1] : 0, gq: partner ? g[1] : 0,
    });
    if (this.surface) {
      this.surface.run(y, 0, out);
      [y.has_surface, y.s, y.v_eq] = [1, out[0], out[1]];
    }
    this.law.run(y, 0, out);
    const u = Math.min(Math.max(out[0], -s.u_max), s.u_max);
    this.commands[k % this.commands.length] = u;
    this.latest = { t: y.t, x, v, u, s: out[1], r: s.reference, d: 0 };
    return Number.isFinite(out[0]) && Number.isFinite(out[1]) && Math.abs(u) < this.facts.max_control;
  }

  // Return what the controller measures or estimates at sample k: {x, v, a}, each an array over the channels.
  measure(x, v, k) {
    const { s, plant, out } = this;
    const noisy = s.noise.position !== 0 || s.noise.velocity !== 0;
    const reading = { dt: s.control_period, x: 0, v: 0 };
    const seen = { x: [], v: [], a: [] }; // a is NaN where the estimator gives none
    plant.channels.forEach(({ unit }, i) => {
      [reading.x, reading.v] = [x[i], v[i]];
      if (noisy) {
        const [first, second] = normals(s.seed, i, k);
        reading.x += s.noise.position * first;
        reading.v += s.noise.velocity * second;
      }
      if (s.counts !== 0) {
        const quantum = (unit === "rad" ? 2 * Math.PI : 1) / s.counts;
        reading.x = quantum * Math.floor(reading.x / quantum + 0.5);
      }
      this.velocity.run(reading, i, out);
      seen.x.push(reading.x);
      seen.v.push(out[0]);
      seen.a.push(out[1]);
    });
    return seen;
  }

  // Return the law's present sliding variable, as a function of the x and v at which the first channel would be.
  sliding() {
    const { s: { reference }, out, law, surface } = this;
    const y = { ...this.y };
    return (x, v) => {
      Object.assign(y, { x, v, e: x - reference, de: v, has_surface: 0, s: 0, v_eq: 0 });
      if (surface) {
        surface.peek(y, 0, out);
        [y.has_surface, y.s, y.v_eq] = [1, out[0], out[1]];
      }
      law.peek(y, 0, out);
      return out[1];
    };
  }

  // Return the nominal f and g of x'' = f + g u: the channels' accelerations for u = 0, and what u = 1 adds to them.
  equation(seen) {
    const { plant } = this;
    if (!this.nominal) return [plant.channels.map(() => 0), plant.channels.map(() => 1)];
    const { qpos, qvel, qacc, ctrl } = this.arrays.nominal;
    const accelerations = (u) => {
      ctrl[plant.ctrl] = u;
      this.mujoco.mj_forward(this.nominal, this.nominalData);
      return plant.channels.map((channel) => qacc[channel.dof]);
    };
    plant.channels.forEach((channel, i) => {
      qpos[channel.qpos] = seen.x[i];
      qvel[channel.dof] = seen.v[i];
    });
    const f = accelerations(0);
    return [f, accelerations(1).map((value, i) => value - f[i])];
  }

  // Apply the reader's push, and the disturbance at a fraction of the physics step. Return the disturbance.
  disturb(fraction) {
    const { s, plant } = this;
    const k = Math.floor(this.step / s.steps);
    const t = k * s.control_period + ((this.step % s.steps) + fraction) * s.physics_step;
    const d = s.disturbance.amplitude * Math.sin(s.disturbance.omega * t);
    const force = this.arrays.qfrc_applied;
    force.set(this.push);
    force[plant.channels[0].dof] += d;
    return d;
  }

  // Do a step of MuJoCo's RK4, with the disturbance at the time of each stage. mj_step would hold it for the whole step,
  // because it has no callback in a browser.
  rungeKutta() {
    const { mujoco, model, data, s } = this;
    const h = s.physics_step;
    const { qpos, qvel, qacc } = this.arrays;
    const start = [qpos.slice(), qvel.slice()];
    const rates = []; // velocities and accelerations of each stage
    const moveTo = (weights) => {
      for (let i = 0; i < qpos.length; i++) {
        let [dx, dv] = [0, 0];
        weights.forEach((weight, j) => {
          dx += weight * rates[j][0][i];
          dv += weight * rates[j][1][i];
        });
        qpos[i] = start[0][i] + h * dx;
        qvel[i] = start[1][i] + h * dv;
      }
    };
    for (const [fraction, weights] of [[0, []], [0.5, [0.5]], [0.5, [0, 0.5]], [this.facts.last_stage, [0, 0, 1]]]) {
      moveTo(weights);
      this.disturb(fraction);
      mujoco.mj_forward(model, data);
      rates.push([qvel.slice(), qacc.slice()]);
    }
    moveTo([1 / 6, 1 / 3, 1 / 3, 1 / 6]);
  }
}

// Simulate a scenario for a duration, s. Return {t, u, s, d, x: [...], v: [...], failed}: t, u, s, d and each channel of
// x and v are arrays of samples.
export function trace(mujoco, vfs, facts, functions, chosen, duration) {
  const run = new Simulation(mujoco, vfs, facts, functions, chosen);
  const samples = Math.floor(duration / run.s.control_period + 1e-6);
  const found = { t: [], u: [], s: [], d: [], x: run.plant.channels.map(() => []), v: run.plant.channels.map(() => []) };
  for (let step = 0; step < samples * run.s.steps && !run.failed; step++) {
    const sample = run.advance();
    if (sample) {
      for (const name of ["t", "u", "s", "d"]) found[name].push(sample[name]);
      for (const name of ["x", "v"]) sample[name].forEach((value, i) => found[name][i].push(value));
    }
  }
  found.failed = run.failed;
  run.delete();
  return found;
}

// Return two standard normal numbers: block k of numpy's Philox4x64-10 with key (seed, channel), by the Box-Muller
// transform. The same numbers are the noise of smc_mujoco's runs.
export function normals(seed, channel, k) {
  let [c0, c1, c2, c3] = [BigInt(k), 0n, 0n, 0n];
  let [key0, key1] = [BigInt(seed), BigInt(channel)];
  for (let round = 0; round < 10; round++) {
    const [one, other] = [c0 * 0xd2e7470ee14c6c93n, c2 * 0xca5a826395121157n];
    [c0, c1, c2, c3] = [(other >> 64n) ^ c1 ^ key0, other & WORD, (one >> 64n) ^ c3 ^ key1, one & WORD];
    key0 = (key0 + 0x9e3779b97f4a7c15n) & WORD;
    key1 = (key1 + 0xbb67ae8584caa73bn) & WORD;
  }
  const radius = Math.sqrt(-2 * Math.log(Number((c0 >> 11n) + 1n) * 2 ** -53));
  const angle = 2 * Math.PI * (Number(c1 >> 11n) * 2 ** -53);
  return [radius * Math.cos(angle), radius * Math.sin(angle)];
}
const WORD = (1n << 64n) - 1n;
